// SPDX-License-Identifier: Apache-2.0
// Tests what varies scripted episodes: noise on actions, and episodes that are played at random.
#include <gmock/gmock.h>

#include <algorithm>

#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using ::tangere::testing::task_named;
using ::testing::ElementsAre;

std::vector<double> first_actions(const Task& task, const Policy& policy, int environments,
                                  std::int64_t first_episode = 0, std::uint64_t seed = 3) {
  VectorOptions options;
  options.seed = seed;
  options.first_episode = first_episode;
  const VectorTask vector(task, environments, options);
  std::vector<double> actions(std::size_t(environments) * task.spec().action.size());
  policy.act(vector, actions);
  return actions;
}

Policy noisy(const Task& task, double noise) {
  return Policy(task, PolicyKind::scripted, {}, {noise, 0});
}

TEST(VariedPolicy, NoiseHasItsDeviationAndNoMean) {
  const auto task = task_named("dummy");
  constexpr int kEpisodes = 4000;
  constexpr double kNoise = 1e-3;
  const std::vector<double> script = first_actions(*task, noisy(*task, 0), kEpisodes);
  EXPECT_EQ(script, first_actions(*task, Policy(*task, PolicyKind::scripted), kEpisodes));
  const std::vector<double> actions = first_actions(*task, noisy(*task, kNoise), kEpisodes);
  double sum = 0, squares = 0;
  int inside = 0;
  const TensorSpec& bounds = task->spec().action;
  for (std::size_t e = 0; e < script.size(); ++e) {
    // Within six deviations of a bound the noise is cut off.
    if (script[e] < bounds.low + 6 * kNoise || script[e] > bounds.high - 6 * kNoise) continue;
    const double added = (actions[e] - script[e]) / kNoise;
    sum += added;
    squares += added * added;
    ++inside;
  }
  ASSERT_GT(inside, 1000);
  EXPECT_NEAR(sum / inside, 0, 4 / std::sqrt(inside));
  EXPECT_NEAR(squares / inside, 1, 4 * std::sqrt(2.0 / inside));
}

TEST(VariedPolicy, NoiseBelongsToTheEpisodeAndKeepsTheBounds) {
  const auto task = task_named("box_pushing");
  const Policy policy = noisy(*task, 2);
  const std::vector<double> among = first_actions(*task, policy, 40);
  const std::size_t width = task->spec().action.size();
  for (const std::size_t e : {std::size_t{0}, std::size_t{7}, std::size_t{39}})
    EXPECT_THAT(first_actions(*task, policy, 1, std::int64_t(e)),
                ::testing::ElementsAreArray(among.begin() + std::ptrdiff_t(e * width),
                                            among.begin() + std::ptrdiff_t((e + 1) * width)));
  EXPECT_NE(among, first_actions(*task, policy, 40, 0, 4)) << "another seed";
  const auto [low, high] = std::minmax_element(among.begin(), among.end());
  EXPECT_EQ(*low, task->spec().action.low) << "so much noise reaches both bounds, and not beyond";
  EXPECT_EQ(*high, task->spec().action.high);
}

TEST(VariedPolicy, NoiseDiffersBetweenActionsAndTheirNumbers) {
  const auto task = task_named("box_pushing");
  const Policy policy = noisy(*task, 0.01), script(*task, PolicyKind::scripted);
  VectorTask vector(*task, 1);
  std::vector<double> added;
  std::vector<double> actions(3), plain(3);
  for (int t = 0; t < 5; ++t) {
    policy.act(vector, actions);
    script.act(vector, plain);
    for (std::size_t k = 0; k < 3; ++k)
      if (std::abs(plain[k]) < 0.9) added.push_back(actions[k] - plain[k]);
    vector.step(actions);
  }
  ASSERT_GE(added.size(), 5U);
  std::sort(added.begin(), added.end());
  EXPECT_EQ(std::adjacent_find(added.begin(), added.end()), added.end());
}

TEST(VariedPolicy, AShareOfTheEpisodesIsPlayedAtRandom) {
  const auto task = task_named("box_pushing");
  const Policy mixed(*task, PolicyKind::scripted, {}, {0, 0.3});
  EXPECT_THAT(mixed.players(), ElementsAre("scripted", "random"));
  EXPECT_THAT(Policy(*task, PolicyKind::hold).players(), ElementsAre("hold"));
  constexpr int kEpisodes = 20000;
  int random = 0, other = 0;
  for (std::int64_t e = 0; e < kEpisodes; ++e) {
    random += mixed.player(3, e);
    other += mixed.player(3, e) != mixed.player(4, e) ? 1 : 0;
    EXPECT_EQ(Policy(*task, PolicyKind::scripted).player(3, e), 0);
  }
  EXPECT_NEAR(random / double(kEpisodes), 0.3, 4 * std::sqrt(0.3 * 0.7 / kEpisodes));
  EXPECT_NEAR(other / double(kEpisodes), 2 * 0.3 * 0.7, 0.02) << "seeds draw independently";
  const std::vector<double> actions = first_actions(*task, mixed, 40),
                            script = first_actions(*task, Policy(*task, PolicyKind::scripted), 40),
                            chance = first_actions(*task, Policy(*task, PolicyKind::random), 40);
  for (std::size_t i = 0; i < actions.size(); ++i)
    EXPECT_EQ(actions[i], (mixed.player(3, std::int64_t(i / 3)) == 1 ? chance : script)[i]) << i;
}

TEST(VariedPolicy, WhatCannotBeVariedIsRefused) {
  const auto task = task_named("dummy");
  const auto complaint = [&](PolicyKind kind, const PolicyVariation& variation) -> std::string {
    try {
      const Policy policy(*task, kind, {{0.1}}, variation);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(complaint(PolicyKind::random, {}), "");
  EXPECT_EQ(complaint(PolicyKind::random, {0.1, 0}),
            "noise, or random episodes, with the policy random; expected scripted");
  EXPECT_EQ(complaint(PolicyKind::csv, {0, 0.1}),
            "noise, or random episodes, with the policy csv; expected scripted");
  EXPECT_EQ(complaint(PolicyKind::scripted, {-0.1, 0}),
            "a noise of -0.1; expected a finite number, 0 or above");
  EXPECT_EQ(complaint(PolicyKind::scripted, {0, 1.5}),
            "a share of 1.5 random episodes; expected 0 to 1");
}

}  // namespace
}  // namespace tangere
