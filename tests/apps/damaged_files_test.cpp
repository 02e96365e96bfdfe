// SPDX-License-Identifier: Apache-2.0
// HDF5 files that are damaged or made to do harm: every command that reads them ends with code 3
// and a message, never by a signal, and never as "a mistake in tangere".
#include <gmock/gmock.h>
#include <hdf5.h>
#include <sys/stat.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"
#include "tests/fuzz/mutator.hpp"
#include "tests/sanitized.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

/// Opens a file, changes it and closes it.
void change(const std::string& path, const std::function<void(hid_t)>& edit) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  ASSERT_GE(file, 0);
  edit(file);
  ASSERT_GE(H5Fclose(file), 0);
}

/// Replaces an attribute by a list of numbers; of one that is written as a scalar, too.
void put_numbers(hid_t file, const char* object, const char* name,
                 const std::vector<std::int64_t>& numbers) {
  H5Adelete_by_name(file, object, name, H5P_DEFAULT);
  const hsize_t size = numbers.size();
  const hid_t space = numbers.size() == 1 ? H5Screate(H5S_SCALAR)
                      : numbers.empty()   ? H5Screate(H5S_NULL)
                                          : H5Screate_simple(1, &size, nullptr);
  const hid_t attribute = H5Acreate_by_name(file, object, name, H5T_STD_I64LE, space, H5P_DEFAULT,
                                            H5P_DEFAULT, H5P_DEFAULT);
  ASSERT_GE(attribute, 0);
  if (!numbers.empty()) {
    ASSERT_GE(H5Awrite(attribute, H5T_NATIVE_INT64, numbers.data()), 0);
  }
  H5Aclose(attribute);
  H5Sclose(space);
}

std::function<void(hid_t)> number(const char* object, const char* name, std::int64_t value) {
  return [=](hid_t file) { put_numbers(file, object, name, {value}); };
}

/// Replaces demo_0's q by a dataset with these properties.
void put_q(hid_t file, hid_t properties, std::vector<hsize_t> dims) {
  const char* const name = "data/demo_0/obs/q";
  ASSERT_GE(H5Ldelete(file, name, H5P_DEFAULT), 0);
  const hid_t space = H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr);
  const hid_t made =
      H5Dcreate2(file, name, H5T_IEEE_F32LE, space, H5P_DEFAULT, properties, H5P_DEFAULT);
  ASSERT_GE(made, 0);
  H5Dclose(made);
  H5Sclose(space);
  H5Pclose(properties);
}

void show_itself(hid_t file) {
  const std::array<hsize_t, 2> dims{2, 10};
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE),
              space = H5Screate_simple(2, dims.data(), nullptr);
  ASSERT_GE(H5Pset_virtual(properties, space, ".", "/data/demo_0/obs/q", space), 0);
  H5Sclose(space);
  put_q(file, properties, {dims[0], dims[1]});
}

void show_a_system_file(hid_t file) {
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
  ASSERT_GE(H5Pset_external(properties, "/etc/passwd", 0, 80), 0);
  put_q(file, properties, {2, 10});
}

void claim_too_much(hid_t file) {
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
  const std::array<hsize_t, 3> chunk{1, 1, 1};
  ASSERT_GE(H5Pset_chunk(properties, 3, chunk.data()), 0);
  put_q(file, properties, {hsize_t{1} << 31, hsize_t{1} << 31, hsize_t{1} << 31});
}

void link_outside(hid_t file) {
  ASSERT_GE(H5Ldelete(file, "data/demo_0/obs/q", H5P_DEFAULT), 0);
  ASSERT_GE(H5Lcreate_external("../outside.h5", "/data/demo_0/obs/q", file, "data/demo_0/obs/q",
                               H5P_DEFAULT, H5P_DEFAULT),
            0);
}

void contain_itself(hid_t file) {
  ASSERT_GE(H5Lcreate_hard(file, "data/demo_0/obs", file, "data/demo_0/obs/again", H5P_DEFAULT,
                           H5P_DEFAULT),
            0);
}

