// SPDX-License-Identifier: Apache-2.0
// Tests readings of tactile fields: every way of reading gives the same numbers, in either
// precision, wherever the environment is in the batch.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/base/error.hpp"
#include "engine/sense/readout.hpp"
#include "kernels/numbers/lanes.hpp"
#include "kernels/numbers/so3.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using kernels::Vec3;

/// Puts the ball under the pad of environment e, sunk by `depth` [m], turning and sliding, `far`
/// [m] away from the origin.
void press(Batch& batch, int e, double depth, double where, double far = 0) {
  std::vector<double> q = testing::q_of(batch, e), v = testing::v_of(batch, e);
  q[0] = far, q[1] = -far, q[2] = -0.015 - depth + far;
  q[3] = far + 8e-3 * std::sin(where), q[4] = -far + 5e-3 * std::cos(2 * where), q[5] = far;
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = 0.05 * std::sin(where + double(i));
  batch.set_state(e, q, v);
}

/// Environments with the ball at different places and depths, some without contact.
Batch pressed(const Model& model, int environments, int moment = 0) {
  Batch batch(model, environments);
  for (int e = 0; e < environments; ++e)
    press(batch, e, (e + moment) % 5 == 4 ? -1e-3 : 2e-4 * (1 + e % 5), double(e) + 0.7 * moment);
  return batch;
}

template <class T>
std::vector<T> field(Readout& readout, const Batch& batch, int environment) {
  std::vector<T> force(std::size_t(3 * batch.model().sensors()[0].points), T(-3));
  readout.tactile(batch, environment, 0, force);
  return force;
}

template <class T>
std::vector<T> values(const DenseFrame<T>& frame) {
  return {frame.values().begin(), frame.values().end()};
}
template <class T>
std::vector<T> values(const CompactFrame<T>& frame) {
  std::vector<T> dense(frame.dense_size(), T(-3));
  frame.expand(dense);
  return dense;
}

struct Reading {
  Precision precision;
  int resolution;  ///< 20² points are a small pad, 27² a large one with edge tiles
};
class TactileReading : public ::testing::TestWithParam<Reading> {};

/// Compares frames that are reused from reading to reading, alone and by blocks, with fields read
/// whole.
template <class Frame, class T>
void check_frames(const Reading& c, int environments) {
  const Model model(testing::rolling_ball(false, c.resolution));
  Readout readout(model, c.precision);
  Frame alone(model, 0);
  std::vector<Frame> block;
  for (int e = 0; e < environments; ++e) block.emplace_back(model, 0);
  for (int moment = 0; moment < 6; ++moment) {
    const Batch batch = pressed(model, environments, moment);
    for (int e = 0; e < environments; ++e) {
      readout.read(batch, e, alone);
      EXPECT_EQ(values(alone), field<T>(readout, batch, e))
          << "environment " << e << ", moment " << moment;
    }
    for (int b = 0; b < batch.blocks(); ++b) {
      const std::size_t first = std::size_t(b * kernels::kBlock);
      const std::size_t count = std::min(block.size() - first, std::size_t(kernels::kBlock));
      readout.read_block(batch, b, std::span(block).subspan(first, count));
    }
    for (int e = 0; e < environments; ++e)
      EXPECT_EQ(values(block[std::size_t(e)]), field<T>(readout, batch, e))
          << "environment " << e << " by block";
    // Reads one environment of a block alone in between.
    readout.read(pressed(model, environments, moment + 3), 0, block[0]);
  }
}

TEST_P(TactileReading, FramesHoldTheField) {
  for (const int environments : {1, 11, 19}) {
    check_frames<DenseFrame<double>, double>(GetParam(), environments);
    check_frames<DenseFrame<float>, float>(GetParam(), environments);
    check_frames<CompactFrame<double>, double>(GetParam(), environments);
    check_frames<CompactFrame<float>, float>(GetParam(), environments);
  }
}

