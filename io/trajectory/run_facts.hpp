// SPDX-License-Identifier: Apache-2.0
// What files say of a run, whether their rows are steps of environments or episodes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/rows/task_spec.hpp"

namespace tangere {

/// What neither the model nor the stepper knows of a run.
struct RunOrigin {
  std::string precision, version, instruction_set;
  std::optional<TaskSpec> task;  ///< defines actions, observations and rewards; none: only a scene
};

struct RunFacts : RunOrigin {
  std::vector<std::string> q_names, q_units;    ///< (nq)
  std::vector<std::string> v_names, v_units;    ///< (nv)
  std::vector<std::string> u_names, u_units;    ///< (nu)
  std::vector<std::string> end_effector_names;  ///< (n) end effectors, empty when there are none
  std::vector<std::string> randomized_names, randomized_units;  ///< (k), empty when nothing varies
  std::string scene_name, scene_text;
  std::string integrator;
  double timestep = 0;   ///< [s]
  double tolerance = 0;  ///< of the scaled residual, dimensionless
  double accuracy = 0;   ///< of the parts of a step, relative; 0: every step is one part
  double sleep = 0;      ///< share of its size that a body may move and still rest; 0: none sleeps
  std::uint64_t seed = 0;
};

}  // namespace tangere
