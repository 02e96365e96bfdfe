// SPDX-License-Identifier: Apache-2.0
// Turns what the engine knows of a run into what its trajectory file says about it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/step/stepper.hpp"
#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// What the model and the batch do not know about a run.
struct RunDescription : RunOrigin {
  std::int64_t steps = 0, first_step = 0;
  int every = 0;                       ///< the option as given; 0: each sensor's own interval
  std::vector<int> tactile_intervals;  ///< K in force, one per sensor
  /// Recorded; none: the field of every sensor.
  std::optional<std::vector<FieldOutput>> fields;
  bool bodies = true, end_effectors = true, audit = false, memory = false;  ///< recorded
  /// As in TrajectoryLayout.
  OutputTimes states = {}, of_bodies = {}, of_end_effectors = {}, of_memory = {};
  std::vector<int> chosen_bodies = {};  ///< none: every body
  std::string command_line;
  std::string policy;
};

/// Describes a sensor of a model. `every`: SensorLayout::every.
SensorLayout sensor_layout(const SensorInfo& info, const TactileDescription& description,
                           int every);

/// What every kind of file says of a run by `stepper`. It names all end effectors.
RunFacts run_facts(const Model& model, const Stepper& stepper, const RunOrigin& origin,
                   std::uint64_t seed);

/// The layout of a rollout of `batch` by `stepper`.
TrajectoryLayout layout_from(const Batch& batch, const Stepper& stepper, const RunDescription& run);

}  // namespace tangere
