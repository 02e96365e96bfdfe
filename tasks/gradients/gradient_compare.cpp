// SPDX-License-Identifier: Apache-2.0
// Chooses the step size by its neighbours: if they agree, it is right; if they do not, there is a
// kink.
#include "tasks/gradients/gradient_compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "engine/derivative/tangent.hpp"
#include "engine/model/random.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/step/displacement.hpp"
#include "tasks/gradients/run_trace.hpp"

namespace tangere {
namespace {

/// Number of step sizes of a sweep. Each is a quarter of the one before and is taken in both
/// directions, so a sweep fills a block of environments.
constexpr int kSweepLevels = 8;
/// Scales of changes. Positions use 1 (m or rad); velocities and controls change more.
constexpr double kVelocityScale = 10, kControlScale = 10, kPlaceScale = 0.01;
constexpr double kLargest = 1e-3;      // step size, times the input's scale
constexpr std::size_t kExplained = 2;  // kinks of an input
constexpr double kNoInfluence =
    1e-10;  // of the loss: an input has no influence if all its derivatives are smaller

double norm_of(std::span<const double> x) {
  return std::sqrt(std::inner_product(x.begin(), x.end(), x.begin(), 0.0));
}

/// Makes an error that is not finite infinite, so that it is the worst.
double finite_error(double error) { return std::isfinite(error) ? error : HUGE_VAL; }

/// Returns the entries to compare: all of `all`, or `requested` of them at random.
std::vector<std::size_t> chosen(std::vector<std::size_t> all, std::size_t requested,
                                std::uint64_t seed, std::uint32_t purpose) {
  if (requested == 0 || all.size() <= requested) return all;
  for (std::size_t i = 0; i < requested; ++i) {
    const RandomKey key{seed, 0, static_cast<std::int64_t>(i), Purpose::control, purpose};
    std::swap(all[i], all[i + std::size_t(uniform(key, 0, double(all.size() - i) - 1e-9))]);
  }
  all.resize(requested);
  std::sort(all.begin(), all.end());
  return all;
}

/// Prefixes sentences with the change of an input at which two runs differ.
std::vector<std::string> with_change(std::vector<std::string> texts, double change) {
  for (std::string& text : texts)
    text = fmt::format("changed by {:.1e} to both sides, {}", change, text);
  return texts;
}

/// Changes of an input whose entries have size `scale`: +, -, largest step size first.
std::array<double, 2 * kSweepLevels> sweep(double scale) {
  std::array<double, 2 * kSweepLevels> changes{};
  double step = kLargest * scale;
  for (std::size_t k = 0; k < kSweepLevels; ++k, step *= 0.25) {
    changes[2 * k] = step;
    changes[2 * k + 1] = -step;
  }
  return changes;
}

/// `values`: the function after each change of sweep(scale).
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
    const double uncertainty =
        std::max(std::abs(slopes[k] - slopes[k - 1]), std::abs(slopes[k + 1] - slopes[k]));
    if (uncertainty < best.uncertainty) best = {slopes[k], uncertainty};
  }
  return best;
}

/// `loss`: reference for the influence of the input. `purpose`: key for the draw of entries.
CheckedInput compare(const Comparison& of, double loss, const CheckOptions& o,
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
  std::size_t worst = 0;
  for (std::size_t k = 0; k < entries.size() && c.influence; ++k) {
    if (!(differences[k].uncertainty <= o.settled * c.scale)) {
      if (++c.kinks <= kExplained) c.to_explain.push_back(entries[k]);
      continue;
    }
    ++c.compared;
    const double error =
        finite_error(std::abs(differences[k].value - of.gradient[entries[k]]) / c.scale);
    if (error >= c.difference_error)
      c.difference_error = error, c.worst = of.entry_name(entries[k]), worst = entries[k];
  }
  if (c.compared > 0 && c.difference_error > o.tolerance) c.to_explain.push_back(worst);
  return c;
}

