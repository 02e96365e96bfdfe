// SPDX-License-Identifier: Apache-2.0
// Short rollouts with a loss that is linear in every state, and their gradients by the adjoint and
// by differences.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "engine/derivative/adjoint.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/step/displacement.hpp"
#include "tests/engine/runs.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere::testing {

using kernels::kBlock;

/// q ⊕ e along dof i.
inline std::vector<double> moved(const Model& model, std::vector<double> q, int dof, double e) {
  displace(model, q, dof, e);
  return q;
}

/// The start of a run and its controls.
struct RunInput {
  std::vector<double> q, v;
  std::vector<std::vector<double>> u;  ///< one row per step
};

/// A moving state near the scene's start, with controls about zero.
inline RunInput random_input(const Model& model, unsigned seed, int steps) {
  Random random(seed);
  RunInput in;
  const Batch batch(model, 1);
  in.q = q_of(batch);
  for (int i = 0; i < model.nv(); ++i) {
    in.q = moved(model, in.q, i, 0.05 * random.normal());
    in.v.push_back(0.3 * random.normal());
  }
  for (int t = 0; t < steps; ++t) {
    in.u.emplace_back();
    for (int k = 0; k < model.nu(); ++k) in.u.back().push_back(0.4 * random.normal());
  }
  return in;
}

/// Σ_t weight(t)·(q_t, v_t) with random weights; quaternions enter with their four components.
class StateLoss {
 public:
  StateLoss(const Model& model, int steps, unsigned seed)
      : model_(model), nq_(model.nq()), nv_(model.nv()) {
    Random random(seed);
    weights_.resize(std::size_t((steps + 1) * (nq_ + nv_)));
    for (double& w : weights_) w = random.normal();
  }
  [[nodiscard]] double value(int step, const std::vector<double>& q,
                             const std::vector<double>& v) const {
    const double* w = at(step);
    double sum = 0;
    for (int i = 0; i < nq_; ++i) sum += w[i] * q[std::size_t(i)];
    for (int i = 0; i < nv_; ++i) sum += w[nq_ + i] * v[std::size_t(i)];
    return sum;
  }
  /// Adds to the cotangents of one lane.
  void add(int step, const std::vector<double>& q, BlockCotangent& c, int lane) const {
    const double* w = at(step);
    for (int i = 0; i < nv_; ++i) c.v[std::size_t(i * kBlock + lane)] += w[nq_ + i];
    std::vector<double> along(static_cast<std::size_t>(nv_));
    add_along_dofs(model_, q, {w, static_cast<std::size_t>(nq_)}, along);
    for (int i = 0; i < nv_; ++i) c.q[std::size_t(i * kBlock + lane)] += along[std::size_t(i)];
  }

 private:
  [[nodiscard]] const double* at(int step) const {
    return &weights_[std::size_t(step * (nq_ + nv_))];
  }
  Model model_;
  int nq_, nv_;
  std::vector<double> weights_;
};

/// The loss of every run of `inputs`, which go together in one batch; NaN where a step finds no
/// solution. An environment has the same bits alone and among others (AdjointScheme,
/// CompanyChangesNothing), and sixteen together cost little more than one.
inline std::vector<double> losses_of_runs(const Model& model, const StepperOptions& options,
                                          const std::vector<RunInput>& inputs,
                                          const StateLoss& loss) {
  if (inputs.empty()) return {};
  const int count = static_cast<int>(inputs.size());
  Batch batch(model, count);
  std::vector<double> sums, u;
  for (int e = 0; e < count; ++e) {
    batch.set_state(e, inputs[std::size_t(e)].q, inputs[std::size_t(e)].v);
    sums.push_back(loss.value(0, q_of(batch, e), v_of(batch, e)));
  }
  Stepper stepper(model, options);
  for (std::size_t t = 0; t < inputs[0].u.size(); ++t) {
    u.clear();
    for (const RunInput& in : inputs) u.insert(u.end(), in.u[t].begin(), in.u[t].end());
    stepper.step(batch, u);
    for (int e = 0; e < count; ++e)
      sums[std::size_t(e)] += failed(batch.status(e)) ? NAN
                                                      : loss.value(static_cast<int>(t) + 1,
                                                                   q_of(batch, e), v_of(batch, e));
  }
  return sums;
}

