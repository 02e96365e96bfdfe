// SPDX-License-Identifier: Apache-2.0
// What `tangere inspect` says about a task.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "engine/rows/task_spec.hpp"

namespace tangere::apps {

/// What a task declares; a bound that is not there is null.
nlohmann::ordered_json task_json(const TaskSpec& spec);
std::string task_text(const TaskSpec& spec);

}  // namespace tangere::apps
