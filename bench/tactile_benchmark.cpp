// SPDX-License-Identifier: Apache-2.0
// Measures the cost of a tactile point: the kernels alone, on pads that are touched everywhere or
// in the middle, against one point at a time in plain C++. Fields, lanes and files follow.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "engine/model/compiled_model.hpp"
#include "engine/model/mesh_grid.hpp"
#include "engine/model/model.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/contact/pair_contact.hpp"
#include "kernels/numbers/so3.hpp"
#include "kernels/table/isa.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {
namespace {

using kernels::kTactileTile;
using kernels::Touch;
using kernels::TouchShape;

/// Operations per point that a sphere touches, law `clamped`, counted in the machine code of the
/// loops. Sums, products, comparisons and choices count one each, a multiply-add two.
constexpr double kOperationsDouble = 113, kOperationsMixed = 110;

Model pad_model(int resolution) {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball.xml").scene;
  scene.sensors[0].array.rows = scene.sensors[0].array.cols = resolution;
  return Model(scene);
}

/// A ball of triangles between circles around z.
MeshShape ball_of_triangles(double radius, int around) {
  MeshShape mesh;
  mesh.vertices = {0, 0, -radius, 0, 0, radius};
  const int rings = around / 2 - 1;
  const auto vertex = [&](int ring, int k) { return 2 + ring * around + k % around; };
  for (int i = 0; i < rings; ++i)
    for (int k = 0; k < around; ++k) {
      const double polar = M_PI * (i + 1) / (rings + 1), turn = 2 * M_PI * k / around;
      mesh.vertices.insert(mesh.vertices.end(),
                           {radius * std::sin(polar) * std::cos(turn),
                            radius * std::sin(polar) * std::sin(turn), -radius * std::cos(polar)});
    }
  for (int k = 0; k < around; ++k) {
    mesh.triangles.push_back({0, vertex(0, k + 1), vertex(0, k)});
    mesh.triangles.push_back({1, vertex(rings - 1, k), vertex(rings - 1, k + 1)});
    for (int i = 0; i + 1 < rings; ++i) {
      mesh.triangles.push_back({vertex(i, k), vertex(i, k + 1), vertex(i + 1, k + 1)});
      mesh.triangles.push_back({vertex(i, k), vertex(i + 1, k + 1), vertex(i + 1, k)});
    }
  }
  return mesh;
}

/// The pad's scene with such a ball: 64 cells along it.
const Model& mesh_model() {
  static const Model model = [] {
    Scene scene = pad_model(200).scene();
    for (LinkDescription& link : scene.links)
      if (link.body.name == "ball") link.body.shape = ball_of_triangles(0.02, 64);
    return Model(scene);
  }();
  return model;
}

/// A rolling ball whose lowest point is `depth` inside a pad of 5 × 5 cm.
struct Press {
  TouchShape shape;
  Touch<double> touch;

