// SPDX-License-Identifier: Apache-2.0
// Tests pictures of a gel by what must hold of them: normals of a ball, mirrored presses, linear
// lamps, places of markers, draws, bytes and pullbacks.
#include "engine/picture/gel_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/base/hash.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using Numbers = std::vector<double>;
constexpr double kPitch = 4e-4, kImprintRadius = 4e-3;  // [m]

Gel random_gel(unsigned seed) {
  testing::Random random(seed);
  Gel gel;
  gel.blur = 5e-4;
  for (auto& channel : gel.lamps)
    for (auto& shade : channel)
      for (double& number : shade) number = random.uniform(-60, 60);
  gel.background = {12, 16, {}};
  for (int k = 0; k < 12 * 16 * 3; ++k)
    gel.background.levels.push_back(float(random.integer(60, 190)));
  return gel;
}

Gel grey_gel(float level) {
  Gel gel;
  gel.background = {1, 1, {level, level, level}};
  return gel;
}

PictureDescription picture_of(Gel gel, int rows, int cols) {
  PictureDescription picture;
  picture.rows = rows, picture.cols = cols;
  picture.gel = std::make_shared<const Gel>(std::move(gel));
  return picture;
}

template <class T>
GelCamera<T> camera_of(const PictureDescription& picture, int rows, int cols, double reach = 1e-3) {
  return {picture_grid(picture, rows, cols, kPitch, kPitch), picture, reach};
}

/// Depths of a ball off the middle of a grid by x and y [m].
template <class T>
std::vector<T> ball(int rows, int cols, double x, double y, double deepest = 8e-4) {
  std::vector<T> depth;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const double u = (j - 0.5 * (cols - 1)) * kPitch - x, v = (i - 0.5 * (rows - 1)) * kPitch - y,
                   square = kImprintRadius * kImprintRadius - u * u - v * v;
      depth.push_back(
          T(square > 0 ? std::max(0.0, deepest - kImprintRadius + std::sqrt(square)) : 0));
    }
  return depth;
}

template <class T>
std::vector<T> colours(GelCamera<T>& camera, std::span<const T> depth, bool markers = false) {
  camera.set_depth(depth);
  std::vector<T> picture(3 * std::size_t(camera.grid().pixels()));
  camera.read(markers, std::span<T>(picture));
  return picture;
}

std::vector<std::uint8_t> bytes(GelCamera<float>& camera, const std::vector<float>& depth) {
  camera.set_depth(depth);
  std::vector<std::uint8_t> picture(3 * std::size_t(camera.grid().pixels()));
  camera.read(false, std::span<std::uint8_t>(picture));
  return picture;
}

TEST(GelCamera, ShowsTheBackgroundWhereNothingTouches) {
  const PictureDescription picture = picture_of(random_gel(1), 12, 16);
  GelCamera<float> camera = camera_of<float>(picture, 9, 11);
  const std::vector<std::uint8_t> found = bytes(camera, std::vector<float>(99));
  for (std::size_t k = 0; k < found.size(); ++k)
    ASSERT_EQ(found[k], picture.gel->background.levels[k]) << k;
  std::vector<float> height(12 * 16, 1);
  camera.read_height(height);
  EXPECT_EQ(height, std::vector<float>(12 * 16, 0));
}

TEST(GelCamera, AveragesTheBackgroundOverLargerPixels) {
  const PictureDescription picture = picture_of(random_gel(2), 6, 4);
  const GelColour<double> colour(*picture.gel, 6, 4);
  const std::vector<float>& given = picture.gel->background.levels;
  double sum = 0;  // of pixel (1, 2), green
  for (int i = 2; i < 4; ++i)
    for (int j = 8; j < 12; ++j) sum += given[std::size_t((i * 16 + j) * 3 + 1)];
  EXPECT_NEAR(colour.background(1)[4 + 2], sum / 8, 1e-5);
}

TEST(GelCamera, ShowsTheNormalsOfABall) {
  Gel gel;
  gel.lamps[1][2][0] = 200;  // n_z - 1
  gel.background = {1, 1, {200, 200, 200}};
  GelCamera<double> camera = camera_of<double>(picture_of(gel, 300, 300), 30, 30);
  const double deepest = 1.6e-3, reach = 0.8 * 2.7e-3;  // of a contact of 2.7 mm or more
  const Numbers found = colours<double>(camera, ball<double>(30, 30, 0, 0, deepest));
  int compared = 0;
  for (int i = 0; i < 300; ++i)
    for (int j = 0; j < 300; ++j) {
      const double pixel = 0.1 * kPitch, distance = std::hypot(i - 149.5, j - 149.5) * pixel;
      if (distance > reach) continue;
      ++compared;
      const double n_z = found[std::size_t(3 * (300 * i + j) + 1)] / 200;
      ASSERT_NEAR(n_z, std::sqrt(1 - distance * distance / (kImprintRadius * kImprintRadius)),
                  0.005)
          << distance;
    }
  EXPECT_GT(compared, 5000);
}

