// SPDX-License-Identifier: Apache-2.0
// Trajectory files: every dataset and attribute, read back through the C library alone; nothing
// half-written remains.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/resource.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "io/hdf5/h5.hpp"
#include "io/trajectory/trajectory_reader.hpp"
#include "tests/files.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using testing::Folder;
using testing::number;
using testing::recording;

std::string write_file(const Folder& folder, const Recording& r = recording()) {
  std::string path = folder / "run.h5";
  TrajectoryFile file(path, r, false);
  testing::write_run(file, r);
  EXPECT_FALSE(std::filesystem::exists(path)) << "named before it was complete";
  file.commit();
  return path;
}

std::vector<hsize_t> shape(hid_t file, const char* name) {
  const hid_t d = H5Dopen(file, name, H5P_DEFAULT);
  EXPECT_GE(d, 0) << name;
  const hid_t s = H5Dget_space(d);
  std::vector<hsize_t> dims(static_cast<std::size_t>(H5Sget_simple_extent_ndims(s)));
  H5Sget_simple_extent_dims(s, dims.data(), nullptr);
  H5Sclose(s);
  H5Dclose(d);
  return dims;
}

template <class T>
std::vector<T> values(hid_t file, const char* name, hid_t type, std::size_t count) {
  std::vector<T> x(count);
  const hid_t d = H5Dopen(file, name, H5P_DEFAULT);
  EXPECT_GE(H5Dread(d, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, x.data()), 0) << name;
  H5Dclose(d);
  return x;
}