/// `along`: the derivative along `direction`, computed another way.
void compare_along(CheckedInput& c, std::span<const double> gradient,
                   std::span<const double> direction, double along) {
  if (!c.influence) return;
  const double dot = std::inner_product(gradient.begin(), gradient.end(), direction.begin(), 0.0);
  c.tangent_error = finite_error(std::abs(dot - along) / (c.scale * norm_of(direction)));
}

/// A gradient by relative changes of a scene's numbers. Places change by parts of 1 cm. `varying`:
/// values of what the scene randomises, in its order.
struct RelativeGradient {
  std::vector<double> has, gradient;  ///< values in the environment, or 1 cm; gradient times these
  std::vector<std::size_t> given;     ///< indices where these are not zero

  RelativeGradient(const NumberGradients& parameters, const Scene& scene,
                   std::span<const double> varying, std::span<const double> absolute) {
    for (std::size_t k = 0; k < absolute.size(); ++k) {
      const NumberInfo& info = parameters.infos()[k];
      const int random = randomization_of(scene, info.number);
      has.push_back(info.number.field == NumberField::pos ? kPlaceScale
                    : random < 0                          ? info.value
                                                          : varying[std::size_t(random)]);
      gradient.push_back(absolute[k] * has[k]);
      if (has[k] != 0) given.push_back(k);
    }
  }
  [[nodiscard]] std::vector<double> change(std::span<const double> relative) const {
    std::vector<double> change(relative.size());
    for (std::size_t k = 0; k < change.size(); ++k) change[k] = relative[k] * has[k];
    return change;
  }
};

}  // namespace

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

void GradientChecker::explain() {
  if (!reads_fields() || (out_.kinks() == 0 && out_.passed())) return;
  const std::vector<std::string> flaws = sensors_without_derivative(model_);
  out_.reasons.insert(out_.reasons.begin(), flaws.begin(), flaws.end());
}

void GradientChecker::check() {
  out_.tolerance = options_.tolerance;
  if (!at_.u.empty()) check_controls();
  check_positions();
  check_velocities();
  check_numbers();
}

void GradientChecker::add(const Comparison& c, std::uint32_t purpose,
                          const std::function<double(const std::vector<double>&)>& along) {
  out_.inputs.push_back(compare(c, out_.loss, options_, purpose));
  for (const std::size_t entry : out_.inputs.back().to_explain) {
    const std::vector<std::string> texts = c.decisions(entry);
    for (const std::string& text : texts)
      out_.reasons.push_back(fmt::format("{}, {}: {}", c.name, c.entry_name(entry), text));
    if (texts.empty())
      out_.reasons.push_back(
          fmt::format("{}, {}: runs on both sides have the same contacts, limits and statuses; a "
                      "point that begins to slip, a clip or a wrong derivative is left",
                      c.name, c.entry_name(entry)));
  }
  const std::vector<double> d = random_direction(c.gradient.size(), options_.seed, purpose);
  compare_along(out_.inputs.back(), c.gradient, d, along(d));
}

void GradientChecker::check_controls() {
  const auto move = [](std::size_t i) { return [i](CheckInputs& x, double e) { x.u[i] += e; }; };
  add({u_name_, grad_u_, all_of(grad_u_.size()),
       [&](std::size_t i) { return difference(kControlScale, move(i)); },
       [&](std::size_t i) { return control_name(i); },
       [&](std::size_t i) { return decisions(kControlScale, move(i)); }},
      0, [&](const std::vector<double>& d) {
        return along({d, {}, {}, {}});
      });
}

/// The derivative along changes of the start and of numbers. Joints that follow others go along.
double GradientChecker::along_start(std::vector<double> q, std::vector<double> v,
                                    std::span<const double> numbers) {
  if (!model_.has_followers()) return along({{}, q, v, numbers});
  q.resize(std::size_t(model_.nv())), v.resize(std::size_t(model_.nv()));
  complete_changes(model_, {at_.q.data(), at_.v.data(), 1, batch().block(0)}, numbers, q, v);
  return along({{}, q, v, numbers});
}

