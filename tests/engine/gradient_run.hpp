// SPDX-License-Identifier: Apache-2.0
// Short rollouts with a loss that is linear in every state, and their gradients by the adjoint and
// by differences.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
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

/// The steps of central differences: four values of a function at each, at e, -e, 2e and -2e.
inline std::vector<double> difference_steps(double start) {
  std::vector<double> steps;
  for (double e = start; e > 1e-5 * start; e *= 0.25) steps.push_back(e);
  return steps;
}

/// The central difference of least error; NaN if none settles (a kink). `values`: of the function,
/// four for each of the steps. A difference's error is estimated as its change from the step
/// before, plus the effect of rounding. At the smallest steps, which serve runs with a kink or a
/// split step close by, two differences can agree by chance.
inline double best_of_differences(const std::vector<double>& steps, const double* values) {
  constexpr double kRounding = 1e-14;  // of a run's loss, relative
  double best = NAN, least = HUGE_VAL, before = NAN;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    // Richardson's extrapolation removes the error of second order.
    const double e = steps[i], above = values[4 * i], below = values[4 * i + 1];
    const double coarse = (values[4 * i + 2] - values[4 * i + 3]) / (4 * e),
                 fine = (above - below) / (2 * e);
    const double value = (4 * fine - coarse) / 3;
    const double rounding = kRounding * (std::abs(above) + std::abs(below)) / e;
    const double error = std::abs(value - before) + rounding;
    if (error < least) least = error, best = value;
    before = value;
  }
  return best;
}

inline double best_difference(const std::function<double(double)>& f, double start) {
  const std::vector<double> steps = difference_steps(start);
  std::vector<double> values;
  for (const double e : steps)
    for (const double at : {e, -e, 2 * e, -2 * e}) values.push_back(f(at));
  return best_of_differences(steps, values.data());
}

/// `complete`: puts what follows from the rest of a start in its place, or empty.
inline RunGradient differences_of_run(const Model& model, const StepperOptions& options,
                                      const RunInput& in, const StateLoss& loss,
                                      double start = 1e-3,
                                      const std::function<void(RunInput&)>& complete = {}) {
  // All runs with other states and controls go in one batch.
  const std::vector<double> steps = difference_steps(start);
  std::vector<RunInput> runs;
  const auto along = [&](const std::function<void(RunInput&, double)>& change) {
    for (const double e : steps)
      for (const double at : {e, -e, 2 * e, -2 * e}) {
        runs.push_back(in);
        change(runs.back(), at);
        if (complete) complete(runs.back());
      }
  };
  for (int i = 0; i < model.nv(); ++i) {
    along([&](RunInput& x, double e) { x.q = moved(model, x.q, i, e); });
    along([&](RunInput& x, double e) { x.v[std::size_t(i)] += 10 * e; });
  }
  for (std::size_t t = 0; t < in.u.size(); ++t)
    for (int k = 0; k < model.nu(); ++k)
      along([&](RunInput& x, double e) { x.u[t][std::size_t(k)] += 10 * e; });
  const std::vector<double> losses = losses_of_runs(model, options, runs, loss);
  const double* next = losses.data();
  const auto difference = [&] {
    next += 4 * steps.size();
    return best_of_differences(steps, next - 4 * steps.size());
  };
  RunGradient g;
  for (int i = 0; i < model.nv(); ++i) {
    g.q.push_back(difference());
    g.v.push_back(difference() / 10);
  }
  for (std::size_t k = 0; k < in.u.size() * std::size_t(model.nu()); ++k)
    g.u.push_back(difference() / 10);
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
