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

inline double loss_of_run(const Model& model, const StepperOptions& options, const RunInput& in,
                          const StateLoss& loss) {
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, options);
  double sum = loss.value(0, q_of(batch), v_of(batch));
  for (std::size_t t = 0; t < in.u.size(); ++t) {
    stepper.step(batch, in.u[t]);
    if (failed(batch.status(0))) return NAN;
    sum += loss.value(static_cast<int>(t) + 1, q_of(batch), v_of(batch));
  }
  return sum;
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
  for (int i = 0; i < model.nv(); ++i) {
    g.q.push_back(adjoint.loss(0).q[std::size_t(i * kBlock + lane)]);
    g.v.push_back(adjoint.loss(0).v[std::size_t(i * kBlock + lane)]);
  }
  const NumberGradients parameters(model);
  g.parameters.resize(std::size_t(parameters.count()));
  parameters.gradient(adjoint.loss(0), batch, lane, g.parameters);
  return g;
}

/// The central difference of least error; NaN if none settles (a kink). Its error is estimated as
/// its change from the step size before, plus the effect of rounding. At the smallest steps, which
/// serve runs with a kink or a split step close by, two differences can agree by chance.
inline double best_difference(const std::function<double(double)>& f, double start) {
  constexpr double kRounding = 1e-14;  // of a run's loss, relative
  double best = NAN, least = HUGE_VAL, before = NAN;
  for (double e = start; e > 1e-5 * start; e *= 0.25) {
    // Richardson's extrapolation removes the error of second order.
    const double above = f(e), below = f(-e);
    const double coarse = (f(2 * e) - f(-2 * e)) / (4 * e), fine = (above - below) / (2 * e);
    const double value = (4 * fine - coarse) / 3;
    const double rounding = kRounding * (std::abs(above) + std::abs(below)) / e;
    const double error = std::abs(value - before) + rounding;
    if (error < least) least = error, best = value;
    before = value;
  }
  return best;
}

inline RunGradient differences_of_run(const Model& model, const StepperOptions& options,
                                      const RunInput& in, const StateLoss& loss,
                                      double start = 1e-3) {
  RunGradient g;
  const auto along = [&](const std::function<void(RunInput&, double)>& change) {
    return best_difference(
        [&](double e) {
          RunInput other = in;
          change(other, e);
          return loss_of_run(model, options, other, loss);
        },
        start);
  };
  for (int i = 0; i < model.nv(); ++i) {
    g.q.push_back(along([&](RunInput& x, double e) { x.q = moved(model, x.q, i, e); }));
    g.v.push_back(along([&](RunInput& x, double e) { x.v[std::size_t(i)] += 10 * e; }) / 10);
  }
  for (std::size_t t = 0; t < in.u.size(); ++t)
    for (int k = 0; k < model.nu(); ++k)
      g.u.push_back(along([&](RunInput& x, double e) { x.u[t][std::size_t(k)] += 10 * e; }) / 10);
  const NumberGradients parameters(model);
  for (int k = 0; k < parameters.count(); ++k) {
    const double size = parameters.infos()[std::size_t(k)].value;
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
