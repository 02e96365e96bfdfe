// SPDX-License-Identifier: Apache-2.0
// One call of the operating system fails, whichever it is, or says that it succeeded and did not. A
// file under its final name holds exactly what an undisturbed run writes, or is absent, and the
// exit code tells which: 0 only if all is there. Where a run replaces a file, the name may hold
// what it held before. TANGERE_FAULTS=all tries every call, TANGERE_FAULTS=N some N calls of each
// kind; without it, a few calls spread over all of them.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

/// Every file below a folder that has its final name, and its bytes.
std::map<std::string, std::string> final_files(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = fs::relative(entry.path(), folder);
    if (entry.is_regular_file() && !name.ends_with(".part") && !name.ends_with(".lock"))
      files[name] = file_bytes(entry.path());
  }
  return files;
}

struct Job {
  std::string name;
  std::vector<Words> before;  ///< undisturbed
  Words words;
};

void PrintTo(const Job& job, std::ostream* out) { *out << job.name; }

const Words kSimulate = {"simulate", "scene.xml", "--steps", "20", "-o", "run.h5"};
/// Its programs are asked by the one that is tried, and keep out of its way.
const Words kProgram = {"--program", "LD_PRELOAD= exec " TANGERE_POLICY_PROGRAM};
const Words kTask = {"generate", "box_pushing", "--episodes", "2", "--threads", "1", "-o", "task"};
const Words kGenerate = {"generate",  "scene.xml", "--episodes", "40",       "--steps",
                         "10",        "--every",   "5",          "--shards", "2",
                         "--threads", "2",         "-o",         "set"};

std::vector<Job> jobs() {
  return {
      {"simulate", {}, kSimulate},
      {"controls", {}, kSimulate + Words{"--controls", "u.csv"}},
      {"simulate_gradients", {}, kSimulate + Words{"--gradients", "final"}},
      {"generate", {}, kGenerate},
      {"generate_deflate", {}, kGenerate + Words{"--compress", "deflate"}},
      {"generate_lz4", {}, kGenerate + Words{"--compress", "lz4"}},
      {"generate_dense", {}, kGenerate + Words{"--tactile", "dense"}},
      {"resume", {kGenerate + Words{"--shard", "0/2"}}, kGenerate + Words{"--resume"}},
      {"merge_copy", {kGenerate + Words{"--no-merge"}}, {"merge", "set", "--copy"}},
      {"merge", {kGenerate + Words{"--no-merge"}}, {"merge", "set"}},
      {"overwrite",
       {kGenerate + Words{"--seed", "3"}},
       kGenerate + Words{"--seed", "4", "--overwrite"}},
      {"go_on",
       {kSimulate},
       Words{"simulate", "scene.xml", "--steps", "9", "-o", "more.h5"} +
           Words{"--state-from", "run.h5"}},
      {"simulate_task", {}, {"simulate", "box_pushing", "-o", "task.h5"}},
      {"generate_program", {}, kTask + kProgram},
      {"export", {kGenerate}, {"export", "set", "--csv", "rows.csv"}},
      {"plot", {kSimulate}, {"plot", "run.h5", "-o", "pads.svg"}},
      {"view", {kSimulate}, {"view", "run.h5", "-o", "run.html"}},
      {"view_set", {kGenerate}, {"view", "set", "-o", "set.html"}},
  };
}

/// Whether calls of a kind say that they succeeded, and did not.
bool lies(const std::string& kind) { return kind == "lost" || kind == "zeros"; }

/// Calls of a kind that are tried; none given: about two, one of every `calls` / 2. Of those that
/// lie it is three times as many: a later write may replace what one of them has lost.
long tries_of(const std::string& kind, long calls) {
  const char* const given = std::getenv("TANGERE_FAULTS");
  if (given == nullptr) return std::min(calls, lies(kind) ? 6L : 2L);
  return std::string(given) == "all" ? calls : std::stol(given);
}

/// What the other runs of a job are compared with. Made once for all kinds of calls.
struct Undisturbed {
  Folder before;                                ///< copied for every call that fails
  std::map<std::string, std::string> given;     ///< final files before the job
  std::map<std::string, std::string> expected;  ///< and after it
  std::map<std::string, long> calls;            ///< by kind
};

Outcome run_shimmed(const Folder& folder, const Words& words, const std::string& fault,
                    const std::string& count = "") {
  std::vector<std::string> environment = {"LD_PRELOAD=" TANGERE_FAULT_SHIM,
                                          "TANGERE_FAULT=" + fault};
  if (!count.empty()) environment.push_back("TANGERE_FAULT_COUNT=" + count);
  return run(folder, words, environment);
}

