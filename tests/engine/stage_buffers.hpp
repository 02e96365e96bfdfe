// SPDX-License-Identifier: Apache-2.0
// Everything that one evaluation of a stage needs, for any number type: runs the kernels in plain
// scalars.
#pragma once

#include <cmath>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "kernels/step/jacobian.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere::testing {

/// Makes all contact points of each pair candidates, so nothing is culled.
template <class N>
class StageBuffers {
 public:
  explicit StageBuffers(const CompiledModel& m) : model_(m) {
    const std::size_t nv = std::size_t(m.nv), entries = std::size_t(m.pattern.assembled);
    centre.resize(std::size_t(m.nq));
    for (auto* v : {&x, &r, &s, &tau, &target, &v_out, &g, &force_scale, &mass})
      v->assign(nv, N(0.0));
    A.assign(entries, N(0.0));
    links_.resize(m.links.size());
    contacts_.resize(m.link_pairs.size() + m.grounded.size() + m.loops.size());
    columns_.resize(2 * m.links.size());
    transmission_columns_.resize(m.transmission_dofs.size());
    transmission_force_.resize(m.transmissions.size());
    polynomials_.resize(m.polynomials.size());
    transmission_second_.resize(std::size_t(m.view.most_transmission_dofs) *
                                std::size_t(m.view.most_transmission_dofs));
    excess_.assign(1, N(0.0));
    faces.assign(3 * m.pairs.size(), N(0.0));
    for (const kernels::PairContact& p : m.pairs) {
      points_.emplace_back();
      for (int k = 0; k < 3 * p.n_points; ++k) points_.back().push_back(N(p.points[k]));
      references_.emplace_back(12, N(0.0));
      lists_.push_back({points_.back().data(), p.n_points, references_.back().data(), 1e9, nullptr,
                        0, 0, nullptr, nullptr});
      areas_.emplace_back();
      for (int k = 0; k < p.n_points && p.weights != nullptr; ++k)
        areas_.back().push_back(N(p.weights[k]));
      if (p.weights != nullptr) lists_.back().weights = areas_.back().data();
    }
  }

  kernels::StageArgs<N> arguments(double c0_over_h, double inverse_h, const double* block) {
    kernels::StageArgs<N> a{};
    a.centre = centre.data();
    a.x = x.data();
    a.r = r.data();
    a.s = s.data();
    a.tau = tau.data();
    a.target = target.data();
    a.c0_over_h = N(c0_over_h);
    a.inverse_h = N(inverse_h);
    a.friction_tangent = N(friction_tangent);
    a.normal_share = N(normal_share);
    a.friction_share = N(friction_share);
    a.block = block;
    a.group = 0;
    a.candidates = lists_.data();
    a.faces = faces.data();
    a.lone = -1;
    a.links = links_.data();
    a.contacts = contacts_.data();
    a.columns = columns_.data();
    a.transmission_columns = transmission_columns_.data();
    a.transmission_force = transmission_force_.data();
    a.transmission_second = transmission_second_.data();
    a.polynomials = polynomials_.data();
    a.own_x = x.data();
    a.own_r = r.data();
    a.v = v_out.data();
    a.g = g.data();
    a.force_scale = force_scale.data();
    a.mass_diagonal = mass.data();
    a.A = A.data();
    a.excess = excess_.data();
    return a;
  }

  void residual(double c0_over_h, double inverse_h, const double* block = nullptr) {
    const auto a = arguments(c0_over_h, inverse_h, block);
    kernels::kinematics(model_.view, a);
    kernels::residual<false>(model_.view, a);
  }
  void residual_and_jacobian(double c0_over_h, double inverse_h, const double* block = nullptr) {
    const auto a = arguments(c0_over_h, inverse_h, block);
    kernels::kinematics(model_.view, a);
    kernels::residual<true>(model_.view, a);
    kernels::jacobian(model_.view, a);
  }
  /// What contact_wrenches() copies after one of these.
  std::vector<N> wrenches() {
    std::vector<N> out(6 * (contacts_.size() - model_.loops.size()));
    kernels::contact_wrenches(model_.view, arguments(1, 1, nullptr), out.data());
    return out;
  }
  [[nodiscard]] N entry(const std::vector<N>& matrix, int i, int j) const {
    const int at = model_.pattern.slot[std::size_t(i * model_.nv + j)];
    return at < 0 ? N(0.0) : matrix[std::size_t(at)];
  }

  std::vector<N> centre, x, r, s, tau, target, v_out, g, force_scale, mass, A;
  std::vector<N> faces;                         ///< (pairs, 3) 0: nearest face, point by point
  double friction_tangent = 1;                  ///< 0: the Jacobian takes friction by its secant
  double normal_share = 1, friction_share = 1;  ///< as in kernels::Stage

 private:
  const CompiledModel& model_;
  std::vector<kernels::LinkScratch<N>> links_;
  std::vector<kernels::ContactScratch<N>> contacts_;
  std::vector<kernels::JointColumns<N>> columns_;
  std::vector<kernels::TransmissionColumn<N>> transmission_columns_;
  std::vector<N> transmission_force_, transmission_second_;
  std::vector<kernels::PolynomialScratch<N>> polynomials_;
  std::vector<N> excess_;
  std::vector<std::vector<N>> points_, references_, areas_;
  std::vector<kernels::CandidateList<N>> lists_;
};

/// A random stage: centre, unknown and history of the size of a step, and faces that count.
template <class N>
void randomise(StageBuffers<N>& b, const CompiledModel& m, Random& random, double h) {
  for (const kernels::Link& l : m.links) {
    if (l.kind == kernels::JointKind::spherical) {
      const kernels::Quat<double> q = random.quaternion();
      const double w[4] = {q.w, q.x, q.y, q.z};
      for (int k = 0; k < 4; ++k) b.centre[std::size_t(l.q + k)] = N(w[k]);
    } else {
      for (int k = 0; k < kernels::dofs(l.kind); ++k)
        b.centre[std::size_t(l.q + k)] = N(0.05 * random.normal());
    }
  }
  for (int i = 0; i < m.nv; ++i) {
    const std::size_t k = std::size_t(i);
    b.x[k] = N(0.5 * h * random.normal());
    b.r[k] = N(0.1 * h * random.normal());
    b.s[k] = N(0.3 * random.normal());
    b.tau[k] = N(0.1 * random.normal());
    b.target[k] = N(0.3 * random.normal());
  }
  for (N& side : b.faces) side = N(std::floor(random.uniform(-1, 2)));
}

}  // namespace tangere::testing
