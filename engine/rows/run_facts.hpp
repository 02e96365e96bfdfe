// SPDX-License-Identifier: Apache-2.0
// Metadata of a run that trajectory files and data sets share.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/rows/channel.hpp"
#include "engine/rows/task_spec.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {

/// Attribute `task` of files of a scene alone.
inline constexpr const char* kNoTask = "none: a scene alone, whose every reward is 0";

/// Metadata of a run that follow neither from the model nor from the stepper.
struct RunOrigin {
  std::string precision, version, instruction_set;
  std::string command;           ///< as it was given, or one that makes a data set again
  std::optional<TaskSpec> task;  ///< defines actions, observations and rewards; none: only a scene
};

struct RunFacts : RunOrigin {
  std::vector<std::string> q_names, q_units;                    ///< (nq)
  std::vector<std::string> v_names, v_units;                    ///< (nv)
  std::vector<std::string> u_names, u_units;                    ///< (nu)
  std::vector<std::string> end_effector_names;                  ///< (n), empty when there are none
  std::vector<std::string> randomized_names, randomized_units;  ///< (k), empty when nothing varies
  std::string scene_name, scene_path, scene_text;
  std::string integrator;
  double timestep = 0;   ///< [s]
  double tolerance = 0;  ///< of the scaled residual, dimensionless
  double accuracy = 0;   ///< of the parts of a step, relative; 0: every step is one part
  double sleep = 0;      ///< share of its size that a body may move and still rest; 0: none sleeps
  std::uint64_t seed = 0;
};

/// Metadata of a run by `stepper`, for all kinds of files, with the names of all end effectors.
RunFacts run_facts(const Model& model, const Stepper& stepper, const RunOrigin& origin,
                   std::uint64_t seed);

/// Facts of a run, or of episodes, of `steps` steps. `every`: steps of a row of a data set; of a
/// trajectory the requested interval of fields, 0: each sensor's own.
Attributes attributes_of(const RunFacts& facts, std::int64_t steps, std::int64_t every);

}  // namespace tangere
