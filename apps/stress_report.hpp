// SPDX-License-Identifier: Apache-2.0
// Reports what `tangere stress` found: rows for people, a summary in words, an object for programs.
#pragma once

#include <string>

#include "apps/console.hpp"
#include "tasks/stress/stress_run.hpp"

namespace tangere::apps {

std::string stress_head();
std::string stress_row(const StressRow& row);
/// Counts of the verdicts.
std::string stress_summary(const StressReport& report);
/// Rows that fail without a word of the engine.
int silent_failures(const StressReport& report);
Json stress_json(const StressReport& report);

}  // namespace tangere::apps
