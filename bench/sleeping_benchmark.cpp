// SPDX-License-Identifier: Apache-2.0
// Measures what sleep gains where ten of eleven bodies rest, and what it costs where bodies may
// sleep and none does.
//
// Google Benchmark runs each once per repetition, because a repetition is a whole comparison: runs
// with and without sleep take turns from the same states, on one thread's CPU time. Neighbours in
// time are compared, and the median of these ratios counts, because a busy machine slows down and
// recovers.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/isa.hpp"

namespace tangere {
namespace {

constexpr double kSecondsOfCase = 2;
constexpr int kFewestRounds = 21;

double cpu_seconds() {
  std::timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

Scene scene(const std::string& name) {
  return read_scene(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml").scene;
}

StepperOptions asleep(double share) {
  StepperOptions options;
  options.sleep = share;
  return options;
}

/// Controls of all environments, step by step.
using Controls = std::vector<std::vector<double>>;

/// The finger goes along the aisle and touches no box; its target never stands still.
Controls along_the_aisle(int environments, int steps) {
  Controls all(static_cast<std::size_t>(steps));
  for (int k = 0; k < steps; ++k)
    for (int e = 0; e < environments; ++e)
      for (const double u : {0.12 + 0.12 * std::sin(0.03 * k), 0.0, 0.0})
        all[static_cast<std::size_t>(k)].push_back(u);
  return all;
}

/// The scene's own controls, from its first step on.
Controls scene_controls(const Model& model, int environments, int steps) {
  const ControlProgram program(model, model.timestep(), 0);
  const auto nu = static_cast<std::size_t>(model.nu());
  Controls all(static_cast<std::size_t>(steps));
  for (int k = 0; k < steps; ++k) {
    std::vector<double>& u = all[static_cast<std::size_t>(k)];
    u.resize(nu * static_cast<std::size_t>(environments));
    for (std::size_t e = 0; e < static_cast<std::size_t>(environments); ++e)
      program.evaluate(k, static_cast<std::int64_t>(e), std::span(u).subspan(e * nu, nu));
  }
  return all;
}

/// A batch where a run begins, and a stepper for it.
struct Runner {
  Stepper stepper;
  Batch start, batch;

  Runner(const Model& model, const StepperOptions& options, int environments)
      : stepper(model, options), start(model, environments, 1), batch(start) {}

  /// Steps and starts from there.
  void go(const Controls& controls) {
    for (const std::vector<double>& u : controls) stepper.step(start, u);
  }
  double time(const Controls& controls) {
    batch = start;
    const double begin = cpu_seconds();
    for (const std::vector<double>& u : controls) stepper.step(batch, u);
    return cpu_seconds() - begin;
  }
  [[nodiscard]] double bodies_asleep() const {
    int sum = 0;
    for (int e = 0; e < batch.environments(); ++e) sum += batch.sleep(e).bodies;
    return static_cast<double>(sum) / batch.environments();
  }
};

double median(std::vector<double> of) {
  std::nth_element(of.begin(), of.begin() + std::ssize(of) / 2, of.end());
  return of[of.size() / 2];
}

struct Comparison {
  double with, without;  ///< median seconds of a run
  double cost;           ///< median of with/without
};

Comparison take_turns(Runner& with, Runner& without, const Controls& controls) {
  std::vector<double> cost, slept, awake;
  for (double spent = 0; spent < kSecondsOfCase || cost.size() < kFewestRounds;) {
    const bool first = cost.size() % 2 == 0;
    double time = first ? with.time(controls) : 0;
    const double other = without.time(controls);
    if (!first) time = with.time(controls);
    spent += time + other;
    slept.push_back(time);
    awake.push_back(other);
    cost.push_back(time / other);
  }
  return {median(slept), median(awake), median(cost)};
}

/// Makes steppers in both orders: where their memory lies changes times by more than what is looked
/// for.
void compare(benchmark::State& state, const Model& model, double share, int environments,
             const Controls& settling, const Controls& controls) {
  const double steps = static_cast<double>(controls.size()) * environments;
  for (auto _ : state) {
    Runner one(model, asleep(share), environments), two(model, asleep(0), environments);
    Runner three(model, asleep(0), environments), four(model, asleep(share), environments);
    for (Runner* runner : {&one, &two, &three, &four}) runner->go(settling);
    const Comparison a = take_turns(one, two, controls), b = take_turns(four, three, controls);
    const double cost = std::sqrt(a.cost * b.cost);
    state.SetIterationTime(0.5 * (a.with + b.with));
    state.counters["step_us"] = 0.5e6 * (a.with + b.with) / steps;
    state.counters["awake_us"] = 0.5e6 * (a.without + b.without) / steps;
    state.counters["asleep"] = one.bodies_asleep();
    state.counters["cost"] = cost;
    state.counters["gain"] = 1 / cost;
  }
  state.SetLabel(kernels::active_isa_name());
}

/// Ten boxes have come to rest; the finger moves.
void ten_of_eleven_rest(benchmark::State& state) {
  const int environments = static_cast<int>(state.range(0));
  const Model model(scene("ten_boxes"));
  compare(state, model, kUsualSleep, environments, along_the_aisle(environments, 200),
          along_the_aisle(environments, environments == 1 ? 400 : 100));
}

/// In every environment other boxes are driven, so few environments have the same bodies asleep.
void others_rest_in_every_environment(benchmark::State& state) {
  const int driven = static_cast<int>(state.range(0)), environments = 16, steps = 100;
  Scene of = scene("ten_boxes");
  for (const LinkDescription& link : of.links)
    if (link.body.name != "finger") of.motors.push_back({link.joint.name, -0.01, 0.01, {}});
  const Model model(of);
  const auto nu = static_cast<std::size_t>(model.nu());
  std::mt19937 random(1);
  std::vector<int> boxes(10);
  std::iota(boxes.begin(), boxes.end(), 0);
  Controls settling(200), running(steps);
  for (Controls* part : {&settling, &running})
    for (std::vector<double>& u : *part) u.assign(nu * environments, 0.0);
  for (std::size_t e = 0; e < environments; ++e) {
    std::shuffle(boxes.begin(), boxes.end(), random);
    for (int k = 0; k < driven; ++k)
      for (Controls* part : {&settling, &running})
        for (std::vector<double>& u : *part) {
          const double sign = (&u - part->data()) % 2 == 0 ? 1 : -1;
          u[e * nu + 3 + 6 * static_cast<std::size_t>(boxes[static_cast<std::size_t>(k)])] = sign;
        }
  }
  compare(state, model, kUsualSleep, environments, settling, running);
}

/// Bodies would have to stand still to the last bit to fall asleep. The boxes are on a slope, down
/// which viscous friction lets them creep.
void nobody_sleeps(benchmark::State& state, const std::string& name) {
  const int environments = static_cast<int>(state.range(0));
  Scene of = scene(name);
  if (name == "ten_boxes") of.gravity[1] = 0.05 * of.gravity[2];
  const Model model(of);
  compare(state, model, 1e-14, environments, {},
          scene_controls(model, environments, environments == 1 ? 300 : 100));
}

}  // namespace
}  // namespace tangere

int main(int argc, char** argv) {
  using namespace tangere;
  benchmark::RegisterBenchmark("ten_of_eleven_rest", ten_of_eleven_rest)
      ->Arg(1)
      ->Arg(16)
      ->Arg(256)
      ->Iterations(1)
      ->UseManualTime();
  benchmark::RegisterBenchmark("others_rest_in_every_environment", others_rest_in_every_environment)
      ->Arg(1)
      ->Arg(3)
      ->Arg(4)
      ->Arg(5)
      ->Iterations(1)
      ->UseManualTime();
  for (const char* name :
       {"ten_boxes", "rolling_ball", "box_pushing", "cap_opening", "insertion", "stable_grasp"})
    benchmark::RegisterBenchmark((std::string("nobody_sleeps/") + name).c_str(),
                                 [name](benchmark::State& state) { nobody_sleeps(state, name); })
        ->Arg(1)
        ->Arg(16)
        ->Iterations(1)
        ->UseManualTime();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
