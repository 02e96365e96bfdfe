// SPDX-License-Identifier: Apache-2.0
// The adjoint of a short run against derivatives forward in dual numbers.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "engine/derivative/tangent.hpp"
#include "tests/engine/gradient_run.hpp"

namespace tangere::testing {

/// The change of a loss of the state after t steps, where that state changes by `state` and the
/// parameters by `rows`. Environment 0 of `batch` and of `tape` is the run's.
using LossChange =
    std::function<double(Tangent& tangent, const Batch& batch, const BlockTape& tape, int t,
                         const std::vector<double>& rows, const StateTangent& state)>;

/// Expects the change of a loss along random directions, of start, controls and numbers of the
/// scene, to be that by the adjoint. `points_dot`: that of every sensor's points, or empty;
/// `by_points`: by the adjoint, times this.
inline void expect_tangent(const Model& model, const StepperOptions& options, const RunInput& in,
                           const RunGradient& adjoint, Random& random,
                           const LossChange& loss_change,
                           std::span<const std::vector<double>> points_dot = {},
                           double by_points = 0) {
  const auto steps = static_cast<int>(in.u.size());
  const auto draw = [&](std::size_t count) {
    std::vector<double> x(count);
    for (double& a : x) a = random.normal();
    return x;
  };
  const std::size_t nv = std::size_t(model.nv()), nu = std::size_t(model.nu());
  StateTangent state{draw(nv), draw(nv), std::vector<double>(nv), std::vector<double>(nv)};
  const NumberGradients numbers(model);
  std::vector<double> change = draw(std::size_t(numbers.count()));
  for (std::size_t k = 0; k < change.size(); ++k) change[k] *= size_of(numbers.infos()[k]);
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  std::vector<double> rows(std::size_t(parameter_rows(model)));
  numbers.spread(change, batch, 0, rows);
  complete_changes(model, {in.q.data(), in.v.data(), 1, batch.block(0)}, rows, state.q, state.v);
  double reverse = by_points, forward = 0;
  for (std::size_t i = 0; i < nv; ++i)
    reverse += adjoint.q[i] * state.q[i] + adjoint.v[i] * state.v[i];
  for (std::size_t k = 0; k < change.size(); ++k) reverse += adjoint.parameters[k] * change[k];
  Stepper stepper(model, options);
  BlockTape tape(model, stepper.integrator(), steps);
  tape.start(batch, 0);
  for (const auto& u : in.u) stepper.step_block(batch, 0, u, &tape);
  Tangent tangent(model, options);
  for (int t = 0; t <= steps; ++t) {
    tape.show(t, batch, 0);
    forward += loss_change(tangent, batch, tape, t, rows, state);
    if (t == steps) break;
    const std::vector<double> u_dot = draw(nu);
    for (std::size_t k = 0; k < nu; ++k) reverse += adjoint.u[std::size_t(t) * nu + k] * u_dot[k];
    tangent.step(batch, 0, 0, tape, t, in.u[std::size_t(t)], u_dot, rows, state, points_dot);
  }
  EXPECT_NEAR(reverse, forward, 1e-9 * (std::abs(forward) + adjoint.norm()));
}

/// Expects the same of a loss of states. Returns how many were compared; 0 if a step of the run
/// finds no solution.
inline int check_tangent(const Model& model, const StepperOptions& options, const RunInput& in,
                         unsigned seed) {
  const auto steps = static_cast<int>(in.u.size());
  const StateLoss loss(model, steps, seed + 1);
  if (!std::isfinite(loss_of_run(model, options, in, loss))) return 0;
  const RunGradient adjoint = adjoint_of_run(model, options, {in}, loss, 0);
  Random random(seed + 70);
  Adjoint cotangents(model, options);  // of the loss by each state
  const auto loss_change = [&](Tangent&, const Batch&, const BlockTape& tape, int t,
                               const std::vector<double>&, const StateTangent& state) {
    cotangents.clear();
    std::vector<double> q(std::size_t(model.nq()));
    for (std::size_t i = 0; i < q.size(); ++i) q[i] = tape.state(t)[kBlock * i];
    loss.add(t, q, cotangents.loss(0), 0);
    double sum = 0;
    for (std::size_t i = 0; i < state.q.size(); ++i)
      sum += cotangents.loss(0).q[kBlock * i] * state.q[i] +
             cotangents.loss(0).v[kBlock * i] * state.v[i];
    return sum;
  };
  expect_tangent(model, options, in, adjoint, random, loss_change);
  return 1;
}

}  // namespace tangere::testing