/// A camera of the surface of a layer, which is blurred over several points.
GelCamera<double> layer_camera(const Gel& gel, int rows, int cols) {
  const PictureDescription picture = picture_of(gel, 24, 32);
  return {picture_grid(picture, rows, cols, kPitch, kPitch), picture, 0, Outside::nearest};
}

TEST(GelCamera, ContinuesTheSurfaceOfALayerBeyondItsPoints) {
  GelCamera<double> camera = layer_camera(random_gel(8), 9, 12);
  camera.set_surface(Numbers(9 * 12, 3e-4));
  Numbers height(24 * 32), picture(3 * height.size());
  camera.read_height(height);
  for (const double h : height) ASSERT_NEAR(h, 3e-4, 1e-15);
  camera.read(false, std::span<double>(picture));
  GelCamera<double> untouched = layer_camera(random_gel(8), 9, 12);
  const Numbers background = colours<double>(untouched, Numbers(9 * 12));
  for (std::size_t k = 0; k < picture.size(); ++k) ASSERT_NEAR(picture[k], background[k], 1e-6);
}

TEST(GelCamera, PullsBackToTheSurfaceOfALayer) {
  GelCamera<double> camera = layer_camera(random_gel(9), 9, 12);
  testing::Random random(10);
  Numbers surface(9 * 12), height(24 * 32), height_bar(height.size()), surface_bar(surface.size());
  for (double& x : surface) x = random.uniform(-1, 1);
  for (double& x : height_bar) x = random.uniform(-1, 1);
  camera.set_surface(surface);
  camera.read_height(height);
  camera.pull_back(false, height_bar, {}, surface_bar);
  double along = 0, transposed = 0;
  for (std::size_t k = 0; k < height.size(); ++k) along += height_bar[k] * height[k];
  for (std::size_t k = 0; k < surface.size(); ++k) transposed += surface_bar[k] * surface[k];
  EXPECT_NEAR(along, transposed, 1e-12 * double(height.size()));
  EXPECT_GT(std::abs(along), 1e-3);
}

/// What is odd in an axis changes its sign with it.
Gel mirrored(Gel gel, int rows, int cols, bool upside_down) {
  const std::size_t odd = upside_down ? 1 : 0;
  const std::size_t place = upside_down ? 2 : 1;
  for (auto& channel : gel.lamps)
    for (std::size_t j = 0; j < kShades; ++j) {
      const bool flips = j == odd || j == 4 || j == 6 + odd;
      for (std::size_t k = 0; k < kShadePlaces; ++k)
        if (flips != (k == place)) channel[j][k] = -channel[j][k];
    }
  const std::vector<float> given = gel.background.levels;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j)
      for (int c = 0; c < 3; ++c)
        gel.background.levels[std::size_t((i * cols + j) * 3 + c)] = given[std::size_t(
            ((upside_down ? rows - 1 - i : i) * cols + (upside_down ? j : cols - 1 - j)) * 3 + c)];
  return gel;
}

class MirroredPress : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Axes, MirroredPress, ::testing::Bool());

TEST_P(MirroredPress, GivesTheMirroredPicture) {
  const bool down = GetParam();
  const Gel gel = random_gel(3);
  GelCamera<float> plain = camera_of<float>(picture_of(gel, 12, 16), 21, 28),
                   other =
                       camera_of<float>(picture_of(mirrored(gel, 12, 16, down), 12, 16), 21, 28);
  const auto a = bytes(plain, ball<float>(21, 28, 1e-3, 6e-4)),
             b = bytes(other, ball<float>(21, 28, down ? 1e-3 : -1e-3, down ? -6e-4 : 6e-4));
  int changed = 0;
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j < 16; ++j)
      for (int c = 0; c < 3; ++c) {
        const int row = down ? 11 - i : i, col = down ? j : 15 - j;
        const int found = b[std::size_t((row * 16 + col) * 3 + c)],
                  expected = a[std::size_t((i * 16 + j) * 3 + c)];
        ASSERT_NEAR(found, expected, 1) << i << " " << j << " " << c;
        changed +=
            std::abs(expected - int(gel.background.levels[std::size_t((i * 16 + j) * 3 + c)])) > 5;
      }
  EXPECT_GT(changed, 50);
}