template <class T>
void check_blocks(const Reading& c) {
  const Model model(testing::rolling_ball(false, c.resolution));
  Readout readout(model, c.precision);
  const Batch batch = pressed(model, 21);
  std::vector<std::vector<T>> fields(
      16, std::vector<T>(std::size_t(3 * c.resolution * c.resolution), T(-3)));
  const std::vector<T> untouched = fields[0];
  for (int b = 0; b < 2; ++b) {
    std::fill(fields.begin(), fields.end(), untouched);
    const std::vector<std::span<T>> spans(fields.begin(), fields.end());
    readout.read_block(batch, b, {0}, spans);
    for (int l = 0; l < 16; ++l) {
      const int e = 16 * b + l;
      EXPECT_EQ(fields[std::size_t(l)], e < 21 ? field<T>(readout, batch, e) : untouched)
          << "environment " << e;
    }
  }
}
TEST_P(TactileReading, BlocksHoldTheFieldsOfTheirEnvironments) {
  check_blocks<double>(GetParam());
  check_blocks<float>(GetParam());
}

TEST_P(TactileReading, AnEnvironmentReadsTheSameInAnyBatch) {
  const Model model(testing::rolling_ball(false, GetParam().resolution));
  Readout readout(model, GetParam().precision);
  const Batch many = pressed(model, 35);
  for (const int e : {0, 7, 9, 16, 34}) {
    Batch one(model, 1);
    one.set_state(0, testing::q_of(many, e), testing::v_of(many, e));
    EXPECT_EQ(field<float>(readout, one, 0), field<float>(readout, many, e));
  }
}

TEST_P(TactileReading, NumbersAreThoseOfThePrecisionWhateverTheirType) {
  const Model model(testing::rolling_ball(false, GetParam().resolution));
  Readout readout(model, GetParam().precision);
  const Batch batch = pressed(model, 3);
  const std::vector<double> wide = field<double>(readout, batch, 1);
  const std::vector<float> narrow = field<float>(readout, batch, 1);
  bool all_floats = true;
  for (std::size_t k = 0; k < wide.size(); ++k) {
    EXPECT_EQ(narrow[k], static_cast<float>(wide[k]));
    all_floats &= wide[k] == double(narrow[k]);
  }
  EXPECT_EQ(all_floats, GetParam().precision == Precision::mixed);
}

INSTANTIATE_TEST_SUITE_P(Pads, TactileReading,
                         ::testing::Values(Reading{Precision::f64, 20},
                                           Reading{Precision::mixed, 20},
                                           Reading{Precision::f64, 27},
                                           Reading{Precision::mixed, 27}));

TEST(Tactile, MixedPrecisionKeepsAMillionthOfThePeak) {
  const Model model(testing::rolling_ball(false, 200));
  Readout exact(model), mixed(model, Precision::mixed);
  Batch batch(model, 1);
  for (const double far : {0.0, 10.0})
    for (const double depth : {1e-5, 3e-5, 1e-4, 1e-3, 5e-3}) {
      double worst = 0, peak = 0;
      for (int where = 0; where < 10; ++where) {
        press(batch, 0, depth, where, far);
        const std::vector<double> a = field<double>(exact, batch, 0),
                                  b = field<double>(mixed, batch, 0);
        double largest = 0, error = 0;
        for (std::size_t k = 0; k < a.size(); ++k) {
          largest = std::max(largest, std::abs(a[k]));
          error = std::max(error, std::abs(a[k] - b[k]));
        }
        peak = std::max(peak, largest);
        worst = std::max(worst, error / largest);
      }
      EXPECT_GT(peak, 0);
      EXPECT_LT(worst, 1e-6) << far << " m away, " << depth << " m deep";
      RecordProperty(
          "worst_at_" + std::to_string(int(1e6 * depth)) + "um_" + std::to_string(int(far)) + "m",
          std::to_string(1e9 * worst) + "e-9");
    }
}

