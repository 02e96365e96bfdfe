// SPDX-License-Identifier: Apache-2.0
// What a task declares: its arrays with names, shapes, units and bounds, and how time goes.
// Buffers, files and the command's tables follow from it. Description only; what a task does is in
// tasks/catalogue/task.hpp.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace tangere {

/// An array of numbers that an environment takes or gives.
struct TensorSpec {
  static constexpr double kUnbounded = std::numeric_limits<double>::infinity();

  std::string name;
  std::vector<std::size_t> shape;  ///< row-major
  std::string unit;                ///< "m", "N", "1" …
  std::string meaning;
  double low = -kUnbounded, high = kUnbounded;  ///< of every number

  [[nodiscard]] std::size_t size() const;
};

struct TaskSpec {
  std::string name;
  std::string summary;  ///< one sentence
  std::string scene;    ///< file below scenes/
  std::string success;  ///< when an episode counts as solved, in words
  TensorSpec action;
  std::vector<TensorSpec>
      observations;          ///< an environment's lie one behind the other, in this order
  int steps_per_action = 1;  ///< simulation steps of an environment step
  int control_every = 0;     ///< controls are asked for every so many of them; 0: once per action
  std::vector<int> moments;  ///< steps of an action after which it looks, ascending, the last one
                             ///< steps_per_action
  int horizon = 1;           ///< actions of an episode; then it is truncated
  bool opening = false;  ///< a reset is followed by one action of zeros, which belongs to the reset
  bool restarts = false;   ///< every action starts from a state that the task gives
  int settling_steps = 0;  ///< a reset ends with so many steps of `settling_timestep` [s]
  double settling_timestep = 0;
  int memory = 0;  ///< numbers of its own that an episode keeps: a goal, a force
  bool looks_at_end_effectors = false,
       looks_at_tactile = false;  ///< what its moments hold besides q and v

  [[nodiscard]] std::size_t observation_size() const;
  /// Throws InputError when something is missing or contradicts something else.
  void check() const;
};

}  // namespace tangere
