// SPDX-License-Identifier: Apache-2.0
// Computes all rates from counts and times.
#include "apps/bench_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/picture/line_plot.hpp"

namespace tangere::apps {
namespace {

double rate(std::int64_t count, double seconds) { return static_cast<double>(count) / seconds; }

double newton_per_step(const BenchmarkResult& result) {
  return rate(result.counts.newton_iterations, static_cast<double>(result.counts.simulation_steps));
}

/// Writes a checksum as text, because many JSON readers keep only 53 bits of a number.
std::string hexadecimal(std::uint64_t checksum) { return fmt::format("{:016x}", checksum); }

std::string frames_text(const BenchSetting& setting) {
  const FrameKind frames = setting.options.frames;
  if (frames == FrameKind::none) return "frames none";
  if (setting.record.empty()) return "no readings";
  if (setting.every == 0) return fmt::format("frames {} of {}", to_string(frames), setting.record);
  return fmt::format("frames {} of {} every {} step{}", to_string(frames), setting.record,
                     setting.every, setting.every == 1 ? "" : "s");
}

std::string csv_field(const Json& value) {
  if (value.is_null()) return "";
  if (value.is_array()) return std::to_string(value.size());
  if (!value.is_string()) return value.dump();
  std::string text = "\"";
  for (const char c : value.get<std::string>()) text += c == '"' ? "\"\"" : std::string(1, c);
  return text + '"';
}

}  // namespace

std::vector<Failure> failures_of(const BenchRun& run) {
  std::vector<Failure> failures;
  for (const FailedEnvironment& f : run.result.failures)
    failures.push_back({f.environment, f.step, f.status});
  return failures;
}

int common_interval(const Model& model, const RolloutOptions& rollout) {
  std::int64_t common = 0;
  for (const FieldOutput of : fields_of(model, rollout.outputs)) {
    const std::int64_t every = reading_times(model, of, rollout).every;
    if (every == 0) return 0;  // at the end alone
    if (common != 0 && common != every) return 0;
    common = every;
  }
  return static_cast<int>(common);
}

std::string bench_heading(const BenchSetting& setting) {
  return fmt::format(
      "{}: {} environments, {} steps, {}, {}, {}\n{}; best of {} timed\n\n"
      "{:>7} {:>14} {:>14} {:>9} {:>18} {:>18}\n{:>7} {:>14} {:>14} {:>9} {:>18} {:>18}",
      setting.model, setting.environments, setting.options.rollout.steps, frames_text(setting),
      to_string(setting.options.precision), setting.isa, setting.machine, setting.options.repeat,
      "threads", "env-steps/s", "median", "speed-up", "env-steps/CPU-s", "tactile points/s",
      "-------", "-----------", "------", "--------", "---------------", "----------------");
}

std::string bench_row(const BenchRun& run, const BenchRun& first) {
  const BenchmarkResult& r = run.result;
  const BenchmarkTime best = r.best();
  return fmt::format(
      "{:>7} {:>14.0f} {:>14.0f} {:>9.2f} {:>18.0f} {:>18.4g}", run.threads,
      rate(r.environment_steps, best.seconds), rate(r.environment_steps, r.median().seconds),
      first.result.best().seconds / best.seconds, rate(r.environment_steps, best.cpu_seconds),
      rate(r.tactile_points, best.seconds));
}

std::string bench_footing(const BenchSetting& setting, const BenchRun& run) {
  return "\n" + sleep_text(setting.sleep, setting.moving_bodies, run.result.counts) +
         fmt::format(
             "Newton iterations per simulation step: {:.2f}, environments failed: {}, checksum: {}",
             newton_per_step(run.result), run.result.failures.size(),
             hexadecimal(run.result.checksum()));
}

Json bench_entry(const BenchSetting& setting, const BenchRun& run) {
  const BenchmarkResult& r = run.result;
  const BenchmarkTime best = r.best(), median = r.median();
  return {{"threads", run.threads},
          {"envs", setting.environments},
          {"steps", setting.options.rollout.steps},
          {"every", setting.every},
          {"frames", to_string(setting.options.frames)},
          {"record", setting.record},
          {"precision", to_string(setting.options.precision)},
          {"isa", setting.isa},
          {"repeat", setting.options.repeat},
          {"pinned", setting.options.pinned},
          {"seconds", best.seconds},
          {"cpu_seconds", best.cpu_seconds},
          {"env_steps_per_second", rate(r.environment_steps, best.seconds)},
          {"env_steps_per_cpu_second", rate(r.environment_steps, best.cpu_seconds)},
          {"tactile_points_per_second", rate(r.tactile_points, best.seconds)},
          {"median_seconds", median.seconds},
          {"median_cpu_seconds", median.cpu_seconds},
          {"median_env_steps_per_second", rate(r.environment_steps, median.seconds)},
          {"median_env_steps_per_cpu_second", rate(r.environment_steps, median.cpu_seconds)},
          {"median_tactile_points_per_second", rate(r.tactile_points, median.seconds)},
          {"newton_iterations", newton_per_step(r)},
          {"mean_asleep", mean_asleep(setting.sleep, r.counts)},
          {"failed", failures_json("environment", failures_of(run))},
          {"checksum", hexadecimal(r.checksum())}};
}

std::string bench_csv(const BenchSetting& setting, const Json& entries) {
  std::string text = "scene,machine";
  for (const auto& [key, value] : entries.at(0).items()) text += "," + key;
  for (const Json& entry : entries) {
    text += "\n" + csv_field(setting.scene) + "," + csv_field(setting.machine);
    for (const auto& [key, value] : entry.items()) text += "," + csv_field(value);
  }
  return text + "\n";
}

std::string bench_svg(const BenchSetting& setting, const std::vector<BenchRun>& runs) {
  PlotCurve curve{"", {}, PlotMark::dot};
  for (const BenchRun& run : runs) {
    const BenchmarkResult& r = run.result;
    curve.points.push_back({static_cast<double>(run.threads),
                            rate(r.environment_steps, r.best().seconds), "", false,
                            rate(r.environment_steps, r.median().seconds)});
  }
  std::ranges::sort(curve.points, {}, &PlotPoint::x);
  const PlotPoint first = curve.points.front(), last = curve.points.back();
  PlotCurve ideal{"", {{0, 0}, {last.x, first.y / first.x * last.x}}};
  ideal.dashed = true;
  PlotPanel panel{"", {"threads"}, {"environment steps per second [1/s]"}, {ideal, curve}};
  panel.height = 320;
  panel.x.from_zero = panel.x.whole = panel.y.from_zero = true;
  return render_line_plot_svg(
      {setting.model + ": speed by threads",
       {fmt::format("{}; {}, {}", setting.machine, setting.isa,
                    to_string(setting.options.precision)),
        fmt::format("scene {}, {} environments, {} steps",
                    std::filesystem::path(setting.scene).filename().string(), setting.environments,
                    setting.options.rollout.steps),
        fmt::format("{}; {} pass{}", frames_text(setting), setting.options.repeat,
                    setting.options.repeat == 1 ? "" : "es")},
       {std::move(panel)},
       "dots: best pass; bars: down to the median; dashed: ideal, in proportion to threads"});
}

}  // namespace tangere::apps
