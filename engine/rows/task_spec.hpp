// SPDX-License-Identifier: Apache-2.0
// Declaration of a task: arrays with names, shapes, units and bounds, and timing. Buffers, files
// and the command's tables follow from it. The functions of a task are in tasks/catalogue/task.hpp.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "engine/scene/field_form.hpp"

namespace tangere {

/// An array of numbers that an environment receives or returns.
struct TensorSpec {
  static constexpr double kUnbounded = std::numeric_limits<double>::infinity();

  std::string name;
  std::vector<std::size_t> shape;  ///< row-major
  std::string unit;                ///< "m", "N", "1" …
  std::string meaning;
  /// Typical magnitudes, one for all numbers or one per index of the last axis, in their unit.
  /// Inputs of networks are divided by them. Empty: 1.
  std::vector<double> scale = {};
  double low = -kUnbounded, high = kUnbounded;  ///< bounds of every number
  bool privileged = false;                      ///< a robot could not measure it
  bool touch = false;                           ///< tactile: all numbers are 0 without contact
  /// As EpisodeChannel::own_bytes(): 1 for pictures in colours, 2 for numbers of bodies, else 0.
  std::size_t own_bytes = 0;

  [[nodiscard]] std::size_t size() const;
};

struct TaskSpec {
  std::string name;
  std::string summary;  ///< one sentence
  std::string scene;    ///< file below scenes/, or the path of a scene file
  std::string success;  ///< when an episode counts as solved, in words
  TensorSpec action;
  /// Stored one after another for each environment, in this order.
  std::vector<TensorSpec> observations;
  int steps_per_action = 1;  ///< simulation steps of an environment step
  int control_every = 0;     ///< simulation steps between requests for controls; 0: once per action
  /// Steps within an action after which a Snapshot is taken: ascending; the last one is
  /// steps_per_action.
  std::vector<int> snapshots;
  int horizon = 1;  ///< actions of an episode, after which it is truncated
  /// A reset is followed by one action of zeros, which belongs to the reset.
  bool warm_up = false;
  bool restarts = false;   ///< every action starts from a state that the task gives
  int settling_steps = 0;  ///< a reset ends with this many steps of `settling_timestep` [s]
  double settling_timestep = 0;
  int task_state = 0;  ///< count of numbers that the task keeps per episode: a goal, a force
  /// Readings in a Snapshot besides q and v.
  bool reads_end_effectors = false, reads_tactile = false, reads_bodies = false,
       reads_shear_state = false;
  /// With reads_tactile: fields and pressures that are read, in order; none: the field of every
  /// sensor.
  std::vector<FieldOutput> fields = {};

  [[nodiscard]] std::size_t observation_size() const;
  /// Throws InputError when something is missing or contradicts something else.
  void check() const;
};

}  // namespace tangere
