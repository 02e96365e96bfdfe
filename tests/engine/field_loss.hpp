// SPDX-License-Identifier: Apache-2.0
// Losses that are linear in the fields of all sensors, after every step of a short run.
#pragma once

#include <span>
#include <vector>

#include "engine/derivative/readout_pullback.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/sense/readout.hpp"
#include "tests/engine/gradient_run.hpp"
#include "tests/engine/gradient_tangent.hpp"

namespace tangere::testing {

/// Σ_t weight(t)·(fields of all sensors after t steps), with random weights.
struct FieldLoss {
  Model model;
  std::vector<std::vector<double>> weights;  ///< of each step: all fields one after another

  FieldLoss(const Model& m, int steps, unsigned seed) : model(m) {
    Random random(seed);
    std::size_t numbers = 0;
    for (const SensorInfo& s : m.sensors()) numbers += 3 * std::size_t(s.points);
    weights.resize(std::size_t(steps) + 1);
    for (auto& w : weights)
      for (std::size_t k = 0; k < numbers; ++k) w.push_back(random.normal());
  }
  [[nodiscard]] std::span<const double> of(std::size_t step, std::size_t sensor) const {
    std::size_t first = 0;
    for (std::size_t s = 0; s < sensor; ++s) first += 3 * std::size_t(model.sensors()[s].points);
    return std::span(weights[step]).subspan(first, 3 * std::size_t(model.sensors()[sensor].points));
  }
  [[nodiscard]] double value(Readout& readout, const Batch& batch, std::size_t step) const {
    double sum = 0;
    for (std::size_t s = 0; s < model.sensors().size(); ++s) {
      const std::span<const double> w = of(step, s);
      std::vector<double> field(w.size());
      readout.tactile(batch, 0, static_cast<int>(s), std::span<double>(field));
      for (std::size_t k = 0; k < w.size(); ++k) sum += w[k] * field[k];
    }
    return sum;
  }
};

inline double field_loss_of_run(const Model& model, const StepperOptions& options,
                                const RunInput& in, const FieldLoss& loss) {
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, options);
  Readout readout(model);
  double sum = loss.value(readout, batch, 0);
  for (std::size_t t = 0; t < in.u.size(); ++t) {
    stepper.step(batch, in.u[t]);
    if (failed(batch.status(0))) return NAN;
    sum += loss.value(readout, batch, t + 1);
  }
  return sum;
}

/// Its gradient by the adjoint. `points`: out: derivatives by every point's own numbers, or null.
inline RunGradient adjoint_of_fields(const Model& model, const StepperOptions& options,
                                     const RunInput& in, const FieldLoss& loss,
                                     std::vector<double>* points = nullptr) {
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, options);
  const int steps = static_cast<int>(in.u.size());
  BlockTape tape(model, stepper.integrator(), steps);
  tape.start(batch, 0);
  for (const auto& u : in.u) stepper.step_block(batch, 0, u, &tape);
  Adjoint adjoint(model, options, {1, true, points != nullptr});
  adjoint.clear();
  ReadoutPullback pullback(model);
  Batch shown(model, 1);
  RunGradient g;
  g.u.resize(std::size_t(steps * model.nu()));
  for (int t = steps; t >= 0; --t) {
    tape.show(t, shown, 0);
    pullback.place(shown, 0);
    pullback.clear();
    for (std::size_t s = 0; s < model.sensors().size(); ++s)
      pullback.dense_field(0, static_cast<int>(s), loss.of(std::size_t(t), s),
                           adjoint.loss(0).parameters,
                           adjoint.loss(0).points_of(model, static_cast<int>(s), 0));
    pullback.finish(adjoint.loss(0));
    if (t == 0) break;
    adjoint.reverse_step(batch, 0, tape, t - 1, in.u[std::size_t(t - 1)]);
    for (int k = 0; k < model.nu(); ++k)
      g.u[std::size_t((t - 1) * model.nu() + k)] = adjoint.loss(0).u[std::size_t(k) * 16];
  }
  for (int i = 0; i < model.nv(); ++i) {
    g.q.push_back(adjoint.loss(0).q[std::size_t(i) * 16]);
    g.v.push_back(adjoint.loss(0).v[std::size_t(i) * 16]);
  }
  const NumberGradients parameters(model);
  g.parameters.resize(std::size_t(parameters.count()));
  parameters.gradient(adjoint.loss(0), batch, 0, g.parameters);
  if (points != nullptr)
    points->assign(adjoint.loss(0).points.begin(),
                   adjoint.loss(0).points.begin() + tactile_points(model) * kPointNumbers);
  return g;
}

/// How the loss changes at a state, in dual numbers. `points_dot`: how the points' own numbers of
/// every sensor change, or empty.
inline LossChange change_of_fields(const FieldLoss& loss,
                                   std::span<const std::vector<double>> points_dot = {}) {
  return [&loss, points_dot](Tangent& tangent, const Batch& batch, const BlockTape& tape, int t,
                             const std::vector<double>& rows, const StateTangent& state) {
    double sum = 0;
    for (std::size_t s = 0; s < loss.model.sensors().size(); ++s) {
      const std::span<const double> w = loss.of(std::size_t(t), s);
      std::vector<double> field_dot(w.size());
      tangent.field(batch, 0, 0, tape, t, static_cast<int>(s), rows,
                    points_dot.empty() ? std::span<const double>() : points_dot[s], state,
                    field_dot);
      for (std::size_t k = 0; k < w.size(); ++k) sum += w[k] * field_dot[k];
    }
    return sum;
  };
}

}  // namespace tangere::testing