TEST(GelCamera, IsLinearInItsLamps) {
  Gel gel = random_gel(4), twice = gel;
  for (auto& channel : twice.lamps)
    for (auto& shade : channel)
      for (double& number : shade) number *= 2;
  GelColour<double> one(gel, 12, 16), two(twice, 12, 16);
  testing::Random random(5);
  Numbers p(16), q(16), up(16), a(48), b(48);
  for (std::size_t k = 0; k < 16; ++k) p[k] = random.uniform(-1, 1), q[k] = random.uniform(-1, 1);
  one.shade(3, p, q, a, up), two.shade(3, p, q, b, up);
  const auto background = one.background(3);
  for (std::size_t k = 0; k < 48; ++k)
    EXPECT_NEAR(b[k] - background[k], 2 * (a[k] - background[k]), 1e-6);
}

TEST(GelCamera, MovesPrintedMarkersWithTheField) {
  for (const double radius : {6.0, 2.0}) {
    PictureDescription picture = picture_of(grey_gel(200), 240, 320);
    picture.markers = {9, 7};
    const double pixel = kPitch * 30 / 240;
    picture.marker_radius = radius * pixel;
    GelCamera<double> camera = camera_of<double>(picture, 30, 40);
    const double dx = 3.3, dy = -2.6;  // [pixels]
    Numbers moved;
    for (int k = 0; k < 30 * 40; ++k) moved.insert(moved.end(), {dx * pixel, dy * pixel});
    camera.move_markers(moved);
    const Numbers found = colours<double>(camera, Numbers(30 * 40), true);
    for (int r = 0; r < 7; ++r)
      for (int c = 0; c < 9; ++c) {
        const double x = (c + 0.5) * 320 / 9 + dx, y = (r + 0.5) * 240 / 7 + dy;
        double sum = 0, along = 0, down = 0;
        for (int i = int(y) - 12; i < int(y) + 12; ++i)
          for (int j = int(x) - 12; j < int(x) + 12; ++j) {
            const double dark = 200 - std::round(found[std::size_t(3 * (320 * i + j))]);
            sum += dark, along += dark * (j + 0.5), down += dark * (i + 0.5);
          }
        EXPECT_NEAR(along / sum, x, radius > 5 ? 0.03 : 0.06);
        EXPECT_NEAR(down / sum, y, radius > 5 ? 0.03 : 0.06);
      }
  }
}

TEST(GelCamera, DrawsNoiseByPixelAndStepAndGainsByEpisode) {
  PictureDescription picture = picture_of(grey_gel(100), 60, 80);
  picture.noise = 2, picture.gain = 0.05;
  GelCamera<double> camera = camera_of<double>(picture, 9, 12);
  const auto drawn = [&](const CameraKey& key) {
    camera.set_draws(key);
    return colours<double>(camera, Numbers(108));
  };
  const auto moments = [](const Numbers& x, std::size_t channel) {
    double sum = 0, squares = 0;
    for (std::size_t k = channel; k < x.size(); k += 3) sum += x[k], squares += x[k] * x[k];
    const double n = double(x.size()) / 3, mean = sum / n;
    return std::array{mean, std::sqrt(squares / n - mean * mean)};
  };
  const Numbers first = drawn({7, 3, 10});
  EXPECT_EQ(first, drawn({7, 3, 10}));
  const Numbers later = drawn({7, 3, 11}), other = drawn({7, 4, 10});
  const std::array<double, 3> gains = camera_gains({7, 3, 0}, 0.05);
  for (std::size_t c = 0; c < 3; ++c) {
    for (const Numbers& x : {first, later}) {
      EXPECT_NEAR(moments(x, c)[0], 100 * gains[c], 0.15);
      EXPECT_NEAR(moments(x, c)[1], 2, 0.1);
    }
    EXPECT_GT(std::abs(moments(other, c)[0] - moments(first, c)[0]), 0.3);
    EXPECT_GT(std::abs(gains[c] - 1), 1e-3);
  }
  EXPECT_NE(first, later);
}

TEST(GelCamera, HasBytesOfZeroForWhatIsNotANumber) {
  GelCamera<float> camera = camera_of<float>(picture_of(grey_gel(100), 12, 16), 9, 11);
  const std::vector<std::uint8_t> found = bytes(camera, std::vector<float>(99, NAN));
  EXPECT_EQ(found, std::vector<std::uint8_t>(3 * 12 * 16, 0));
}

/// The bytes are the same on every instruction set and machine.
TEST(GelCamera, HasTheSameBytesEverywhere) {
  PictureDescription picture = picture_of(default_gel(), 48, 64);
  picture.noise = 1.5;
  GelCamera<float> camera = camera_of<float>(picture, 18, 24);
  camera.set_draws({1, 2, 3});
  const auto found = bytes(camera, ball<float>(18, 24, 7e-4, 1e-4));
  EXPECT_EQ(hash_bytes(std::as_bytes(std::span(found))), 4940634401793582955U);
}

