// SPDX-License-Identifier: Apache-2.0
// --record, or <outputs> of the scene: what a run of a scene computes and stores, and when.
#pragma once

#include <string>
#include <vector>

#include "tasks/run/rollout.hpp"

namespace tangere::apps {

struct Record {
  std::vector<TimedName> asked;  ///< with times: "q/final", "bodies.box"; none: everything
  RolloutOutputs outputs;
  std::string where;  ///< "--record", or file, line and <outputs>; for messages

  [[nodiscard]] const TimedName* find(const std::string& name) const;
};

/// Returns what the option asks for; if it is empty, what the scene asks for. Throws InputError for
/// a name that the scene does not have. Single bodies are left to the caller, see take_bodies().
Record record_of(const std::string& option, const Model& model);

/// Takes what friction remembers: at the rows that are asked for, else where a run can be continued
/// from: at its last row, or where rows of q are thinned at each of them.
void take_memory(Record& record, const Model& model);

/// Throws InputError where memory is asked for. `who`: what does not store it, "a data set".
void refuse_memory(const Record& record, const std::string& who);

/// Makes the bodies that are asked for one output. Throws InputError where their times differ.
void take_bodies(Record& record, const Model& model);

}  // namespace tangere::apps
