// SPDX-License-Identifier: Apache-2.0
// tangere identify: finds numbers of a scene from recorded tactile fields. Without a recording it
// tries how well they can be found: it simulates one, adds noise and starts from wrong numbers.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/identify_report.hpp"
#include "apps/memory.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/text_output.hpp"
#include "engine/base/error.hpp"
#include "engine/model/random.hpp"
#include "io/trajectory/trajectory_reader.hpp"

namespace tangere::apps {
namespace {

constexpr double kNoise = 0.01;  // of the fields' peak

struct IdentifyArguments {
  std::string scene, recording, controls, svg;
  std::vector<std::string> numbers;
  std::optional<std::int64_t> environment, steps;
  std::optional<double> noise;
  std::optional<std::uint64_t> seed;
  std::optional<int> starts;
  bool overwrite = false, allow_unknown = false;
};

void check_arguments(const IdentifyArguments& a) {
  if (a.numbers.empty())
    throw InputError("--number is missing; expected the name of a number, as often as wanted");
  for (const std::string& number : a.numbers)
    if (std::ranges::count(a.numbers, number) > 1)
      throw InputError(
          fmt::format("--number '{}' is given twice; expected each number once", number));
  const bool trial = a.recording.empty();
  if (!trial && (a.seed || a.steps))
    throw InputError("--seed or --steps with a recording; expected them without one");
  if (trial && a.environment) throw InputError("--env without a recording");
}

/// The interval of all sensors. A fit takes the fields of all of them after the same steps.
int interval_of(const Model& model) {
  if (model.sensors().empty())
    throw InputError(model.scene().path + ": no tactile sensor; expected one that was recorded");
  const SensorInfo& first = model.sensors()[0];
  for (const SensorInfo& s : model.sensors())
    if (s.every != first.every)
      throw InputError(
          fmt::format("{}: sensor '{}' is read every {} steps and '{}' every {}; expected one "
                      "interval for all",
                      model.scene().path, first.name, first.every, s.name, s.every));
  return std::max(1, first.every);
}

/// Checks that sensor s of the file is that of the scene, read after steps every, 2 every, …
void check_sensor(const TrajectoryReader& file, std::size_t s, const SensorInfo& expected,
                  int every) {
  const SensorLayout& found = file.sensors()[s];
  const std::string where = fmt::format("{}: sensor '{}'", file.path(), found.name);
  if (found.points != expected.points)
    throw InputError(fmt::format("{} has {} points; expected {}, as in the scene", where,
                                 found.points, expected.points));
  if (!file.has_field(s)) throw InputError(where + " has pressure or shear; expected whole fields");
  if (found.every != every)
    throw InputError(fmt::format("{} was read every {} steps; expected every {}, as in the scene",
                                 where, found.every, every));
  const std::int64_t frames = file.frames(s);
  if (frames == 0) throw InputError(where + " has no field");
  if (file.step(s, 0) != every || file.step(s, frames - 1) != frames * every)
    throw InputError(fmt::format("{} has {} fields of steps {} to {}; expected all of them", where,
                                 frames, file.step(s, 0), file.step(s, frames - 1)));
}

/// Reads the fields of all sensors of the scene.
FieldSequence read_recording(const IdentifyArguments& a, const Model& model, double timestep) {
  const TrajectoryReader file(a.recording);
  const std::int64_t environment = a.environment.value_or(0);
  if (environment >= file.environments())
    throw InputError(fmt::format("--env {}: {} has environments 0 to {}", environment, a.recording,
                                 file.environments() - 1));
  if (file.first_step() != 0)
    throw InputError(
        fmt::format("{} continues a run after {} steps; expected a recording that "
                    "begins where the scene does",
                    a.recording, file.first_step()));
  if (std::abs(file.timestep() - timestep) > 1e-9 * timestep)
    throw InputError(fmt::format("{} has steps of {:g} s; expected {:g} s, as in the scene",
                                 a.recording, file.timestep(), timestep));
  if (!model.scene().randomizations.empty())
    throw InputError(model.scene().path +
                     ": <randomize> with a recording; expected a scene whose numbers do not vary");
  FieldSequence out{interval_of(model), {}};
  for (const SensorInfo& sensor : model.sensors()) {
    const std::size_t s = file.find_sensor(sensor.name);
    check_sensor(file, s, sensor, static_cast<int>(out.every));
    const auto frames = static_cast<std::size_t>(file.frames(s));
    if (out.readings.empty()) out.readings.resize(frames);
    for (std::size_t k = 0; k < std::min(frames, out.readings.size()); ++k) {
      const std::vector<double> field = file.force(s, static_cast<std::int64_t>(k), environment);
      out.readings[k].insert(out.readings[k].end(), field.begin(), field.end());
    }
    out.readings.resize(std::min(frames, out.readings.size()));
  }
  return out;
}

double peak_of(const FieldSequence& sequence) {
  double peak = 0;
  for (const auto& reading : sequence.readings)
    for (const double f : reading) peak = std::max(peak, std::abs(f));
  return peak;
}

/// Multiplies the true values by random factors of ½ to 2.
std::vector<double> wrong_start(const std::vector<double>& truth, std::uint64_t seed) {
  std::vector<double> out;
  for (std::uint32_t k = 0; k < truth.size(); ++k)
    out.push_back(truth[k] * log_uniform({seed, 0, 0, Purpose::tactile, k}, 0.5, 2));
  return out;
}

int identify_numbers(const IdentifyArguments& a, const Console& console) {
  check_arguments(a);
  const Scene scene = read_scene_for(a.scene, a.allow_unknown, console);
  const Model model(scene);
  const ControlProgram controls = make_controls(a.controls, 0, model, Stepper(model), console);
  RecordedRun run{[&](std::int64_t t, int e, std::span<double> u) { controls.evaluate(t, e, u); },
                  0, interval_of(model)};
  IdentificationOptions options;
  options.numbers = a.numbers;
  options.starts = a.starts.value_or(options.starts);
  IdentifyReport report{scene, a.numbers, {}, {}, 0, {}};
  Scene start = scene;
  if (a.recording.empty()) {
    const std::uint64_t seed = a.seed.value_or(1);
    run.steps = step_count(a.steps, controls);
    check_memory(identification_bytes(model, run, a.numbers.size()),
                 fmt::format("a fit of {} steps", run.steps));
    report.truth = numbers_of(scene, a.numbers);
    start = with_numbers(scene, a.numbers, wrong_start(report.truth, seed));
    report.recorded = simulate_fields(scene, run);
    add_noise(report.recorded, a.noise.value_or(kNoise) * peak_of(report.recorded), seed);
  } else {
    report.recorded = read_recording(a, model, model.timestep());
    run.steps = run.every * std::ssize(report.recorded.readings);
    controls.check_covers(run.steps);
  }
  report.peak = peak_of(report.recorded);
  options.noise = a.noise.value_or(a.recording.empty() ? kNoise : 0) * report.peak;
  TextOutput picture(a.svg, a.overwrite);
  report.fit = identify(start, run, report.recorded, options);
  console.print(
      fmt::format("{}: {} readings, one every {} steps of {:g} s, largest number {:.3g} N",
                  a.recording.empty() ? "simulated" : a.recording, report.recorded.readings.size(),
                  run.every, model.timestep(), report.peak));
  print(console, report);
  if (picture.requested()) {
    const Scene found = with_numbers(scene, a.numbers, report.fit.values());
    picture.write(draw(report, simulate_fields(found, run), model.timestep()), console);
  }
  return exit_code(report);
}

}  // namespace

Command add_identify(CLI::App& program) {
  const auto arguments = std::make_shared<IdentifyArguments>();
  const auto console = std::make_shared<Console>();
  IdentifyArguments& a = *arguments;
  CLI::App& app = add_command(
      program, "identify", "Find numbers of a scene from recorded tactile fields",
      "tangere identify scenes/identify_ball.xml --number 'tactile pad kn' --svg fit.svg");
  add_text(app, "SCENE", a.scene, "",
           "Scene file (XML) with the numbers where you would guess them")
      .required();
  add_text(app, "RECORDING", a.recording, "",
           "HDF5 file laid out like those of 'tangere simulate'; without one, a trial: recordings "
           "are simulated, and numbers start wrong by factors of up to 2");
  add_texts(
      app, "--number", a.numbers, "NAME",
      "Sought number, such as \"tactile pad kn\" or \"body ball density\"; it has to be positive");
  add_whole_number<std::int64_t>(app, "--env", a.environment, 0, kMostEnvironments,
                                 "Environment of the recording, counted from 0 [default: 0]");
  add_text(app, "--controls", a.controls, "U.csv",
           "Controls of the recorded run, one row per step [default: the scene's <control>]");
  add_steps_option(app, a.steps, "Steps of a trial [default: as many as the controls last]");
  add_positive_number(app, "--noise", a.noise,
                      "Standard deviation of the noise over the fields' largest number, which a "
                      "trial adds [default: 0.01 for a trial; for a recording, not known]");
  add_whole_number<int>(app, "--starts", a.starts, 1, 1000,
                        "Most starts, tried while a fit is not sure [default: 6]");
  add_whole_number<std::uint64_t>(app, "--seed", a.seed, 0, 1000000,
                                  "Of a trial: seed of the noise and of the start [default: 1]");
  add_text(app, "--svg", a.svg, "F.svg", "Write a picture of the fit");
  add_overwrite_option(app, a.overwrite, "Replace the picture if it exists");
  add_allow_unknown_option(app, a.allow_unknown);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return identify_numbers(*arguments, *console); },
          [arguments] { return !arguments->recording.empty(); }};
}

}  // namespace tangere::apps
