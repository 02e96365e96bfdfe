// SPDX-License-Identifier: Apache-2.0
// A block of environments is run to its end and evaluated before its histories are released, so
// memory does not grow with the number of environments.
#include "tasks/stress/stress_run.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>

#include "engine/base/as_size.hpp"
#include "engine/model/short_touches.hpp"
#include "engine/scene/contact_resolution.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/block_threads.hpp"
#include "tasks/run/costly_steps.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {
namespace {

constexpr int kQuickEnvironments = 2;  // at most, of a quick run
constexpr double kMostHistory = 2e9;   // bytes of what a block's environments did
constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

struct Setting {
  Integrator integrator;
  double step;      ///< [s]
  double accuracy;  ///< of its parts; 0: steps are not cut
};

/// What one block came to.
struct BlockOutcome {
  double worst = -HUGE_VAL;  ///< of the environments that did not fail; NaN where one has no number
  StepCounts counts{};
  int most_evaluations = 0;
  bool silent = false;  ///< an environment misses the bound and none of its steps has a flag
  std::vector<FailedEnvironment> failures{};
};

/// Scratch of one thread.
struct Worker {
  Stepper stepper;
  Readout readout;
};

/// A case's scene with one setting, ready to be played.
struct Play {
  const Criterion& measure;
  double bound;
  Setting setting;
  Batch batch;
  ControlProgram controls;
  std::int64_t steps;
  std::stop_token stop;
  std::atomic<bool> stopped{false};

  [[nodiscard]] const Model& model() const { return batch.model(); }

  void block(Worker& w, int b, std::span<double> u, BlockOutcome& out) {
    const int first = b * kernels::kBlock, lanes = lanes_of(batch, b);
    StepTally tally(batch, first, lanes);
    std::vector<StressHistory> histories;
    if (measure) histories.assign(as_size(lanes), StressHistory(model(), setting.step));
    const auto record = [&] {
      for (std::size_t l = 0; l < histories.size(); ++l)
        if (const int e = first + static_cast<int>(l); tally.live(e))
          histories[l].add(w.readout, batch, e);
    };
    record();
    // Environments with a step whose status indicates a possible error.
    std::vector<bool> flagged(as_size(lanes));
    for (std::int64_t k = 0; k < steps; ++k) {
      if (stop.stop_requested()) {
        stopped = true;
        return;
      }
      write_controls(controls, k, batch, b, u);
      w.stepper.step_block(batch, b, u);
      for (int e = first; e < first + lanes; ++e) {
        if (!tally.live(e)) continue;
        out.most_evaluations = std::max(out.most_evaluations, batch.iterations(e));
        const StepStatus status = batch.status(e);
        if (status != StepStatus::converged && status != StepStatus::split && !failed(status))
          flagged[as_size(e - first)] = true;
      }
      tally.count(batch, k);
      record();
    }
    for (std::size_t l = 0; l < histories.size(); ++l)
      if (tally.live(first + static_cast<int>(l))) add_outcome(histories[l], flagged[l], out);
    out.counts = tally.counts;
    out.failures = std::move(tally.failures);
  }

