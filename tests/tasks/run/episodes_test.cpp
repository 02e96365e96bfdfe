// SPDX-License-Identifier: Apache-2.0
// Tests that episodes from many threads equal, bit for bit, those that one stepper steps by hand.
#include "tasks/run/episodes.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "tests/tasks/episode_by_hand.hpp"

namespace tangere {
namespace {

using namespace testing;

/// A ball far from the pad that a motor turns ever faster. Some episodes start with so much spin
/// that a step soon turns by more than half a turn, which has no solution.
Model with_failing_spinner() {
  Scene scene = small_scene();
  LinkDescription link;
  link.name = "spinner";
  link.joint.name = "spinner_joint";
  link.joint.type = JointType::free;
  link.joint.pose.position = {1, 0, 1};
  link.body.name = "spinner";
  link.body.shape = SphereShape{0.02};
  link.body.density = 1000;
  scene.links.push_back(link);
  // I = 5.4e-6 kg m²: 0.005 N m adds 4.7 rad/s per step of 5 ms; π per step is 628 rad/s.
  MotorDescription motor;
  motor.joint = "spinner_joint";
  motor.low = -0.005;
  motor.high = 0.005;
  scene.motors.push_back(motor);
  scene.control = ConstantControl{{0, 0, 0.2, 0, 0, 0, 1, 0, 0}};
  RandomizationDescription spin;
  spin.number = {NumberOwner::joint, NumberField::v, "spinner_joint", 3};
  spin.distribution.kind = Distribution::Kind::list;
  spin.distribution.values = {-600, -600, -600, 300};
  scene.randomizations.push_back(spin);
  return Model(scene);
}

template <class T>
void expect_as_by_hand(const Model& model, const EpisodeOptions& o, const Recorder& recorder) {
  ASSERT_EQ(std::ssize(recorder.episodes), o.episodes);
  for (const std::int64_t e : {std::int64_t{0}, std::int64_t{1}, std::int64_t{15}, std::int64_t{16},
                               std::int64_t{37}, o.episodes - 1}) {
    const RecordedEpisode expected = ByHand<T>(model, o, e).episode;
    const RecordedEpisode& found = recorder.episodes.at(e);
    EXPECT_EQ(found.actions == expected.actions, true) << "actions of episode " << e;
    ASSERT_EQ(found.observations.size(), expected.observations.size());
    for (std::size_t name = 0; name < expected.observations.size(); ++name) {
      ASSERT_EQ(found.observations[name].size(), expected.observations[name].size());
      EXPECT_TRUE(found.observations[name] == expected.observations[name])
          << "observation " << name << " of episode " << e;
    }
  }
}

/// Whether the last field of an episode has anything but zeros.
bool touched(const RecordedEpisode& episode, std::size_t points, std::size_t number_bytes) {
  const std::string& all = episode.observations.at(2);
  const std::string last = all.substr(all.size() - 3 * points * number_bytes);
  return std::any_of(last.begin(), last.end(), [](char c) { return c != 0; });
}

TEST(Episodes, AreThoseSteppedByHand) {
  Recorder recorder(kRows);
  const EpisodeSummary summary = run(small_ball(), options(), recorder);
  EXPECT_FALSE(recorder.single);
  EXPECT_TRUE(touched(recorder.episodes.at(3), 1024, 8)) << "the pad does not touch: no test";
  expect_as_by_hand<double>(small_ball(), options(), recorder);
  EXPECT_EQ(recorder.episodes.at(0).observations[0].size(), (kRows + 1) * 10 * sizeof(double));
  EXPECT_EQ(recorder.episodes.at(0).actions.size(), kRows * 3 * sizeof(float));
  EXPECT_EQ(summary.episodes, kEpisodes);
  EXPECT_EQ(summary.rows, kEpisodes * kRows);
  EXPECT_EQ(summary.environment_steps, kEpisodes * kSteps);
  EXPECT_GE(summary.counts.newton_iterations, summary.environment_steps);
  EXPECT_EQ(recorder.steps, (EpisodeSteps{kEpisodes * kSteps, 0, 0}));
  EXPECT_FALSE(summary.stopped);
  EXPECT_THAT(summary.failures, ::testing::IsEmpty());
}

TEST(Episodes, InMixedPrecisionLeaveAsSingles) {
  const EpisodeOptions o = options(2, Precision::mixed);
  Recorder recorder(kRows);
  run(small_ball(), o, recorder);
  EXPECT_TRUE(recorder.single);
  EXPECT_TRUE(touched(recorder.episodes.at(3), 1024, 4));
  expect_as_by_hand<float>(small_ball(), o, recorder);
}

TEST(Episodes, OfPadsThatAreReadSixteenAtATimeAreTheSame) {
  Scene scene = small_scene();
  scene.sensors[0].array.rows = scene.sensors[0].array.cols = 12;  // below Readout::kSmallPad
  scene.sensors.push_back(scene.sensors[0]);
  scene.sensors.back().name = "second";
  scene.sensors.back().array.cols = 40;
  const Model model(scene);
  for (const Precision precision : {Precision::f64, Precision::mixed}) {
    const EpisodeOptions o = options(2, precision);
    Recorder recorder(kRows);
    run(model, o, recorder);
    ASSERT_EQ(recorder.episodes.at(0).observations.size(), 4U);
    if (precision == Precision::f64)
      expect_as_by_hand<double>(model, o, recorder);
    else
      expect_as_by_hand<float>(model, o, recorder);
  }
}

TEST(Episodes, WithEndEffectorsHaveThemBeforeTheSensors) {
  Scene scene = small_scene();
  for (const char* joint : {"ball_joint", "pad_joint"}) {
    EndEffectorDescription& v = scene.end_effectors.emplace_back();
    v.name = v.joint = joint;
    v.position = {0.01, 0.02, 0.03};
  }
  const Model model(scene);
  for (const Precision precision : {Precision::f64, Precision::mixed}) {
    EpisodeOptions o = options(2, precision);
    o.piece_bytes = 1 << 20;
    Recorder recorder(kRows);
    run(model, o, recorder);
    const RecordedEpisode& episode = recorder.episodes.at(37);
    ASSERT_EQ(episode.observations.size(), 4U);
    const std::string& positions = episode.observations[2];
    const std::size_t row = 6 * (precision == Precision::f64 ? sizeof(double) : sizeof(float));
    ASSERT_EQ(positions.size(), (kRows + 1) * row);
    EXPECT_NE(positions.substr(0, row), positions.substr(kRows * row)) << "nothing moves: no test";
    if (precision == Precision::f64)
      expect_as_by_hand<double>(model, o, recorder);
    else
      expect_as_by_hand<float>(model, o, recorder);
  }
}

struct Way {
  int threads, blocks_in_flight;
  std::size_t piece_bytes;
};
void PrintTo(const Way& w, std::ostream* out) {
  *out << w.threads << " threads, " << w.blocks_in_flight << " blocks, " << w.piece_bytes
       << " bytes";
}

class EpisodeWays : public ::testing::TestWithParam<Way> {
 public:
  static const Recorder& one_by_one(Precision precision) {
    static Recorder f64(kRows), mixed(kRows);
    Recorder& recorder = precision == Precision::f64 ? f64 : mixed;
    EpisodeOptions o = options(1, precision);
    o.blocks_in_flight = 1;
    if (recorder.pieces == 0) run(small_ball(), o, recorder);
    return recorder;
  }
};

TEST_P(EpisodeWays, GiveTheSameBits) {
  for (const Precision precision : {Precision::f64, Precision::mixed}) {
    EpisodeOptions o = options(GetParam().threads, precision);
    o.blocks_in_flight = GetParam().blocks_in_flight;
    o.piece_bytes = GetParam().piece_bytes;
    Recorder recorder(kRows);
    const EpisodeSummary summary = run(small_ball(), o, recorder);
    EXPECT_TRUE(recorder.episodes == one_by_one(precision).episodes) << to_string(precision);
    EXPECT_EQ(std::ssize(recorder.episodes), kEpisodes);
    EXPECT_EQ(recorder.finished.size(), 5U);
    EXPECT_GE(summary.peak_blocks_in_flight, 1);
    EXPECT_LE(summary.peak_blocks_in_flight, o.blocks_in_flight);
    // A row of 16 episodes takes 400 kB in double; pieces of one row are the smallest there are.
    if (o.piece_bytes == 1) {
      EXPECT_EQ(recorder.most_rows, 1);
      EXPECT_EQ(recorder.pieces, 5 * (kRows + 1));
    } else if (o.piece_bytes == std::size_t{1} << 21) {
      EXPECT_GT(recorder.most_rows, 1);
      EXPECT_GT(recorder.pieces, 5);
    } else {
      EXPECT_EQ(recorder.pieces, 5);
    }
  }
}

constexpr std::size_t kWhole = std::size_t{1} << 28, kSome = std::size_t{1} << 21;
INSTANTIATE_TEST_SUITE_P(All, EpisodeWays,
                         ::testing::Values(Way{1, 1, 1}, Way{1, 2, kSome}, Way{1, 5, kWhole},
                                           Way{2, 1, kSome}, Way{2, 2, 1}, Way{2, 5, kSome},
                                           Way{4, 1, kWhole}, Way{4, 2, kSome}, Way{4, 5, 1},
                                           Way{4, 5, kWhole}));

TEST(Episodes, ThatFailAreReportedWithTheStateBeforeAndDisturbNobody) {
  const Model model = with_failing_spinner();
  const ControlProgram controls(model, model.timestep(), kSeed);
  for (const int threads : {1, 4}) {
    EpisodeOptions o = options(threads);
    o.episodes = 40;
    o.piece_bytes = 1;  // failures come up in the middle of a block
    Recorder recorder(kRows);
    const EpisodeSummary summary = run(model, o, recorder);
    std::size_t failures = 0;
    std::int64_t steps = 0;
    for (std::int64_t e = 0; e < o.episodes; ++e) {
      const ByHand<double> expected(model, o, e);
      steps += expected.steps;
      if (expected.failure.empty()) {
        EXPECT_TRUE(recorder.episodes.at(e) == expected.episode) << "episode " << e;
        EXPECT_FALSE(recorder.failures.contains(e));
        continue;
      }
      const FailedEpisode& by_hand = expected.failure[0];
      ASSERT_TRUE(recorder.failures.contains(e)) << "episode " << e;
      ASSERT_LT(failures, summary.failures.size());
      for (const FailedEpisode& found : {recorder.failures.at(e), summary.failures[failures]}) {
        EXPECT_EQ(found.episode, e);
        EXPECT_EQ(found.step, by_hand.step);
        EXPECT_EQ(found.status, by_hand.status);
        EXPECT_EQ(found.q, by_hand.q);
        EXPECT_EQ(found.v, by_hand.v);
      }
      EXPECT_GT(by_hand.step, 0) << "it failed at once: the state before is the first one";
      ++failures;
    }
    EXPECT_EQ(summary.failures.size(), failures);
    EXPECT_GT(failures, 0U);
    EXPECT_LT(failures, 40U);
    EXPECT_EQ(summary.episodes, 40);
    EXPECT_EQ(summary.rows, (40 - static_cast<std::int64_t>(failures)) * kRows);
    EXPECT_EQ(summary.environment_steps, steps);
  }
}

TEST(Episodes, ActionsAreClippedAndRandomControlsDifferByEpisode) {
  EpisodeOptions o = options();
  o.episodes = 3;
  o.steps = 4;
  o.every = 2;
  CsvControl table{{{2, 0, -7}, {3, 0, -1}, {0, 0.1, 0}, {0, 0.1, 0}}, "u.csv"};  // 2 and 3: both 1
  Recorder clipped(2);
  run_episodes(small_ball(), {}, ControlProgram(small_ball(), 5e-3, kSeed, table), o, clipped);
  const std::vector<float> expected{1, 0, -1, 0, 0.1F, 0};
  EXPECT_EQ(clipped.episodes.at(2).actions, bytes_of(std::span<const float>(expected)));

  o.every = 1;
  Recorder random(4);
  const ControlProgram noise(small_ball(), 5e-3, kSeed, RandomControl{1, 0.01});
  run_episodes(small_ball(), {}, noise, o, random);
  EXPECT_NE(random.episodes.at(0).actions, random.episodes.at(1).actions);
  std::vector<double> u(3);
  noise.evaluate(0, 2, u);
  const std::vector<float> first(u.begin(), u.end());
  EXPECT_EQ(random.episodes.at(2).actions.substr(0, 12), bytes_of(std::span<const float>(first)));
}

/// Targets are kept as they are, and clipped to a range of u.
TEST(Episodes, ActionsHaveTheBoundsOfTheirMotors) {
  Scene scene = small_ball().scene();
  MotorDescription& motor = scene.motors.at(0);
  motor.scale = 0.1, motor.u_range = {-20, 255};
  const Model model(scene);
  EpisodeOptions o = options();
  o.episodes = 1;
  o.steps = 2;
  o.every = 1;
  const CsvControl table{{{2, 0, -70}, {300, 0, -10}}, "u.csv"};
  Recorder recorder(2);
  run_episodes(model, {}, ControlProgram(model, 5e-3, kSeed, table), o, recorder);
  const std::vector<float> expected{2, 0, -20, 255, 0, -10};
  EXPECT_EQ(recorder.episodes.at(0).actions, bytes_of(std::span<const float>(expected)));
}

TEST(Episodes, SolverOptionsReachTheStepper) {
  EpisodeOptions o = options();
  o.episodes = 1;
  Recorder fine(kRows), coarse(kRows);
  run(small_ball(), o, fine);
  StepperOptions solver;
  solver.timestep = 1e-2;
  run_episodes(small_ball(), solver, ControlProgram(small_ball(), 1e-2, kSeed), o, coarse);
  EXPECT_FALSE(fine.episodes == coarse.episodes);
}

}  // namespace
}  // namespace tangere