void nest_deep(hid_t file) {
  hid_t group = H5Gopen2(file, "data/demo_0/obs", H5P_DEFAULT);
  for (int depth = 0; depth < 20'000; ++depth) {
    const hid_t inner = H5Gcreate2(group, "g", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    ASSERT_GE(inner, 0);
    H5Gclose(group);
    group = inner;
  }
  H5Gclose(group);
}

void number_backwards(hid_t file) {
  ASSERT_GE(H5Lmove(file, "data/demo_0", file, "data/demo_-7", H5P_DEFAULT, H5P_DEFAULT), 0);
}

/// Garbage where the texts of attributes lie, which HDF5 1.10 does not check.
void damage_heaps(const std::string& path) {
  std::string bytes = file_bytes(path);
  for (std::size_t at = bytes.find("GCOL"); at != std::string::npos;
       at = bytes.find("GCOL", at + 4))
    for (std::size_t k = 16; k < 80 && at + k < bytes.size(); ++k) bytes[at + k] = '\xFF';
  std::ofstream(path, std::ios::binary) << bytes;
}

struct Damage {
  std::string name;
  std::function<void(hid_t)> edit;
  std::string said;  ///< by `validate`
};
void PrintTo(const Damage& damage, std::ostream* out) { *out << damage.name; }

Words generate() {
  return {"generate",   scene("rolling_ball_small.xml"),
          "--episodes", "3",
          "--steps",    "10",
          "--every",    "5",
          "--threads",  "1",
          "-o",         "set"};
}

void expect_answer(const Outcome& outcome, const std::string& command, const std::string& said) {
  SCOPED_TRACE(command);
  EXPECT_EQ(outcome.signal, 0) << outcome.err;
  EXPECT_THAT(outcome.err, Not(HasSubstr("mistake in tangere")));
  EXPECT_THAT(outcome.out, Not(HasSubstr("root:")));
  EXPECT_THAT(outcome.out, Not(HasSubstr("-7")));
  if (said.empty()) return;
  EXPECT_NE(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err + outcome.out, HasSubstr(said));
}

class DamagedShard : public ::testing::TestWithParam<Damage> {
 protected:
  /// The set that is damaged: written once, copied for each damage.
  static void SetUpTestSuite() {
    whole_ = std::make_unique<Folder>();
    ASSERT_EQ(run(*whole_, generate()).exit_code, 0);
  }
  static void TearDownTestSuite() { whole_.reset(); }
  static inline std::unique_ptr<Folder> whole_;
};

TEST_P(DamagedShard, EndsInAMessage) {
  const Folder folder;
  fs::copy(whole_->path(), folder.path(),
           fs::copy_options::recursive | fs::copy_options::copy_symlinks);
  fs::copy_file(folder.path("set/shard-00000.h5"), folder.path("outside.h5"));
  change(folder.path("set/shard-00000.h5"), GetParam().edit);
  expect_answer(run(folder, {"validate", "set"}), "validate", GetParam().said);
  expect_answer(run(folder, {"info", "set"}), "info", "");
  expect_answer(run(folder, {"export", "set", "--csv", "x.csv"}), "export", "");
  expect_answer(run(folder, {"view", "set", "-o", "x.html"}), "view", "");
  expect_answer(run(folder, {"merge", "set", "--copy", "--overwrite"}), "merge", "");
  expect_answer(run(folder, generate() + Words{"--resume"}), "resume", "");
}

INSTANTIATE_TEST_SUITE_P(
    Files, DamagedShard,
    ::testing::Values(
        Damage{"no_interval", number("scene", "every", 0), "'every' is 0; expected 1"},
        Damage{"no_steps", number("scene", "steps", 0), "'steps' is 0; expected 1"},
        Damage{"endless_episodes", number(".", "episodes", 1'000'000'000'000'000),
               "expected 1000000000000000 together"},
        Damage{"endless_shards", number(".", "dataset_shards", 1'000'000'000),
               "counts 1000000000 shards; expected 1 to 1000000"},
        Damage{"endless_rows", number("data/demo_0", "num_samples", 3'000'000'000),
               "demo_0 has 3000000000 rows, expected 2"},
        Damage{"an_empty_number", [](hid_t file) { put_numbers(file, "scene", "steps", {}); },
               "expected one number; found 0"},
        Damage{"two_numbers",
               [](hid_t file) {
                 put_numbers(file, "scene", "steps", {1, 2});
               },
               "expected one number; found 2"},
        Damage{"a_view_of_itself", show_itself, "it shows itself"},
        Damage{"numbers_of_the_system", show_a_system_file, "its numbers lie in another file"},
        Damage{"more_than_any_file", claim_too_much, "more numbers than any file holds"},
        Damage{"a_link_outside", link_outside, "cannot open dataset"},
        Damage{"a_group_in_itself", contain_itself, ""},
        Damage{"groups_nested_deep", nest_deep, ""},
        Damage{"a_negative_episode", number_backwards, "episode 0 is not in exactly one of"}),
    [](const auto& damage) { return damage.param.name; });

TEST(DamagedFile, HeapsThatTheLibraryTrustsEndInAMessage) {
  const Folder folder;
  ASSERT_EQ(run(folder, generate()).exit_code, 0);
  damage_heaps(folder.path("set/shard-00000.h5"));
  for (const Words& words :
       {Words{"validate", "set"}, Words{"info", "set"}, Words{"merge", "set", "--overwrite"},
        generate() + Words{"--resume"}}) {
    const Outcome outcome = run(folder, words);
    expect_answer(outcome, words[0], "");
    EXPECT_NE(outcome.exit_code, 0);
    EXPECT_THAT(outcome.err + outcome.out, HasSubstr("shard-00000.h5"));
  }
}

/// What the library loops over is ended after a second instead of ten.
const std::vector<std::string> kSoon = {"TANGERE_READ_SECONDS=1"};

/// Sets the size of the free space in every heap of texts to zero. HDF5 1.10 then steps from object
/// to object for ever.
int empty_the_free_space(std::string& bytes) {
  const auto number_at = [&](std::size_t at, std::size_t size) {
    std::uint64_t number = 0;
    std::memcpy(&number, &bytes.at(at), size);
    return number;
  };
  int heaps = 0;
  for (std::size_t heap = bytes.find("GCOL"); heap != std::string::npos;
       heap = bytes.find("GCOL", heap + 4)) {
    const std::uint64_t end = heap + number_at(heap + 8, 8);
    // An object: its number (2 bytes), references (2), nothing (4), its size (8), the text.
    std::uint64_t at = heap + 16;
    while (at + 16 <= end && number_at(at, 2) != 0) at += 16 + (number_at(at + 8, 8) + 7) / 8 * 8;
    if (at + 16 > end) continue;
    bytes.replace(at + 8, 8, 8, '\0');
    ++heaps;
  }
  return heaps;
}

TEST(DamagedFile, HeapsOverWhichTheLibraryLoopsEndInAMessage) {
  const Folder folder;
  ASSERT_EQ(
      run(folder, {"simulate", scene("rolling_ball_small.xml"), "--steps", "4", "-o", "run.h5"})
          .exit_code,
      0);
  std::string bytes = folder.read("run.h5");
  ASSERT_GT(empty_the_free_space(bytes), 0);
  folder.write("run.h5", bytes);
  const Outcome outcome = run(folder, {"plot", "run.h5", "-o", "pads.svg"}, kSoon);
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err,
              HasSubstr("the HDF5 library did not come back within 1 s of computing (0.2 s "
                        "where it reads no numbers); "
                        "it had last read 'run.h5', object "));
}

TEST(DamagedFile, ShardsOverWhichTheLibraryLoopsEndResuming) {
  const Folder folder;
  ASSERT_EQ(run(folder, generate()).exit_code, 0);
  std::string bytes = folder.read("set/shard-00000.h5");
  ASSERT_GT(empty_the_free_space(bytes), 0);
  folder.write("set/shard-00000.h5", bytes);
  const Outcome outcome = run(folder, generate() + Words{"--resume"}, kSoon);
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err,
              HasSubstr("the HDF5 library did not come back within 1 s of computing (0.2 s "
                        "where it reads no numbers); "
                        "it had last read 'set/shard-00000.h5', object "));
}

TEST(DamagedFile, TheLimitOfReadingIsAWholeNumberOfSeconds) {
  const Folder folder;
  for (const char* text : {"", "0", "-1", "1.5", "soon", "86401", "99999999999999999999"}) {
    const Outcome outcome =
        run(folder, {"validate", "set"}, {std::string("TANGERE_READ_SECONDS=") + text});
    EXPECT_EQ(outcome.exit_code, 2) << text;
    EXPECT_THAT(outcome.err, HasSubstr(std::string("TANGERE_READ_SECONDS=") + text +
                                       "; expected a whole number of seconds, 1 to 86400"));
  }
}

/// HDF5 1.10 ended the process that read mutants 79, 218 and 257 with a segmentation fault. The
/// address sanitizer finds its read first; it is told to end the process by a signal as well.
TEST(DamagedFile, MutantsOfAShardDoNotCrashResuming) {
  const Folder folder;
  if (kSanitized) setenv("ASAN_OPTIONS", "abort_on_error=1", 1);
  fs::copy_file(scene("rolling_ball_small.xml"),
                folder.path("scene.xml"));  // same words, same bytes
  Words words = generate();
  words[1] = "scene.xml";
  ASSERT_EQ(run(folder, words).exit_code, 0);
  const std::string whole = folder.read("set/shard-00000.h5");
  for (const std::uint64_t mutant : {2, 5, 79, 218, 257}) {
    SCOPED_TRACE(mutant);
    folder.write("set/shard-00000.h5", fuzz::Mutator(mutant).hdf5({whole}));
    const Outcome outcome = run(folder, words + Words{"--resume"});
    expect_answer(outcome, "resume", "");
    EXPECT_GE(outcome.exit_code, 0);
    if (outcome.exit_code != 0) {
      EXPECT_THAT(outcome.err, HasSubstr("shard-00000.h5"));
    }
    if (outcome.err.find("ERROR: AddressSanitizer") != std::string::npos) {
      EXPECT_THAT(outcome.err, HasSubstr(" in H5HG_read"));  // the library's mistake, not ours
    }
  }
  if (kSanitized) unsetenv("ASAN_OPTIONS");
}

TEST(DamagedFile, ATrajectoryWithoutFiniteForcesIsNotDrawn) {
  const Folder folder;
  ASSERT_EQ(run(folder, {"simulate", scene("rolling_ball_small.xml"), "--steps", "20", "--every",
                         "1", "-o", "run.h5"})
                .exit_code,
            0);
  const auto put_force = [&](double value) {
    change(folder.path("run.h5"), [&](hid_t file) {
      const hid_t force = H5Dopen2(file, "tactile/pad/force", H5P_DEFAULT),
                  all = H5Dget_space(force);
      const std::array<hsize_t, 5> first{0, 0, 0, 0, 0}, one{1, 1, 1, 1, 1};
      H5Sselect_hyperslab(all, H5S_SELECT_SET, first.data(), nullptr, one.data(), nullptr);
      const hid_t memory = H5Screate_simple(5, one.data(), nullptr);
      EXPECT_GE(H5Dwrite(force, H5T_NATIVE_DOUBLE, memory, all, H5P_DEFAULT, &value), 0);
      for (const hid_t space : {all, memory}) H5Sclose(space);
      H5Dclose(force);
    });
  };
  for (const auto& [value, shown] : {std::pair{double{NAN}, "nan"}, {HUGE_VAL, "inf"}}) {
    put_force(value);
    const Outcome outcome = run(folder, {"plot", "run.h5", "-o", "pads.svg"});
    EXPECT_EQ(outcome.exit_code, 3);
    EXPECT_THAT(outcome.err, HasSubstr(std::string("frame 0 has a number that is ") + shown));
    const Outcome page = run(folder, {"view", "run.h5", "-o", "run.html"});
    EXPECT_EQ(page.exit_code, 3);
    EXPECT_THAT(page.err, HasSubstr(std::string("has a number that is ") + shown));
  }
  change(folder.path("run.h5"),
         [](hid_t file) { put_numbers(file, "tactile/pad/force", "every", {0}); });
  EXPECT_THAT(run(folder, {"plot", "run.h5", "-o", "pads.svg"}).err, HasSubstr("every 0 steps"));
}

/// Every status of the steps becomes 77, which means nothing.
void damage_status(hid_t file) {
  const hid_t status = H5Dopen2(file, "solver/status", H5P_DEFAULT), all = H5Dget_space(status);
  const std::vector<std::int8_t> values(static_cast<std::size_t>(H5Sget_simple_extent_npoints(all)),
                                        77);
  EXPECT_GE(H5Dwrite(status, H5T_NATIVE_INT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
  H5Sclose(all);
  H5Dclose(status);
}

/// What a trajectory claims is checked before anyone counts with it.
TEST(DamagedFile, ATrajectoryThatClaimsWhatNoRunHasIsRefused) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  struct Claim {
    std::function<void(hid_t)> edit;
    const char *of_run, *of_page;  // said by `simulate --state-from` and `view`; "": nothing
  };
  const Folder folder;
  const Words run_words{"simulate", scene("rolling_ball_small.xml"), "--steps", "20"};
  ASSERT_EQ(run(folder, run_words + Words{"-o", "whole.h5"}).exit_code, 0);
  for (const Claim& claim :
       {Claim{number(".", "first_step", kMost), "'first_step' is 9223372036854775807; expected 0",
              "after 9223372036854775807 steps: the file is damaged"},
        Claim{number(".", "first_step", -1), "'first_step' is -1; expected 0 to",
              "after -1 steps: the file is damaged"},
        Claim{number(".", "steps", kMost), "'steps' is 9223372036854775807; expected 0 to",
              "'steps' is 9223372036854775807"},
        Claim{number(".", "steps", 3), "the states are damaged", "claims 4 fields of 3 steps"},
        Claim{number(".", "environments", (std::int64_t{1} << 32) + 1),
              "'environments' is 4294967297; expected 1 to 2147483647", "has the shape"},
        Claim{number(".", "first_episode", kMost), "'first_episode' is 9223372036854775807", ""},
        Claim{damage_status, "solver status 77 of row 20: the file is damaged", ""}}) {
    fs::copy_file(folder.path("whole.h5"), folder.path("run.h5"),
                  fs::copy_options::overwrite_existing);
    change(folder.path("run.h5"), claim.edit);
    const Outcome more = run(folder, run_words + Words{"--state-from", "run.h5", "-o", "more.h5"});
    expect_answer(more, "simulate --state-from", claim.of_run);
    EXPECT_EQ(more.exit_code, 3) << more.err;
    expect_answer(run(folder, {"view", "run.h5", "-o", "run.html", "--overwrite"}), "view",
                  claim.of_page);
    expect_answer(run(folder, {"plot", "run.h5", "-o", "run.svg", "--overwrite"}), "plot", "");
    EXPECT_FALSE(fs::exists(folder.path("more.h5")));
  }
}

TEST(DamagedFile, OtherThanRegularFilesAreRefused) {
  const Folder folder;
  for (const Words& words :
       {Words{"simulate", "/dev/zero", "-o", "x.h5"}, Words{"validate", "/dev/zero"},
        Words{"plot", "/dev/zero", "-o", "x.svg"}}) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 3) << words[0];
    EXPECT_THAT(outcome.err, HasSubstr("/dev/zero: is a device")) << words[0];
  }
  // Nobody writes into it: who opened it would wait for ever.
  ASSERT_EQ(mkfifo(folder.path("pipe").c_str(), 0600), 0);
  const std::string small = scene("rolling_ball_small.xml");
  folder.write("mesh.xml", R"(<tangere><robot><link name="a"><joint name="a" type="free3d"/>
<body name="a" type="mesh" filename="pipe.obj" density="1"/></link></robot></tangere>)");
  fs::create_symlink("pipe", folder.path("pipe.obj"));
  for (const Words& words :
       {Words{"inspect", "pipe"}, Words{"inspect", "mesh.xml"}, Words{"info", "pipe"},
        Words{"simulate", small, "--controls", "pipe", "-o", "x.h5"},
        Words{"simulate", small, "--state-from", "pipe", "--steps", "2", "-o", "x.h5"},
        Words{"view", "pipe", "-o", "x.html"}, Words{"export", "pipe", "--csv", "x.csv"}}) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 3) << words[0];
    EXPECT_THAT(outcome.err, HasSubstr(": is a FIFO; expected ")) << words[0];
  }
}

TEST(DamagedFile, TextThatIsNoUtf8IsRefusedWithItsLine) {
  const Folder folder;
  folder.write("scene.xml", "<redmax>\n  <!-- \xFF -->\n</redmax>\n");
  const Outcome outcome = run(folder, {"inspect", "scene.xml"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("scene.xml:2: byte 0xff is no UTF-8"));
}

TEST(DamagedFile, NamesToRecordStandOnce) {
  const Folder folder;
  const Outcome outcome = run(folder, generate() + Words{"--record", "q,q"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("'q' is listed twice"));
}

TEST(DamagedFile, TheViewForMinariDoesNotFollowLinks) {
  const Folder folder, elsewhere;
  ASSERT_EQ(run(folder, generate() + Words{"--no-merge"}).exit_code, 0);
  fs::create_directory_symlink(elsewhere.path(), folder.path("set/minari"));
  const Outcome outcome = run(folder, {"merge", "set"});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("is a symbolic link"));
  EXPECT_TRUE(elsewhere.files().empty());
}

}  // namespace
}  // namespace tangere::apps
