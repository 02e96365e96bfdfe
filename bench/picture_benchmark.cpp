// SPDX-License-Identifier: Apache-2.0
// Time of a picture of a gel and of its pullback, by the size of the field and of the picture; and
// of a picture of a camera, by its side.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>

#include "engine/picture/gel_camera.hpp"
#include "engine/picture/scene_view.hpp"

namespace tangere {
namespace {

constexpr double kPitch = 4e-4, kRadius = 4e-3, kDeepest = 1e-3;  // [m]

PictureDescription picture_of(const benchmark::State& state, double noise) {
  PictureDescription picture;
  picture.rows = static_cast<int>(state.range(2)), picture.cols = static_cast<int>(state.range(3));
  Gel gel = default_gel();
  gel.reach = 8e-4;
  picture.gel = std::make_shared<const Gel>(std::move(gel));
  picture.noise = noise;
  return picture;
}

template <class T>
std::vector<T> pressed_ball(int rows, int cols) {
  std::vector<T> depth;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const double x = (j - 0.5 * cols) * kPitch, y = (i - 0.5 * rows) * kPitch,
                   square = kRadius * kRadius - x * x - y * y;
      depth.push_back(
          static_cast<T>(square > 0 ? std::max(0.0, kDeepest - kRadius + std::sqrt(square)) : 0));
    }
  return depth;
}

template <class T>
struct Press {
  int rows, cols;
  PictureDescription picture;
  GelCamera<T> camera;
  std::vector<T> depth;

  explicit Press(const benchmark::State& state, double noise = 0)
      : rows(static_cast<int>(state.range(0))),
        cols(static_cast<int>(state.range(1))),
        picture(picture_of(state, noise)),
        camera(picture_grid(picture, rows, cols, kPitch, kPitch), picture, 0),
        depth(pressed_ball<T>(rows, cols)) {
    camera.set_draws({});
  }
  [[nodiscard]] std::size_t numbers() const { return 3 * std::size_t(camera.grid().pixels()); }
};

void picture_bytes(benchmark::State& state, double noise) {
  Press<float> press(state, noise);
  std::vector<std::uint8_t> bytes(press.numbers());
  for (auto _ : state) {
    press.camera.set_depth(press.depth);
    press.camera.read(false, std::span<std::uint8_t>(bytes));
    benchmark::DoNotOptimize(bytes.data());
  }
  state.SetItemsProcessed(state.iterations());
}

void BM_Picture(benchmark::State& state) { picture_bytes(state, 0); }
void BM_NoisyPicture(benchmark::State& state) { picture_bytes(state, 1.5); }

/// Colours before they are rounded, which gradients take.
template <class T>
void BM_PictureNumbers(benchmark::State& state) {
  Press<T> press(state);
  std::vector<T> colours(press.numbers());
  for (auto _ : state) {
    press.camera.set_depth(press.depth);
    press.camera.read(false, std::span<T>(colours));
    benchmark::DoNotOptimize(colours.data());
  }
  state.SetItemsProcessed(state.iterations());
}

template <class T>
void BM_PicturePullback(benchmark::State& state) {
  Press<T> press(state);
  std::vector<T> colour_bar(press.numbers(), T(1)), surface_bar(press.depth.size()),
      depth_bar(press.depth.size());
  press.camera.set_depth(press.depth);
  for (auto _ : state) {
    press.camera.pull_back(false, {}, colour_bar, surface_bar);
    press.camera.pull_back_depth(surface_bar, depth_bar);
    benchmark::DoNotOptimize(depth_bar.data());
  }
  state.SetItemsProcessed(state.iterations());
}

void sizes(benchmark::internal::Benchmark* b) {
  b->Args({36, 47, 240, 320})->Args({24, 32, 240, 320})->Args({36, 47, 48, 64});
  b->Unit(benchmark::kMicrosecond);
}

/// A table with 18 solids of five kinds, a ball of 1 984 triangles and the ground, from a corner.
struct Table {
  std::vector<ViewSolid> solids;
  std::vector<double> vertices;
  std::vector<std::array<int, 3>> triangles;
  ViewSolid mesh;
  Vector3 light;

