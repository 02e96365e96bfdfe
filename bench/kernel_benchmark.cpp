// SPDX-License-Identifier: Apache-2.0
// Measures the parts of a step: kernels of one group of eight environments, the rolling ball in
// contact. Time is that of the whole group. ns/env divides it by eight, or by one if a lane is
// evaluated alone. ns/candidate divides once more, by the contact points near the touched body.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/step/control.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/group_step.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/isa.hpp"

namespace tangere {
namespace {

using kernels::kGroup;
using kernels::LaneRow;

/// The rolling ball, or another object in its place.
Model model_of(const Shape& object) {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball.xml").scene;
  for (LinkDescription& link : scene.links)
    if (link.body.name == "ball") link.body.shape = object;
  return Model(scene);
}

constexpr double kHalf = 0.02;  ///< radius of the ball, half an edge of a cube [m]

MeshShape cube_of_triangles() {
  MeshShape mesh;
  for (int k = 0; k < 8; ++k)
    for (int c = 0; c < 3; ++c) mesh.vertices.push_back((k >> c & 1) != 0 ? kHalf : -kHalf);
  mesh.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  return mesh;
}

/// A group in the middle of the run, at the predicted pose of its next step.
class Group {
 public:
  explicit Group(const Model& model) : model_(model), work_(compiled(model_)) {
    Batch batch(model_, kGroup, 1);
    Stepper stepper(model_);
    const ControlProgram program(model_, model_.timestep(), 1);
    const auto nu = std::size_t(model_.nu());
    std::vector<double> u(kGroup * nu);
    for (std::int64_t t = 0; t < 200; ++t) {
      for (std::size_t e = 0; e < kGroup; ++e)
        program.evaluate(t, std::int64_t(e), {&u[e * nu], nu});
      stepper.step(batch, u);
    }
    const CompiledModel& m = compiled(model_);
    block_.assign(batch.block(0), batch.block(0) + std::size_t(m.layout.rows) * kernels::kBlock);
    const double h = stepper.timestep();
    for (int l = 0; l < kGroup; ++l) {
      const auto at = [&](int row) { return block_[std::size_t(row * kernels::kBlock + l)]; };
      for (int i = 0; i < m.nq; ++i) work_.stage.centre[i][l] = at(m.layout.q + i);
      for (int i = 0; i < m.nv; ++i) {
        const double v = at(m.layout.v + i);
        work_.stage.x[i][l] = h * v;
        work_.stage.s[i][l] = -v;
        work_.stage.r[i][l] = work_.stage.tau[i][l] = 0;
      }
      work_.stage.c0_over_h[l] = work_.stage.inverse_h[l] = 1 / h;
    }
    work_.stage.block = block_.data();
    work_.stage.group = 0;
    table().group.kinematics(view(), work_.stage);
    find_candidates(m, table(), work_, kAllLanes);
    lists_to_rows(m, table(), work_, kAllLanes);
    table().group.evaluate(view(), work_.stage, -1);
    table().group.factor(view(), work_.stage, nullptr);
  }

  static const kernels::KernelTable& table() { return kernels::active_kernels(); }
  [[nodiscard]] const kernels::ModelView& view() const { return compiled(model_).view; }
  [[nodiscard]] const CompiledModel& compiled_model() const { return compiled(model_); }
  Workspace& work() { return work_; }

