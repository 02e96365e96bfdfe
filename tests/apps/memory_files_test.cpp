// SPDX-License-Identifier: Apache-2.0
// The shear state goes through files: a run that goes on from one is the run that was not
// interrupted, to the bit, and a memory that does not fit is refused.
#include <gmock/gmock.h>
#include <hdf5.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <limits>

#include "tests/apps/arrays.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"
#include "tests/sanitized.hpp"

namespace tangere::apps {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

/// A pad with a skin, both with ks, pushes a box over ground that has it, too.
const std::string kElastic = scene("box_pushing_elastic.xml");
/// Points of the pad on the box, of the box on the ground, and of the skin on two bodies.
constexpr std::size_t kPoints = 66 + 8 + 2 * 130;

/// Runs `simulate WORDS -o out` and returns what it told people.
std::string simulate(const Folder& folder, const std::string& out, const Words& words,
                     int exit_code = 0) {
  const Outcome outcome =
      run(folder, Words{"simulate", kElastic, "-o", out, "--overwrite"} + words);
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  return outcome.err;
}

/// All rows of `other` are the last ones of `one`.
void expect_same_rows(const Folder& folder, const std::string& one, const std::string& other,
                      std::size_t environments) {
  for (const std::string name : {"q", "v", "tactile/pad/force", "memory/s"}) {
    const Array whole = array_of(folder.path(one), name), on = array_of(folder.path(other), name);
    ASSERT_GT(on.dims[0], 0U);
    const std::size_t width = on.values.size() / on.dims[0],
                      all = whole.values.size() / whole.dims[0];
    ASSERT_EQ(width * 19, all * environments) << name;
    for (std::size_t row = 0; row < on.dims[0]; ++row) {
      const double* from = &whole.values[(whole.dims[0] - on.dims[0] + row) * all];
      ASSERT_TRUE(std::equal(from, from + width, &on.values[row * width])) << name << " " << row;
    }
  }
}

class MemoryGoesOn : public ::testing::TestWithParam<std::string> {};

TEST_P(MemoryGoesOn, FromARowOfAFileToTheBit) {
  const Folder folder;
  const Words scheme{"--integrator", GetParam()}, drawn{"--envs", "19", "--seed", "3"};
  const std::string steps = GetParam() == "SDIRK3" && kSanitized ? "100" : "120";
  simulate(folder, "whole.h5", scheme + drawn + Words{"--steps", steps});
  const Array s_start = array_of(folder.path("whole.h5"), "memory/s");
  EXPECT_THAT(s_start.dims, ElementsAre(1, 19, kPoints, 3));
  for (std::size_t e = 0; e < 19; ++e) {
    const auto from = s_start.values.begin() + std::ptrdiff_t(e * kPoints * 3);
    EXPECT_GT(std::count_if(from, from + kPoints * 3, [](double s) { return s != 0; }), 100) << e;
  }
  const std::string rest = std::to_string(std::stoi(steps) - 90);
  // The last row, of which a file has the memory without being asked.
  simulate(folder, "first.h5", scheme + drawn + Words{"--steps", "90"});
  EXPECT_THAT(
      simulate(folder, "on.h5", scheme + Words{"--state-from", "first.h5", "--steps", rest}),
      Not(HasSubstr("unsheared")));
  expect_same_rows(folder, "whole.h5", "on.h5", 19);
  // A row in the middle, fewer environments.
  simulate(folder, "rows.h5", scheme + drawn + Words{"--steps", "105", "--record", "memory/30"});
  EXPECT_EQ(array_of(folder.path("rows.h5"), "memory/step").values,
            (std::vector<double>{0, 30, 60, 90}));
  simulate(
      folder, "few.h5",
      scheme + Words{"--state-from", "rows.h5", "--row", "90", "--steps", rest, "--envs", "3"});
  expect_same_rows(folder, "whole.h5", "few.h5", 3);
}

INSTANTIATE_TEST_SUITE_P(Schemes, MemoryGoesOn,
                         ::testing::Values("BDF1", "BDF2", "SDIRK2", "SDIRK3"),
                         [](const auto& scheme) { return scheme.param; });

/// A skin whose memory waits for its readings, every 5 steps, keeps it in rows between them, too.
TEST(MemoryFiles, HoldWhatWaitsForAReading) {
  const Folder folder;
  std::string text = file_bytes(kElastic);
  const std::string at = "resolution=\"13 10\" every=\"5\"";
  ASSERT_NE(text.find(at), std::string::npos);
  text.insert(text.find(at), "memory=\"read\" ");
  folder.write("waits.xml", text);
  const auto go = [&](const std::string& out, const Words& words) {
    const Outcome outcome = run(folder, Words{"simulate", "waits.xml", "-o", out} + words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  };
  go("whole.h5", {"--steps", "120", "--envs", "19", "--seed", "3"});
  EXPECT_THAT(array_of(folder.path("whole.h5"), "memory/s").dims,
              ElementsAre(1, 19, 66 + 8 + 2 * 130 * 2, 3));
  go("first.h5", {"--steps", "93", "--envs", "19", "--seed", "3"});
  go("on.h5", {"--state-from", "first.h5", "--steps", "27"});
  expect_same_rows(folder, "whole.h5", "on.h5", 19);
}

TEST(MemoryFiles, SayWhatARowLacks) {
  const Folder folder;
  simulate(folder, "first.h5", {"--steps", "60"});
  const Words onward{"--state-from", "first.h5", "--steps", "1"};
  const std::string told = simulate(folder, "on.h5", onward + Words{"--row", "50"});
  EXPECT_THAT(told, HasSubstr("row 50 of first.h5 does not hold the shear state (row 60 "
                              "does): contacts with ks and joints with friction begin unsheared"));
  EXPECT_THAT(array_of(folder.path("on.h5"), "memory/step").values, ElementsAre(1));
  // Where rows of q are thinned, each of them can be continued.
  simulate(folder, "thin.h5", {"--steps", "60", "--record", "q/25,v/25"});
  EXPECT_THAT(array_of(folder.path("thin.h5"), "memory/step").values, ElementsAre(0, 25, 50));
  simulate(folder, "every.h5", {"--steps", "3", "--record", "memory"});
  EXPECT_THAT(array_of(folder.path("every.h5"), "memory/step").values, ElementsAre(0, 1, 2, 3));
  simulate(folder, "end.h5", {"--steps", "3", "--record", "memory/final"});
  EXPECT_THAT(array_of(folder.path("end.h5"), "memory/step").values, ElementsAre(3));
}

TEST(MemoryFiles, IsRefusedWhereThereIsNone) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const Outcome none = run(folder, {"simulate", ball, "-o", "a.h5", "--record", "memory"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("--record: 'memory', but nothing in the scene has ks or friction "
                                  "of joints"));
  const Outcome set =
      run(folder, {"generate", kElastic, "-o", "set", "--episodes", "1", "--record", "q,memory"});
  EXPECT_EQ(set.exit_code, 2);
  EXPECT_THAT(set.err, HasSubstr("--record: 'memory', but a data set does not hold it"));
  EXPECT_EQ(run(folder, {"simulate", ball, "-o", "a.h5", "--steps", "2"}).exit_code, 0);
  const h5::Id file = h5::open_file(folder.path("a.h5"));
  EXPECT_FALSE(h5::has_link(file, "memory"));
}

/// Puts another dataset of zeros in the place of one.
void replace(hid_t file, const char* name, std::vector<hsize_t> dims) {
  ASSERT_GE(H5Ldelete(file, name, H5P_DEFAULT), 0);
  const hid_t space = H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr);
  const hid_t made =
      H5Dcreate2(file, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  ASSERT_GE(made, 0);
  H5Dclose(made);
  H5Sclose(space);
}

/// Writes one number into the first place of a dataset.
void put_first(hid_t file, const char* name, double number) {
  const hid_t dataset = H5Dopen2(file, name, H5P_DEFAULT), space = H5Dget_space(dataset);
  const hsize_t rank = static_cast<hsize_t>(H5Sget_simple_extent_ndims(space));
  const std::vector<hsize_t> zero(rank, 0), one(rank, 1);
  H5Sselect_hyperslab(space, H5S_SELECT_SET, zero.data(), nullptr, one.data(), nullptr);
  const hid_t single = H5Screate(H5S_SCALAR);
  EXPECT_GE(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, single, space, H5P_DEFAULT, &number), 0);
  H5Sclose(single), H5Sclose(space), H5Dclose(dataset);
}

TEST(MemoryFiles, DamageAndPointsOfAnotherSceneAreRefused) {
  struct Harm {
    int exit_code;
    std::string said;
    std::function<void(hid_t)> edit;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Harm harms[] = {
      {3, "row 10 has a number that is not finite: the file is damaged",
       [&](hid_t f) { put_first(f, "memory/s", nan); }},
      {3, "expected 1 rows of 334 points",
       [](hid_t f) {
         replace(f, "memory/s", {1, 2, 463, 3});
       }},
      {3, "expected 1 rows of 334 points",
       [](hid_t f) {
         replace(f, "memory/s", {1, 464, 3});
       }},
      {3, "points of 2 environments",
       [](hid_t f) {
         replace(f, "memory/s", {1, 1, 464, 3});
       }},
      {3, "contacts, first and place do not belong together",
       [](hid_t f) {
         replace(f, "memory/place", {463, 3});
       }},
      {3, "expected ascending steps from 0 to 10",
       [](hid_t f) { put_first(f, "memory/step", 11); }},
      {3, "memory", [](hid_t f) { H5Ldelete(f, "memory/s", H5P_DEFAULT); }},
      {3, "first", [](hid_t f) { H5Adelete_by_name(f, "memory", "first", H5P_DEFAULT); }},
      {2, "point 0 of 'contact pad box' lies elsewhere than in the scene",
       [](hid_t f) { put_first(f, "memory/place", 1); }},
      {2, "point 0 of 'contact pad box' lies elsewhere than in the scene",
       [&](hid_t f) { put_first(f, "memory/place", nan); }},
  };
  const Folder folder;
  for (const Harm& damage : harms) {
    SCOPED_TRACE(damage.said);
    simulate(folder, "run.h5", {"--steps", "10", "--envs", "2"});
    const hid_t file = H5Fopen(folder.path("run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(file, 0);
    damage.edit(file);
    H5Fclose(file);
    const std::string told =
        simulate(folder, "on.h5", {"--state-from", "run.h5", "--steps", "1"}, damage.exit_code);
    EXPECT_THAT(told, HasSubstr(damage.said));
    EXPECT_FALSE(std::filesystem::exists(folder.path("on.h5")));
  }
  // Contacts of another scene with the same joints: the ground has none of it.
  std::string text = file_bytes(kElastic);
  text.replace(text.find("ks=\"250\""), 8, "ks=\"0\"");
  folder.write("other.xml", text);
  simulate(folder, "run.h5", {"--steps", "10", "--envs", "2"});
  const Outcome other = run(
      folder, {"simulate", "other.xml", "-o", "on.h5", "--state-from", "run.h5", "--steps", "1"});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("run.h5: 4 contacts remember; in the scene 3 do"));
}

}  // namespace
}  // namespace tangere::apps
