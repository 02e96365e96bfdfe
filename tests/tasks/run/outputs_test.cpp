// SPDX-License-Identifier: Apache-2.0
// Tests that what nobody asks for is not computed: the calls of tactile kernels are counted.
#include <gmock/gmock.h>

#include <atomic>

#include "kernels/table/kernel_table.hpp"
#include "tasks/run/rollout.hpp"
#include "tests/tasks/episode_by_hand.hpp"
#include "tests/tasks/recorded.hpp"

namespace tangere {
namespace {

using namespace testing;
using kernels::KernelTable;
using ::testing::ElementsAre;

std::atomic<int> whole_calls{0}, pressure_calls{0};
const KernelTable* counted = nullptr;

template <auto Function, class Args>
auto count(const Args& a) {
  ++(a.pressure ? pressure_calls : whole_calls);
  return (counted->*Function)(a);
}

/// Counts the calls of tactile kernels while it lives.
class Counting {
 public:
  Counting() : before_(kernels::active_kernels()), table_(before_) {
    counted = &before_;
    whole_calls = pressure_calls = 0;
    table_.tactile = count<&KernelTable::tactile, kernels::TactileArgs<double>>;
    table_.tactile_mixed = count<&KernelTable::tactile_mixed, kernels::TactileArgs<float>>;
    table_.tactile_block = count<&KernelTable::tactile_block, kernels::TactileBlockArgs<double>>;
    table_.tactile_block_mixed =
        count<&KernelTable::tactile_block_mixed, kernels::TactileBlockArgs<float>>;
    kernels::use_kernels(table_);
  }
  ~Counting() { kernels::use_kernels(before_); }
  Counting(const Counting&) = delete;
  Counting& operator=(const Counting&) = delete;

