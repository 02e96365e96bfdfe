// SPDX-License-Identifier: Apache-2.0
// Tests many environments of a task: an episode is the same alone or among others, on any number of
// threads, and ends and starts follow Gymnasium's order.
#include <gmock/gmock.h>

#include <algorithm>
#include <iterator>

#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using testing::play;
using testing::Shown;
using testing::task_named;

class EveryTask : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryTask, DeclaresWhatItDoes) {
  const auto task = task_named(GetParam());
  const TaskSpec& spec = task->spec();
  EXPECT_EQ(spec.name, GetParam());
  EXPECT_FALSE(spec.summary.empty() || spec.success.empty() || spec.action.meaning.empty());
  for (const TensorSpec& o : spec.observations)
    EXPECT_FALSE(o.unit.empty() || o.meaning.empty()) << o.name;
  VectorTask vector(*task, 3);
  EXPECT_EQ(vector.observations().size(), 3 * spec.observation_size());
  EXPECT_THAT(vector.starting(), ::testing::Each(1));
  EXPECT_THAT(vector.rewards(), ::testing::Each(0.0));
  EXPECT_THROW(vector.step(std::vector<double>(1)), InputError);
}

/// Compares the first steps of 100 environments (of 19 if they are expensive) on three threads with
/// some of them played alone on one thread, and with all of them on one.
TEST_P(EveryTask, AnEpisodeIsTheSameAloneOrAmongOthers) {
  const auto task = task_named(GetParam());
  VectorOptions options;
  options.seed = 11;
  options.autoreset = false;  // the next episode depends on the number of environments
  const bool cheap = GetParam() == "dummy" || GetParam() == "box_pushing";
  const bool gel = GetParam().ends_with("_gel");
  const int environments = cheap ? 100 : gel ? 9 : 19;
  const int steps = gel ? 1 : task->spec().steps_per_action > 20 ? 2 : 4;
  options.threads = 3;
  const std::vector<Shown> among = play(*task, PolicyKind::random, environments, steps, options);
  options.threads = 1;
  EXPECT_EQ(play(*task, PolicyKind::random, environments, steps, options), among);
  for (const int e : {0, 7, environments - 1}) {
    options.first_episode = e;
    EXPECT_EQ(play(*task, PolicyKind::random, 1, steps, options)[0], among[std::size_t(e)])
        << "episode " << e;
  }
}

INSTANTIATE_TEST_SUITE_P(Tasks, EveryTask, ::testing::ValuesIn(task_names()),
                         [](const auto& given) { return given.param; });

/// Several threads reset many environments at once. No other episode's draws enter an environment's
/// lane.
TEST(VectorTask, DrawsTheSameStartsOnAnyNumberOfThreads) {
  const auto task = task_named("dummy");
  constexpr int kEnvironments = 1000;
  const auto starts = [&](const VectorTask& vector) {
    std::vector<double> all;
    for (int e = 0; e < kEnvironments; ++e) {
      const auto q = vector.view(e).now().q;
      all.insert(all.end(), q.begin(), q.end());
    }
    return all;
  };
  const std::vector<double> expected = starts(VectorTask(*task, kEnvironments));
  VectorOptions options;
  options.threads = 4;
  VectorTask vector(*task, kEnvironments, options);
  for (int round = 0; round < 30; ++round) {
    const std::vector<double> found = starts(vector);
    const auto differ =
        std::mismatch(expected.begin(), expected.end(), found.begin()).first - expected.begin();
    ASSERT_EQ(differ, std::ssize(expected))
        << "round " << round << ", environment " << differ / task->model().nq();
    vector.reset(0);
  }
}

TEST(VectorTask, StartsTheNextEpisodeInTheStepAfterAnEnd) {
  const auto task = task_named("dummy");
  constexpr int kEnvironments = 5;
  VectorTask vector(*task, kEnvironments);
  const Policy policy(*task, PolicyKind::scripted);
  std::vector<double> actions(kEnvironments);
  const int horizon = task->spec().horizon;
  for (int round = 0; round < 3; ++round) {
    for (int e = 0; e < kEnvironments; ++e) {
      EXPECT_EQ(vector.episodes()[std::size_t(e)], e + round * kEnvironments);
      EXPECT_EQ(vector.starting()[std::size_t(e)], 1);
      EXPECT_EQ(vector.lengths()[std::size_t(e)], 0);
      EXPECT_EQ(vector.rewards()[std::size_t(e)], 0);
    }
    double sum = 0;
    for (int t = 1; t <= horizon; ++t) {
      policy.act(vector, actions);
      vector.step(actions);
      sum += vector.rewards()[2];
      for (std::size_t e = 0; e < kEnvironments; ++e) {
        EXPECT_EQ(vector.truncated()[e], t == horizon);
        EXPECT_EQ(vector.terminated()[e], 0);
        EXPECT_EQ(vector.starting()[e], 0);
      }
    }
    EXPECT_EQ(vector.returns()[2], sum);
    EXPECT_THAT(vector.success(), ::testing::Each(1));
    vector.step(actions);
  }
}

