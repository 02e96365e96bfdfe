// SPDX-License-Identifier: Apache-2.0
// Measures environment steps per second of the rolling ball on one thread, by batch size, size of
// pad, kind of frame and precision. This is the upper limit for the whole program.
#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/isa.hpp"
#include "tasks/run/benchmark_fields.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere {
namespace {

constexpr std::uint64_t kSeed = 1;

/// The scene's own run with its controls, its length and its tactile interval.
class RollingBall {
 public:
  RollingBall(int environments, int resolution, FrameKind frames, Precision precision)
      : model_(scene(resolution)),
        start_(model_, environments, kSeed),
        batch_(start_),
        stepper_(model_),
        readout_(model_, precision),
        fields_(model_, environments, reading_in(precision), frames),
        program_(model_, model_.timestep(), kSeed),
        row_(std::size_t(environments) * std::size_t(model_.nu())) {
    const auto nu = std::size_t(model_.nu());
    controls_.resize(std::size_t(program_.steps()) * row_);
    for (std::int64_t t = 0; t < program_.steps(); ++t)
      for (int e = 0; e < environments; ++e)
        program_.evaluate(t, start_.episode(e),
                          {&controls_[std::size_t(t) * row_ + std::size_t(e) * nu], nu});
    for (const SensorInfo& sensor : model_.sensors())
      intervals_.push_back(tactile_interval(sensor, {}));
    if (frames == FrameKind::none) intervals_.clear();
  }

  /// Every run starts from the same state and therefore takes the same steps.
  void restore() { batch_ = start_; }
  /// Returns the Newton passes of all environments.
  std::int64_t run() {
    std::int64_t passes = 0;
    for (std::int64_t t = 0; t < program_.steps(); ++t) {
      stepper_.step(batch_, {&controls_[std::size_t(t) * row_], row_});
      for (const std::int32_t i : batch_.iterations()) passes += i;
      for (std::size_t s = 0; s < intervals_.size(); ++s)
        if ((t + 1) % intervals_[s] == 0) read(int(s));
    }
    return passes;
  }

  [[nodiscard]] std::int64_t steps() const { return program_.steps(); }
  [[nodiscard]] int failed_count() const { return batch_.failed_count(); }

 private:
  static BenchmarkOptions reading_in(Precision precision) {
    BenchmarkOptions options;
    options.precision = precision;
    return options;
  }
  static Scene scene(int resolution) {
    Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball.xml").scene;
    scene.sensors[0].array.rows = scene.sensors[0].array.cols = resolution;
    return scene;
  }
  void read(int sensor) {
    for (int block = 0; block < batch_.blocks(); ++block)
      fields_.read(readout_, batch_, block, std::size_t(sensor));
    benchmark::ClobberMemory();
  }

  Model model_;
  Batch start_, batch_;
  Stepper stepper_;
  Readout readout_;
  BenchmarkFields fields_;
  ControlProgram program_;
  std::size_t row_;               // count of numbers in the controls of one step, (E, nu)
  std::vector<double> controls_;  // (T, E, nu)
  std::vector<int> intervals_;
};

void BM_RollingBall(benchmark::State& state, FrameKind frames, Precision precision) {
  const auto environments = static_cast<int>(state.range(0)),
             resolution = static_cast<int>(state.range(1));
  RollingBall ball(environments, resolution, frames, precision);
  ball.run();  // warms caches and pages; its state is discarded
  std::int64_t passes = 0;
  for (auto _ : state) {
    state.PauseTiming();
    ball.restore();
    state.ResumeTiming();
    passes += ball.run();
  }
  if (ball.failed_count() > 0) state.SkipWithError("an environment failed");
  const auto steps = double(state.iterations()) * double(ball.steps()) * environments;
  state.counters["env_steps/s"] = benchmark::Counter(steps, benchmark::Counter::kIsRate);
  state.counters["newton/step"] = double(passes) / steps;
  state.SetLabel(kernels::active_isa_name());
}

void sizes(benchmark::internal::Benchmark* b) {
  b->ArgNames({"envs", "points"})->Unit(benchmark::kMillisecond);
  for (const int environments : {1, 16, 256})
    for (const int resolution : {20, 200}) b->Args({environments, resolution});
}
BENCHMARK_CAPTURE(BM_RollingBall, none, FrameKind::none, Precision::f64)
    ->ArgNames({"envs", "points"})
    ->Args({1, 20})
    ->Args({16, 20})
    ->Args({256, 20})
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_RollingBall, dense_double, FrameKind::dense, Precision::f64)->Apply(sizes);
BENCHMARK_CAPTURE(BM_RollingBall, dense_mixed, FrameKind::dense, Precision::mixed)->Apply(sizes);
BENCHMARK_CAPTURE(BM_RollingBall, compact_double, FrameKind::compact, Precision::f64)->Apply(sizes);
BENCHMARK_CAPTURE(BM_RollingBall, compact_mixed, FrameKind::compact, Precision::mixed)
    ->Apply(sizes);

}  // namespace
}  // namespace tangere
