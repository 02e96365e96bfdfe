// SPDX-License-Identifier: Apache-2.0
// --record, or <outputs> of the scene: what a run of a scene computes and stores, and when.
#pragma once

#include <string>
#include <vector>

#include "tasks/catalogue/task.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere::apps {

struct Record {
  std::vector<TimedName> requested;  ///< with times: "q/final", "bodies.box"; none: everything
  RolloutOutputs outputs;
  std::string where;  ///< "--record", or file, line and <outputs>; for messages

  [[nodiscard]] const TimedName* find(const std::string& name) const;
};

/// Returns the outputs of the option; if it is empty, those of the scene. Throws InputError for a
/// name that the scene does not have. Single bodies need take_bodies().
Record record_of(const std::string& option, const Model& model);

/// Returns what the option names of a task's observations and of the readings of its sensors; none:
/// all observations. Throws InputError for another name.
std::vector<TimedName> record_of_task(const std::string& option, const Task& task);

/// Adds the shear state: at the requested rows, else where a run can be continued from: at its last
/// row, or if rows of q are thinned at each of them.
void take_memory(Record& record, const Model& model);

/// Throws InputError if the shear state or forces of transmissions are requested. `who`: what does
/// not store them, "a data set".
void refuse_trajectory_outputs(const Record& record, const std::string& who);

/// Joins the requested bodies to one output. Throws InputError if their times differ.
void take_bodies(Record& record, const Model& model);

}  // namespace tangere::apps