 private:
  const KernelTable& before_;
  KernelTable table_;
};

/// Runs 16 episodes and returns how many bytes of readings one gave.
std::size_t run_with(const Model& model, const std::vector<TimedName>& record) {
  EpisodeOptions o;
  o.episodes = 16;
  o.steps = 4;
  o.every = 2;
  o.record = record;
  const ControlProgram controls(model, model.timestep(), 0);
  Recorder recorder(2);
  run_episodes(model, {}, controls, o, recorder);
  std::size_t bytes = 0;
  const auto& all = recorder.episodes.at(0).observations;
  for (std::size_t name = model.end_effectors().empty() ? 2 : 3; name < all.size(); ++name)
    bytes += all[name].size();
  return bytes;
}

TEST(Outputs, FieldsThatNobodyAskedForAreNotRead) {
  const Model model(small_scene());
  const auto points = std::size_t(model.sensors()[0].points);
  const Counting counting;
  const std::string sensor = std::string(model.sensors()[0].name);
  EXPECT_EQ(run_with(model, {{"q"}}), 0U);
  EXPECT_EQ(whole_calls + pressure_calls, 0);
  EXPECT_EQ(run_with(model, {{sensor + ".pressure"}}), 3 * points * sizeof(double));
  EXPECT_EQ(whole_calls, 0);
  EXPECT_GT(pressure_calls, 0);
  pressure_calls = 0;
  EXPECT_EQ(run_with(model, {{sensor + ".sum"}}), 3 * 6 * sizeof(double));
  EXPECT_EQ(pressure_calls, 0);
  EXPECT_GT(whole_calls, 0);
}

TEST(Outputs, ARolloutReadsNeitherFieldsNorBodiesThatNobodyAskedFor) {
  const Model model(small_scene());
  Batch batch(model, 2);
  Stepper stepper(model);
  const ControlProgram controls(model, stepper.timestep(), 0);
  RolloutOptions o{3, 1};
  o.outputs = {std::vector<FieldOutput>{}, false, false};
  const Counting counting;
  Recorded sink(rollout_recording(batch, stepper, o, {}));
  run_rollout(batch, std::span(&stepper, 1), controls, o, sink);
  for (const auto& [name, rows] : sink.all())
    EXPECT_EQ(name.find_first_of("/"), name.starts_with("solver/") ? 6 : std::string::npos) << name;
  EXPECT_EQ(whole_calls + pressure_calls, 0);
  EXPECT_LT(rollout_bytes(model, 1, o.outputs), rollout_bytes(model, 1) / 2);
}

std::vector<std::int64_t> steps_of(const std::vector<RecordedRow>& rows) {
  std::vector<std::int64_t> steps;
  for (const RecordedRow& row : rows) steps.push_back(row.step);
  return steps;
}

/// What a rollout of 12 steps hands on.
Recorded handed(const Model& model, const RolloutOutputs& outputs) {
  Batch batch(model, 3);
  Stepper stepper(model);
  const ControlProgram controls(model, stepper.timestep(), 0);
  RolloutOptions o{12, 1};
  o.outputs = outputs;
  Recorded sink(rollout_recording(batch, stepper, o, {}));
  run_rollout(batch, std::span(&stepper, 1), controls, o, sink);
  return sink;
}

TEST(Outputs, WhatIsTakenAtTimesOfItsOwnIsReadThenAndNeverElse) {
  const Model model(small_scene());
  const Counting counting;
  const Recorded all = handed(model, {});
  const int of_all = whole_calls;
  ASSERT_GT(of_all, 0);
  RolloutOutputs some;
  some.fields = {{0, FieldForm::field, {4}}};
  some.states = {0, true};
  some.body_times = {6};
  some.chosen_bodies = {model.nb() - 1};
  whole_calls = 0;
  const Recorded few = handed(model, some);
  EXPECT_EQ(12 * whole_calls, 3 * of_all);
  const std::string field = "tactile/" + std::string(model.sensors()[0].name) + "/force";
  EXPECT_THAT(steps_of(few[field]), ElementsAre(4, 8, 12));
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(few[field][k], all[field][4 * k + 3]);
  EXPECT_THAT(few["q"], ElementsAre(all["q"][12]));
  EXPECT_TRUE(few["u"].empty()) << "controls leave with every state alone";
  ASSERT_EQ(few["bodies/pose"].size(), 3U);
  const std::size_t nb = std::size_t(model.nb());
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t e = 0; e < 3; ++e)
      for (std::size_t i = 0; i < 7; ++i)
        EXPECT_EQ(few["bodies/pose"][k].numbers[7 * e + i],
                  all["bodies/pose"][6 * k].numbers[7 * (nb * e + nb - 1) + i]);
  some.fields = {{0, FieldForm::field, {0, true}}};
  whole_calls = 0;
  EXPECT_THAT(steps_of(handed(model, some)[field]), ElementsAre(12));
  EXPECT_EQ(12 * whole_calls, of_all);
  EXPECT_LT(rollout_bytes(model, 1, some), rollout_bytes(model, 1));
}

/// Episodes of 8 steps and rows of 2, in pieces of every size.
TEST(Outputs, EpisodesHoldWhatIsTakenAndComputeNothingElse) {
  const Model model(small_scene());
  const ControlProgram controls(model, model.timestep(), 0);
  EpisodeOptions o;
  o.episodes = 17;
  o.steps = 8;
  o.every = 2;
  const auto played = [&](const EpisodeOptions& options) {
    Recorder recorder(4);
    run_episodes(model, {}, controls, options, recorder);
    return recorder.episodes;
  };
  const auto row = [](const std::string& bytes, std::size_t rows, std::size_t k) {
    return bytes.substr(bytes.size() / rows * k, bytes.size() / rows);
  };
  const Counting counting;
  const auto all = played(o);
  const int of_all = whole_calls;
  const std::string sensor = std::string(model.sensors()[0].name),
                    body = body_output(model.body_names()[1]);
  o.record = {{"q", {4}}, {body, {0, true}}, {"bodies"}, {sensor, {8}}};
  for (const std::size_t piece : {std::size_t(1), std::size_t(30000), std::size_t(1) << 25}) {
    o.piece_bytes = piece;
    whole_calls = 0;
    const auto some = played(o);
    EXPECT_EQ(5 * whole_calls, 2 * of_all) << "rows 0 and 4 of 5";
    const std::size_t bodies = model.end_effectors().empty() ? 2 : 3;
    for (const auto& [number, episode] : some) {
      const RecordedEpisode& whole = all.at(number);
      EXPECT_EQ(episode.actions, whole.actions);
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_EQ(row(episode.observations[0], 3, k), row(whole.observations[0], 5, 2 * k));
      EXPECT_EQ(episode.observations[1], "");
      const std::size_t motion = 13 * sizeof(double);
      ASSERT_EQ(episode.observations[bodies + 1].size(), motion);
      EXPECT_EQ(episode.observations[bodies + 1],
                row(episode.observations[bodies], 5, 4).substr(motion, motion));
      for (std::size_t k = 0; k < 2; ++k)
        EXPECT_EQ(row(episode.observations[bodies + 2], 2, k),
                  row(whole.observations[bodies], 5, 4 * k));
    }
  }
  o.record = {{sensor, {3}}};
  EXPECT_THROW(played(o), InputError) << "a row is two steps";
  RolloutOutputs nobody;
  nobody.chosen_bodies = {-1};
  EXPECT_THROW(handed(model, nobody), InputError);
}

}  // namespace
}  // namespace tangere