void copy_folder(const Folder& from, const Folder& to) {
  fs::copy(from.path(), to.path(), fs::copy_options::recursive | fs::copy_options::copy_symlinks);
}

void prepare_job(const Job& job, const Words& words, Undisturbed& u) {
  fs::copy_file(scene("rolling_ball_small.xml"), u.before.path("scene.xml"));
  std::string table;  // of many buffers
  for (int row = 0; row < 5000; ++row) table += "0.01,0,0.19999\n";
  u.before.write("u.csv", table);
  for (const Words& before : job.before) ASSERT_EQ(run(u.before, before).exit_code, 0);
  const Folder folder, counts;
  copy_folder(u.before, folder);
  u.given = final_files(folder.path());
  const Outcome whole = run_shimmed(folder, words, "count:0", counts.path("calls"));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  u.expected = final_files(folder.path());
  ASSERT_NE(u.expected, u.given);
  std::istringstream lines(file_bytes(counts.path("calls")));
  std::string kind;
  for (long number = 0; lines >> kind >> number;) u.calls[kind] = number;
}

class Fault : public ::testing::TestWithParam<std::tuple<Job, const char*>> {
 protected:
  void SetUp() override {
    const Job& job = std::get<0>(GetParam());
    const bool memory = std::string(std::get<1>(GetParam())) == "memory";
    words_ = job.words;
    // The n-th allocation is the same one in every run only if threads do not take turns.
    if (memory)
      if (const auto threads = std::find(words_.begin(), words_.end(), "--threads");
          threads != words_.end())
        *(threads + 1) = "1";
    static std::map<std::pair<std::string, bool>, Undisturbed> all;
    const auto [place, added] = all.try_emplace({job.name, memory});
    if (added) prepare_job(job, words_, place->second);
    whole_ = &place->second;
  }
  Words words_;
  const Undisturbed* whole_ = nullptr;
};

TEST_P(Fault, LeavesWholeFilesOrNone) {
  const std::string kind = std::get<1>(GetParam());
  const auto& [before, given, expected, all_calls] = *whole_;
  ASSERT_TRUE(all_calls.contains(kind));
  const long calls = all_calls.at(kind);
  const long step = std::max(1L, calls / std::max(1L, tries_of(kind, calls)));
  int failed = 0, tried = 0;
  // oneTBB crashes where it is refused a thread, so the program asks for threads beforehand: a
  // limit shows at the first.
  const long last = kind == "thread" ? std::min(calls, 1L) : calls;
  for (long n = 1; n <= last; n += step, ++tried) {
    SCOPED_TRACE(std::to_string(n) + " of " + std::to_string(calls) + " calls");
    const Folder folder;
    copy_folder(before, folder);
    const Outcome outcome = run_shimmed(folder, words_, kind + ":" + std::to_string(n));
    ASSERT_EQ(outcome.signal, 0) << outcome.err;
    // HDF5 1.10 crashes over some reads that fail while it copies; the command survives that.
    if (kind != "read") {
      ASSERT_THAT(outcome.err, Not(HasSubstr("ended by a signal")));
    }
    const auto files = final_files(folder.path());
    for (const auto& [name, bytes] : files) {
      const auto same = expected.find(name), old = given.find(name);
      ASSERT_TRUE(same != expected.end()) << name << "\n" << outcome.err;
      ASSERT_TRUE(same->second == bytes || (old != given.end() && old->second == bytes))
          << name << " differs\n"
          << outcome.err;
    }
    if (outcome.exit_code == 0) {
      ASSERT_TRUE(files == expected) << outcome.err;
      continue;
    }
    ASSERT_FALSE(outcome.err.empty());
    ++failed;
    if (!lies(kind)) continue;
    ASSERT_EQ(outcome.exit_code, 3) << outcome.err;
    ASSERT_THAT(outcome.err, ContainsRegex("'[^']+\\.part' is damaged: .*(bytes|read back)"));
  }
  // Every job writes a file, flushes it and gives it its name.
  if (kind == "write" || kind == "sync" || kind == "rename" || lies(kind)) {
    EXPECT_GT(failed, 0);
  }
  RecordProperty("calls", static_cast<int>(last));
  RecordProperty("tried", tried);
  RecordProperty("failed", failed);
}

INSTANTIATE_TEST_SUITE_P(Calls, Fault,
                         ::testing::Combine(::testing::ValuesIn(jobs()),
                                            ::testing::Values("write", "sync", "rename", "close",
                                                              "truncate", "open", "read", "thread",
                                                              "memory", "lost", "zeros")),
                         [](const auto& fault) {
                           return std::get<0>(fault.param).name + "_" + std::get<1>(fault.param);
                         });

}  // namespace
}  // namespace tangere::apps
