// SPDX-License-Identifier: Apache-2.0
// Tests when outputs are taken against counting, and the words that say so.
#include "engine/scene/output_times.hpp"

#include <gmock/gmock.h>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

TEST(OutputTimes, RowsBeforeARowAreThoseThatAreTaken) {
  for (const OutputTimes times : {OutputTimes{}, OutputTimes{1}, OutputTimes{3}, OutputTimes{7},
                                  OutputTimes{100}, OutputTimes{0, true}})
    for (const std::int64_t first : {0, 1, 5, 7})
      for (const std::int64_t last : {0, 1, 6, 14}) {
        std::int64_t taken = 0;
        for (std::int64_t row = 0; row <= last; ++row) {
          EXPECT_EQ(times.before(row, last, first), taken)
              << to_string(times) << ", row " << row << " of " << last << " after " << first;
          taken += times.at(row, last, first) ? 1 : 0;
        }
        EXPECT_EQ(times.before(last + 1, last, first), taken);
        if (times.final) {
          EXPECT_EQ(taken, 1);
        }
      }
}

TEST(OutputTimes, WordsSayWhen) {
  EXPECT_EQ(split_times("pad").name, "pad");
  EXPECT_FALSE(split_times("pad").times.given());
  EXPECT_EQ(split_times("pad.sum/10").name, "pad.sum");
  EXPECT_EQ(split_times("pad.sum/10").times, (OutputTimes{10}));
  EXPECT_EQ(split_times("q/final").times, (OutputTimes{0, true}));
  for (const char* word : {"q", "q/3", "q/final"})
    EXPECT_EQ(split_times(word).name + to_string(split_times(word).times), word);
  for (const char* word : {"q/", "q/0", "q/-1", "q/1.5", "q/last", "q/5x", "q/1000000001"}) {
    try {
      split_times(word);
      ADD_FAILURE() << word;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(word));
      EXPECT_THAT(error.what(), HasSubstr("'q/final'"));
    }
  }
}

}  // namespace
}  // namespace tangere