  Table() {
    const Vector3 eye{0.05, -0.5, 0.35}, forward = unit(Vector3{0, 0, 0.03} - eye),
                                         right = unit(cross(forward, {0, 0, 1})),
                                         down = cross(forward, right);
    const auto seen = [&](const Vector3& v) {
      return Vector3{dot(v, right), dot(v, down), dot(v, forward)};
    };
    light = seen(unit({0.35, -0.6, 0.75}));
    const auto placed = [&](SolidKind kind, double turn, const Vector3& at, const Vector3& size) {
      const Vector3 x = unit({std::cos(turn), std::sin(turn), 0.5 * std::sin(3 * turn)}),
                    y = unit(cross(x, {0.1, 0.3, 1})), z = cross(x, y);
      ViewSolid solid{kind, static_cast<std::int32_t>(solids.size())};
      solid.axes = {seen(x), seen(y), seen(z)};
      solid.origin = seen(at - eye);
      solid.size = size;
      solid.colour = {0.8, 0.5, 0.3};
      return solid;
    };
    ViewSolid ground{SolidKind::half_space, 20};
    ground.axes = {seen({1, 0, 0}), seen({0, 1, 0}), seen({0, 0, 1})};
    ground.origin = seen(Vector3{0, 0, 0} - eye);
    ground.square = 0.05;
    ground.colour = {0.6, 0.6, 0.6};
    const Vector3 sizes[] = {{0.03, 0.03, 0.03},
                             {0.03, 0.02, 0.04},
                             {0.02, 0.03, 0.025},
                             {0.02, 0.03, 0},
                             {0.02, 0.03, 0}};
    for (int k = 0; k < 18; ++k)
      solids.push_back(placed(static_cast<SolidKind>(k % 5), k,
                              {0.07 * (k % 6) - 0.18, 0.09 * (k / 6) - 0.1, 0.03}, sizes[k % 5]));
    solids.push_back(ground);
    mesh = placed(SolidKind::ball, 0, {0, 0.15, 0.05}, {1, 1, 1});
    constexpr int kRings = 32;
    for (int i = 0; i <= kRings; ++i)
      for (int j = 0; j < kRings; ++j) {
        const double lift = M_PI * i / kRings, turn = 2 * M_PI * j / kRings;
        for (const double x :
             {std::sin(lift) * std::cos(turn), std::sin(lift) * std::sin(turn), std::cos(lift)})
          vertices.push_back(0.04 * x);
        const int a = i * kRings + j, b = i * kRings + (j + 1) % kRings;
        if (i > 0 && i < kRings) triangles.push_back({a, a + kRings, b});
        if (i < kRings - 1) triangles.push_back({b, a + kRings, b + kRings});
      }
  }
};

void BM_Camera(benchmark::State& state) {
  const Table table;
  const int side = static_cast<int>(state.range(0));
  SceneView view({side, side, 45, 10});
  std::vector<std::uint8_t> bytes(3 * view.grid().pixels());
  for (auto _ : state) {
    view.begin(table.light, 0.35);
    for (const ViewSolid& solid : table.solids) view.add(solid);
    view.add(ViewMesh{table.vertices, table.triangles, 1}, table.mesh);
    unpack_colours(view.colours(), bytes);
    benchmark::DoNotOptimize(bytes.data());
  }
  state.SetItemsProcessed(state.iterations());
}

BENCHMARK(BM_Camera)->Arg(64)->Arg(84)->Arg(128)->Arg(224)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_Picture)->Apply(sizes);
BENCHMARK(BM_NoisyPicture)->Apply(sizes);
BENCHMARK(BM_PictureNumbers<float>)->Apply(sizes);
BENCHMARK(BM_PictureNumbers<double>)->Apply(sizes);
BENCHMARK(BM_PicturePullback<float>)->Apply(sizes);
BENCHMARK(BM_PicturePullback<double>)->Apply(sizes);

}  // namespace
}  // namespace tangere
