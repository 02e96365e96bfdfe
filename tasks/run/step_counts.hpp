// SPDX-License-Identifier: Apache-2.0
// Counts of steps and evaluations, and failed environments, for rollouts, episodes, benchmarks,
// cases and tasks.
#pragma once

#include <cstdint>

#include "engine/step/batch.hpp"

namespace tangere {

/// Sums over steps of single environments.
struct StepCounts {
  std::int64_t simulation_steps = 0;
  std::int64_t newton_iterations = 0;
  std::int64_t split_steps = 0;
  std::int64_t accuracy_not_met_steps = 0;  ///< with parts that missed the requested accuracy
  std::int64_t tunnelled_steps = 0;         ///< in which a body passed through another
  std::int64_t damped_steps = 0;            ///< that would have created energy
  std::int64_t overlapping_steps = 0;       ///< after which bodies of a contact overlap unnoticed
  std::int64_t bodies_asleep = 0;           ///< summed over simulation_steps
  /// Readings of layers that do not carry the loads of their contacts, where a run has readings.
  std::int64_t loads_not_carried = 0;

  /// Counts the step that an environment has just taken.
  void count(const Batch& batch, int environment) {
    const StepStatus status = batch.status(environment);
    ++simulation_steps;
    newton_iterations += batch.iterations(environment);
    split_steps += status == StepStatus::split ? 1 : 0;
    accuracy_not_met_steps += status == StepStatus::accuracy_not_met ? 1 : 0;
    tunnelled_steps += status == StepStatus::tunnelled ? 1 : 0;
    damped_steps += status == StepStatus::damped ? 1 : 0;
    overlapping_steps += status == StepStatus::overlapping ? 1 : 0;
    bodies_asleep += batch.sleep(environment).bodies;
  }

  /// Steps with wrong motion, because contacts were missed: tunnelled or overlapping.
  [[nodiscard]] std::int64_t missed_contacts() const { return tunnelled_steps + overlapping_steps; }

  StepCounts& operator+=(const StepCounts& other) {
    simulation_steps += other.simulation_steps;
    newton_iterations += other.newton_iterations;
    split_steps += other.split_steps;
    accuracy_not_met_steps += other.accuracy_not_met_steps;
    tunnelled_steps += other.tunnelled_steps;
    damped_steps += other.damped_steps;
    overlapping_steps += other.overlapping_steps;
    bodies_asleep += other.bodies_asleep;
    loads_not_carried += other.loads_not_carried;
    return *this;
  }
};

/// An environment for which no solution was found. It keeps the state before that step.
struct FailedEnvironment {
  int environment;
  std::int64_t step;  ///< the first that failed; -1: before this run
  StepStatus status;  ///< why
};

/// Counts of actions, steps and episodes of a task's environments.
struct VectorCounts {
  std::int64_t environment_steps = 0;  ///< actions taken, without those of openings
  StepCounts steps;                    ///< of the simulation, without those that failed

  VectorCounts& operator+=(const VectorCounts& other) {
    environment_steps += other.environment_steps;
    steps += other.steps;
    return *this;
  }
};

}  // namespace tangere
