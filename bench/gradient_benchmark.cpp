// SPDX-License-Identifier: Apache-2.0
// Compares rollouts with gradients and the same rollouts without, one after the other in one run on
// one thread.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <optional>
#include <vector>

#include "engine/derivative/field_tangent.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/tape.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/isa.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/gradients/task_tape.hpp"
#include "tasks/run/benchmark_fields.hpp"
#include "tasks/run/vector_task.hpp"

namespace tangere {
namespace {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

/// ½ |v|² after the last step, weighted with `number`.
class LastSpeed : public RolloutLoss {
 public:
  explicit LastSpeed(double weight) : weight_(weight) {}
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    if (at.step != at.steps) return 0;
    double sum = 0;
    for (std::size_t i = 0; i < at.v.size(); ++i) {
      sum += 0.5 * weight_ * at.v[i] * at.v[i];
      out.v[i] += weight_ * at.v[i];
    }
    return sum;
  }

 private:
  double weight_;
};

class Rollout {
 public:
  Rollout(const char* scene, int environments, bool tactile, int losses)
      : model_(read_scene(std::string(TANGERE_SOURCE_DIR "/scenes/") + scene + ".xml").scene),
        start_(model_, environments, 1),
        program_(model_, model_.timestep(), 1),
        stepper_(model_),
        readout_(model_, Precision::f64),
        fields_(model_, environments, {}, tactile ? FrameKind::compact : FrameKind::none) {
    options_.length = program_.steps();
    if (tactile) {
      owned_.push_back(make_loss(LossKind::tactile, model_, kEvery));
    } else {
      for (int k = 0; k < losses; ++k) owned_.push_back(std::make_unique<LastSpeed>(k + 1));
    }
    for (const auto& l : owned_) losses_.push_back(l.get());
    tactile_ = tactile;
  }

  [[nodiscard]] double steps() const { return double(options_.length) * start_.environments(); }

  /// Runs the rollout alone, with the fields that its loss reads. Returns its processor time.
  double forward() {
    Batch batch = start_;
    std::vector<double> u(std::size_t(batch.environments() * model_.nu()));
    const auto nu = std::size_t(model_.nu());
    const double begin = cpu_seconds();
    for (int b = 0; b < batch.blocks(); ++b)
      for (std::int64_t t = 0; t < options_.length; ++t) {
        for (int e = 16 * b; e < std::min(16 * b + 16, batch.environments()); ++e)
          program_.evaluate(t, e, std::span(u).subspan(std::size_t(e) * nu, nu));
        stepper_.step_block(batch, b, u);
        if (tactile_ && (t + 1) % kEvery == 0)
          for (int s = 0; s < int(model_.sensors().size()); ++s)
            fields_.read(readout_, batch, b, std::size_t(s));
      }
    return cpu_seconds() - begin;
  }
  double with_gradients(bool parameters) {
    if (!rollouts_) {
      options_.parameters = parameters;
      rollouts_.emplace(model_, options_, losses_);
    }
    const double begin = cpu_seconds();
    const GradientSummary g = rollouts_->run(
        start_,
        [&](std::int64_t step, int e, std::span<double> u) { program_.evaluate(step, e, u); });
    benchmark::DoNotOptimize(g.losses[0].u.data());
    return cpu_seconds() - begin;
  }
  [[nodiscard]] double tape_bytes() const {
    return double(BlockTape::bytes(model_, model_.integrator(), options_.length)) / 16 /
           double(options_.length);
  }