TEST(VectorTask, ALaterEpisodeIsWhatItIsAtTheStart) {
  const auto task = task_named("box_pushing");
  VectorOptions options;
  options.first_episode = 4;
  const int horizon = task->spec().horizon;
  const Shown both = play(*task, PolicyKind::random, 1, 2 * horizon, options)[0];
  options.first_episode = 5;
  const Shown second = play(*task, PolicyKind::random, 1, horizon - 1, options)[0];
  const std::size_t first = std::size_t(horizon + 1) * (task->spec().observation_size() + 1);
  EXPECT_EQ(std::vector<double>(both.numbers.begin() + std::ptrdiff_t(first), both.numbers.end()),
            second.numbers);
  EXPECT_EQ(both.resets, 2);
  EXPECT_EQ(both.ends, 1);
}

TEST(VectorTask, AnotherSeedIsAnotherRunAndTheSameSeedTheSame) {
  const auto task = task_named("box_pushing_privileged");
  VectorTask vector(*task, 2);
  const std::vector<double> first(vector.observations().begin(), vector.observations().end());
  vector.reset(7);
  EXPECT_NE(first[0], vector.observations()[0]);
  vector.step(std::vector<double>(6, 0.5));
  vector.reset(0);
  EXPECT_THAT(vector.observations(), ::testing::ElementsAreArray(first));
  EXPECT_EQ(vector.counts().environment_steps, 0);
}

TEST(VectorTask, AnActionThatIsNoNumberEndsItsEpisodeAlone) {
  const auto task = task_named("box_pushing_reduced");
  VectorTask vector(*task, 3);
  std::vector<double> actions(9, 0.0);
  actions[4] = std::nan("");
  vector.step(actions);
  EXPECT_THAT(vector.truncated(), ::testing::ElementsAre(0, 1, 0));
  EXPECT_EQ(vector.status(1), StepStatus::non_finite);
  EXPECT_EQ(vector.success()[1], 0);
  vector.step(std::vector<double>(9, 0.0));
  EXPECT_THAT(vector.starting(), ::testing::ElementsAre(0, 1, 0));
  EXPECT_EQ(vector.status(1), StepStatus::converged);
}

/// Stable grasp has an opening, so a restart takes steps while the others stand still.
TEST(VectorTask, RestartsSomeEnvironmentsAndLeavesTheOthersAlone) {
  for (const char* name : {"stable_grasp", "box_pushing"}) {
    SCOPED_TRACE(name);
    const auto task = task_named(name);
    VectorOptions options;
    options.autoreset = false;
    VectorTask vector(*task, 3, options), alone(*task, 3, options);
    const std::size_t width = task->spec().observation_size();
    const std::vector<double> actions(3 * task->spec().action.size(), 0.3);
    vector.step(actions);
    alone.step(actions);
    const std::vector<double> before(vector.observations().begin(), vector.observations().end()),
        rewards(vector.rewards().begin(), vector.rewards().end());
    vector.restart(std::vector<std::uint8_t>{0, 1, 0});
    EXPECT_THAT(vector.starting(), ::testing::ElementsAre(0, 1, 0));
    EXPECT_THAT(vector.episodes(), ::testing::ElementsAre(0, 4, 2));
    EXPECT_EQ(vector.rewards()[0], rewards[0]);
    EXPECT_EQ(vector.rewards()[1], 0);
    EXPECT_EQ(vector.lengths()[1], 0);
    options.first_episode = 4;
    const VectorTask fourth(*task, 1, options);
    EXPECT_THAT(vector.observation(1), ::testing::ElementsAreArray(fourth.observation(0)));
    for (const int e : {0, 2}) {
      EXPECT_THAT(vector.observation(e), ::testing::ElementsAreArray(std::span(before).subspan(
                                             std::size_t(e) * width, width)));
    }
    vector.step(actions);
    alone.step(actions);
    for (const int e : {0, 2})
      EXPECT_THAT(vector.observation(e), ::testing::ElementsAreArray(alone.observation(e)));
    vector.reset(0, 7);
    EXPECT_THAT(vector.episodes(), ::testing::ElementsAre(7, 8, 9));
    EXPECT_THROW(vector.restart(std::vector<std::uint8_t>{1}), InputError);
  }
}

TEST(VectorTask, ClipsActionsAndKeepsAnEndWithoutAutoreset) {
  const auto task = task_named("dummy");
  VectorOptions options;
  options.autoreset = false;
  VectorTask vector(*task, 1, options);
  vector.step(std::vector<double>{3.0});
  EXPECT_EQ(vector.actions()[0], 0.5);
  for (int t = 1; t < task->spec().horizon; ++t) vector.step(std::vector<double>{0.0});
  EXPECT_EQ(vector.truncated()[0], 1);
  const double last = vector.observations()[0];
  vector.step(std::vector<double>{0.5});
  EXPECT_EQ(vector.observations()[0], last);
  EXPECT_EQ(vector.truncated()[0], 1);
  EXPECT_EQ(vector.rewards()[0], 0);
  EXPECT_THROW(VectorTask(*task, 0), InputError);
  options.threads = 0;
  EXPECT_THROW(VectorTask(*task, 1, options), InputError);
}

TEST(TaskList, KnowsItsNames) {
  EXPECT_TRUE(is_task("box_pushing"));
  EXPECT_FALSE(is_task("box"));
  EXPECT_THROW(static_cast<void>(task_spec("box")), InputError);
  const Scene other = read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball_small.xml").scene;
  EXPECT_THROW(static_cast<void>(make_task("box_pushing", other)), InputError);
}

}  // namespace
}  // namespace tangere
