// SPDX-License-Identifier: Apache-2.0
// Options of a rollout, and the steps at which its sensors are read.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/field_form.hpp"

namespace tangere {

/// Optional channels of a rollout besides q, v, controls and step results. Others are not computed.
struct RolloutOutputs {
  std::optional<std::vector<FieldOutput>> fields;  ///< none: the field of every sensor
  bool bodies = true, end_effectors = true;
  bool audit = false;          ///< balance of energy and momentum
  bool memory = false;         ///< shear state
  bool transmissions = false;  ///< their forces at the end of each step
  /// Rows at which q and v, bodies, end effectors and shear state are written; none: every row. If
  /// `states` are given, controls are not written, and steps only if they end at a row of q.
  OutputTimes states = {}, body_times = {}, end_effector_times = {}, shear_times = {};
  std::vector<int> chosen_bodies = {};  ///< ascending; none: every body
};

struct RolloutOptions {
  std::int64_t steps = 0;
  int every = 0;  ///< steps between fields; 0: the scene's `every`, or 1 if it has none
  Precision precision = Precision::f64;  ///< of tactile fields
  /// Steps taken before row 0 by the run that this one continues. Times, controls and intervals of
  /// fields count them.
  std::int64_t first_step = 0;
  RolloutOutputs outputs = {};
};

/// Returns what is read of tactile fields. Throws InputError as check_outputs() does.
std::vector<FieldOutput> fields_of(const Model& model, const RolloutOutputs& outputs);
/// The same without pictures of cameras.
std::vector<FieldOutput> sensor_fields_of(const Model& model, const RolloutOutputs& outputs);
/// Steps between the fields of a sensor under these options, where a reading has no times of its
/// own.
int tactile_interval(const SensorInfo& sensor, const RolloutOptions& options);
/// When a reading is taken: its own times, else the interval of its sensor.
OutputTimes reading_times(const Model& model, FieldOutput output, const RolloutOptions& options);
/// Number of readings that a rollout takes.
std::int64_t tactile_frames(const Model& model, FieldOutput output, const RolloutOptions& options);

/// Memory that a rollout allocates besides batch and stepper [bytes].
double rollout_bytes(const Model& model, int environments, const RolloutOutputs& outputs = {});

}  // namespace tangere
