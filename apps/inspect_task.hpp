// SPDX-License-Identifier: Apache-2.0
// What `tangere inspect` says about a task.
#pragma once

#include <string>

#include "apps/console.hpp"
#include "engine/rows/task_spec.hpp"

namespace tangere::apps {

/// What a task declares; a bound that is not there is null.
Json task_json(const TaskSpec& spec);
std::string task_text(const TaskSpec& spec);

}  // namespace tangere::apps