TEST(TrajectoryFile, HoldsWhatItPromises) {
  const Folder folder;
  const hid_t f = H5Fopen(write_file(folder).c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  ASSERT_GE(f, 0);
  using Dims = std::vector<hsize_t>;
  EXPECT_EQ(shape(f, "/time"), Dims({6}));
  EXPECT_EQ(shape(f, "/q"), Dims({6, 2, 3}));
  EXPECT_EQ(shape(f, "/v"), Dims({6, 2, 3}));
  EXPECT_EQ(shape(f, "/u"), Dims({5, 2, 1}));
  EXPECT_EQ(shape(f, "/bodies/pose"), Dims({6, 2, 1, 7}));
  EXPECT_EQ(shape(f, "/bodies/twist"), Dims({6, 2, 1, 6}));
  EXPECT_EQ(shape(f, "/tactile/skin/force"), Dims({2, 2, 3, 4, 3}));
  EXPECT_EQ(shape(f, "/solver/iterations"), Dims({5, 2}));
  EXPECT_EQ(shape(f, "/solver/status"), Dims({5, 2}));
  EXPECT_EQ(shape(f, "/randomized"), Dims({2, 1}));
  const auto q = values<double>(f, "/q", H5T_NATIVE_DOUBLE, 36);
  const auto pose = values<double>(f, "/bodies/pose", H5T_NATIVE_DOUBLE, 84);
  for (std::int64_t t = 0; t < 6; ++t) {
    for (std::size_t k = 0; k < 6; ++k) EXPECT_EQ(q[std::size_t(t) * 6 + k], number(1, t, k));
    for (std::size_t k = 0; k < 14; ++k) EXPECT_EQ(pose[std::size_t(t) * 14 + k], number(3, t, k));
  }
  EXPECT_EQ(values<std::int64_t>(f, "/tactile/skin/step", H5T_NATIVE_INT64, 2),
            (std::vector<std::int64_t>{2, 4}));
  EXPECT_EQ(values<std::int8_t>(f, "/solver/status", H5T_NATIVE_INT8, 10)[1], -1);
  EXPECT_EQ(values<std::int32_t>(f, "/solver/iterations", H5T_NATIVE_INT32, 10)[4], 2);
  EXPECT_EQ(values<double>(f, "/time", H5T_NATIVE_DOUBLE, 6)[3], 0.03);
  for (const char* name :
       {"scene_text", "command_line", "instruction_set", "tangere_version", "integrator",
        "timestep", "tolerance", "seed", "quaternion_order", "precision"})
    EXPECT_GT(H5Aexists(f, name), 0) << name;
  for (const char* name : {"/q", "/v", "/u", "/bodies/pose", "/bodies/twist"}) {
    EXPECT_GT(H5Aexists_by_name(f, name, "names", H5P_DEFAULT), 0) << name;
    EXPECT_GT(H5Aexists_by_name(f, name, "units", H5P_DEFAULT), 0) << name;
  }
  for (const char* name : {"pressure_sign", "units", "axis0", "corner0", "body", "components"})
    EXPECT_GT(H5Aexists_by_name(f, "/tactile/skin/force", name, H5P_DEFAULT), 0) << name;
  H5Fclose(f);
}

TEST(TrajectoryFile, HoldsEndEffectorsWhereThereAreAny) {
  const Folder folder;
  {
    const h5::Id without = h5::open_file(write_file(folder));
    EXPECT_FALSE(h5::has_link(without, "variables"));
  }
  const Folder other;
  const std::vector<std::string> names = {"tip", "heel"};
  const Recording r = recording(5, names);
  EXPECT_EQ(recorded_bytes(r) - recorded_bytes(recording()), 6U * 2 * 2 * 3 * 8);
  const h5::Id f = h5::open_file(write_file(other, r));
  const h5::Id d = h5::open_dataset(f, "variables/position");
  ASSERT_EQ(h5::dimensions(d), (h5::Dims{6, 2, 2, 3}));
  std::vector<double> x(72);
  h5::read_box(d, {0, 0, 0, 0}, {6, 2, 2, 3}, x.data());
  for (std::size_t k = 0; k < 72; ++k)
    EXPECT_EQ(x[k], number(5, std::int64_t(k / 12), k % 12)) << k;
  EXPECT_EQ(h5::read_texts(d, "names"), names);
  EXPECT_EQ(h5::read_text(d, "units"), "m");
  EXPECT_EQ(h5::read_text(d, "frame"), "world");
}

TEST(TrajectoryFile, RefusesARowWithoutTheEndEffectorsItsLayoutHas) {
  const Folder folder;
  TrajectoryFile file(folder / "run.h5", recording(5, {"tip"}), false);
  EXPECT_THROW(testing::write_run(file, recording()), IoError);
}

TEST(TrajectoryFile, ReaderGivesBackTheFields) {
  const Folder folder;
  const TrajectoryReader reader(write_file(folder));
  EXPECT_EQ(reader.scene_name(), "synthetic");
  EXPECT_EQ(reader.environments(), 2);
  EXPECT_EQ(reader.timestep(), 0.01);
  ASSERT_EQ(reader.sensors().size(), 1U);
  EXPECT_EQ(reader.sensors()[0].pressure_sign, -1);
  EXPECT_EQ(reader.sensors()[0].corner1[1], 0.003);
  EXPECT_EQ(reader.frames(0), 2);
  EXPECT_EQ(reader.step(0, 1), 4);
  const std::vector<double> all = testing::field(1, 1e-3);
  EXPECT_EQ(reader.force(0, 1, 1), std::vector<double>(all.begin() + 36, all.end()));
  EXPECT_THROW((void)reader.find_sensor("skim"), InputError);
}

TEST(TrajectoryFile, TheSameRunGivesTheSameBytes) {
  const Folder a, b;
  EXPECT_EQ(file_bytes(write_file(a)), file_bytes(write_file(b)));
}

TEST(TrajectoryFile, UncommittedRunsLeaveNothing) {
  const Folder folder;
  {
    TrajectoryFile file(folder / "run.h5", recording(), false);
    EXPECT_EQ(folder.entries(), 1U);  // the .part
  }
  EXPECT_EQ(folder.entries(), 0U);
}

TEST(TrajectoryFile, IncompleteRunsAreNotCommitted) {
  const Folder folder;
  {
    TrajectoryFile file(folder / "run.h5", recording(), false);
    testing::write_run(file, recording(4));  // a step short
    try {
      file.commit();
      ADD_FAILURE() << "an incomplete file was committed";
    } catch (const IoError& e) {
      EXPECT_THAT(e.what(), ::testing::HasSubstr("5 rows of 6 of 'time'"));
    }
    Recording more = recording();
    more.channels.push_back({.name = "sleep/clearance", .shape = {2}, .rows = 6});
    TrajectoryFile without(folder / "sleep.h5", more, false);
    testing::write_run(without, recording());
    try {
      without.commit();
      ADD_FAILURE() << "a file without rows of a channel was committed";
    } catch (const IoError& e) {
      EXPECT_THAT(e.what(), ::testing::HasSubstr("0 rows of 6 of 'sleep/clearance'"));
    }
  }
  EXPECT_EQ(folder.entries(), 0U);
}

TEST(TrajectoryFile, ExistingOutputsAreKeptUnlessOverwritten) {
  const Folder folder;
  write_file(folder);
  EXPECT_THROW(TrajectoryFile(folder / "run.h5", recording(), false), IoError);
  EXPECT_EQ(TrajectoryReader(folder / "run.h5").frames(0), 2);
  TrajectoryFile again(folder / "run.h5", recording(7), true);
  testing::write_run(again, recording(7));
  again.commit();
  EXPECT_EQ(TrajectoryReader(folder / "run.h5").frames(0), 3);
}

TEST(TrajectoryFile, PlacesThatCannotBeWrittenAreNamed) {
  const Folder folder;
  const auto message = [&](const std::string& path) -> std::string {
    try {
      TrajectoryFile file(path, recording(), true);
    } catch (const IoError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(message(folder / "missing/run.h5"), ::testing::HasSubstr("missing"));
  EXPECT_THAT(message(folder / ""), ::testing::Not(""));
  std::filesystem::create_directory(folder / "dir.h5");
  EXPECT_THAT(message(folder / "dir.h5"), ::testing::HasSubstr("folder"));
  EXPECT_EQ(folder.entries(), 1U);
}

TEST(TrajectoryFile, AbsurdSizesAreRefusedBeforeAnythingIsWritten) {
  const Folder folder;
  EXPECT_THROW(TrajectoryFile(folder / "run.h5", recording(std::int64_t(1) << 60), false),
               InputError);
  EXPECT_THROW(TrajectoryFile(folder / "run.h5", recording(std::int64_t(1) << 45), false), IoError);
  Recording twice = recording();
  twice.channels.push_back(twice.channels[0]);
  EXPECT_THROW(TrajectoryFile(folder / "run.h5", twice, false), InputError);
  EXPECT_EQ(folder.entries(), 0U);
}

TEST(TrajectoryFile, AFullDiskIsAnErrorAndLeavesNothing) {
  // A limit on the size of files stands for a disk that fills up: writes fail in the middle of the
  // run.
  const Folder folder;
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit small = before;
  small.rlim_cur = 300 * 1024;
  setrlimit(RLIMIT_FSIZE, &small);
  std::string message;
  try {
    const Recording r = recording(20000);
    TrajectoryFile file(folder / "run.h5", r, false);
    testing::write_run(file, r);
    file.commit();
  } catch (const IoError& e) {
    message = e.what();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_NE(message.find("File too large"), std::string::npos) << message;
  EXPECT_EQ(folder.entries(), 0U);
}

TEST(TrajectoryReader, OtherFilesAreRefused) {
  const Folder folder;
  std::ofstream(folder / "text.h5") << "not hdf5";
  EXPECT_THROW(TrajectoryReader(folder / "text.h5"), IoError);
  EXPECT_THROW(TrajectoryReader(folder / "none.h5"), IoError);
  const hid_t f = H5Fcreate((folder / "other.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(f);
  EXPECT_THROW(TrajectoryReader(folder / "other.h5"), IoError);
  const std::string whole = write_file(folder);
  std::filesystem::resize_file(whole, std::filesystem::file_size(whole) / 2);
  EXPECT_THROW(
      {
        const TrajectoryReader cut(whole);
        (void)cut.force(0, 1, 1);
      },
      IoError);
}

}  // namespace
}  // namespace tangere
