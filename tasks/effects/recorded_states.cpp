// SPDX-License-Identifier: Apache-2.0
// A serial run that copies states out.
#include "tasks/effects/recorded_states.hpp"

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/episode_program.hpp"

namespace tangere {
namespace {

void copy_states(const Batch& batch, std::vector<double>& q, std::vector<double>& v) {
  const std::size_t nq = as_size(batch.model().nq()), nv = as_size(batch.model().nv());
  q.resize(nq * as_size(batch.environments()));
  v.resize(nv * as_size(batch.environments()));
  for (int e = 0; e < batch.environments(); ++e) {
    batch.get_q(e, std::span(q).subspan(as_size(e) * nq, nq));
    batch.get_v(e, std::span(v).subspan(as_size(e) * nv, nv));
  }
}

}  // namespace

RecordedStates record_states(const Model& model, int environments, int instants,
                             std::uint64_t seed) {
  Batch batch(model, environments, seed);
  StepperOptions awake;  // every instant shows the whole scene
  awake.sleep = 0;
  Stepper stepper(model, awake);
  const ControlProgram program(model, model.timestep(), seed);
  const std::int64_t planned = program.steps();
  const std::int64_t steps = planned < 0 ? kOpenRunSteps : std::min(planned, kMostRunSteps);
  const std::int64_t requested = std::min<std::int64_t>(instants, steps);
  RecordedStates recorded{model, environments, planned, steps, {}, 0, {}};
  for (std::size_t k = 0; k < model.scene().randomizations.size(); ++k) {
    recorded.numbers.emplace_back();
    for (int e = 0; e < environments; ++e)
      recorded.numbers.back().push_back(batch.randomized_value(e, static_cast<int>(k)));
  }
  std::vector<double> u(as_size(model.nu()) * as_size(environments)), before_q, before_v;
  for (std::int64_t step = 0; step < steps; ++step) {
    write_controls(program, step, batch, u);
    const auto next = static_cast<std::int64_t>(recorded.instants.size());
    if (next < requested && step == (2 * next + 1) * steps / (2 * requested)) {
      RecordedInstant now;
      now.step = step;
      copy_states(batch, now.q, now.v);
      now.previous_q = before_q, now.previous_v = before_v;
      now.controls = u;
      for (int e = 0; e < environments; ++e) now.failed.push_back(failed(batch.status(e)) ? 1 : 0);
      recorded.instants.push_back(std::move(now));
    }
    copy_states(batch, before_q, before_v);
    stepper.step(batch, u);
  }
  for (int e = 0; e < environments; ++e) recorded.failed += failed(batch.status(e)) ? 1 : 0;
  return recorded;
}

}  // namespace tangere
