// SPDX-License-Identifier: Apache-2.0
// Tests that no output replaces a file that the command reads, whatever leads to that file, and
// that no .part empties a file that has another name.
#include <gmock/gmock.h>

#include <filesystem>
#include <map>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// "whole.xml" includes "part.xml", whose body has the mesh "cube.obj" and whose control is
/// "u.csv"; "set" is a data set of two shards, merged; "run.h5" a trajectory. "hard" and "soft" are
/// links to the second shard.
class Inputs : public testing::TestWithParam<Refusal> {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<Folder>();
    fs::copy_file(scene("rolling_ball_small.xml"), folder_->path("small.xml"));
    folder_->write("cube.obj",
                   "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
                   "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    folder_->write("part.xml", R"(<tangere><robot><link name="l">
      <joint name="j" type="free3d" pos="0 0 0" quat="1 0 0 0"/>
      <body name="b" type="mesh" filename="cube.obj" transform_type="OBJ_TO_JOINT"
        density="1000"/></link></robot></tangere>)");
    folder_->write("whole.xml", R"(<tangere><include file="part.xml"/></tangere>)");
    folder_->write("u.csv", "0,0,0\n0,0,0\n");
    ASSERT_EQ(run(*folder_, {"simulate", "small.xml", "-o", "run.h5", "--steps", "10"}).exit_code,
              0);
    const Outcome made = run(*folder_, {"generate", "small.xml", "-o", "set", "--episodes", "32",
                                        "--shards", "2", "--steps", "10", "--every", "5"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    fs::create_hard_link(folder_->path("set/shard-00001.h5"), folder_->path("hard"));
    fs::create_symlink(folder_->path("set/shard-00001.h5"), folder_->path("soft"));
    fs::create_directory(folder_->path("linked"));
    fs::create_hard_link(folder_->path("small.xml"), folder_->path("linked/shard-00000.h5"));
    fs::create_hard_link(folder_->path("u.csv"), folder_->path("other.html.part"));
    fs::copy_file(folder_->path("small.xml"), folder_->path("left.h5.part"));
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::map<std::string, std::string> contents() {
    std::map<std::string, std::string> all;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder_->path()))
      if (entry.is_regular_file()) all[entry.path()] = file_bytes(entry.path());
    return all;
  }
  static std::unique_ptr<Folder> folder_;
};
std::unique_ptr<Folder> Inputs::folder_;

TEST_P(Inputs, AreNoOutputs) {
  const std::map<std::string, std::string> before = contents();
  const Outcome outcome = run(*folder_, GetParam().words);
  EXPECT_EQ(outcome.exit_code, GetParam().exit_code) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(GetParam().message));
  EXPECT_TRUE(contents() == before);
}

Words simulated(const std::string& scene, const std::string& output, const Words& more = {}) {
  return Words{"simulate", scene, "-o", output, "--overwrite", "--steps", "2"} + more;
}

INSTANTIATE_TEST_SUITE_P(
    Of, Inputs,
    testing::Values(
        Refusal{"included", simulated("whole.xml", "part.xml"), 2, "is the input 'part.xml'"},
        Refusal{"mesh", simulated("whole.xml", "cube.obj"), 2, "is the input 'cube.obj'"},
        Refusal{"table", simulated("small.xml", "u.csv", {"--controls", "u.csv"}), 2,
                "input 'u.csv'"},
        Refusal{"state", simulated("small.xml", "run.h5", {"--state-from", "run.h5"}), 2,
                "is the input 'run.h5'"},
        Refusal{"plot", {"plot", "run.h5", "-o", "run.h5", "--overwrite"}, 2, "input 'run.h5'"},
        Refusal{
            "drawn_mesh", {"plot", "whole.xml", "-o", "cube.obj", "--overwrite"}, 2, "cube.obj"},
        Refusal{"effects",
                {"inspect", "small.xml", "--effects", "--svg", "small.xml", "--overwrite"},
                2,
                "is the input 'small.xml'"},
        Refusal{"viewed",
                {"view", "set", "-o", "set/shard-00001.h5", "--overwrite", "--episode", "0"},
                2,
                "is the input 'set/shard-00001.h5'"},
        Refusal{"exported",
                {"export", "set", "--csv", "set/shard-00001.h5", "--overwrite", "--episode", "0"},
                2,
                "is the input 'set/shard-00001.h5'"},
        Refusal{"merged_file",
                {"export", "set", "--csv", "set/robomimic.hdf5", "--overwrite"},
                2,
                "is the input 'set/robomimic.hdf5'"},
        Refusal{"through_links",
                {"view", "set/robomimic.hdf5", "-o", "set/shard-00001.h5", "--overwrite",
                 "--episode", "0"},
                2,
                "is the input 'set/shard-00001.h5'"},
        Refusal{"hard_link", {"view", "set", "-o", "hard", "--overwrite"}, 2, "set/shard-00001.h5"},
        Refusal{"soft_link", {"view", "set", "-o", "soft", "--overwrite"}, 2, "set/shard-00001.h5"},
        Refusal{"shard_that_is_the_scene",
                {"generate", "small.xml", "-o", "linked", "--episodes", "1", "--steps", "5",
                 "--overwrite"},
                2,
                "'linked/shard-00000.h5' is the input 'small.xml'"},
        Refusal{"part_with_two_names", {"view", "run.h5", "-o", "other.html"}, 3, "with 2 names"},
        Refusal{"part_that_is_read", simulated("left.h5.part", "left.h5"), 2, "left.h5.part"}),
    [](const auto& test) { return test.param.name; });

/// What the merge made before is replaced as it was.
TEST(InputFiles, AMergeReplacesItsOwnFiles) {
  const Folder folder;
  const Words words{"generate",   scene("rolling_ball_small.xml"),
                    "-o",         "set",
                    "--episodes", "2",
                    "--steps",    "10",
                    "--every",    "5"};
  ASSERT_EQ(run(folder, words).exit_code, 0);
  EXPECT_EQ(run(folder, {"merge", "set", "--overwrite"}).exit_code, 0);
  EXPECT_EQ(run(folder, {"merge", "set", "--overwrite", "--copy"}).exit_code, 0);
  EXPECT_EQ(run(folder, words + Words{"--overwrite"}).exit_code, 0);
}

}  // namespace
}  // namespace tangere::apps