  Press(double radius, double depth) : shape{PrimitiveShape::sphere, {radius, 0, 0}} {
    touch.Q = kernels::diagonal(1.0);
    touch.c = {0.001, -0.002, radius - depth};
    touch.omega = {0.3, -0.2, 0.1};
    touch.v = {0.01, 0.02, -0.005};
    touch.law = {1, 0.01, 2, 0.003};
  }
};
/// Every point of the pad is in contact.
const Press kEverywhere(0.5, 2e-3);
/// The ball of the scene, 25 mm away: every tile is tested.
const Press kNearby(0.02, -0.025);
/// The ball of the scene, 5 cm away: beyond a sphere around the pad.
const Press kAway(0.02, -0.05);
/// The ball of the scene at its greatest depth; it touches a 25th of the points.
const Press kMiddle(0.02, 1e-3);

/// The same ball as a mesh.
Press mesh_in_middle() {
  Press press = kMiddle;
  const auto& bodies = compiled(mesh_model()).bodies;
  const auto ball = std::find_if(bodies.begin(), bodies.end(),
                                 [](const CompiledBody& b) { return b.grid != nullptr; });
  press.shape = {PrimitiveShape::mesh, {1, 0, 0}, ball->grid};
  const kernels::Vec3<double> axis = {0.36, 0.48, 0.8};  // no axis of the grid is one of the pad
  press.touch.Q = kernels::to_matrix(kernels::quaternion_exp(axis));
  return press;
}

int run(const kernels::TactileArgs<double>& a) { return kernels::active_kernels().tactile(a); }
int run(const kernels::TactileArgs<float>& a) { return kernels::active_kernels().tactile_mixed(a); }
void run(const kernels::TactileBlockArgs<double>& a) { kernels::active_kernels().tactile_block(a); }
void run(const kernels::TactileBlockArgs<float>& a) {
  kernels::active_kernels().tactile_block_mixed(a);
}

void count(benchmark::State& state, double points, double operations = 0) {
  using benchmark::Counter;
  const double all = double(state.iterations()) * points;
  state.counters["ns/point"] = Counter(all * 1e-9, Counter::kIsRate | Counter::kInvert);
  if (operations > 0) state.counters["flop/s"] = Counter(all * operations, Counter::kIsRate);
  state.SetLabel(kernels::active_isa_name());
}

/// Evaluates tiles into a list (compact) or an array (dense), whole or their pressure alone.
template <class Real>
void field(benchmark::State& state, const Press& press, int resolution, bool dense,
           bool pressure = false) {
  const Model model = pad_model(resolution);
  const CompiledSensor& sensor = compiled(model).sensors[0];
  const kernels::PadTiles pad = sensor.tiles();
  AlignedVector<Real> values(std::size_t(pad.tiles()) * 3 * kTactileTile),
      array(std::size_t(sensor.points()) * 3);
  std::vector<int> active(std::size_t(pad.tiles()));
  const kernels::TactileArgs<Real> args{&pad,
                                        ContactLaw::clamped,
                                        1,
                                        &press.shape,
                                        &press.touch,
                                        active.data(),
                                        dense ? nullptr : values.data(),
                                        dense ? array.data() : nullptr,
                                        pressure};
  int tiles = 0;
  for (auto _ : state) {
    tiles = run(args);
    benchmark::ClobberMemory();
  }
  const bool all = &press == &kEverywhere;
  count(state, sensor.points(),
        all && !pressure ? (sizeof(Real) == 4 ? kOperationsMixed : kOperationsDouble) : 0);
  state.counters["tiles"] = tiles;
}

/// Evaluates a small pad in every environment of a group or block, one point after the other.
template <class Real>
void block(benchmark::State& state, int resolution, bool pressure = false) {
  constexpr std::size_t kLanes = sizeof(Real) == 4 ? 16 : 8;
  const Model model = pad_model(resolution);
  const CompiledSensor& sensor = compiled(model).sensors[0];
  const kernels::PadTiles pad = sensor.tiles();
  AlignedVector<Touch<kernels::LaneRow>> touches(2);
  const auto* from = reinterpret_cast<const double*>(&kMiddle.touch);
  for (Touch<kernels::LaneRow>& touch : touches)
    for (std::size_t k = 0; k < sizeof(Touch<double>) / sizeof(double); ++k)
      std::fill_n(reinterpret_cast<kernels::LaneRow*>(&touch)[k].lane, kernels::kGroup, from[k]);
  const Touch<kernels::LaneRow>* shape_touches[] = {touches.data()};
  std::array<std::vector<Real>, kLanes> arrays;
  std::array<Real*, kLanes> dense;
  for (std::size_t l = 0; l < kLanes; ++l) {
    arrays[l].resize(std::size_t(sensor.points()) * 3);
    dense[l] = arrays[l].data();
  }
  const kernels::TactileBlockArgs<Real> args{
      &pad, ContactLaw::clamped, 1, &kMiddle.shape, shape_touches, dense.data(), pressure};
  for (auto _ : state) {
    run(args);
    benchmark::ClobberMemory();
  }
  count(state, double(sensor.points()) * double(kLanes));
}

/// Evaluates the same field point by point, like a textbook. The kernels are compared with this.
void BM_OnePointAtATime(benchmark::State& state) {
  const Model model = pad_model(200);
  const kernels::PadTiles pad = compiled(model).sensors[0].tiles();
  const Press& press = kEverywhere;
  const Touch<double>& t = press.touch;
  std::vector<double> array(std::size_t(pad.rows * pad.cols) * 3);
  const kernels::LawParameters<double> law = {t.law, ContactLaw::clamped, 0};
  const double step = 0.05 / 199;
  for (auto _ : state) {
    double* to = array.data();
    for (int i = 0; i < pad.rows; ++i)
      for (int j = 0; j < pad.cols; ++j, to += 3) {
        const auto at =
            point_contact(kernels::SphereDistance<double>{press.shape.size[0]}, law, t.Q, t.c,
                          t.omega, t.v, {i * step - 0.025, j * step - 0.025, 0});
        to[0] = at.force.x, to[1] = at.force.y, to[2] = -at.force.z;
      }
    benchmark::ClobberMemory();
  }
  count(state, pad.rows * pad.cols);
}

#if defined(__x86_64__)
// Independent multiply-adds: two units with a latency of four keep at most eight chains busy, fewer
// than ten.
constexpr int kChains = 10, kRounds = 100;
__attribute__((target("avx512f"))) void multiply_add_512(float* x) {
  __m512 chain[kChains];
  for (int c = 0; c < kChains; ++c) chain[c] = _mm512_set1_ps(x[c]);
  const __m512 a = _mm512_set1_ps(0.5F), b = _mm512_set1_ps(x[kChains]);
  for (int n = 0; n < kRounds; ++n)
    for (__m512& y : chain) y = _mm512_fmadd_ps(y, a, b);
  for (int c = 0; c < kChains; ++c) x[c] = _mm512_cvtss_f32(chain[c]);
}
__attribute__((target("avx2,fma"))) void multiply_add_256(float* x) {
  __m256 chain[kChains];
  for (int c = 0; c < kChains; ++c) chain[c] = _mm256_set1_ps(x[c]);
  const __m256 a = _mm256_set1_ps(0.5F), b = _mm256_set1_ps(x[kChains]);
  for (int n = 0; n < kRounds; ++n)
    for (__m256& y : chain) y = _mm256_fmadd_ps(y, a, b);
  for (int c = 0; c < kChains; ++c) x[c] = _mm256_cvtss_f32(chain[c]);
}
/// Measures the peak of this core in single precision; double precision reaches half of it.
void BM_PeakMultiplyAdd(benchmark::State& state) {
  const std::string_view isa = kernels::active_isa_name();
  const int width = isa == "avx512" ? 16 : 8;
  if (isa != "avx512" && isa != "avx2")
    return state.SkipWithError("this instruction set fuses nothing");
  std::array<float, kChains + 1> x{};
  for (auto _ : state) {
    width == 16 ? multiply_add_512(x.data()) : multiply_add_256(x.data());
    benchmark::ClobberMemory();
  }
  state.counters["flop/s"] = benchmark::Counter(
      double(state.iterations()) * 2 * kChains * kRounds * width, benchmark::Counter::kIsRate);
  state.SetLabel(std::string(isa));
}
BENCHMARK(BM_PeakMultiplyAdd);
#endif

/// The same points as a list, each with its own axes.
Model list_model() {
  Scene scene = pad_model(200).scene();
  const RectArray& a = scene.sensors[0].array;
  for (int i = 0; i < 200; ++i)
    for (int j = 0; j < 200; ++j) {
      TactilePoint p;
      for (std::size_t k = 0; k < 3; ++k)
        p.position[k] = a.corner0[k] + 0.05 / 199 * (i * a.axis0[k] + j * a.axis1[k]);
      p.axis0 = a.axis0, p.axis1 = a.axis1, p.normal = {0, 0, 1};
      scene.sensors[0].points.push_back(p);
    }
  return Model(scene);
}
/// Evaluates tiles of a curved pad that is touched everywhere. The pad's axes are the body's: the
/// ball comes from below.
template <class Real>
void curved(benchmark::State& state) {
  const Model model = list_model();
  const kernels::PadTiles pad = compiled(model).sensors[0].tiles();
  Press press(0.5, 2e-3);
  press.touch.c.z = -0.005 - press.touch.c.z;
  AlignedVector<Real> values(std::size_t(pad.tiles()) * 3 * kTactileTile);
  std::vector<int> active(std::size_t(pad.tiles()));
  const kernels::TactileArgs<Real> args{
      &pad,          ContactLaw::clamped, 1,      &press.shape, &press.touch,
      active.data(), values.data(),       nullptr};
  int tiles = 0;
  for (auto _ : state) {
    tiles = run(args);
    benchmark::ClobberMemory();
  }
  count(state, pad.rows);
  state.counters["tiles"] = tiles;
}
/// Makes the distance to a ball of 2024 triangles on 64 cells.
void BM_MakeMeshGrid(benchmark::State& state) {
  const MeshShape mesh = ball_of_triangles(0.02, 46);
  for (auto _ : state) benchmark::DoNotOptimize(make_mesh_grid(mesh));
  state.counters["triangles"] = double(mesh.triangles.size());
}
void BM_CurvedDouble(benchmark::State& s) { curved<double>(s); }
void BM_CurvedMixed(benchmark::State& s) { curved<float>(s); }
void BM_DenseDouble(benchmark::State& s) { field<double>(s, kEverywhere, 200, true); }
void BM_DenseMixed(benchmark::State& s) { field<float>(s, kEverywhere, 200, true); }
void BM_CompactDouble(benchmark::State& s) { field<double>(s, kEverywhere, 200, false); }
void BM_CompactMixed(benchmark::State& s) { field<float>(s, kEverywhere, 200, false); }
void BM_CulledDouble(benchmark::State& s) { field<double>(s, kMiddle, 200, true); }
void BM_CulledMixed(benchmark::State& s) { field<float>(s, kMiddle, 200, true); }
void BM_CulledMeshDouble(benchmark::State& s) { field<double>(s, mesh_in_middle(), 200, true); }
void BM_CulledMeshMixed(benchmark::State& s) { field<float>(s, mesh_in_middle(), 200, true); }
void BM_SmallPadDouble(benchmark::State& s) { field<double>(s, kMiddle, 20, true); }
void BM_SmallPadMixed(benchmark::State& s) { field<float>(s, kMiddle, 20, true); }
void BM_SmallPadAcrossEnvironmentsDouble(benchmark::State& s) { block<double>(s, 20); }
void BM_SmallPadAcrossEnvironmentsMixed(benchmark::State& s) { block<float>(s, 20); }
void BM_DensePressureDouble(benchmark::State& s) { field<double>(s, kEverywhere, 200, true, true); }
void BM_DensePressureMixed(benchmark::State& s) { field<float>(s, kEverywhere, 200, true, true); }
void BM_NearbyMixed(benchmark::State& s) { field<float>(s, kNearby, 200, true); }
void BM_OutOfReachMixed(benchmark::State& s) { field<float>(s, kAway, 200, true); }
void BM_CulledPressureMixed(benchmark::State& s) { field<float>(s, kMiddle, 200, true, true); }
void BM_PressureAcrossEnvironmentsMixed(benchmark::State& s) { block<float>(s, 20, true); }

/// Reads 16 environments with the ball of the scene at the end of its run, in mixed precision: the
/// shapes' poses, the kernel, and zeros where nothing touches.
void reading(benchmark::State& state, FieldForm form) {
  const Model model = pad_model(200);
  Batch batch(model, kernels::kBlock);
  Stepper stepper(model);
  const ControlProgram controls(model, model.timestep(), 0);
  std::vector<double> u(std::size_t(kernels::kBlock * model.nu()));
  for (std::int64_t t = 0; t < controls.steps(); ++t) {
    for (int e = 0; e < kernels::kBlock; ++e)
      controls.evaluate(t, e, std::span(u).subspan(std::size_t(e * model.nu()), 3));
    stepper.step(batch, u);
  }
  Readout readout(model, Precision::mixed);
  std::vector<std::vector<float>> arrays(
      kernels::kBlock, std::vector<float>(numbers_of(model.sensors()[0].points, form)));
  std::vector<std::span<float>> places(arrays.begin(), arrays.end());
  for (auto _ : state) {
    readout.read_block(batch, 0, {0, form}, std::span<const std::span<float>>(places));
    benchmark::ClobberMemory();
  }
  count(state, double(kernels::kBlock) * model.sensors()[0].points);
}
void BM_ReadField(benchmark::State& s) { reading(s, FieldForm::field); }
void BM_ReadPressure(benchmark::State& s) { reading(s, FieldForm::pressure); }
void BM_ReadShear(benchmark::State& s) { reading(s, FieldForm::shear); }
void BM_ReadSum(benchmark::State& s) { reading(s, FieldForm::sum); }
BENCHMARK(BM_OnePointAtATime);
BENCHMARK(BM_DenseDouble);
BENCHMARK(BM_DenseMixed);
BENCHMARK(BM_DensePressureDouble);
BENCHMARK(BM_DensePressureMixed);
BENCHMARK(BM_CulledPressureMixed);
BENCHMARK(BM_NearbyMixed);
BENCHMARK(BM_OutOfReachMixed);
BENCHMARK(BM_PressureAcrossEnvironmentsMixed);
BENCHMARK(BM_ReadField);
BENCHMARK(BM_ReadPressure);
BENCHMARK(BM_ReadShear);
BENCHMARK(BM_ReadSum);
BENCHMARK(BM_CompactDouble);
BENCHMARK(BM_CompactMixed);

BENCHMARK(BM_CurvedDouble);
BENCHMARK(BM_CurvedMixed);
BENCHMARK(BM_CulledDouble);
BENCHMARK(BM_CulledMixed);
BENCHMARK(BM_CulledMeshDouble);
BENCHMARK(BM_CulledMeshMixed);
BENCHMARK(BM_MakeMeshGrid)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_SmallPadDouble);
BENCHMARK(BM_SmallPadMixed);
BENCHMARK(BM_SmallPadAcrossEnvironmentsDouble);
BENCHMARK(BM_SmallPadAcrossEnvironmentsMixed);

}  // namespace
}  // namespace tangere