inline double loss_of_run(const Model& model, const StepperOptions& options, const RunInput& in,
                          const StateLoss& loss) {
  return losses_of_runs(model, options, {in}, loss)[0];
}

/// The scale of a number's changes: its value, or 1 cm of a place, which may be zero.
inline double size_of(const NumberInfo& info) {
  return info.number.field == NumberField::pos ? 0.01 : info.value;
}

/// Gradient: q₀ (nv), v₀ (nv), u (steps, nu).
struct RunGradient {
  std::vector<double> q, v, u, parameters;
  [[nodiscard]] double norm() const {
    double sum = 0;
    for (const auto* x : {&q, &v, &u})
      for (double g : *x) sum += g * g;
    return std::sqrt(sum);
  }
};

/// Gradient of environment `lane` of `inputs`, which run together.
inline RunGradient adjoint_of_run(const Model& model, const StepperOptions& options,
                                  const std::vector<RunInput>& inputs, const StateLoss& loss,
                                  int lane) {
  const int count = static_cast<int>(inputs.size()), steps = static_cast<int>(inputs[0].u.size());
  Batch batch(model, count);
  for (int e = 0; e < count; ++e)
    batch.set_state(e, inputs[std::size_t(e)].q, inputs[std::size_t(e)].v);
  Stepper stepper(model, options);
  BlockTape tape(model, stepper.integrator(), steps);
  tape.start(batch, 0);
  std::vector<std::vector<double>> u;
  for (int t = 0; t < steps; ++t) {
    u.emplace_back();
    for (const RunInput& in : inputs)
      u.back().insert(u.back().end(), in.u[std::size_t(t)].begin(), in.u[std::size_t(t)].end());
    stepper.step_block(batch, 0, u.back(), &tape);
  }
  Adjoint adjoint(model, options, {1, true});
  adjoint.clear();
  const auto state = [&](int step, int e) {
    std::vector<double> q(std::size_t(model.nq()));
    for (std::size_t i = 0; i < q.size(); ++i) q[i] = tape.state(step)[i * kBlock + std::size_t(e)];
    return q;
  };
  RunGradient g;
  g.u.resize(std::size_t(steps * model.nu()));
  for (int t = steps; t >= 0; --t) {
    for (int e = 0; e < count; ++e) loss.add(t, state(t, e), adjoint.loss(0), e);
    if (t == 0) break;
    adjoint.reverse_step(batch, 0, tape, t - 1, u[std::size_t(t - 1)]);
    for (int k = 0; k < model.nu(); ++k)
      g.u[std::size_t((t - 1) * model.nu() + k)] =
          adjoint.loss(0).u[std::size_t(k * kBlock + lane)];
  }
  fold_followers(model, adjoint.loss(0), lane, tape.state(0), batch.block(0));
  for (int i = 0; i < model.nv(); ++i) {
    g.q.push_back(adjoint.loss(0).q[std::size_t(i * kBlock + lane)]);
    g.v.push_back(adjoint.loss(0).v[std::size_t(i * kBlock + lane)]);
  }
  const NumberGradients parameters(model);
  g.parameters.resize(std::size_t(parameters.count()));
  parameters.gradient(adjoint.loss(0), batch, lane, g.parameters);
  return g;
}

