// SPDX-License-Identifier: Apache-2.0
// The same words for the same thing, whichever subcommand met it.
#include "apps/run_report.hpp"

#include <fmt/format.h>

#include <csignal>

#include "engine/error.hpp"

namespace tangere::apps {
namespace {

constexpr std::size_t kMostFailuresListed = 20;

}  // namespace

std::int64_t step_count(std::optional<std::int64_t> asked, const ControlProgram& controls) {
  const std::int64_t steps = asked.value_or(controls.steps());
  if (steps < 0)
    throw InputError("the controls have no end, so the number of steps is not known; give --steps");
  controls.check_covers(steps);
  return steps;
}

void note_empty_sensors(const Console& console, const Model& model, const RolloutOptions& rollout) {
  for (const SensorInfo& sensor : model.sensors()) {
    const int every = tactile_interval(sensor, rollout);
    if (every > rollout.steps)
      console.note(fmt::format("sensor {} is read every {} steps: no field in {} steps",
                               sensor.name, every, rollout.steps));
  }
}

int report_stop(const Console& console, const std::string& command, int signal,
                const std::string& when) {
  const char* name = signal == SIGINT ? "SIGINT" : "SIGTERM";
  const ExitCode code = signal == SIGINT ? kInterrupted : kTerminated;
  const std::string text = fmt::format("stopped by {} {}; nothing was written", name, when);
  console.fail("tangere: " + text);
  console.result({{"command", command}, {"exit_code", static_cast<int>(code)}, {"error", text}});
  return code;
}

Json failures_of(const std::vector<FailedEnvironment>& failures) {
  Json list = Json::array();
  for (const FailedEnvironment& f : failures)
    list.push_back({{"environment", f.environment},
                    {"step", f.step},
                    {"status", static_cast<int>(f.status)},
                    {"reason", to_string(f.status)}});
  return list;
}

void list_failures(const Console& console, const std::vector<FailedEnvironment>& failures,
                   const std::string& where) {
  for (std::size_t i = 0; i < failures.size() && i < kMostFailuresListed; ++i)
    console.fail(fmt::format("environment {} failed in step {}: {}", failures[i].environment,
                             failures[i].step, to_string(failures[i].status)));
  if (failures.size() > kMostFailuresListed)
    console.fail(fmt::format("failed too, not listed: {}; {}",
                             failures.size() - kMostFailuresListed, where));
}

}  // namespace tangere::apps
