// SPDX-License-Identifier: Apache-2.0
// Which command ends with which code, as the table in docs/command.md says.
#include <gmock/gmock.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <set>
#include <thread>

#include "apps/console.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using ::testing::HasSubstr;

struct Row {
  std::string name;
  int exit_code;
  Words words;
};
void PrintTo(const Row& row, std::ostream* out) { *out << row.name; }

/// "small.xml" a scene, "bad.xml" none, "failing.xml" one whose step finds no root, "set" a data
/// set, "run.h5" a trajectory, "broken" a folder with half a shard, "full" an output that is there.
class ExitCodes : public ::testing::TestWithParam<Row> {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<Folder>();
    namespace fs = std::filesystem;
    fs::copy_file(scene("rolling_ball_small.xml"), folder_->path("small.xml"));
    folder_->write("bad.xml", "<tangere>\n<nothing/></tangere>");
    // A step of one day has no solution.
    std::string days = folder_->read("small.xml");
    const std::string step = "timestep=\"5e-3\"";
    days.replace(days.find(step), step.size(), "timestep=\"86400\"");
    folder_->write("failing.xml", days);
    const Words generate = {"generate", "small.xml", "--episodes", "2",         "--steps",
                            "4",        "--every",   "2",          "--threads", "1"};
    ASSERT_EQ(run(*folder_, generate + Words{"-o", "set"}).exit_code, 0);
    ASSERT_EQ(
        run(*folder_, {"simulate", "small.xml", "--steps", "4", "--every", "1", "-o", "run.h5"})
            .exit_code,
        0);
    fs::create_directory(folder_->path("broken"));
    const std::string shard = folder_->read("set/shard-00000.h5");
    folder_->write("broken/shard-00000.h5", shard.substr(0, shard.size() / 2));
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::unique_ptr<Folder> folder_;
};
std::unique_ptr<Folder> ExitCodes::folder_;

TEST_P(ExitCodes, AreThoseOfTheTable) {
  const Outcome outcome = run(*folder_, GetParam().words);
  EXPECT_EQ(outcome.signal, 0);
  EXPECT_EQ(outcome.exit_code, GetParam().exit_code) << outcome.out << outcome.err;
  EXPECT_EQ(outcome.err.find("mistake in tangere"), std::string::npos) << outcome.err;
}

