// SPDX-License-Identifier: Apache-2.0
// Tests that tasks can be solved without learning, at the rates over 1000 episodes in
// docs/tasks.md. Plays the first 400 of these; TANGERE_EPISODES=1000 plays them all.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>

#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using testing::play_episodes;
using testing::Played;
using testing::task_named;

int episodes() {
  const char* const given = std::getenv("TANGERE_EPISODES");
  return given == nullptr ? 400 : std::stoi(given);
}

/// `documented`: the rate in docs/tasks.md. The measured rate, which it returns, is at least that,
/// less half of its 95 % interval. `failed`: simulations without a solution, flagged by their
/// status (docs/tasks.md). `share`: one of so many episodes is played.
double expect_rate(const Task& task, double documented, int failed, int share) {
  const int count = episodes() / share;
  const Played scripted = play_episodes(task, PolicyKind::scripted, count);
  const double half_width = 1.96 * std::sqrt(documented * (1 - documented) / count);
  EXPECT_GE(scripted.rate(), documented - half_width) << task.spec().name;
  EXPECT_LE(scripted.failures, failed);
  return scripted.rate();
}

/// Also compares with a policy that holds.
void expect_solved(const std::string& name, double documented, int failed = 0, int share = 1) {
  const auto task = task_named(name);
  const double rate = expect_rate(*task, documented, failed, share);
  const Played idle = play_episodes(*task, PolicyKind::hold, episodes() / share / 10);
  EXPECT_GT(rate, idle.rate() + 2 * idle.half_width()) << name;
}

TEST(Scripted, HoldsThePad) { expect_solved("dummy", 1); }
TEST(Scripted, RollsTheBall) { expect_solved("ball_rolling_small", 1); }
TEST(Scripted, GraspsTheBar) { expect_solved("stable_grasp", 0.997, 0, 2); }
TEST(Scripted, TurnsTheBoxIntoTheHole) { expect_solved("insertion_rotation", 1); }
TEST(Scripted, MovesTheBoxIntoTheHole) { expect_solved("insertion_translation", 0.981); }
TEST(Scripted, InsertsTheBox) { expect_solved("insertion", 0.81); }
TEST(Scripted, OpensTheCap) { expect_solved("cap_opening_blind", 0.969, 0, 2); }
TEST(Scripted, PushesTheBox) { expect_solved("box_pushing_privileged", 0.763, 1); }
TEST(Scripted, TurnsTheEgg) { expect_solved("in_hand", 0.972, 0, 5); }

// Friction that remembers.
TEST(Scripted, GraspsTheBarElastically) { expect_solved("stable_grasp_elastic", 0.993, 0, 5); }
TEST(Scripted, InsertsTheBoxElastically) { expect_solved("insertion_elastic", 0.789, 0, 2); }
TEST(Scripted, OpensTheCapElastically) { expect_solved("cap_opening_elastic", 1, 0, 4); }
TEST(Scripted, PushesTheBoxElastically) { expect_solved("box_pushing_elastic", 0.828, 1, 2); }

// Gels that are the contact.
TEST(Scripted, GraspsTheBarWithGels) { expect_rate(*task_named("stable_grasp_gel"), 0.961, 0, 40); }
TEST(Scripted, InsertsTheBoxWithGels) { expect_rate(*task_named("insertion_gel"), 0.778, 0, 40); }

}  // namespace
}  // namespace tangere
