// SPDX-License-Identifier: Apache-2.0
// Mutants of every kind of file that tangere reads: each is read or refused with a documented
// error, in 10 s and 1 GB. TANGERE_FUZZ=N reads N mutants of each kind, TANGERE_FUZZ_FIRST=K from
// number K on.
#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/fuzz/mutator.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/fuzz/watched_child.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere::fuzz {

static void PrintTo(const Target& target, std::ostream* out) { *out << target.name; }

namespace {

namespace fs = std::filesystem;

std::uint64_t number_from(const char* variable, std::uint64_t otherwise) {
  const char* const given = std::getenv(variable);
  return given == nullptr ? otherwise : std::stoull(given);
}

class Fuzz : public ::testing::TestWithParam<Target> {};

/// Keeps a mutant for whoever repairs the reader; returns where.
std::string keep(const std::string& name, const std::string& bytes) {
  const fs::path path = fs::temp_directory_path() / name;
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

TEST_P(Fuzz, EveryMutantIsReadOrRefused) {
  const Target& target = GetParam();
  const std::uint64_t first = number_from("TANGERE_FUZZ_FIRST", 0),
                      end = first + number_from("TANGERE_FUZZ", target.hdf5 ? 20 : 200),
                      in_child = target.hdf5 ? 20 : 1000;
  const testing::Folder scratch;
  const std::string folder = scratch / "folder";
  fs::create_directory(folder);
  const std::vector<std::string> corpus = target.prepare(folder);
  const auto mutant = [&](std::uint64_t seed) {
    Mutator change(seed);
    return target.hdf5 ? change.hdf5(corpus) : change.text(corpus);
  };
  for (const std::string& whole : corpus) EXPECT_TRUE(read_mutant(target, folder, whole));
  const auto read = [&](std::uint64_t seed) { return read_mutant(target, folder, mutant(seed)); };
  std::uint64_t accepted = 0, crashes = 0, forgiven = 0;
  int findings = 0;
  for (std::uint64_t next = first; next < end && findings < 5;) {
    const ChildEnd child = run_in_watched_child(next, std::min(next + in_child, end), read);
    next += child.done;
    accepted += child.accepted;
    if (child.leaked && !child.finding.empty()) {
      ++findings;
      ADD_FAILURE() << "a mutant of " << target.name << " up to " << next << ": " << child.finding;
    }
    if (!child.crashed) continue;
    // HDF5 may have damaged the memory of the child over the mutants before, and a machine that
    // pauses makes any of them slow. Nothing else needs a second look.
    const bool again = target.hdf5 || child.slow;
    if (!child.finding.empty() &&
        (!again || run_in_watched_child(next, next + 1, read).finding != "")) {
      ++findings;
      const std::string name = "tangere-" + target.name + "-" + std::to_string(next);
      ADD_FAILURE() << "mutant " << next << " of " << target.name << " ("
                    << keep(name, mutant(next)) << "): " << child.finding;
    } else {
      ++forgiven;
    }
    ++crashes;
    ++next;
  }
  std::printf(
      "%s: %llu mutants, %llu read, %llu ended by the HDF5 library or by a pause, %d findings\n",
      target.name.c_str(), static_cast<unsigned long long>(end - first),
      static_cast<unsigned long long>(accepted), static_cast<unsigned long long>(forgiven),
      findings);
  EXPECT_GT(accepted, 0U);                     // else only the first check is tested
  EXPECT_LT(accepted, end - first - crashes);  // else nothing is
}

INSTANTIATE_TEST_SUITE_P(Files, Fuzz, ::testing::ValuesIn(targets()),
                         [](const auto& target) { return target.param.name; });

TEST(WatchedChild, TellsOurCrashesFromOthers) {
  const auto end_of = [](const std::function<bool(std::uint64_t)>& read) {
    return run_in_watched_child(5, 7, read);
  };
  const ChildEnd well = end_of([](std::uint64_t mutant) { return mutant == 5; });
  EXPECT_EQ(well.done, 2U);
  EXPECT_EQ(well.accepted, 1U);
  EXPECT_FALSE(well.crashed) << well.finding;
  const ChildEnd thrown = end_of(
      [](std::uint64_t mutant) { return mutant == 6 ? throw std::out_of_range("beyond") : true; });
  EXPECT_EQ(thrown.done, 1U);
  EXPECT_THAT(thrown.finding, ::testing::HasSubstr("beyond"));
  const ChildEnd crashed = end_of([](std::uint64_t) {
    volatile int* const nowhere = nullptr;
    return *nowhere != 0;
  });
  EXPECT_TRUE(crashed.crashed);
  EXPECT_NE(crashed.finding, "");
  const ChildEnd full = end_of([](std::uint64_t) {
    std::vector<char> much(std::size_t{3} << 29, 'x');
    return much.back() == 'x';
  });
  EXPECT_NE(full.finding, "");
#ifdef __SANITIZE_ADDRESS__
  const ChildEnd leaky = end_of([](std::uint64_t) {
    int* volatile lost = new int(3);
    const bool three = *lost == 3;
    lost = nullptr;
    return three;
  });
  EXPECT_TRUE(leaky.leaked);
  EXPECT_EQ(leaky.done, 2U);
  EXPECT_THAT(leaky.finding, ::testing::HasSubstr("leak of"));
#endif
}

}  // namespace
}  // namespace tangere::fuzz