INSTANTIATE_TEST_SUITE_P(
    Commands, ExitCodes,
    ::testing::Values(
        Row{"help", kDone, {"--help"}}, Row{"version", kDone, {"--version"}},
        Row{"inspect", kDone, {"inspect", "small.xml"}},
        Row{"simulate", kDone, {"simulate", "small.xml", "--steps", "2", "-o", "a.h5"}},
        Row{"dry_run",
            kDone,
            {"generate", "small.xml", "--episodes", "2", "--steps", "2", "--every", "2", "-o", "x",
             "--dry-run"}},
        Row{"validate", kDone, {"validate", "set"}}, Row{"info", kDone, {"info", "set"}},
        Row{"merge", kDone, {"merge", "set", "--overwrite"}},
        Row{"export", kDone, {"export", "set", "--csv", "rows.csv"}},
        Row{"plot", kDone, {"plot", "run.h5", "-o", "pads.svg"}},
        Row{"view", kDone, {"view", "run.h5", "-o", "run.html"}},
        Row{"simulate_failed",
            kSomeFailed,
            {"simulate", "failing.xml", "--steps", "2", "-o", "b.h5"}},
        Row{"generate_failed",
            kSomeFailed,
            {"generate", "failing.xml", "--episodes", "2", "--steps", "2", "--every", "1", "-o",
             "failed"}},
        Row{"accuracy_target_missed",
            kSomeFailed,
            {"accuracy", "small.xml", "--steps", "60", "--envs", "1", "--quantity", "state",
             "--target", "1e-12"}},
        Row{"skin", kDone, {"skin", "--modulus", "2e5", "--thickness", "3e-3", "--pitch", "1e-3"}},
        Row{"skin_without_pitch", kUsage, {"skin", "--modulus", "2e5", "--thickness", "3e-3"}},
        Row{"skin_under_a_needle",
            kUsage,
            {"skin", "--modulus", "2e5", "--thickness", "3e-3", "--pitch", "1e-3", "--radius",
             "1e-4", "--press", "1e-4"}},
        Row{"stress", kDone, {"stress", "--case", "slope_below", "--integrator", "BDF1"}},
        Row{"stress_silent_failure",
            kSomeFailed,
            {"stress", "--case", "sliding_cube", "--integrator", "BDF1", "--timestep", "0.05"}},
        Row{"stress_unknown_case", kUsage, {"stress", "--case", "slope"}},
        Row{"no_subcommand", kUsage, {}}, Row{"unknown_subcommand", kUsage, {"simulat"}},
        Row{"unknown_option", kUsage, {"inspect", "small.xml", "--colour"}},
        Row{"missing_option", kUsage, {"simulate", "small.xml"}},
        Row{"number_out_of_range", kUsage, {"simulate", "small.xml", "--envs", "0", "-o", "c.h5"}},
        Row{"bad_scene", kUsage, {"inspect", "bad.xml"}},
        Row{"too_much_memory",
            kUsage,
            {"simulate", "small.xml", "--envs", "1000000000", "--steps", "2", "-o", "c.h5"}},
        Row{"too_many_shards",
            kUsage,
            {"generate", "small.xml", "--episodes", "1000000000", "--steps", "100000", "-o", "x",
             "--dry-run"}},
        Row{"missing_scene", kInputOutput, {"inspect", "none.xml"}},
        Row{"missing_set", kInputOutput, {"validate", "none"}},
        Row{"existing_output",
            kInputOutput,
            {"simulate", "small.xml", "--steps", "2", "-o", "run.h5"}},
        Row{"no_folder",
            kInputOutput,
            {"simulate", "small.xml", "--steps", "2", "-o", "none/a.h5"}},
        Row{"validate_damaged", kInputOutput, {"validate", "broken"}},
        Row{"info_damaged", kInputOutput, {"info", "broken"}},
        Row{"merge_damaged", kInputOutput, {"merge", "broken"}},
        Row{"export_damaged", kInputOutput, {"export", "broken", "--csv", "d.csv"}},
        Row{"view_damaged", kInputOutput, {"view", "broken", "-o", "d.html"}},
        Row{"plot_damaged", kInputOutput, {"plot", "broken/shard-00000.h5", "-o", "d.svg"}}),
    [](const auto& row) { return row.param.name; });

TEST(ExitCode, OfASignalIsThatOfTheTable) {
  for (const auto& [signal, code] :
       {std::pair{SIGTERM, kTerminated}, std::pair{SIGINT, kInterrupted}}) {
    const Folder folder;
    Program program(folder, {"simulate", scene("rolling_ball_small.xml"), "--steps", "10000000",
                             "--every", "1000", "-o", "long.h5"});
    while (!std::filesystem::exists(folder.path("long.h5.part")))
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    program.send(signal);
    EXPECT_EQ(program.wait().exit_code, code);
  }
}

/// Every code has one row in the table, and no row has a code that does not exist.
TEST(ExitCode, IsDocumentedOnce) {
  const std::string page = file_bytes(TANGERE_SOURCE_DIR "/docs/command.md");
  const std::string item = "\n- **";
  std::string list = page.substr(page.find("**Exit codes.**"));
  list = list.substr(0, list.find("\n\n", list.find(item)));
  std::multiset<int> codes;
  for (std::size_t at = list.find(item); at != std::string::npos; at = list.find(item, at + 1))
    codes.insert(std::stoi(list.substr(at + item.size())));
  EXPECT_EQ(codes, (std::multiset<int>{kDone, kSomeFailed, kUsage, kInputOutput, kTerminated,
                                       kInterrupted}));
  const Folder folder;
  std::string help = run(folder, {"--help"}).out;
  std::replace(help.begin(), help.end(), '\n', ' ');
  for (const int code : codes) EXPECT_THAT(help, HasSubstr(" " + std::to_string(code) + " "));
  for (const char* other : {"/apps/README.md", "/docs/failures.md", "/README.md"})
    EXPECT_EQ(file_bytes(std::string(TANGERE_SOURCE_DIR) + other).find("**Exit codes.**"),
              std::string::npos)
        << other;
}

}  // namespace
}  // namespace tangere::apps