  void add_outcome(const StressHistory& history, bool flagged, BlockOutcome& out) const {
    const double value = measure(history);
    if (!(value <= out.worst)) out.worst = std::isnan(out.worst) ? out.worst : value;
    if (!(value <= bound) && !flagged) out.silent = true;
  }
};

/// Plays a scene and adds up its blocks. None when it was stopped.
std::optional<BlockOutcome> play(const Scene& scene, const StressCase& of, int environments,
                                 const Setting& setting, int threads, const std::stop_token& stop) {
  const Model model(scene);
  const ControlProgram controls(model, setting.step, 0);
  const std::int64_t steps =
      of.seconds > 0 ? std::llround(of.seconds / setting.step) : controls.steps();
  const double bytes = static_cast<double>(steps) * model.nb() * 13 * sizeof(double) *
                       std::min(environments, kernels::kBlock);
  if (of.measure && bytes > kMostHistory)
    throw InputError("case '" + of.name + "' takes " + std::to_string(steps) +
                     " steps, whose history does not fit; expected a longer timestep");
  Play run{of.measure, of.bound,
           setting,    Batch(model, environments),
           controls,   std::max<std::int64_t>(steps, 1),
           stop};
  const int used = std::min(threads, run.batch.blocks());
  BlockThreads block_threads(used);
  std::vector<Worker> workers;
  workers.reserve(as_size(used));
  for (int i = 0; i < used; ++i)
    workers.push_back(
        {Stepper(model, {setting.integrator, setting.step, std::nullopt, setting.accuracy}),
         Readout(model)});
  std::vector<double> u(as_size(environments) * as_size(model.nu()));
  std::vector<BlockOutcome> blocks(as_size(run.batch.blocks()));
  block_threads.for_each(run.batch.blocks(), workers,
                         [&](Worker& w, int b) { run.block(w, b, u, blocks[as_size(b)]); });
  if (run.stopped) return std::nullopt;
  BlockOutcome sum;
  for (const BlockOutcome& b : blocks) {
    if (!(b.worst <= sum.worst)) sum.worst = std::isnan(sum.worst) ? sum.worst : b.worst;
    sum.counts += b.counts;
    sum.silent = sum.silent || b.silent;
    sum.most_evaluations = std::max(sum.most_evaluations, b.most_evaluations);
    sum.failures.insert(sum.failures.end(), b.failures.begin(), b.failures.end());
  }
  if (sum.worst == -HUGE_VAL) sum.worst = kNotANumber;
  return sum;
}

double passes(const BlockOutcome& out) {
  return static_cast<double>(out.counts.newton_iterations) /
         static_cast<double>(out.counts.simulation_steps);
}

void set_verdict(const BlockOutcome& out, StressRow& row) {
  row.evaluations = passes(out);
  row.most_evaluations = out.most_evaluations;
  row.counts = out.counts;
  row.failed = static_cast<int>(out.failures.size());
  const bool nobody_left = row.of->measure && row.failed == row.environments;
  const bool met = nobody_left || row.value <= row.of->bound;  // false for NaN
  const bool few = row.failed <= row.of->may_fail * row.environments;
  // Passes are not a matter of right and wrong, so failed environments say more.
  const bool silent = row.of->measure ? out.silent || std::isnan(row.value) : few;
  if (met) {
    row.verdict = few ? StressVerdict::holds : StressVerdict::flagged;
  } else {
    row.verdict = silent ? StressVerdict::fails : StressVerdict::flagged;
  }
  if (row.verdict != StressVerdict::flagged) return;
  if (row.failed > 0)
    row.reason = to_string(out.failures.front().status);
  else if (row.counts.tunnelled_steps > 0)
    row.reason = to_string(StepStatus::tunnelled);
  else if (row.counts.overlapping_steps > 0)
    row.reason = to_string(StepStatus::overlapping);
  else if (row.counts.accuracy_not_met_steps > 0)
    row.reason = to_string(StepStatus::accuracy_not_met);
  else if (row.counts.damped_steps > 0)
    row.reason = to_string(StepStatus::damped);
}

/// Warnings of a run with the same steps; "" if there are none.
std::string warning_of(const Scene& scene, const StressRow& row) {
  if (row.accuracy > 0) return "";
  if (!row.of->measure) return costly_steps(row.integrator, row.counts);
  for (const auto& lines : {short_touches(Model(scene), row.integrator, row.step),
                            coarse_contact_lines(scene), polygonal_rolling_lines(scene)})
    if (!lines.empty()) return lines.front();
  return "";
}

/// Fills in the result of a setting. False if it was stopped.
bool measure(const Scene& scene, int threads, const std::stop_token& stop, StressRow& row) {
  const Setting setting{row.integrator, row.step, row.accuracy};
  const auto out =
      play(varied(scene, row.of->variant), *row.of, row.environments, setting, threads, stop);
  if (!out) return false;
  row.value = out->worst;
  if (!row.of->measure) {
    const auto ordinary = play(scene, *row.of, row.environments, setting, threads, stop);
    if (!ordinary) return false;
    row.value = passes(*out) / passes(*ordinary);
  }
  set_verdict(*out, row);
  if (row.verdict == StressVerdict::fails)
    if (const std::string warning = warning_of(varied(scene, row.of->variant), row);
        !warning.empty()) {
      row.verdict = StressVerdict::flagged;
      row.reason = "warning: " + warning;
    }
  return true;
}

std::vector<Setting> settings_of(const StressCase& of, const StressOptions& options,
                                 const Scene& scene) {
  std::vector<double> steps = of.steps.empty() ? std::vector{scene.timestep} : of.steps;
  if (options.quick) steps.resize(1);
  if (options.step) steps = {*options.step};
  std::vector<Integrator> schemes = of.schemes.empty() ? std::vector{scene.integrator} : of.schemes;
  if (options.integrator) schemes = {*options.integrator};
  if (options.accuracy && !options.integrator) {
    std::erase_if(schemes, [](Integrator i) { return i.scheme().estimate.empty(); });
    if (schemes.empty() && !options.name.empty())
      throw InputError("case '" + of.name +
                       "' is played with BDF2, which cannot keep an accuracy; "
                       "expected --integrator as well");
  }
  std::vector<Setting> settings;
  for (const Integrator scheme : schemes) {
    for (const double step : steps)
      settings.push_back({scheme, step, options.accuracy.value_or(0)});
  }
  return settings;
}

StressRow refused(const StressCase& of, const char* reason) {
  StressRow row;
  row.of = &of;
  row.value = kNotANumber;
  row.environments = row.failed = of.environments;
  row.verdict = StressVerdict::flagged;
  row.reason = std::string("refused: ") + reason;
  return row;
}

/// Plays all settings of a case. False when it was stopped.
bool run_case(const StressCase& of, const StressOptions& options, const StressScenes& scenes,
              const StressListener& listener, std::vector<StressRow>& rows) {
  const auto add = [&](StressRow row) {
    rows.push_back(std::move(row));
    if (listener.row) listener.row(rows.back());
  };
  Scene scene;
  std::vector<std::string> warnings;
  try {
    StressScene read = scenes(of.scene);
    scene = std::move(read.scene);
    warnings = std::move(read.warnings);
    const Model compiled(varied(scene, of.variant));  // which may refuse it, too
  } catch (const InputError& error) {
    add(refused(of, error.what()));
    return true;
  }
  for (const Setting& setting : settings_of(of, options, scene)) {
    StressRow row;
    row.of = &of;
    row.integrator = setting.integrator;
    row.step = setting.step;
    row.accuracy = setting.accuracy;
    row.environments =
        options.quick ? std::min(of.environments, kQuickEnvironments) : of.environments;
    if (!measure(scene, options.threads, listener.stop, row)) return false;
    if (row.verdict == StressVerdict::fails && !warnings.empty()) {
      row.verdict = StressVerdict::flagged;
      row.reason = "warning: " + warnings.front();
    }
    add(std::move(row));
  }
  return true;
}

}  // namespace

const char* to_string(StressVerdict value) {
  switch (value) {
    case StressVerdict::holds: return "holds";
    case StressVerdict::flagged: return "flagged";
    case StressVerdict::fails: return "fails";
  }
  return "";
}

std::vector<std::string> stress_names(std::span<const StressCase> cases) {
  std::vector<std::string> names;
  for (const StressCase& c : cases) names.push_back(c.name);
  return names;
}

StressReport run_stress(std::span<const StressCase> cases, const StressOptions& options,
                        const StressScenes& scenes, const StressListener& listener) {
  StressReport report;
  bool found = false;
  for (const StressCase& of : cases) {
    const bool chosen = options.name.empty() ? of.quick || !options.quick : of.name == options.name;
    if (!chosen) continue;
    found = true;
    if (run_case(of, options, scenes, listener, report.rows)) continue;
    report.stopped = true;
    break;
  }
  if (!found) throw InputError("no hard case is called '" + options.name + "'");
  return report;
}

}  // namespace tangere