/// Central differences at ever smaller steps, and the one of least error; NaN if none settles (a
/// kink). A difference's error is estimated as its change from the step before, plus the effect of
/// rounding. At the smallest steps, which serve runs with a kink or a split step close by, two
/// differences can agree by chance.
class CentralDifferences {
 public:
  explicit CentralDifferences(double start) : step_(start), last_(1e-5 * start) {}
  /// Where the next values are taken: at e, -e, 2e and -2e.
  [[nodiscard]] std::array<double, 4> places() const {
    return {step_, -step_, 2 * step_, -2 * step_};
  }
  void add(std::span<const double, 4> values) {
    // Richardson's extrapolation removes the error of second order.
    const double above = values[0], below = values[1];
    const double coarse = (values[2] - values[3]) / (4 * step_),
                 fine = (above - below) / (2 * step_);
    const double value = (4 * fine - coarse) / 3;
    const double rounding = kRounding * (std::abs(above) + std::abs(below)) / step_;
    const double error = std::abs(value - before_) + rounding;
    if (error < least_) least_ = error, best_ = value;
    before_ = value;
    step_ *= kRatio;
    // From here on the effect of rounding alone exceeds the least error.
    finished_ = step_ <= last_ || rounding / kRatio > least_;
  }
  [[nodiscard]] bool finished() const { return finished_; }
  [[nodiscard]] double best() const { return best_; }

 private:
  static constexpr double kRounding = 1e-14;  // of a run's loss, relative
  static constexpr double kRatio = 0.25;
  double step_, last_;
  double best_ = NAN, least_ = HUGE_VAL, before_ = NAN;
  bool finished_ = false;
};

inline double best_difference(const std::function<double(double)>& f, double start) {
  CentralDifferences differences(start);
  while (!differences.finished()) {
    std::array<double, 4> values{};
    std::ranges::transform(differences.places(), values.begin(), f);
    differences.add(values);
  }
  return differences.best();
}

/// `complete`: puts what follows from the rest of a start in its place, or empty.
inline RunGradient differences_of_run(const Model& model, const StepperOptions& options,
                                      const RunInput& in, const StateLoss& loss,
                                      double start = 1e-3,
                                      const std::function<void(RunInput&)>& complete = {}) {
  std::vector<std::function<void(RunInput&, double)>> directions;
  for (int i = 0; i < model.nv(); ++i) {
    directions.emplace_back([&, i](RunInput& x, double e) { x.q = moved(model, x.q, i, e); });
    directions.emplace_back([i](RunInput& x, double e) { x.v[std::size_t(i)] += 10 * e; });
  }
  for (std::size_t t = 0; t < in.u.size(); ++t)
    for (int k = 0; k < model.nu(); ++k)
      directions.emplace_back([=](RunInput& x, double e) { x.u[t][std::size_t(k)] += 10 * e; });
  std::vector<CentralDifferences> found(directions.size(), CentralDifferences(start));
  // All runs with other states and controls go in one batch for each size of step.
  while (!std::ranges::all_of(found, &CentralDifferences::finished)) {
    std::vector<RunInput> runs;
    for (std::size_t i = 0; i < directions.size(); ++i) {
      if (found[i].finished()) continue;
      for (const double e : found[i].places()) {
        runs.push_back(in);
        directions[i](runs.back(), e);
        if (complete) complete(runs.back());
      }
    }
    const std::vector<double> losses = losses_of_runs(model, options, runs, loss);
    auto next = losses.begin();
    for (CentralDifferences& differences : found) {
      if (differences.finished()) continue;
      differences.add(std::span<const double, 4>(next, 4));
      next += 4;
    }
  }
  RunGradient g;
  auto next = found.begin();
  for (int i = 0; i < model.nv(); ++i) {
    g.q.push_back((next++)->best());
    g.v.push_back((next++)->best() / 10);
  }
  for (; next != found.end(); ++next) g.u.push_back(next->best() / 10);
  const NumberGradients parameters(model);
  for (int k = 0; k < parameters.count(); ++k) {
    const double size = size_of(parameters.infos()[std::size_t(k)]);
    if (size == 0) {  // at a bound of the scene's numbers: one-sided
      g.parameters.push_back(NAN);
      continue;
    }
    g.parameters.push_back(best_difference(
                               [&](double e) {
                                 Scene scene = model.scene();
                                 number_in(scene, parameters.infos()[std::size_t(k)].number) +=
                                     e * size;
                                 return loss_of_run(Model(scene), options, in, loss);
                               },
                               start) /
                           size);
  }
  return g;
}

}  // namespace tangere::testing