void GradientChecker::check_positions() {
  const auto move = [this](std::size_t i) {
    return [this, i](CheckInputs& x, double e) {
      displace(model_, x.q, static_cast<int>(i), e);
      complete_velocities(model_, x.q, x.v);
    };
  };
  add({"q", grad_q_, all_of(grad_q_.size()), [&](std::size_t i) { return difference(1, move(i)); },
       [&](std::size_t i) { return std::string(model_.v_names()[i]); },
       [&](std::size_t i) { return decisions(1, move(i)); }},
      1, [&](std::vector<double> d) { return along_start(std::move(d), {}, {}); });
}

void GradientChecker::check_velocities() {
  const auto move = [this](std::size_t i) {
    return [this, i](CheckInputs& x, double e) {
      x.v[i] += e;
      complete_velocities(model_, x.q, x.v);
    };
  };
  add({"v", grad_v_, all_of(grad_v_.size()),
       [&](std::size_t i) { return difference(kVelocityScale, move(i)); },
       [&](std::size_t i) { return std::string(model_.v_names()[i]); },
       [&](std::size_t i) { return decisions(kVelocityScale, move(i)); }},
      2, [&](std::vector<double> d) { return along_start({}, std::move(d), {}); });
}

/// Takes relative changes, because units differ.
void GradientChecker::check_numbers() {
  const RelativeGradient r(parameters_, model_.scene(), varying_, grad_numbers_);
  const auto move = [&](std::size_t k) {
    return [&, k](Scene& scene, std::vector<double>& varying, double e) {
      const SceneNumber& number = parameters_.infos()[k].number;
      const int random = randomization_of(scene, number);
      (random < 0 ? number_in(scene, number) : varying[std::size_t(random)]) += e * r.has[k];
    };
  };
  add({"numbers", r.gradient, r.given, [&](std::size_t k) { return difference_of_scene(move(k)); },
       [&](std::size_t k) { return parameters_.infos()[k].name; },
       [&](std::size_t k) { return decisions_of_scene(move(k)); }},
      3, [&](const std::vector<double>& d) {
        std::vector<double> rows(std::size_t(parameter_rows(model_)));
        parameters_.spread(r.change(d), batch(), 0, rows);
        return along_start({}, {}, rows);
      });
}

Difference GradientChecker::difference(double scale, const MoveInput& move) const {
  return best_difference(values(nullptr, moved(scale, move), varying_, nullptr), scale);
}

std::vector<CheckInputs> GradientChecker::moved(double scale, const MoveInput& move) const {
  std::vector<CheckInputs> all;
  for (const double e : sweep(scale)) {
    all.push_back(at_);
    move(all.back(), e);
  }
  return all;
}

Difference GradientChecker::difference_of_scene(const MoveScene& move) const {
  std::vector<double> found;
  for (const double e : sweep(1)) found.push_back(value_of_scene(move, e, nullptr));
  return best_difference(found, 1);
}

double GradientChecker::value_of_scene(const MoveScene& move, double e, RunTrace* trace) const {
  Scene scene = model_.scene();
  std::vector<double> varying = varying_;
  move(scene, varying, e);
  return values(&scene, {at_}, varying, trace)[0];
}

std::vector<std::string> GradientChecker::decisions(double scale, const MoveInput& move) const {
  RunTrace trace(model_);
  const auto changes = sweep(scale);
  static_cast<void>(values(nullptr, moved(scale, move), varying_, &trace));
  for (std::size_t k = changes.size(); k > 0; k -= 2)
    if (std::vector<std::string> texts = trace.differences(int(k) - 2, trace, int(k) - 1);
        !texts.empty())
      return with_change(std::move(texts), changes[k - 2]);
  return {};
}

std::vector<std::string> GradientChecker::decisions_of_scene(const MoveScene& move) const {
  const auto changes = sweep(1);
  for (std::size_t k = changes.size(); k > 0; k -= 2) {
    RunTrace above(model_), below(model_);
    static_cast<void>(value_of_scene(move, changes[k - 2], &above));
    static_cast<void>(value_of_scene(move, changes[k - 1], &below));
    if (std::vector<std::string> texts = above.differences(0, below, 0); !texts.empty())
      return with_change(std::move(texts), changes[k - 2]);
  }
  return {};
}

}  // namespace tangere
