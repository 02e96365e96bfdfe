// SPDX-License-Identifier: Apache-2.0
// Measures the cost of the task layer: box pushing through a VectorTask, against the same states,
// controls and fields through a bare Stepper and Readout, on one thread.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "engine/sense/readout.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/numbers/lanes.hpp"
#include "kernels/table/isa.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/run/policy.hpp"

namespace tangere {
namespace {

constexpr int kEnvironments = 1024;
constexpr std::size_t kActs = 3, kControls = 6;

/// One episode of every environment under random actions that were drawn in advance.
struct Pushing {
  std::unique_ptr<Task> task =
      make_task("box_pushing", read_scene(TANGERE_SOURCE_DIR "/scenes/box_pushing.xml").scene);
  std::optional<VectorTask> vector;
  std::optional<Batch> start;
  std::vector<std::vector<double>> actions, controls;  // per action: (E, 3), (E, 6)

  Pushing() {
    VectorOptions options;
    options.autoreset = false;
    vector.emplace(*task, kEnvironments, options);
    start.emplace(vector->batch());
    const Policy policy(*task, PolicyKind::random);
    std::vector<double> a(kEnvironments * kActs), u(kEnvironments * kControls);
    for (int t = 0; t < task->spec().horizon; ++t) {
      policy.act(*vector, a);
      vector->step(a);
      for (std::size_t e = 0; e < kEnvironments; ++e)
        task->controls(vector->view(int(e)), 0, std::span(u).subspan(e * kControls, kControls));
      actions.push_back(a);
      controls.push_back(u);
    }
  }
};

Pushing& pushing() {
  static Pushing p;
  return p;
}

void report(benchmark::State& state) {
  const auto steps = double(state.iterations()) * kEnvironments * pushing().task->spec().horizon;
  state.counters["env_steps/s"] = benchmark::Counter(steps, benchmark::Counter::kIsRate);
  state.SetLabel(kernels::active_isa_name());
}

void BM_VectorTask(benchmark::State& state) {
  Pushing& p = pushing();
  for (auto _ : state) {
    state.PauseTiming();
    p.vector->reset(0);
    state.ResumeTiming();
    for (const std::vector<double>& a : p.actions) p.vector->step(a);
  }
  report(state);
}

void BM_Bare(benchmark::State& state) {
  Pushing& p = pushing();
  const Model& model = p.task->model();
  Stepper stepper(model);
  Readout readout(model, Precision::mixed);
  const std::size_t numbers = 3 * std::size_t(model.sensors()[0].points);
  std::vector<double> fields(kEnvironments * numbers);
  Batch batch = *p.start;
  for (auto _ : state) {
    state.PauseTiming();
    batch = *p.start;
    state.ResumeTiming();
    for (const std::vector<double>& u : p.controls)
      for (int block = 0; block < batch.blocks(); ++block) {
        for (int k = 0; k < p.task->spec().steps_per_action; ++k)
          stepper.step_block(batch, block, u);
        std::array<std::span<double>, kernels::kBlock> parts;
        for (std::size_t l = 0; l < parts.size(); ++l)
          parts[l] =
              std::span(fields).subspan((std::size_t(block) * parts.size() + l) * numbers, numbers);
        readout.read_block(batch, block, {0}, std::span<const std::span<double>>(parts));
      }
    benchmark::ClobberMemory();
  }
  report(state);
}

BENCHMARK(BM_VectorTask)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Bare)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tangere
