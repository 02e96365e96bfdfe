// SPDX-License-Identifier: Apache-2.0
// Tests readings in the rows of a task's environments: each is, bit for bit, what a data set of the
// same episodes has, and stays while its environment stands still.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/tasks/episode_recorder.hpp"
#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using testing::task_named;
using ::testing::ThrowsMessage;

constexpr int kShownTogether = 19;  // two blocks

VectorOptions with_readings(std::vector<TimedName> readings) {
  VectorOptions options;
  options.seed = 4;
  options.autoreset = false;
  options.readings = std::move(readings);
  return options;
}

/// The bytes of each reading of each environment, row after row until its episode is over.
std::vector<std::vector<std::string>> play_readings(const Task& task, const VectorOptions& options,
                                                    int actions) {
  VectorTask vector(task, kShownTogether, options);
  const Policy policy(task, PolicyKind::scripted);
  std::vector<double> chosen(kShownTogether * task.spec().action.size());
  std::vector<std::vector<std::string>> bytes(kShownTogether,
                                              std::vector<std::string>(vector.readings().size()));
  std::vector<std::uint8_t> over(kShownTogether);
  for (int t = 0; t <= actions; ++t) {
    if (t > 0) {
      policy.act(vector, chosen);
      vector.step(chosen);
    }
    for (std::size_t e = 0; e < kShownTogether; ++e) {
      if (over[e] != 0) continue;
      for (std::size_t k = 0; k < vector.readings().size(); ++k) {
        const std::size_t width = vector.readings()[k].width();
        bytes[e][k] += testing::bytes_of(vector.reading(k).subspan(e * width, width));
      }
      over[e] = vector.terminated()[e] | vector.truncated()[e];
    }
  }
  return bytes;
}

/// `first`: place of the first reading among the observations of a data set.
void expect_those_of_episodes(const std::string& name, const std::vector<TimedName>& readings,
                              std::size_t first) {
  const auto task = task_named(name);
  EpisodeOptions o;
  o.episodes = kShownTogether;
  o.seed = 4;
  o.precision = Precision::mixed;
  o.record = {{"q"}};
  o.record.insert(o.record.end(), readings.begin(), readings.end());
  testing::Recorder recorder(task->spec().horizon);
  const Policy policy(*task, PolicyKind::scripted);
  run_episodes(*task, policy, o, recorder);
  VectorOptions options = with_readings(readings);
  for (const int threads : {1, 2}) {
    options.threads = threads;
    const auto found = play_readings(*task, options, task->spec().horizon);
    for (int e = 0; e < kShownTogether; ++e)
      for (std::size_t k = 0; k < readings.size(); ++k)
        EXPECT_TRUE(found[std::size_t(e)][k] ==
                    recorder.episodes.at(e).observations[first + k].substr(
                        0, found[std::size_t(e)][k].size()))
            << name << ", episode " << e << ", reading " << k;
  }
}

TEST(RowReadings, AreThoseOfADataSet) {
  expect_those_of_episodes("box_pushing", {{"pad", {1}}, {"pad.pressure"}, {"pad.sum", {1}}}, 4);
}

TEST(RowReadings, HaveTheActionThatAStartTakes) {
  expect_those_of_episodes("stable_grasp", {{"left_pad.sum", {18}}, {"right_pad", {60}}}, 3);
}

TEST(RowReadings, StayWhileAnEnvironmentStandsStill) {
  const auto task = task_named("box_pushing");
  VectorTask vector(*task, 3, with_readings({{"pad.sum", {1}}}));
  const Policy policy(*task, PolicyKind::scripted);
  std::vector<double> actions(3 * task->spec().action.size());
  for (int t = 0; t < 30; ++t) {
    policy.act(vector, actions);
    vector.step(actions);
  }
  const auto all = [&] {
    return std::vector<float>(vector.reading(0).begin(), vector.reading(0).end());
  };
  const std::vector<float> before = all();
  vector.restart(std::vector<std::uint8_t>{0, 1, 0});
  const std::vector<float> after = all();
  const auto width = std::ptrdiff_t(vector.readings()[0].width());
  for (const std::ptrdiff_t e : {0, 2}) {
    EXPECT_TRUE(std::equal(after.begin() + e * width, after.begin() + (e + 1) * width,
                           before.begin() + e * width));
    EXPECT_TRUE(std::any_of(after.begin() + e * width, after.begin() + (e + 1) * width,
                            [](float x) { return x != 0; }))
        << "the pad does not touch: no test";
  }
  std::fill(actions.begin(), actions.begin() + 3, std::numeric_limits<double>::quiet_NaN());
  vector.step(actions);
  EXPECT_EQ(vector.truncated()[0], 1);
  const std::vector<float> failed = all();
  EXPECT_TRUE(std::all_of(failed.begin(), failed.end(), [](float x) { return std::isfinite(x); }));
  vector.step(std::vector<double>(actions.size(), 0.1));
  const std::vector<float> last = all();
  EXPECT_TRUE(std::equal(last.begin(), last.begin() + width, failed.begin()));
  EXPECT_FALSE(std::equal(last.begin() + 2 * width, last.end(), failed.begin() + 2 * width));
}

TEST(RowReadings, AreOfSensorsThatTheTaskDoesNotObserve) {
  const auto task = task_named("box_pushing");
  const auto refused = [&](const TimedName& reading, const std::string& message) {
    EXPECT_THAT([&] { VectorTask(*task, 1, with_readings({reading})); },
                ThrowsMessage<InputError>(HasSubstr(message)));
  };
  refused({"tactile"}, "reading 'tactile' of task 'box_pushing'; expected one of a sensor of its");
  refused({"pda"}, "reading 'pda' of task 'box_pushing'; expected one of a sensor");
  refused({"pad", {3}}, "'pad/3', and a row is every 5 steps; expected a divisor of 5");
  refused({"pad", {10}}, "'pad/10' of a task; expected 'pad', which is in every row, or a window");
  refused({"pad.markers"}, "sensor 'pad' has no <markers>");
  EXPECT_THAT(
      [&] {
        VectorTask(*task, 1, with_readings({{"pad"}, {"pad", {1}}}));
      },
      ThrowsMessage<InputError>(HasSubstr("reading 'pad' is listed twice")));
}

}  // namespace
}  // namespace tangere
