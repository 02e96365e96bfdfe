// SPDX-License-Identifier: Apache-2.0
// Tests windows of readings within rows: each reading is, bit for bit, what a stepper that is
// stepped by hand reads there, whatever the threads and the pieces.
#include <gmock/gmock.h>

#include <algorithm>
#include <array>

#include "tests/tasks/episode_by_hand.hpp"

namespace tangere {
namespace {

using namespace testing;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr int kRowSteps = 20, kBetween = 5, kWindow = kRowSteps / kBetween;

/// The ball with a sensor whose readings depend on those before, with noise.
Scene imperfect_scene() {
  Scene scene = small_scene();
  SensorImperfections& flaws = scene.sensors[0].imperfections;
  flaws.source = {"s.xml", 3};
  flaws.noise = {2e-4, 1e-4};
  flaws.delay = 0.012, flaws.low_pass = 0.01;
  return scene;
}

EpisodeOptions windowed(const Model& model, Precision precision = Precision::f64) {
  EpisodeOptions o = testing::options(2, precision);
  o.episodes = 18;
  o.every = kRowSteps;
  const std::string pad = std::string(model.sensors()[0].name);
  o.record = {{"q"}, {pad, {kBetween}}, {pad + ".sum", {10}}, {pad + ".shear"}};
  return o;
}

/// Readings of an episode before the first step and after each.
template <class T>
std::vector<std::vector<T>> read_by_hand(const Model& model, const EpisodeOptions& o,
                                         std::int64_t episode, FieldOutput output) {
  Batch batch(model, 1, o.seed, episode);
  Stepper stepper(model);
  Readout readout(model, o.precision);
  const ControlProgram controls(model, model.timestep(), o.seed);
  std::vector<double> u(std::size_t(model.nu()));
  std::vector<std::vector<T>> all;
  const auto read = [&] {
    std::vector<T>& numbers = all.emplace_back(numbers_of(model, output));
    const std::array<std::span<T>, 1> place{std::span<T>(numbers)};
    readout.read_block(batch, 0, output, std::span<const std::span<T>>(place));
  };
  read();
  for (std::int64_t t = 0; t < o.steps; ++t) {
    controls.evaluate(t, episode, u);
    stepper.step(batch, u);
    read();
  }
  return all;
}

/// The bytes of rows of windows.
template <class T>
std::string windows_of(const std::vector<std::vector<T>>& readings, int between) {
  std::string bytes;
  for (std::size_t row = 0; row < readings.size(); row += kRowSteps)
    for (int before = kRowSteps - between; before >= 0; before -= between) {
      const std::size_t step = row < std::size_t(before) ? 0 : row - std::size_t(before);
      bytes += bytes_of(std::span<const T>(readings[step]));
    }
  return bytes;
}

template <class T>
void expect_windows(const Model& model, Precision precision) {
  EpisodeOptions o = windowed(model, precision);
  const std::size_t first = model.end_effectors().empty() ? 2 : 3;
  for (const std::size_t piece : {std::size_t(1), std::size_t(900'000), std::size_t(1) << 25}) {
    o.piece_bytes = piece;
    o.threads = piece == 1 ? 1 : 2;
    Recorder recorder(o.steps / o.every);
    testing::run(model, o, recorder);
    for (const std::int64_t e : {0, 3, 17}) {
      const std::vector<std::string>& found = recorder.episodes.at(e).observations;
      ASSERT_EQ(found.size(), first + 3);
      const auto field = read_by_hand<T>(model, o, e, {0, FieldForm::field}),
                 shear = read_by_hand<T>(model, o, e, {0, FieldForm::shear}),
                 sum = read_by_hand<T>(model, o, e, {0, FieldForm::sum});
      EXPECT_TRUE(found[first] == windows_of(field, kBetween)) << "episode " << e;
      EXPECT_TRUE(found[first + 1] == windows_of(shear, kRowSteps)) << "a reading of each row";
      EXPECT_TRUE(found[first + 2] == windows_of(sum, 10)) << "episode " << e;
      const std::vector<T>& last = field.back();
      EXPECT_TRUE(std::any_of(last.begin(), last.end(), [](T x) { return x != 0; }))
          << "the pad does not touch: no test";
    }
  }
}

TEST(Windows, HoldWhatAStepperByHandReads) {
  expect_windows<double>(small_ball(), Precision::f64);
  expect_windows<float>(small_ball(), Precision::mixed);
}

TEST(Windows, AreThoseOfAnImperfectSensor) {
  expect_windows<float>(Model(imperfect_scene()), Precision::mixed);
}

TEST(Windows, CountInTheMemoryOfARun) {
  EpisodeOptions o = windowed(small_ball());
  o.piece_bytes = 1;  // pieces of one row
  const double with = episode_bytes(small_ball(), o);
  o.record[1].times = {};
  const double without = episode_bytes(small_ball(), o);
  const double reading = 3.0 * small_ball().sensors()[0].points * sizeof(double);
  // Each of the slots has the row and the readings since the last one.
  EXPECT_EQ(with - without, 2 * 16 * reading * (2 * kWindow - 1));
}

TEST(Windows, AreOfDivisorsOfARow) {
  const std::string pad = std::string(small_ball().sensors()[0].name);
  const auto record = [&](TimedName one) {
    EpisodeOptions o = windowed(small_ball());
    o.record = {std::move(one)};
    Recorder recorder(o.steps / o.every);
    testing::run(small_ball(), o, recorder);
  };
  EXPECT_THAT(
      [&] {
        record({pad, {7}});
      },
      ThrowsMessage<InputError>(HasSubstr("'" + pad +
                                          "/7', and a row is every 20 steps; expected a "
                                          "divisor of 20, for a window, or a multiple")));
  EXPECT_THAT(
      [&] {
        record({pad, {30}});
      },
      ThrowsMessage<InputError>(HasSubstr("expected a multiple of 20")));
  EXPECT_THAT(
      [&] {
        record({"q", {5}});
      },
      ThrowsMessage<InputError>(HasSubstr("expected a multiple of 20: windows are of "
                                          "forces")));
}

}  // namespace
}  // namespace tangere
