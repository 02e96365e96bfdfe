// SPDX-License-Identifier: Apache-2.0
// --record, or <outputs> of the scene: what a run of a scene computes and stores.
#pragma once

#include <string>
#include <vector>

#include "tasks/run/rollout.hpp"

namespace tangere::apps {

struct Record {
  std::vector<std::string> names;  ///< as asked for; none: everything
  RolloutOutputs outputs;
};

/// Returns what the option asks for; if it is empty, what the scene asks for. Throws InputError for
/// a name that the scene does not have.
Record record_of(const std::string& option, const Model& model);

}  // namespace tangere::apps