 private:
  static constexpr int kEvery = 5;
  Model model_;
  Batch start_;
  ControlProgram program_;
  Stepper stepper_;
  Readout readout_;
  BenchmarkFields fields_;
  TapeOptions options_;
  std::vector<std::unique_ptr<RolloutLoss>> owned_;
  std::vector<const RolloutLoss*> losses_;
  std::optional<GradientRollouts> rollouts_;
  bool tactile_ = false;
};

void BM_Gradients(benchmark::State& state, const char* scene, bool tactile, int losses,
                  bool parameters) {
  Rollout rollout(scene, int(state.range(0)), tactile, losses);
  rollout.forward();
  rollout.with_gradients(parameters);
  double alone = 1e300, both = 1e300;
  for (auto _ : state) {
    alone = std::min(alone, rollout.forward());
    both = std::min(both, rollout.with_gradients(parameters));
  }
  state.counters["forward/s"] = rollout.steps() / alone;
  state.counters["with_gradients/s"] = rollout.steps() / both;
  state.counters["ratio"] = both / alone;
  state.counters["tape_bytes/step"] = rollout.tape_bytes();
  state.SetLabel(kernels::active_isa_name());
}

#define TANGERE_GRADIENTS(name, scene, tactile, losses, parameters)         \
  BENCHMARK_CAPTURE(BM_Gradients, name, scene, tactile, losses, parameters) \
      ->ArgName("envs")                                                     \
      ->Arg(1)                                                              \
      ->Arg(1024)                                                           \
      ->Unit(benchmark::kMillisecond)                                       \
      ->Iterations(3)

TANGERE_GRADIENTS(rolling_ball, "rolling_ball", false, 1, false);
TANGERE_GRADIENTS(rolling_ball_8_losses, "rolling_ball", false, 8, false);
TANGERE_GRADIENTS(rolling_ball_parameters, "rolling_ball", false, 1, true);
TANGERE_GRADIENTS(rolling_ball_tactile, "rolling_ball", true, 1, false);
TANGERE_GRADIENTS(box_pushing, "box_pushing", false, 1, false);
TANGERE_GRADIENTS(box_pushing_tactile, "box_pushing", true, 1, false);
TANGERE_GRADIENTS(stable_grasp, "stable_grasp", false, 1, false);
TANGERE_GRADIENTS(stable_grasp_tactile, "stable_grasp", true, 1, false);
TANGERE_GRADIENTS(cap_opening, "cap_opening", false, 1, false);
TANGERE_GRADIENTS(insertion, "insertion", false, 1, false);

/// A closed loop without the time of its policy: 64 episodes of 100 actions that the task's script
/// chose before, forward in a VectorTask and on a TaskTape, and back with derivatives by every
/// observation and reward.
class Loop {
 public:
  explicit Loop(const char* name) : task_(make(name)), vector_(*task_, kEnvironments, forward()) {
    TapeOptions options;
    options.length = kActions;
    options.precision = Precision::mixed;
    tape_.emplace(*task_, kEnvironments, options);
    const std::size_t e = kEnvironments, seen = task_->spec().observation_size(),
                      width = task_->spec().action.size();
    observation_bar_.assign(e * seen, 1e-3);
    reward_bar_.assign(e, 1.0);
    action_bar_.resize(e * width);
    for (int t = 0; t < kActions; ++t) {
      std::vector<double>& a = actions_.emplace_back(e * width);
      for (int i = 0; i < kEnvironments; ++i)
        task_->scripted(tape_->view(i), tape_->observations().subspan(std::size_t(i) * seen, seen),
                        std::span(a).subspan(std::size_t(i) * width, width));
      tape_->step(a);
      for (const std::uint8_t alive : tape_->alive()) taken_ += alive;
    }
  }

  /// Actions of all episodes.
  [[nodiscard]] double taken() const { return taken_; }
  double alone() {
    vector_.reset(0);
    const double begin = cpu_seconds();
    for (const auto& a : actions_) vector_.step(a);
    return cpu_seconds() - begin;
  }
  /// Processor times of forward, and of both directions.
  std::pair<double, double> with_gradients() {
    tape_->reset(0, 0);
    const double begin = cpu_seconds();
    for (const auto& a : actions_) tape_->step(a);
    const double middle = cpu_seconds();
    for (int t = 0; t < kActions; ++t) tape_->reverse({observation_bar_, reward_bar_}, action_bar_);
    benchmark::DoNotOptimize(action_bar_.data());
    return {middle - begin, cpu_seconds() - begin};
  }

 private:
  static constexpr int kEnvironments = 64, kActions = 100;
  static std::unique_ptr<Task> make(const char* name) {
    Scene scene =
        read_scene(std::string(TANGERE_SOURCE_DIR "/scenes/") + task_spec(name).scene).scene;
    scene.solver.tolerance = kGradientTolerance;  // the same steps with and without gradients
    return make_task(name, scene);
  }
  static VectorOptions forward() {
    VectorOptions options;
    options.autoreset = false;
    return options;
  }

