// SPDX-License-Identifier: Apache-2.0
// Rows of episodes follow from their steps.
#include "tasks/run/episode_options.hpp"

#include <fmt/format.h>

#include "engine/base/error.hpp"

namespace tangere {

void check_at_least_one(const char* what, std::int64_t value) {
  if (value < 1) throw InputError(fmt::format("{} {}; expected at least 1", value, what));
}

std::int64_t action_rows(const EpisodeOptions& options) {
  check_at_least_one("steps", options.steps);
  check_at_least_one("steps per action", options.every);
  if (options.steps % options.every != 0)
    throw InputError(
        fmt::format("{} steps, and an action is held for {}; expected a multiple of {} steps",
                    options.steps, options.every, options.every));
  return options.steps / options.every;
}

}  // namespace tangere
