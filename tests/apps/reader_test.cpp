// SPDX-License-Identifier: Apache-2.0
// The readers of docs/datasets.md, run as they stand there.
#include <gmock/gmock.h>

#include <cstdio>
#include <cstdlib>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

/// A Python that has h5py; empty when there is none.
std::string python() {
  for (const char* name : {"python3", "/usr/bin/python3"})
    if (std::system((std::string(name) + " -c 'import h5py, numpy' >/dev/null 2>&1").c_str()) == 0) return name;
  return {};
}

std::vector<std::string> readers() {
  std::string page = file_bytes(TANGERE_SOURCE_DIR "/docs/datasets.md");
  const std::string begin = "```python\n", end = "```";
  std::vector<std::string> blocks;
  for (std::size_t at = page.find(begin); at != std::string::npos; at = page.find(begin, at)) {
    at += begin.size();
    blocks.push_back(page.substr(at, page.find(end, at) - at));
  }
  return blocks;
}

TEST(Readers, OfThePageReadADataSet) {
  const std::string interpreter = python();
  if (interpreter.empty()) GTEST_SKIP() << "no python3 with h5py: the readers of docs/datasets.md were NOT tried";
  const Folder folder;
  ASSERT_EQ(run(folder, {"generate", scene("rolling_ball_small.xml"), "--output", "balls", "--episodes", "32", "--seed",
                         "1", "--quiet"})
                .exit_code,
            0);
  ASSERT_EQ(run(folder, {"generate", scene("rolling_ball_small.xml"), "--output", "sparse", "--episodes", "4", "--tactile",
                         "sparse", "--quiet"})
                .exit_code,
            0);
  const std::vector<std::string> blocks = readers();
  ASSERT_GE(blocks.size(), 4U);
  int tried = 0;
  for (const std::string& block : blocks) {
    const bool needs_minari = block.find("import minari") != std::string::npos;
    if (needs_minari && std::system((interpreter + " -c 'import minari' >/dev/null 2>&1").c_str()) != 0) {
      std::printf("Minari is not installed: its reader was NOT tried\n");
      continue;
    }
    folder.write("reader.py", block);
    const std::string command = "cd " + folder.path() + " && " + interpreter + " reader.py >out.txt 2>err.txt";
    EXPECT_EQ(std::system(command.c_str()), 0) << block << folder.read("err.txt");
    EXPECT_FALSE(folder.read("out.txt").empty());
    ++tried;
  }
  EXPECT_GE(tried, 3);
}

}  // namespace
}  // namespace tangere::apps
