// SPDX-License-Identifier: Apache-2.0
// Each joint becomes a combination of joints that follow none, once, leaders first.
#include "engine/model/compile_followers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

namespace tangere {
namespace {

/// A coordinate in terms of joints that follow none: offset + Σ ratio q + Σ power_k qᵏ⁺². With
/// powers there is one joint.
struct Combination {
  std::map<std::size_t, double> ratios;  ///< by joint
  double offset = 0;
  std::array<double, kMostPowers> powers{};
  [[nodiscard]] bool is_polynomial() const { return powers != std::array<double, kMostPowers>{}; }
};

/// Returns p(a + b q) as a polynomial in q.
kernels::Polynomial shifted(const kernels::Polynomial& p, double a, double b) {
  kernels::Polynomial out{};
  for (std::size_t k = p.size(); k-- > 0;) {  // out (a + b q) + p_k
    for (std::size_t j = out.size(); j-- > 0;) out[j] = a * out[j] + (j > 0 ? b * out[j - 1] : 0.0);
    out[0] += p[k];
  }
  return out;
}

class Followers {
 public:
  Followers(const CompiledModel& m, const NameIndex& joints)
      : m_(m), joints_(joints), known_(m.scene.links.size()), begun_(m.scene.links.size()) {}

  /// Returns the coordinate of a joint.
  const Combination& combination(std::size_t joint) {
    std::optional<Combination>& out = known_[joint];
    if (out) return *out;
    const JointDescription& d = m_.scene.links[joint].joint;
    if (dof_count(d.type) != 1)
      fail(d, fmt::format("has {} degrees of freedom; expected a revolute or prismatic joint where "
                          "one follows",
                          dof_count(d.type)));
    if (std::exchange(begun_[joint], 1) != 0) fail(d, "follows itself; expected no circle");
    if (!d.follows.empty() && d.ratio.size() != d.follows.size())
      fail(d, fmt::format("follows {} joints with {} ratios; expected as many", d.follows.size(),
                          d.ratio.size()));
    if (std::ranges::any_of(d.powers, [](double c) { return c != 0; }))
      return out.emplace(polynomial(d));
    Combination sum;
    if (d.follows.empty()) sum.ratios[joint] = 1;
    if (!d.follows.empty()) sum.offset = d.offset;
    for (std::size_t k = 0; k < d.follows.size(); ++k) {
      const Combination& leader =
          combination(std::size_t(joints_.find("joint", d.follows[k], d.source)));
      sum.offset += d.ratio[k] * leader.offset;
      for (const auto& [of, ratio] : leader.ratios) sum.ratios[of] += d.ratio[k] * ratio;
      for (std::size_t p = 0; p < kMostPowers; ++p) sum.powers[p] += d.ratio[k] * leader.powers[p];
      if (leader.is_polynomial() && d.follows.size() > 1)
        fail(d,
             fmt::format("follows {} joints, of which '{}' follows by a polynomial; expected one "
                         "joint where one of them does",
                         d.follows.size(), d.follows[k]));
    }
    return out.emplace(std::move(sum));
  }

 private:
  /// Returns a polynomial of the one joint that a joint follows.
  Combination polynomial(const JointDescription& d) {
    if (d.follows.size() != 1)
      fail(d, fmt::format("has powers and follows {} joints; expected one", d.follows.size()));
    if (d.powers.size() > kMostPowers)
      fail(d, fmt::format("has {} powers; expected at most {}", d.powers.size(), kMostPowers));
    const Combination& leader =
        combination(std::size_t(joints_.find("joint", d.follows[0], d.source)));
    if (leader.is_polynomial())
      fail(d, fmt::format("follows '{}' by a polynomial, and '{}' follows by one itself; expected "
                          "one polynomial in a chain",
                          d.follows[0], d.follows[0]));
    if (leader.ratios.size() != 1)
      fail(d, fmt::format("follows '{}' by a polynomial, and '{}' follows {} joints; expected one "
                          "that follows one or none",
                          d.follows[0], d.follows[0], leader.ratios.size()));
    const auto& [of, ratio] = *leader.ratios.begin();
    kernels::Polynomial p = {d.offset, d.ratio[0], 0, 0, 0};
    std::ranges::copy(d.powers, p.begin() + 2);
    p = shifted(p, leader.offset, ratio);
    Combination out;
    out.ratios[of] = p[1];
    out.offset = p[0];
    out.powers = {p[2], p[3], p[4]};
    return out;
  }

  [[noreturn]] static void fail(const JointDescription& d, const std::string& text) {
    throw InputError(d.source.prefix() + "joint '" + d.name + "' " + text);
  }

  const CompiledModel& m_;
  const NameIndex& joints_;
  std::vector<std::optional<Combination>> known_;  ///< of each joint
  std::vector<char> begun_;
};

}  // namespace

void compile_followers(CompiledModel& m, const NameIndex& joints) {
  Followers followers(m, joints);
  for (std::size_t i = 0; i < m.scene.links.size(); ++i) {
    if (m.scene.links[i].joint.follows.empty()) continue;
    const Combination& of = followers.combination(i);
    const CompiledJoint& own = m.joints[i];
    if (of.is_polynomial()) {
      const auto& [leader, ratio] = *of.ratios.begin();
      m.polynomials.push_back({own.v,
                               own.q,
                               own.link,
                               m.joints[leader].v,
                               m.joints[leader].q,
                               {of.offset, ratio, of.powers[0], of.powers[1], of.powers[2]}});
      m.links[std::size_t(own.link)].has_chart = true;
      continue;
    }
    m.followers.push_back({own.v, own.q, of.offset});
    for (const auto& [leader, ratio] : of.ratios)
      m.ties.push_back({own.v, own.q, m.joints[leader].v, m.joints[leader].q, ratio});
  }
}

std::vector<DofPlace> following_dofs(const CompiledModel& m) {
  std::vector<DofPlace> out;
  for (const kernels::Follower& f : m.followers) out.push_back({f.v, f.q});
  for (const kernels::PolynomialFollower& f : m.polynomials) out.push_back({f.v, f.q});
  return out;
}

void place_initial_followers(CompiledModel& m) {
  const std::vector<double> q = m.initial_q, v = m.initial_v;
  place_followers(
      m, [&](int i) -> double& { return m.initial_q[std::size_t(i)]; },
      [&](int i) -> double& { return m.initial_v[std::size_t(i)]; });
  constexpr double kRounding = 1e-6;  // of files that give both
  const auto differs = [](double given, double placed) {
    return std::abs(given - placed) > kRounding * (1 + std::abs(placed));
  };
  for (const DofPlace& f : following_dofs(m)) {
    const auto of = std::ranges::find_if(
        m.joints, [&](const CompiledJoint& j) { return j.v == f.v && j.link_count > 0; });
    const JointDescription& d = m.scene.links[std::size_t(of - m.joints.begin())].joint;
    const auto given = std::ranges::find(m.scene.initial, d.name, &InitialState::joint);
    const auto iq = std::size_t(f.q), iv = std::size_t(f.v);
    if (given == m.scene.initial.end() ||
        !(differs(q[iq], m.initial_q[iq]) || differs(v[iv], m.initial_v[iv])))
      continue;
    throw InputError(given->source.prefix() +
                     fmt::format("joint '{}' starts at {} with rate {}, but by what it follows "
                                 "(line {}) at {} with {}; expected no start of its own",
                                 d.name, q[iq], v[iv], d.source.line, m.initial_q[iq],
                                 m.initial_v[iv]));
  }
}

}  // namespace tangere
