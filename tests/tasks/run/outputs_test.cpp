// SPDX-License-Identifier: Apache-2.0
// Tests that what nobody asks for is not computed: the calls of tactile kernels are counted.
#include <gmock/gmock.h>

#include <atomic>

#include "kernels/table/kernel_table.hpp"
#include "tasks/run/rollout.hpp"
#include "tests/tasks/episode_by_hand.hpp"

namespace tangere {
namespace {

using namespace testing;
using kernels::KernelTable;

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
std::size_t run_with(const Model& model, std::optional<std::vector<FieldOutput>> fields) {
  EpisodeOptions o;
  o.episodes = 16;
  o.steps = 4;
  o.every = 2;
  o.fields = std::move(fields);
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
  EXPECT_EQ(run_with(model, std::vector<FieldOutput>{}), 0U);
  EXPECT_EQ(whole_calls + pressure_calls, 0);
  EXPECT_EQ(run_with(model, std::vector<FieldOutput>{{0, FieldForm::pressure}}),
            3 * points * sizeof(double));
  EXPECT_EQ(whole_calls, 0);
  EXPECT_GT(pressure_calls, 0);
  pressure_calls = 0;
  EXPECT_EQ(run_with(model, std::vector<FieldOutput>{{0, FieldForm::sum}}), 3 * 6 * sizeof(double));
  EXPECT_EQ(pressure_calls, 0);
  EXPECT_GT(whole_calls, 0);
}

TEST(Outputs, ARolloutReadsNeitherFieldsNorBodiesThatNobodyAskedFor) {
  struct Sizes : RowSink {
    std::size_t bodies = 0, fields = 0;
    void write(const StateRow& row) override {
      bodies += row.body_pose.size() + row.body_twist.size() + row.end_effectors.size();
    }
    void write(const StepRow&) override {}
    void write(const TactileRow& row) override { fields += row.numbers.size(); }
  } sizes;
  const Model model(small_scene());
  Batch batch(model, 2);
  Stepper stepper(model);
  const ControlProgram controls(model, stepper.timestep(), 0);
  RolloutOptions o{3, 1};
  o.outputs = {std::vector<FieldOutput>{}, false, false};
  const Counting counting;
  run_rollout(batch, stepper, controls, o, sizes);
  EXPECT_EQ(sizes.bodies + sizes.fields, 0U);
  EXPECT_EQ(whole_calls + pressure_calls, 0);
  EXPECT_LT(rollout_bytes(model, 1, o.outputs), rollout_bytes(model, 1) / 2);
}

}  // namespace
}  // namespace tangere
