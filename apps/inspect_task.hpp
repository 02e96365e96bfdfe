// SPDX-License-Identifier: Apache-2.0
// Reports a task for `tangere inspect`.
#pragma once

#include <string>

#include "apps/console.hpp"
#include "engine/rows/task_spec.hpp"

namespace tangere::apps {

/// What a task declares. A missing bound is null.
Json task_json(const TaskSpec& spec);
std::string task_text(const TaskSpec& spec);

}  // namespace tangere::apps
