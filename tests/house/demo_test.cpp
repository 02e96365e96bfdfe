// SPDX-License-Identifier: Apache-2.0
// Tests that what ./run-demo says about its data set holds for the shard that its command writes.
#include <unistd.h>

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "tests/files.hpp"

namespace {

namespace fs = std::filesystem;
namespace h5 = tangere::h5;

std::string demo_text() { return tangere::file_bytes(TANGERE_SOURCE_DIR "/run-demo"); }

/// Dataset → shape, from lines such as "  data/demo_0/obs/q   (35, 10)   m".
std::map<std::string, h5::Dims> promised_shapes() {
  static const std::regex line(R"(\n  ([a-z0-9_/]+) +\(([0-9, ]+)\) )");
  static const std::regex number("[0-9]+");
  const std::string text = demo_text();
  std::map<std::string, h5::Dims> shapes;
  for (std::sregex_iterator at(text.begin(), text.end(), line), end; at != end; ++at) {
    const std::string list = (*at)[2];
    for (std::sregex_iterator n(list.begin(), list.end(), number); n != end; ++n)
      shapes[(*at)[1]].push_back(std::stoull(n->str()));
  }
  return shapes;
}

TEST(House, DemoTellsTheTruthAboutItsFile) {
  const std::map<std::string, h5::Dims> promised = promised_shapes();
  ASSERT_TRUE(promised.contains("data/demo_0/obs/q") && promised.contains("data/demo_0/obs/pad"));

  static const std::regex command(
      R"(\n\$tangere (generate scenes/rolling_ball\.xml --episodes ([0-9]+) .*--steps )"
      R"(350.*) --output)");
  std::smatch match;
  const std::string text = demo_text();
  ASSERT_TRUE(std::regex_search(text, match, command));
  const fs::path folder =
      fs::path(testing::TempDir()) / ("tangere_demo_test_" + std::to_string(getpid()));
  fs::create_directories(folder);
  const fs::path file = folder / "shard-00000.h5";
  const std::string run = "cd '" TANGERE_SOURCE_DIR "' && '" TANGERE_PROGRAM "' " + match[1].str() +
                          " --seed 1 --overwrite --quiet --output '" + folder.string() + "'";
  ASSERT_EQ(std::system(run.c_str()), 0) << run;

  const h5::Id opened = h5::open_file(file.string());
  for (const auto& [name, shape] : promised)
    EXPECT_EQ(h5::dimensions(h5::open_dataset(opened, name)), shape) << name;
  const tangere::ShardContent content = tangere::check_shard(file.string());
  EXPECT_EQ(std::to_string(content.demos), match[2].str());
  EXPECT_NE(text.find(match[2].str() + " episodes, data/demo_0 to data/demo_" +
                      std::to_string(content.demos - 1)),
            std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "shard-00001.h5")) << "the text names one shard";
  fs::remove_all(folder);
}

}  // namespace
