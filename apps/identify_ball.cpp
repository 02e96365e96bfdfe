// SPDX-License-Identifier: Apache-2.0
// An example: finds the stiffness, damping and friction of a tactile skin and the mass of a ball
// from one noisy recording.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "engine/base/error.hpp"
#include "engine/model/random.hpp"
#include "engine/step/control.hpp"
#include "io/files/part_file.hpp"
#include "io/picture/series_plot.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/gradients/identification.hpp"

namespace tangere::apps {
namespace {

/// The density of a sphere stands for its mass.
const std::vector<std::string> kSought = {"tactile pad kn", "tactile pad kt", "tactile pad mu",
                                          "body ball density"};
constexpr std::array<const char*, 4> kShort = {"kn", "kt", "mu", "mass"};
constexpr std::array<const char*, 4> kUnits = {"N/m", "N s/m", "1", "g"};

struct Options {
  std::string scene = "scenes/identify_ball.xml", svg;
  std::optional<double> noise;
  std::optional<std::uint64_t> seed;
  bool overwrite = false;
};

/// Values of the sought numbers as printed; the last one is a mass [g].
std::vector<double> shown(const Scene& scene, std::vector<double> values) {
  for (const LinkDescription& link : scene.links)
    if (const auto* ball = std::get_if<SphereShape>(&link.body.shape);
        ball != nullptr && link.body.name == "ball")
      values[3] *= 1e3 * 4.0 / 3.0 * std::numbers::pi * std::pow(ball->radius, 3);
  return values;
}

double peak_of(const FieldSequence& sequence) {
  double peak = 0;
  for (const auto& reading : sequence.readings)
    for (double f : reading) peak = std::max(peak, std::abs(f));
  return peak;
}

/// Multiplies the true values by random factors of ½ to 2.
std::vector<double> wrong_start(const std::vector<double>& truth, std::uint64_t seed) {
  std::vector<double> out;
  for (std::uint32_t k = 0; k < truth.size(); ++k)
    out.push_back(truth[k] * log_uniform({seed, 0, 0, Purpose::tactile, k}, 0.5, 2));
  return out;
}

void print_fit(const Scene& scene, const std::vector<double>& truth, const Identification& fit) {
  fmt::print("{:>4} {:>12} {:>10}   {:>9} {:>9} {:>9} {:>9}\n", "", "misfit [N^2]", "|gradient|",
             "kn [N/m]", "kt [N s/m]", "mu", "mass [g]");
  for (std::size_t k = 0; k < fit.points.size(); ++k) {
    const std::vector<double> v = shown(scene, fit.points[k].values);
    fmt::print("{:>4} {:>12.5e} {:>10.2e}   {:>9.5f} {:>9.5f}  {:>9.5f} {:>9.5f}\n", k,
               fit.points[k].misfit, fit.points[k].gradient, v[0], v[1], v[2], v[3]);
  }
  fmt::print("\n{:>5} {:>10} {:>10} {:>10} {:>12} {:>14}\n", "", "true", "found", "unit",
             "error [%]", "deviation [%]");
  const std::vector<double> t = shown(scene, truth), found = shown(scene, fit.values());
  for (std::size_t k = 0; k < t.size(); ++k)
    fmt::print("{:>5} {:>10.5f} {:>10.5f} {:>10} {:>12.3f} {:>14.3f}\n", kShort[k], t[k], found[k],
               kUnits[k], 100 * (found[k] / t[k] - 1), 100 * fit.deviation[k]);
  fmt::print(
      "\n{}; noise of a number: {:.3e} N; condition of the Fisher information (of logarithms): "
      "{:.1f}\n",
      fit.converged ? "converged" : "NOT converged", fit.noise, fit.condition);
  fmt::print("adjoint gradient against central differences at the start: {:.1e} of its norm\n",
             fit.gradient_difference);
}

CurvePanel misfit_panel(const Identification& fit) {
  CurvePanel panel{"The fit",
                   "iteration",
                   "over its first value",
                   true,
                   {{"misfit", {}, {}, false, 0}, {"|gradient|", {}, {}, false, 1}}};
  for (std::size_t k = 0; k < fit.points.size(); ++k) {
    for (Curve& c : panel.curves) c.x.push_back(static_cast<double>(k));
    panel.curves[0].y.push_back(fit.points[k].misfit / fit.points[0].misfit);
    panel.curves[1].y.push_back(fit.points[k].gradient / fit.points[0].gradient);
  }
  return panel;
}

CurvePanel values_panel(const std::vector<double>& truth, const Identification& fit) {
  CurvePanel panel{"Numbers over their true values", "iteration", "value / truth", false, {}};
  for (std::size_t n = 0; n < truth.size(); ++n) {
    Curve c{kShort[n], {}, {}, false, static_cast<int>(n)};
    for (std::size_t k = 0; k < fit.points.size(); ++k)
      c.x.push_back(static_cast<double>(k)), c.y.push_back(fit.points[k].values[n] / truth[n]);
    panel.curves.push_back(std::move(c));
  }
  return panel;
}

/// Forces of the whole pad over time, recorded and fitted.
CurvePanel forces_panel(const FieldSequence& recorded, const FieldSequence& fitted,
                        double timestep) {
  CurvePanel panel{
      "Force on the whole pad: recorded (dots) and fitted", "time [s]", "force [N]", false, {}};
  const std::array<const char*, 3> names = {"shear along axis0", "shear along axis1", "pressure"};
  for (const FieldSequence* s : {&recorded, &fitted})
    for (std::size_t c = 0; c < 3; ++c) {
      Curve curve{s == &recorded ? "" : names[c], {}, {}, s == &recorded, static_cast<int>(c)};
      for (std::size_t k = 0; k < s->readings.size(); ++k) {
        double sum = 0;
        for (std::size_t i = c; i < s->readings[k].size(); i += 3) sum += s->readings[k][i];
        curve.x.push_back(timestep * static_cast<double>(s->every) * static_cast<double>(k + 1));
        curve.y.push_back(sum);
      }
      panel.curves.push_back(std::move(curve));
    }
  return panel;
}

int identify_ball(const Options& o) {
  const double share = o.noise.value_or(0.01);
  const std::uint64_t seed = o.seed.value_or(1);
  const SceneFile file = read_scene(o.scene);
  for (const std::string& warning : file.warnings) fmt::print(stderr, "warning: {}\n", warning);
  const Scene& scene = file.scene;
  const Model model(scene);
  const std::vector<double> truth = numbers_of(scene, kSought), start = wrong_start(truth, seed);
  const ControlProgram program(model, model.timestep(), 0);
  const RecordedRun run{
      [&](std::int64_t t, int e, std::span<double> u) { program.evaluate(t, e, u); },
      program.steps(), std::max(1, model.sensors()[0].every)};
  FieldSequence recorded = simulate_fields(scene, run);
  const double noise = share * peak_of(recorded);
  add_noise(recorded, noise, seed);
  fmt::print("{}: {} readings of {} points, noise {:.3e} N ({:.3g} % of the peak)\n", o.scene,
             recorded.readings.size(), model.sensors()[0].points, noise, 100 * share);
  IdentificationOptions options;
  options.numbers = kSought;
  const Identification fit = identify(with_numbers(scene, kSought, start), run, recorded, options);
  print_fit(scene, truth, fit);
  if (!o.svg.empty()) {
    const FieldSequence fitted = simulate_fields(with_numbers(scene, kSought, fit.values()), run);
    const std::array<CurvePanel, 3> panels = {misfit_panel(fit), values_panel(truth, fit),
                                              forces_panel(recorded, fitted, model.timestep())};
    const std::array<std::string, 1> captions = {
        fmt::format("noise {:.3g} % of the peak, seed {}; condition of the information {:.1f}",
                    100 * share, seed, fit.condition)};
    write_text_atomically(o.svg,
                          render_curves_svg("A skin and a ball from a recording", captions, panels),
                          o.overwrite);
    fmt::print("wrote {}\n", o.svg);
  }
  return fit.converged ? kDone : kSomeFailed;
}

int guarded(int argc, char** argv) {
  Options o;
  Parser parser(
      "Finds k_n, k_t and mu of a tactile skin and the mass of a ball from a noisy recording.",
      "identify_ball",
      "Example:\n  identify_ball scenes/identify_ball.xml --noise 0.02 --seed 3 --svg fit.svg");
  CLI::App& app = parser.root();
  add_text(app, "SCENE", o.scene, "",
           "Scene with a pad 'pad' and a ball 'ball' [default: scenes/identify_ball.xml]");
  add_positive_number(app, "--noise", o.noise,
                      "Standard deviation over the fields' largest number [default: 0.01]");
  add_whole_number<std::uint64_t>(app, "--seed", o.seed, 0, 1000000,
                                  "Seed of the noise and of the wrong start [default: 1]");
  add_text(app, "--svg", o.svg, "FILE", "Write a picture of the fit");
  add_flag(app, "--overwrite", o.overwrite, "Replace the picture if it exists");
  try {
    return parser.parse(argc, argv) ? identify_ball(o) : kDone;
  } catch (const InputError& error) {
    fmt::print(stderr, "identify_ball: {}\n", error.what());
    return kUsage;
  } catch (const IoError& error) {
    fmt::print(stderr, "identify_ball: {}\n", error.what());
    return kInputOutput;
  }
}

}  // namespace
}  // namespace tangere::apps

int main(int argc, char** argv) { return tangere::apps::guarded(argc, argv); }
