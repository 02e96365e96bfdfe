// SPDX-License-Identifier: Apache-2.0
// Tests that memory and files of `tangere generate` grow with the number of episodes as documented.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/apps/program.hpp"
#include "tests/sanitized.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;

TEST(MemoryGrowth, GenerateDoesNotGrowWithTheNumberOfEpisodes) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer keeps freed memory";
  for (const Words& kind :
       {Words{}, Words{"--tactile", "dense"}, Words{"--compress", "deflate", "--tactile", "dense"},
        Words{"--compress", "lz4"}}) {
    double before = 0;
    for (const std::string episodes : {"64", "1024"}) {
      const Folder folder;
      Words words{"generate",   scene("rolling_ball_small.xml"),
                  "--output",   "set",
                  "--steps",    "50",
                  "--every",    "5",
                  "--threads",  "2",
                  "--no-merge", "--episodes",
                  episodes};
      words.insert(words.end(), kind.begin(), kind.end());
      ASSERT_EQ(run(folder, words).exit_code, 0);
      if (episodes == "64") before = peak_memory();
    }
    // A thousand episodes are 135 MB.
    EXPECT_LT(peak_memory() - before, 48 << 20) << "from " << before;
    EXPECT_LT(peak_memory(), 232 << 20);
  }
}

TEST(MemoryGrowth, MergedFilesGrowByTheSameForEachEpisode) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer keeps freed memory";
  const Folder folder;
  std::vector<double> robomimic, minari;
  double memory = 0;
  for (const int episodes : {512, 1024, 2048, 4096}) {
    const std::string set = "of" + std::to_string(episodes);
    ASSERT_EQ(run(folder, {"generate", scene("rolling_ball_small.xml"), "--output", set,
                           "--episodes", std::to_string(episodes), "--steps", "1", "--every", "1",
                           "--record", "q", "--quiet"})
                  .exit_code,
              0);
    robomimic.push_back(static_cast<double>(fs::file_size(folder.path(set + "/robomimic.hdf5"))));
    minari.push_back(static_cast<double>(fs::file_size(
        folder.path(set + "/minari/tangere/rolling_ball_small-v0/data/main_data.hdf5"))));
    fs::remove_all(folder.path(set));
    if (memory == 0) memory = peak_memory();
  }
  for (const std::vector<double>* size : {&robomimic, &minari})
    for (std::size_t k = 1; k + 1 < size->size(); ++k) {
      const double first =
          ((*size)[k] - (*size)[k - 1]) / 512.0 / static_cast<double>(1 << (k - 1));
      const double then = ((*size)[k + 1] - (*size)[k]) / 512.0 / static_cast<double>(1 << k);
      EXPECT_NEAR(then, first, 0.02 * first) << "bytes per episode";
      EXPECT_LT(then, 2000);
    }
  // There are 3584 more episodes. If a command kept 5 kB of each, it would need 18 MB.
  EXPECT_LT(peak_memory() - memory, 16 << 20) << "from " << memory;
}

}  // namespace
}  // namespace tangere::apps
