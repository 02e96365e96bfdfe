// SPDX-License-Identifier: Apache-2.0
// The adjoint of a short run of a scene against differences of whole runs.
#pragma once

#include <gtest/gtest.h>

#include "tests/engine/gradient_run.hpp"

namespace tangere::testing {

/// Compares every entry relative to the gradient's norm over its group. Returns how many it
/// compared.
inline int compare(const std::vector<double>& a, const std::vector<double>& b, double scale,
                   double tolerance, const char* what) {
  int compared = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(b[i])) continue;
    EXPECT_NEAR(a[i], b[i], tolerance * scale) << what << " " << i;
    ++compared;
  }
  return compared;
}

inline double norm(const std::vector<double>& x) {
  double sum = 0;
  for (double a : x)
    if (std::isfinite(a)) sum += a * a;
  return std::sqrt(sum);
}

/// The scene without steps that are taken again because they create energy or turn too far: the run
/// jumps where that is decided, and a difference across the jump is no derivative.
inline Model without_second_looks(Scene scene) {
  scene.solver.bounded_energy = false;
  return Model(scene);
}

/// Returns how many derivatives were compared; 0 if a step of the run finds no solution.
inline int check_gradient(const Model& model, const StepperOptions& o, const RunInput& in,
                          unsigned seed, double tolerance) {
  const StateLoss loss(model, static_cast<int>(in.u.size()), seed);
  if (!std::isfinite(loss_of_run(model, o, in, loss))) return 0;
  const RunGradient adjoint = adjoint_of_run(model, o, {in}, loss, 0);
  const RunGradient difference = differences_of_run(model, o, in, loss);
  int compared = compare(adjoint.q, difference.q, norm(difference.q), tolerance, "q");
  compared += compare(adjoint.v, difference.v, norm(difference.v), tolerance, "v");
  compared += compare(adjoint.u, difference.u, norm(difference.u), tolerance, "u");
  const NumberGradients parameters(model);
  std::vector<double> a = adjoint.parameters,
                      b = difference.parameters;  // by their relative changes: units differ
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double size = size_of(parameters.infos()[k]);
    a[k] *= size, b[k] *= size;
  }
  const double scale = norm(b);
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (!std::isfinite(b[k])) continue;
    EXPECT_NEAR(a[k], b[k], tolerance * scale) << parameters.infos()[k].name;
    ++compared;
  }
  return compared;
}
inline int check_gradient(const Scene& scene, Integrator scheme, unsigned seed, int steps,
                          double tolerance, double accuracy = 0) {
  const Model model = without_second_looks(scene);
  StepperOptions o = options(scheme, scene.timestep, 1e-13);
  o.accuracy = accuracy;
  return check_gradient(model, o, random_input(model, seed, steps), seed + 1, tolerance);
}

/// Expects the gradient of a run of six steps from velocities v against differences. Some of the
/// steps must end with this status: the tape says which scheme took their parts.
inline void expect_gradient_through(const Model& model, const StepperOptions& o,
                                    const std::vector<double>& v, StepStatus status) {
  RunInput in = random_input(model, 5, 6);
  Batch batch(model, 1);
  in.q = q_of(batch), in.v = v;
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, o);
  int found = 0;
  for (const std::vector<double>& u : in.u) {
    stepper.step(batch, u);
    found += batch.status(0) == status;
  }
  EXPECT_GT(found, 0);
  const StateLoss loss(model, 6, 7);
  const RunGradient adjoint = adjoint_of_run(model, o, {in}, loss, 0),
                    differences = differences_of_run(model, o, in, loss);
  EXPECT_EQ(compare(adjoint.q, differences.q, norm(differences.q), 1e-6, "q"), 6);
  EXPECT_EQ(compare(adjoint.v, differences.v, norm(differences.v), 1e-6, "v"), 6);
}

/// Whether a step of the run is split because it found no root.
inline bool splits(const Scene& scene, Integrator scheme, unsigned seed, int steps) {
  const Model model = without_second_looks(scene);
  const RunInput in = random_input(model, seed, steps);
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, options(scheme, scene.timestep, 1e-13));
  bool split = false;
  for (const std::vector<double>& u : in.u) {
    stepper.step(batch, u);
    split = split || batch.status(0) == StepStatus::split;
  }
  return split;
}

}  // namespace tangere::testing