 private:
  Model model_;
  Workspace work_;
  AlignedVector<double> block_;
};

template <class F>
void run(benchmark::State& state, double environments, const F& f,
         const Model& model = model_of(SphereShape{kHalf})) {
  Group group(model);
  for (auto _ : state) {
    f(group);
    benchmark::ClobberMemory();
  }
  const auto& list = group.work().own_candidates.lists[0];
  state.counters["ns/env"] =
      benchmark::Counter(double(state.iterations()) * environments * 1e-9,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  const int candidates = environments == 1 ? list.own_count[0] : list.count;
  state.counters["candidates"] = candidates;
  state.counters["ns/candidate"] =
      benchmark::Counter(double(state.iterations()) * environments * candidates * 1e-9,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  state.SetLabel(kernels::active_isa_name());
}

void BM_Kinematics(benchmark::State& s) {
  run(s, kGroup, [](Group& g) { g.table().group.kinematics(g.view(), g.work().stage); });
}
void BM_FindCandidates(benchmark::State& s) {
  run(s, kGroup, [](Group& g) {
    g.work().own_candidates.searched = 0;
    find_candidates(g.compiled_model(), g.table(), g.work(), kAllLanes);
  });
}
void BM_ListsToRows(benchmark::State& s) {
  run(s, kGroup, [](Group& g) {
    g.work().own_candidates.all_in_rows = 0;
    std::ranges::fill(g.work().own_candidates.in_rows, kNoLane);
    lists_to_rows(g.compiled_model(), g.table(), g.work(), kAllLanes);
  });
}
void BM_Residual(benchmark::State& s) {
  run(s, kGroup, [](Group& g) { g.table().group.residual(g.view(), g.work().stage, -1); });
}
void BM_ResidualOfOneLane(benchmark::State& s) {
  run(s, 1, [](Group& g) { g.table().group.residual(g.view(), g.work().stage, 0); });
}
void BM_Evaluate(benchmark::State& s) {
  run(s, kGroup, [](Group& g) { g.table().group.evaluate(g.view(), g.work().stage, -1); });
}
void BM_EvaluateOneLane(benchmark::State& s) {
  run(s, 1, [](Group& g) { g.table().group.evaluate(g.view(), g.work().stage, 0); });
}
/// The same without contact; the difference to the above is the cost of contact.
void BM_EvaluateWithoutCandidates(benchmark::State& s) {
  run(s, kGroup, [](Group& g) {
    g.work().own_candidates.lists[0].count = 0;
    g.table().group.evaluate(g.view(), g.work().stage, -1);
  });
}
/// The pad's contact points on a cube, and on the same cube as a mesh of 64 cells.
void BM_EvaluateOnCuboid(benchmark::State& s) {
  run(
      s, kGroup, [](Group& g) { g.table().group.evaluate(g.view(), g.work().stage, -1); },
      model_of(CuboidShape{{2 * kHalf, 2 * kHalf, 2 * kHalf}, {2, 2, 2}}));
}
void BM_EvaluateOnMesh(benchmark::State& s) {
  static const Model model = model_of(cube_of_triangles());
  run(
      s, kGroup, [](Group& g) { g.table().group.evaluate(g.view(), g.work().stage, -1); }, model);
}
void BM_Factor(benchmark::State& s) {
  run(s, kGroup, [](Group& g) { g.table().group.factor(g.view(), g.work().stage, nullptr); });
}
void BM_Solve(benchmark::State& s) {
  run(s, kGroup, [](Group& g) {
    g.table().group.solve(g.view(), g.work().stage, g.work().stage.g, g.work().test);
  });
}
void BM_SolveWatched(benchmark::State& s) {
  run(s, kGroup, [](Group& g) {
    g.table().group.solve_watched(g.view(), g.work().stage, g.work().stage.g, g.work().test,
                                  &g.work().sound);
  });
}
BENCHMARK(BM_Kinematics);
BENCHMARK(BM_FindCandidates);
BENCHMARK(BM_ListsToRows);
BENCHMARK(BM_Residual);
BENCHMARK(BM_ResidualOfOneLane);
BENCHMARK(BM_Evaluate);
BENCHMARK(BM_EvaluateOneLane);
BENCHMARK(BM_EvaluateWithoutCandidates);
BENCHMARK(BM_EvaluateOnCuboid);
BENCHMARK(BM_EvaluateOnMesh);
BENCHMARK(BM_Factor);
BENCHMARK(BM_Solve);
BENCHMARK(BM_SolveWatched);

}  // namespace
}  // namespace tangere
