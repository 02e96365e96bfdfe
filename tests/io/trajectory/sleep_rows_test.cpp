// SPDX-License-Identifier: Apache-2.0
// Rows of /sleep come back as they were given, and each compressed chunk is written once.
#include "io/trajectory/sleep_rows.hpp"

#include <gtest/gtest.h>

#include "io/hdf5/h5.hpp"

namespace tangere {
namespace {

constexpr int kEnvironments = 2048, kTrees = 16, kRows = 19;
constexpr hsize_t kIslandRows = 8;  // of a chunk of 1 MiB: 2048 x 16 numbers of 4 bytes are 128 KiB

TrajectoryLayout layout_of_sleep() {
  TrajectoryLayout layout;
  layout.steps = kRows - 1;
  layout.environments = kEnvironments;
  for (int i = 0; i < kTrees; ++i) layout.trees.push_back("tree" + std::to_string(i));
  layout.u_names = {"a", "b"};
  return layout;
}

/// Numbers that tell row and environment; every third environment is new.
SleepState state_of(int row, int environment) {
  SleepState state;
  if (environment % 3 == 0) return state;
  const int at = row * kEnvironments + environment;
  for (int i = 0; i < kTrees; ++i) {
    state.island.push_back(i % 2 == 0 ? -1 : (at + i) % kTrees);
    state.asleep.push_back(i % 2 == 0 ? 0 : 1);
    state.rested.push_back(at + i);
  }
  state.u = {at + 0.25, -at - 0.5};
  state.clearance = 1e-6 * at;
  state.resting = at % 2 == 1;
  return state;
}

hsize_t chunks_in(const h5::Id& file, const char* name) {
  const h5::Id dataset = h5::open_dataset(file, name);
  const h5::Id space(H5Dget_space(dataset.get()));
  hsize_t count = 0;
  EXPECT_GE(H5Dget_num_chunks(dataset.get(), space.get(), &count), 0) << name;
  return count;
}

TEST(SleepRows, ChunksAreWrittenWholeAndRowsComeBack) {
  const TrajectoryLayout layout = layout_of_sleep();
  const h5::Id file = h5::create_memory_file();
  SleepRows rows(file, layout);
  std::vector<SleepState> sleep(kEnvironments);
  for (int row = 0; row < kRows; ++row) {
    for (int e = 0; e < kEnvironments; ++e) sleep[static_cast<std::size_t>(e)] = state_of(row, e);
    rows.write({row, sleep});
    const bool last = row + 1 == kRows;
    const hsize_t whole = static_cast<hsize_t>(row + 1) / kIslandRows;
    EXPECT_EQ(chunks_in(file, "sleep/island"), last ? 3 : whole) << "after row " << row;
    EXPECT_EQ(chunks_in(file, "sleep/resting"), last ? 1 : 0) << "after row " << row;
  }
  EXPECT_EQ(rows.written(), kRows);
  for (const int row : {0, 7, 8, 17, 18}) {
    const std::optional<SavedSleep> saved = read_sleep(file, row, kRows, kEnvironments);
    ASSERT_TRUE(saved);
    EXPECT_EQ(saved->trees, layout.trees);
    for (const int e : {0, 1, 2, kEnvironments - 1}) {
      const SleepState &there = saved->environments[static_cast<std::size_t>(e)],
                       given = state_of(row, e);
      EXPECT_EQ(there.island, given.island) << row << ", environment " << e;
      EXPECT_EQ(there.asleep, given.asleep) << row << ", environment " << e;
      EXPECT_EQ(there.rested, given.rested) << row << ", environment " << e;
      EXPECT_EQ(there.u, given.u) << row << ", environment " << e;
      EXPECT_EQ(there.clearance, given.clearance) << row << ", environment " << e;
      EXPECT_EQ(there.resting, given.resting) << row << ", environment " << e;
    }
  }
}

/// A row of more than a chunk is cut between environments, and there may be no controls.
TEST(SleepRows, ARowMayTakeSeveralChunks) {
  TrajectoryLayout layout = layout_of_sleep();
  layout.u_names.clear();
  layout.environments = 20000;
  layout.steps = 1;
  const h5::Id file = h5::create_memory_file();
  SleepRows rows(file, layout);
  std::vector<SleepState> sleep(20000);
  for (const int row : {0, 1}) {
    sleep[19999] = state_of(row, 19999);
    sleep[19999].u.clear();
    rows.write({row, sleep});
    EXPECT_EQ(chunks_in(file, "sleep/rested"), row == 0 ? 2 : 4);
  }
  for (const int row : {0, 1})
    EXPECT_EQ(read_sleep(file, row, 2, 20000)->environments[19999].rested,
              state_of(row, 19999).rested);
}

}  // namespace
}  // namespace tangere