TEST(GelCamera, PullsBackToTheDepth) {
  PictureDescription picture = picture_of(random_gel(6), 24, 32);
  picture.markers = {3, 2};
  picture.gain = 0.1;
  GelCamera<double> camera = camera_of<double>(picture, 12, 16, 1e-3);
  camera.set_draws({1, 1, 1});
  const Numbers depth = ball<double>(12, 16, 1e-4, -3e-4, 1e-3);
  testing::Random random(7);
  Numbers colour_bar(3 * 24 * 32), height_bar(24 * 32);
  for (double& x : colour_bar) x = random.uniform(-1, 1);
  for (double& x : height_bar) x = 1e5 * random.uniform(-1, 1);
  const auto loss = [&](const Numbers& at) {
    const Numbers picture_of_it = colours<double>(camera, at, true);
    Numbers height(height_bar.size());
    camera.read_height(height);
    double sum = 0;
    for (std::size_t k = 0; k < colour_bar.size(); ++k) sum += colour_bar[k] * picture_of_it[k];
    for (std::size_t k = 0; k < height.size(); ++k) sum += height_bar[k] * height[k];
    return sum;
  };
  camera.set_depth(depth);
  Numbers surface_bar(depth.size()), depth_bar(depth.size());
  camera.pull_back(true, height_bar, colour_bar, surface_bar);
  camera.pull_back_depth(surface_bar, depth_bar);
  double largest = 0;
  for (const double x : depth_bar) largest = std::max(largest, std::abs(x));
  int contacts = 0;
  for (std::size_t k = 0; k < depth.size(); ++k) {
    if (depth_bar[k] == 0) continue;
    ++contacts;
    Numbers more = depth, less = depth;
    more[k] += 1e-8, less[k] -= 1e-8;
    EXPECT_NEAR(depth_bar[k], (loss(more) - loss(less)) / 2e-8, 1e-5 * largest) << k;
  }
  EXPECT_GT(contacts, 15);
}

/// By the motion of printed markers, with discs that overlap and others that leave the picture.
TEST(GelCamera, PullsBackToTheMotionOfItsMarkers) {
  PictureDescription picture = picture_of(random_gel(6), 24, 32);
  picture.markers = {4, 3};
  picture.marker_radius = 1.2e-3;
  picture.gain = 0.1;
  GelCamera<double> camera = camera_of<double>(picture, 12, 16, 1e-3);
  camera.set_draws({1, 1, 1});
  const Numbers depth = ball<double>(12, 16, 1e-4, -3e-4, 1e-3);
  testing::Random random(8);
  Numbers colour_bar(3 * 24 * 32), moved(2 * 12 * 16);
  for (double& x : colour_bar) x = random.uniform(-1, 1);
  for (double& x : moved) x = 3e-4 * random.uniform(-1, 1);
  const auto loss = [&](const Numbers& at) {
    camera.move_markers(at);
    const Numbers seen = colours<double>(camera, depth, true);
    double sum = 0;
    for (std::size_t k = 0; k < seen.size(); ++k) sum += colour_bar[k] * seen[k];
    return sum;
  };
  static_cast<void>(loss(moved));
  Numbers surface_bar(depth.size()), moved_bar(moved.size());
  camera.pull_back(true, {}, colour_bar, surface_bar, moved_bar);
  double largest = 0;
  for (const double x : moved_bar) largest = std::max(largest, std::abs(x));
  EXPECT_GT(largest, 1e3);
  for (std::size_t k = 0; k < moved.size(); ++k) {
    Numbers more = moved, less = moved;
    more[k] += 1e-9, less[k] -= 1e-9;
    EXPECT_NEAR(moved_bar[k], (loss(more) - loss(less)) / 2e-9, 1e-5 * largest) << k;
  }
}

/// Colours follow from the blurred surface, heights from the surface itself.
TEST(GelCamera, HeightsAreNotBlurred) {
  Gel gel = grey_gel(100);
  gel.blur = 5e-4;
  const Numbers depth = ball<double>(30, 40, 0, 0, 1e-3);
  const auto highest = [&](double blur) {
    gel.blur = blur;
    PictureDescription picture = picture_of(gel, 60, 80);
    GelCamera<double> camera = camera_of<double>(picture, 30, 40);
    camera.set_depth(depth);
    Numbers height(60 * 80);
    camera.read_height(height);
    return *std::max_element(height.begin(), height.end());
  };
  EXPECT_EQ(highest(5e-4), highest(0));
  EXPECT_NEAR(highest(5e-4), *std::max_element(depth.begin(), depth.end()), 3e-5);
}

}  // namespace
}  // namespace tangere
