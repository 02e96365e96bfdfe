// SPDX-License-Identifier: Apache-2.0
// Steps are shown in milliseconds for people, in seconds for programs.
#include "apps/stress_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/scene_run.hpp"

namespace tangere::apps {
namespace {

int count(const StressReport& report, StressVerdict verdict) {
  return static_cast<int>(std::count_if(report.rows.begin(), report.rows.end(),
                                        [&](const StressRow& r) { return r.verdict == verdict; }));
}

std::string verdict_text(const StressRow& row) {
  std::string text = to_string(row.verdict);
  if (row.verdict == StressVerdict::flagged) text += ": " + row.reason;
  return text;
}

/// Whether it came to a step. A refused scene has neither scheme nor step.
bool played(const StressRow& row) { return row.counts.simulation_steps > 0; }

Json row_json(const StressRow& row) {
  Json json{{"case", row.of->name},
            {"scene", row.of->scene},
            {"scheme", played(row) ? Json(to_string(row.integrator)) : Json()},
            {"step", played(row) ? Json(row.step) : Json()},
            {"criterion", row.of->criterion},
            {"bound", row.of->bound},
            {"value", finite(row.value)},
            {"evaluations_per_step", row.evaluations},
            {"most_evaluations", row.most_evaluations},
            {"environment_steps", row.counts.simulation_steps}};
  json.update(split_json(row.counts));
  json.update({{"envs", row.environments},
               {"failed", row.failed},
               {"verdict", to_string(row.verdict)},
               {"reason", row.reason}});
  return json;
}

}  // namespace

std::string stress_head() {
  return fmt::format("{:<26} {:<7} {:>5}  {:<48} {:>9} {:>8} {:>7} {:>6} {:>10}  verdict", "case",
                     "scheme", "ms", "criterion", "measured", "at most", "passes", "splits",
                     "failed");
}

std::string stress_row(const StressRow& row) {
  return fmt::format("{:<26} {:<7} {:>5}  {:<48} {:>9} {:>8} {:>7} {:>6} {:>10}  {}", row.of->name,
                     played(row) ? to_string(row.integrator) : "-",
                     played(row) ? fmt::format("{:g}", 1e3 * row.step) : "-", row.of->criterion,
                     std::isnan(row.value) ? "-" : fmt::format("{:.3g}", row.value),
                     fmt::format("{:.4g}", row.of->bound), fmt::format("{:.2f}", row.evaluations),
                     row.counts.split_steps, fmt::format("{} of {}", row.failed, row.environments),
                     verdict_text(row));
}

int silent_failures(const StressReport& report) { return count(report, StressVerdict::fails); }

std::string stress_summary(const StressReport& report) {
  return fmt::format("Holds: {}. Flagged: {}. Fails: {}.", count(report, StressVerdict::holds),
                     count(report, StressVerdict::flagged), silent_failures(report));
}

Json stress_json(const StressReport& report) {
  Json rows = Json::array();
  for (const StressRow& row : report.rows) rows.push_back(row_json(row));
  return {{"stopped", report.stopped},
          {"holds", count(report, StressVerdict::holds)},
          {"flagged", count(report, StressVerdict::flagged)},
          {"fails", count(report, StressVerdict::fails)},
          {"rows", rows}};
}

}  // namespace tangere::apps