  std::unique_ptr<Task> task_;
  VectorTask vector_;
  std::optional<TaskTape> tape_;
  std::vector<std::vector<double>> actions_;
  std::vector<double> observation_bar_, reward_bar_, action_bar_;
  double taken_ = 0;
};

void BM_ClosedLoop(benchmark::State& state, const char* name) {
  Loop loop(name);
  double alone = 1e300, forward = 1e300, both = 1e300;
  for (auto _ : state) {
    alone = std::min(alone, loop.alone());
    const auto [first, all] = loop.with_gradients();
    forward = std::min(forward, first);
    both = std::min(both, all);
  }
  state.counters["alone/s"] = loop.taken() / alone;
  state.counters["on_tape/s"] = loop.taken() / forward;
  state.counters["with_gradients/s"] = loop.taken() / both;
  state.counters["ratio"] = both / alone;
  state.SetLabel(kernels::active_isa_name());
}
BENCHMARK_CAPTURE(BM_ClosedLoop, box_pushing, "box_pushing")
    ->Unit(benchmark::kMillisecond)
    ->Iterations(20);
BENCHMARK_CAPTURE(BM_ClosedLoop, box_pushing_reduced, "box_pushing_reduced")
    ->Unit(benchmark::kMillisecond)
    ->Iterations(20);
BENCHMARK_CAPTURE(BM_ClosedLoop, cap_opening, "cap_opening")
    ->Unit(benchmark::kMillisecond)
    ->Iterations(20);

/// Returns processor time per point of the touched tiles [ns], best of several runs.
template <class F>
double per_point(std::size_t tiles, const F& f) {
  constexpr int kRepeats = 200;
  double best = 1e300;
  for (int round = 0; round < 5; ++round) {
    const double begin = cpu_seconds();
    for (int i = 0; i < kRepeats; ++i) f();
    best = std::min(best, cpu_seconds() - begin);
  }
  return 1e9 * best / kRepeats / (64 * double(tiles));
}

/// Measures the field of the rolling ball in the middle of its run: read, along a direction of the
/// state, and in reverse; in reverse also by the scene's numbers and by every point's own.
void BM_FieldDerivatives(benchmark::State& state) {
  const Model model(read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball.xml").scene);
  Batch batch(model, 16, 1);
  const ControlProgram program(model, model.timestep(), 1);
  Stepper stepper(model);
  std::vector<double> u(16 * std::size_t(model.nu()));
  for (std::int64_t t = 0; t < program.steps() / 2; ++t) {
    for (int e = 0; e < 16; ++e)
      program.evaluate(t, e,
                       std::span(u).subspan(std::size_t(e * model.nu()), std::size_t(model.nu())));
    stepper.step(batch, u);
  }
  Readout readout(model);
  CompactFrame<double> frame(model, 0);
  readout.read(batch, 3, frame);
  const std::vector<double> direction(std::size_t(model.nv()), 0.1),
      cotangents(frame.values().size(), 1.0);
  std::vector<double> change(frame.values().size());
  AlignedVector<double> rows(16 * std::size_t(parameter_rows(model)));
  std::vector<double> points(std::size_t(tactile_points(model) * kPointNumbers));
  FieldTangent tangent(model);
  tangent.place(batch, 0);
  ReadoutPullback pullback(model);
  pullback.place(batch, 0);
  pullback.clear();
  const std::size_t tiles = frame.tiles().size();
  for (auto _ : state) {
    state.counters["read"] = per_point(tiles, [&] { readout.read(batch, 3, frame); });
    state.counters["tangent"] = per_point(tiles, [&] {
      tangent.move(3, direction, direction);
      tangent.field(0, frame.tiles(), change);
    });
    state.counters["reverse"] =
        per_point(tiles, [&] { pullback.field(3, 0, frame.tiles(), cotangents); });
    state.counters["numbers"] =
        per_point(tiles, [&] { pullback.field(3, 0, frame.tiles(), cotangents, rows); });
    state.counters["points"] =
        per_point(tiles, [&] { pullback.field(3, 0, frame.tiles(), cotangents, rows, points); });
  }
  state.counters["tiles"] = double(tiles);
  state.SetLabel(kernels::active_isa_name());
}
BENCHMARK(BM_FieldDerivatives)->Unit(benchmark::kMillisecond)->Iterations(1);

}  // namespace
}  // namespace tangere