TEST(Tactile, AFrameNamesTheSensorThatIsMissing) {
  const Model model(testing::rolling_ball(false, 20));
  for (const int sensor : {-1, 1}) {
    EXPECT_THROW(DenseFrame<float>(model, sensor), InputError);
    EXPECT_THROW(CompactFrame<double>(model, sensor), InputError);
  }
}

TEST(Tactile, ForcesOfSeveralBodiesAdd) {
  // A second ball in the same place doubles the field.
  Scene one = testing::rolling_ball(false, 20), two = one;
  two.links.push_back(two.links[1]);
  two.links[2].name = two.links[2].body.name = "twin";
  two.links[2].joint.name = "twin_joint";
  const Model m1(one), m2(two);
  Batch b1(m1, 1), b2(m2, 1);
  std::vector<double> q1 = testing::q_of(b1), q2 = testing::q_of(b2);
  q1[2] = q2[2] = -0.016;
  b1.set_state(0, q1, testing::v_of(b1));
  b2.set_state(0, q2, testing::v_of(b2));
  std::vector<double> f1(1200), f2(1200);
  Readout r1(m1), r2(m2);
  r1.tactile(b1, 0, 0, f1);
  r2.tactile(b2, 0, 0, f2);
  double peak = 0;
  for (std::size_t k = 0; k < f1.size(); ++k) {
    EXPECT_EQ(2 * f1[k], f2[k]);
    peak = std::max(peak, std::abs(f1[k]));
  }
  EXPECT_GT(peak, 0);
}

TEST(Tactile, BodiesReportTheirOwnFrames) {
  // Twists by differences of poses, on a scene with offset and yawed body frames.
  const Model model(testing::two_balls());
  Readout readout(model);
  Batch batch(model, 1);
  std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = 0.3 - 0.1 * double(i % 5);
  const auto poses = [&](double t) {
    std::vector<double> at = q;
    for (std::size_t i = 0; i < 3; ++i)
      at[i] += t * v[i], at[3 + i] += t * v[3 + i], at[10 + i] += t * v[9 + i];
    for (std::size_t ball = 0; ball < 2; ++ball) {
      const std::size_t p = 6 + 7 * ball, w = 6 + 6 * ball;
      const auto turned =
          kernels::rotate_by(kernels::Quat<double>{q[p], q[p + 1], q[p + 2], q[p + 3]},
                             t * Vec3<double>{v[w], v[w + 1], v[w + 2]});
      at[p] = turned.w, at[p + 1] = turned.x, at[p + 2] = turned.y, at[p + 3] = turned.z;
    }
    batch.set_state(0, at, v);
    std::vector<double> pose(21), twist(18);
    readout.bodies(batch, 0, pose, twist);
    return std::pair(pose, twist);
  };
  const double h = 1e-6;
  const auto [now, twist] = poses(0);
  const auto ahead = poses(h).first, behind = poses(-h).first;
  for (std::size_t b = 0; b < 3; ++b) {
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(twist[6 * b + 3 + i], (ahead[7 * b + i] - behind[7 * b + i]) / (2 * h), 1e-9);
    double norm = 0;
    for (std::size_t i = 3; i < 7; ++i) norm += now[7 * b + i] * now[7 * b + i];
    EXPECT_NEAR(norm, 1, 1e-14);
    // ω = 2 q̇ q*, its vector part.
    const auto quat = [&](const std::vector<double>& x) {
      return kernels::Quat<double>{x[7 * b + 3], x[7 * b + 4], x[7 * b + 5], x[7 * b + 6]};
    };
    const auto turn = quat(ahead) * conjugate(quat(behind));
    const double rate[3] = {turn.x / h, turn.y / h, turn.z / h};
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(twist[6 * b + i], rate[i], 1e-8);
  }
  EXPECT_NEAR(now[2], 0.062, 1e-15);  // the plate's body frame sits 2 mm above its joint
}

}  // namespace
}  // namespace tangere
