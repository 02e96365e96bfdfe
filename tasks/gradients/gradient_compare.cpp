// SPDX-License-Identifier: Apache-2.0
// Chooses the step size by its neighbours: if they agree, it is right; if they do not, there is a
// kink.
#include "tasks/gradients/gradient_compare.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/derivative/tangent.hpp"
#include "engine/model/random.hpp"
#include "engine/model/scene_number.hpp"
#include "engine/step/displacement.hpp"

namespace tangere {
namespace {

constexpr double kLargest = 1e-3;  // step size, times the input's scale
constexpr double kNoInfluence =
    1e-10;  // of the loss: an input has no influence if all its derivatives are smaller

double norm_of(std::span<const double> x) {
  return std::sqrt(std::inner_product(x.begin(), x.end(), x.begin(), 0.0));
}

/// Makes an error that is not finite infinite, so that it is the worst.
double finite_error(double error) { return std::isfinite(error) ? error : HUGE_VAL; }

/// Returns the entries to compare: all of `all`, or `wanted` of them at random.
std::vector<std::size_t> chosen(std::vector<std::size_t> all, std::size_t wanted,
                                std::uint64_t seed, std::uint32_t purpose) {
  if (wanted == 0 || all.size() <= wanted) return all;
  for (std::size_t i = 0; i < wanted; ++i) {
    const RandomKey key{seed, 0, static_cast<std::int64_t>(i), Purpose::control, purpose};
    std::swap(all[i], all[i + std::size_t(uniform(key, 0, double(all.size() - i) - 1e-9))]);
  }
  all.resize(wanted);
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace

std::array<double, 2 * kSweepLevels> sweep(double scale) {
  std::array<double, 2 * kSweepLevels> changes{};
  double step = kLargest * scale;
  for (std::size_t k = 0; k < kSweepLevels; ++k, step *= 0.25) {
    changes[2 * k] = step;
    changes[2 * k + 1] = -step;
  }
  return changes;
}

Difference best_difference(std::span<const double> values, double scale) {
  std::array<double, kSweepLevels>
      slopes{};  // without the error of second order; none for the first size
  double step = kLargest * scale, coarse = NAN;
  for (std::size_t k = 0; k < kSweepLevels; ++k, step *= 0.25) {
    const double central = (values[2 * k] - values[2 * k + 1]) / (2 * step);
    slopes[k] = (16 * central - coarse) / 15;
    coarse = central;
  }
  Difference best{NAN, HUGE_VAL};
  for (std::size_t k = 2; k + 1 < kSweepLevels; ++k) {
    const double doubt =
        std::max(std::abs(slopes[k] - slopes[k - 1]), std::abs(slopes[k + 1] - slopes[k]));
    if (doubt < best.doubt) best = {slopes[k], doubt};
  }
  return best;
}

CheckedInput compare(const Comparison& of, double loss, const CompareOptions& o,
                     std::uint32_t purpose) {
  CheckedInput c;
  c.name = of.name;
  c.entries = of.gradient.size();
  c.norm = norm_of(of.gradient);
  const std::vector<std::size_t> entries =
      chosen(of.among, static_cast<std::size_t>(o.entries), o.seed, purpose);
  std::vector<Difference> differences;
  double square = 0;
  for (const std::size_t i : entries) {
    differences.push_back(of.difference(i));
    if (std::isfinite(differences.back().value))
      square += differences.back().value * differences.back().value;
  }
  c.scale = std::max(c.norm, std::sqrt(square));
  if (!std::isfinite(c.norm)) c.difference_error = HUGE_VAL;
  c.influence = !(c.scale <= kNoInfluence * std::abs(loss));
  for (std::size_t k = 0; k < entries.size() && c.influence; ++k) {
    if (!(differences[k].doubt <= o.settled * c.scale)) {
      ++c.kinks;
      continue;
    }
    ++c.compared;
    const double error =
        finite_error(std::abs(differences[k].value - of.gradient[entries[k]]) / c.scale);
    if (error >= c.difference_error)
      c.difference_error = error, c.worst = of.entry_name(entries[k]);
  }
  return c;
}

void compare_along(CheckedInput& c, std::span<const double> gradient,
                   std::span<const double> direction, double along) {
  if (!c.influence) return;
  const double dot = std::inner_product(gradient.begin(), gradient.end(), direction.begin(), 0.0);
  c.tangent_error = finite_error(std::abs(dot - along) / (c.scale * norm_of(direction)));
}

RelativeGradient::RelativeGradient(const NumberGradients& parameters, const Scene& scene,
                                   std::span<const double> varying,
                                   std::span<const double> absolute) {
  for (std::size_t k = 0; k < absolute.size(); ++k) {
    const int random = randomization_of(scene, parameters.infos()[k].number);
    has.push_back(random < 0 ? parameters.infos()[k].value : varying[std::size_t(random)]);
    gradient.push_back(absolute[k] * has[k]);
    if (has[k] != 0) given.push_back(k);
  }
}

std::vector<double> RelativeGradient::change(std::span<const double> relative) const {
  std::vector<double> change(relative.size());
  for (std::size_t k = 0; k < change.size(); ++k) change[k] = relative[k] * has[k];
  return change;
}

std::vector<std::size_t> all_of(std::size_t count) {
  std::vector<std::size_t> all(count);
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

std::vector<double> random_direction(std::size_t n, std::uint64_t seed, std::uint32_t purpose) {
  std::vector<double> d(n);
  for (std::size_t i = 0; i < n; ++i)
    d[i] = uniform({seed, 1, static_cast<std::int64_t>(i), Purpose::control, purpose}, -1, 1);
  return d;
}

double GradientCheck::max_relative_error() const {
  double worst = 0;
  for (const CheckedInput& c : inputs)
    worst = std::max({worst, c.difference_error, c.tangent_error});
  return worst;
}
std::size_t GradientCheck::entries() const {
  return std::accumulate(inputs.begin(), inputs.end(), std::size_t{0},
                         [](std::size_t n, const auto& c) { return n + c.compared; });
}
std::size_t GradientCheck::kinks() const {
  return std::accumulate(inputs.begin(), inputs.end(), std::size_t{0},
                         [](std::size_t n, const auto& c) { return n + c.kinks; });
}

void GradientChecker::check() {
  if (!at_.u.empty()) check_controls();
  check_positions();
  check_velocities();
  check_numbers();
}

void GradientChecker::add(const Comparison& c, std::uint32_t purpose,
                          const std::function<double(const std::vector<double>&)>& along) {
  out_.inputs.push_back(compare(c, out_.loss, options_, purpose));
  const std::vector<double> d = random_direction(c.gradient.size(), options_.seed, purpose);
  compare_along(out_.inputs.back(), c.gradient, d, along(d));
}

void GradientChecker::check_controls() {
  add({u_name_, by_u_, all_of(by_u_.size()),
       [&](std::size_t i) {
         return difference(kControlScale, [i](CheckInputs& x, double e) { x.u[i] += e; });
       },
       [&](std::size_t i) { return control_name(i); }},
      0, [&](const std::vector<double>& d) {
        return along({d, {}, {}, {}});
      });
}

void GradientChecker::check_positions() {
  const auto move = [this](std::size_t i) {
    return [this, i](CheckInputs& x, double e) { displace(model_, x.q, static_cast<int>(i), e); };
  };
  add({"q", by_q_, all_of(by_q_.size()), [&](std::size_t i) { return difference(1, move(i)); },
       [&](std::size_t i) { return std::string(model_.v_names()[i]); }},
      1, [&](const std::vector<double>& d) {
        return along({{}, d, {}, {}});
      });
}

void GradientChecker::check_velocities() {
  add({"v", by_v_, all_of(by_v_.size()),
       [&](std::size_t i) {
         return difference(kVelocityScale, [i](CheckInputs& x, double e) { x.v[i] += e; });
       },
       [&](std::size_t i) { return std::string(model_.v_names()[i]); }},
      2, [&](const std::vector<double>& d) {
        return along({{}, {}, d, {}});
      });
}

/// Takes relative changes of the environment's own values, because units differ.
void GradientChecker::check_numbers() {
  const RelativeGradient r(parameters_, model_.scene(), varying_, by_numbers_);
  const auto of_number = [&](std::size_t k) {
    return difference_of_scene([&, k](Scene& scene, std::vector<double>& varying, double e) {
      const SceneNumber& number = parameters_.infos()[k].number;
      const int random = randomization_of(scene, number);
      (random < 0 ? number_in(scene, number) : varying[std::size_t(random)]) *= 1 + e;
    });
  };
  add({"numbers", r.gradient, r.given, of_number,
       [&](std::size_t k) { return parameters_.infos()[k].name; }},
      3, [&](const std::vector<double>& d) {
        std::vector<double> rows(std::size_t(parameter_rows(model_)));
        parameters_.spread(r.change(d), batch(), 0, rows);
        return along({{}, {}, {}, rows});
      });
}

Difference GradientChecker::difference(
    double scale, const std::function<void(CheckInputs&, double)>& change) const {
  std::vector<CheckInputs> all;
  for (const double e : sweep(scale)) {
    all.push_back(at_);
    change(all.back(), e);
  }
  return best_difference(values(nullptr, all, varying_), scale);
}

Difference GradientChecker::difference_of_scene(
    const std::function<void(Scene&, std::vector<double>&, double)>& change) const {
  std::vector<double> found;
  for (const double e : sweep(1)) {
    Scene scene = model_.scene();
    std::vector<double> varying = varying_;
    change(scene, varying, e);
    found.push_back(values(&scene, {at_}, varying)[0]);
  }
  return best_difference(found, 1);
}

}  // namespace tangere
