// SPDX-License-Identifier: Apache-2.0
// Time of a picture of a gel and of its pullback, by the size of the field and of the picture.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>

#include "engine/picture/gel_camera.hpp"

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

BENCHMARK(BM_Picture)->Apply(sizes);
BENCHMARK(BM_NoisyPicture)->Apply(sizes);
BENCHMARK(BM_PicturePullback<float>)->Apply(sizes);
BENCHMARK(BM_PicturePullback<double>)->Apply(sizes);

}  // namespace
}  // namespace tangere
