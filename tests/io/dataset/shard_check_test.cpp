// SPDX-License-Identifier: Apache-2.0
// Every kind of damage to a shard is found and named.
#include "io/dataset/shard_check.hpp"

#include <gmock/gmock.h>
#include <hdf5.h>

#include <cstring>
#include <fstream>
#include <functional>

#include "io/dataset/content_sum.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/hdf5/h5.hpp"
#include "io/trajectory/trajectory_file.hpp"
#include "tests/files.hpp"
#include "tests/io/older_file.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere {
namespace {

using testing::dataset_layout;
using testing::dataset_number;
using testing::Folder;
using ::testing::HasSubstr;

/// A whole shard of 20 episodes, of which 17 failed.
class ShardCheck : public ::testing::Test {
 protected:
  ShardCheck() {
    DatasetLayout l = dataset_layout(20);
    l.randomized_names = {"ground box mu"};
    l.randomized_units = {"1"};
    DatasetWriter writer({folder_ / "set"}, l);
    testing::write_block(writer, l, 0);
    testing::write_block(writer, l, 16, {testing::failure(17)});
  }

  /// The message of check_shard; "" if it finds nothing.
  [[nodiscard]] std::string complaint() const {
    try {
      static_cast<void>(check_shard(path_));
    } catch (const IoError& error) {
      return error.what();
    }
    return "";
  }

  [[nodiscard]] std::string complaint_of_sample() const {
    try {
      sample_shard(path_);
    } catch (const IoError& error) {
      return error.what();
    }
    return "";
  }

  [[nodiscard]] std::string read() const { return file_bytes(path_); }
  void write(const std::string& bytes) const {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
  }

  /// Opens the shard for writing, unlike our programs.
  void change(const std::function<void(hid_t)>& how) const {
    const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(file, 0);
    how(file);
    H5Fclose(file);
  }
  static void set(hid_t file, const char* object, const char* name, std::int64_t value) {
    const hid_t owner = H5Oopen(file, object, H5P_DEFAULT),
                attribute = H5Aopen(owner, name, H5P_DEFAULT);
    EXPECT_GE(H5Awrite(attribute, H5T_NATIVE_INT64, &value), 0) << name;
    H5Aclose(attribute);
    H5Oclose(owner);
  }

  Folder folder_;
  std::string path_ = folder_ / "set/shard-00000.h5";
};

std::string bytes_of_row(std::int64_t episode, std::size_t name, std::int64_t row,
                         std::size_t width) {
  std::vector<float> numbers;
  for (std::size_t k = 0; k < width; ++k)
    numbers.push_back(dataset_number<float>(episode, name, row, k));
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(float)};
}

TEST_F(ShardCheck, FindsNothingInAWholeOne) { EXPECT_EQ(complaint(), ""); }

/// Earlier formats have other names and units for the scene's numbers, or another checksum.
TEST_F(ShardCheck, RefusesEarlierFormats) {
  for (const std::int64_t version : {1, 2, 3, 4}) {
    change([&](hid_t file) { set(file, "/", "format_version", version); });
    EXPECT_THAT(complaint(), HasSubstr("its format_version is " + std::to_string(version) +
                                       "; expected 5 to 7 (generate the data set again)"));
    EXPECT_THAT(complaint_of_sample(), HasSubstr("its format_version is ")) << "merge calls it";
  }
}

/// The format before has no checksum of labels, and its description_sum covers less.
TEST_F(ShardCheck, ReadsTheFormatBeforeWithoutSumsOfLabels) {
  EXPECT_TRUE(check_shard(path_).has_label_sum);
  testing::make_older(path_, 6);
  EXPECT_EQ(complaint(), "");
  EXPECT_FALSE(check_shard(path_).has_label_sum);
}

/// The one before that has the checksum in which zeros are hashed as well.
TEST_F(ShardCheck, ReadsFormatFiveWithItsOwnChecksum) {
  ContentSum sum(true);
  for (std::int64_t episode = 0; episode < 20; ++episode)
    for (const auto& [name, width] : {std::pair{0U, 2U}, {1U, 3U}, {2U, 2U}, {3U, 36U}})
      for (std::int64_t row = 0; row < (name == 0 ? 3 : 4) && episode != 17; ++row) {
        const std::string bytes = bytes_of_row(episode, name, row, width);
        sum.add(episode, name, row, 1, bytes.size(), bytes.data());
      }
  testing::make_older(path_, 5);
  EXPECT_THAT(complaint(), HasSubstr("the checksum of its numbers is "));
  change([&](hid_t file) {
    const std::uint64_t value = sum.value();
    const hid_t attribute = H5Aopen(file, "content_sum", H5P_DEFAULT);
    EXPECT_GE(H5Awrite(attribute, H5T_NATIVE_UINT64, &value), 0);
    H5Aclose(attribute);
  });
  EXPECT_EQ(complaint(), "");
  EXPECT_EQ(complaint_of_sample(), "");
}

TEST_F(ShardCheck, FindsEveryFlippedBitOfARow) {
  const std::string whole = read();
  // A row of a field, of q in obs and of v in final_obs.
  for (const auto& [name, row, width] : {std::tuple{3U, 1, 36U}, {1U, 2, 3U}, {2U, 3, 2U}}) {
    const std::string part = bytes_of_row(5, name, row, width);
    const std::size_t at = whole.find(part);
    ASSERT_NE(at, std::string::npos) << name;
    ASSERT_EQ(whole.find(part, at + 1), std::string::npos)
        << "the numbers do not say where they belong";
    for (std::size_t bit = 0; bit < 8 * part.size(); bit += width == 36 ? 29 : 1) {
      std::string damaged = whole;
      damaged[at + bit / 8] = static_cast<char>(damaged[at + bit / 8] ^ (1 << bit % 8));
      write(damaged);
      EXPECT_THAT(complaint(), HasSubstr("the checksum of its numbers is ")) << "bit " << bit;
    }
  }
  write(whole);
  EXPECT_EQ(complaint(), "");
}

TEST_F(ShardCheck, FindsAFlippedBitOfAnyDataset) {
  for (const char* name : {"actions", "rewards", "dones", "obs/q", "obs/v", "obs/skin",
                           "final_obs/q", "final_obs/v", "final_obs/skin"}) {
    const std::string whole = read();
    haddr_t at = 0;
    {
      const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
      const hid_t dataset =
          H5Dopen(file, (std::string("data/demo_19/") + name).c_str(), H5P_DEFAULT);
      at = H5Dget_offset(dataset);
      H5Dclose(dataset);
      H5Fclose(file);
    }
    ASSERT_NE(at, HADDR_UNDEF) << name;
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 1);
    write(damaged);
    EXPECT_THAT(complaint(), HasSubstr("is damaged")) << name;
    write(whole);
  }
}

TEST_F(ShardCheck, FindsRowsThatChangedPlaces) {
  const std::string whole = read();
  const auto swapped = [&](const std::string& a, const std::string& b) {
    std::string damaged = whole;
    const std::size_t at_a = whole.find(a), at_b = whole.find(b);
    damaged.replace(at_a, a.size(), b);
    damaged.replace(at_b, b.size(), a);
    return damaged;
  };
  write(swapped(bytes_of_row(5, 3, 0, 36), bytes_of_row(5, 3, 1, 36)));  // in an episode
  EXPECT_THAT(complaint(), HasSubstr("checksum"));
  write(swapped(bytes_of_row(5, 3, 1, 36), bytes_of_row(6, 3, 1, 36)));  // between episodes
  EXPECT_THAT(complaint(), HasSubstr("checksum"));
}

TEST_F(ShardCheck, FindsEpisodesThatAreMissingOrThereTwice) {
  const std::string whole = read();
  change([](hid_t file) { H5Ldelete(file, "data/demo_3", H5P_DEFAULT); });
  EXPECT_THAT(complaint(), HasSubstr("episode 3 is not in exactly one of /data and /failed"));
  write(whole);
  change([](hid_t file) { H5Ldelete(file, "failed/episode_17", H5P_DEFAULT); });
  EXPECT_THAT(complaint(), HasSubstr("episode 17 is not in exactly one"));
  write(whole);
  change([](hid_t file) {
    H5Gclose(H5Gcreate(file, "failed/episode_4", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  });
  EXPECT_THAT(complaint(), HasSubstr("episode 4 is not in exactly one"));
  write(whole);
  change([](hid_t file) {
    H5Lmove(file, "data/demo_3", file, "failed/episode_3", H5P_DEFAULT, H5P_DEFAULT);
  });
  EXPECT_THAT(complaint(), HasSubstr("/data counts 57 rows; its demos have 54"));
  // Two demos exchange their names.
  write(whole);
  change([](hid_t file) {
    H5Lmove(file, "data/demo_3", file, "data/x", H5P_DEFAULT, H5P_DEFAULT);
    H5Lmove(file, "data/demo_4", file, "data/demo_3", H5P_DEFAULT, H5P_DEFAULT);
    H5Lmove(file, "data/x", file, "data/demo_4", H5P_DEFAULT, H5P_DEFAULT);
  });
  EXPECT_THAT(complaint(), HasSubstr("checksum"));
}

TEST_F(ShardCheck, FindsCountsThatAreWrong) {
  const std::string whole = read();
  const auto with = [&](const char* object, const char* name, std::int64_t value) {
    write(whole);
    change([&](hid_t file) { set(file, object, name, value); });
    return complaint();
  };
  EXPECT_THAT(with("data", "total", 56), HasSubstr("/data counts 56 rows; its demos have 57"));
  EXPECT_THAT(with("data/demo_7", "num_samples", 2), HasSubstr("demo_7 has 2 rows, expected 3"));
  EXPECT_THAT(with(".", "episodes", 21), HasSubstr("episode 20 is not in exactly one"));
  EXPECT_THAT(with(".", "episodes", 16), HasSubstr("/data counts 57 rows; its demos have 48"));
  EXPECT_THAT(with(".", "first_episode", 1), HasSubstr("episode 20 is not in exactly one"));
  EXPECT_THAT(with("scene", "steps", 8), HasSubstr("demo_0 has 3 rows, expected 4"));
  EXPECT_THAT(with(".", "content_sum", 1), HasSubstr("expected 0000000000000001"));
  // 192 steps, of which bodies passed in 3 and overlapped after 36.
  EXPECT_THAT(with(".", "tunnelled_steps", -1), HasSubstr("is -1; expected 0 to 192"));
  EXPECT_THAT(with(".", "overlapping_steps", 190), HasSubstr("is 190; expected 0 to 189"));
  EXPECT_THAT(with(".", "simulation_steps", 38), HasSubstr("is 36; expected 0 to 35"));
  EXPECT_THAT(with(".", "simulation_steps", -1), HasSubstr("'simulation_steps' of '/'"));
}

TEST_F(ShardCheck, FindsADescriptionThatHasChanged) {
  const std::string whole = read();
  for (const char* const name : {"name", "tangere_version", "text"}) {
    write(whole);
    change([&](hid_t file) {
      const h5::Id scene(H5Gopen2(file, "scene", H5P_DEFAULT));
      H5Adelete(scene.get(), name);
      h5::write_attribute(scene, name, "something else");
    });
    EXPECT_THAT(complaint(), HasSubstr("the checksum of its description is ")) << name;
  }
  for (const char* const name : {"description_sum", "label_sum"}) {
    write(whole);
    change([&](hid_t file) { H5Adelete(file, name); });
    EXPECT_THAT(complaint(), HasSubstr(name));
  }
  write(whole);
  testing::make_older(path_, 6);
  EXPECT_EQ(complaint(), "") << "some files of older versions have none";
}

/// A flipped bit in any attribute of an episode, in its value as it lies in the file.
TEST_F(ShardCheck, FindsLabelsThatHaveChanged) {
  const std::string whole = read();
  const auto with = [&](const char* object, const char* name) {
    write(whole);
    change([&](hid_t file) {
      const h5::Id owner(H5Oopen(file, object, H5P_DEFAULT)),
          attribute(H5Aopen(owner.get(), name, H5P_DEFAULT)), type(H5Aget_type(attribute.get()));
      std::vector<char> bytes(H5Aget_storage_size(attribute.get()));
      EXPECT_GE(H5Aread(attribute.get(), type.get(), bytes.data()), 0);
      bytes.back() = static_cast<char>(bytes.back() ^ 1);
      EXPECT_GE(H5Awrite(attribute.get(), type.get(), bytes.data()), 0);
    });
    return complaint();
  };
  EXPECT_THAT(with("data/demo_7", "randomized"), HasSubstr("the checksum of its episodes' labels"));
  for (const char* const name : {"step", "status", "q", "v", "randomized"})
    EXPECT_THAT(with("failed/episode_17", name), HasSubstr("the checksum of its episodes' labels"))
        << name;
  write(whole);
  change([](hid_t file) { set(file, ".", "simulation_steps", 191); });
  EXPECT_THAT(complaint(), HasSubstr("the checksum of its episodes' labels"));
  write(whole);
  change([](hid_t file) {
    const h5::Id root(H5Gopen2(file, "/", H5P_DEFAULT));
    H5Adelete(root.get(), "command");
    h5::write_attribute(root, "command", "tangere generate another");
  });
  EXPECT_THAT(complaint(), HasSubstr("the checksum of its description"));
  write(whole);
  change([](hid_t file) {
    const h5::Id demo(H5Gopen2(file, "data/demo_7", H5P_DEFAULT));
    h5::write_attribute(demo, "seen by", "a user");
  });
  EXPECT_EQ(complaint(), "") << "an attribute of the user's";
}

TEST_F(ShardCheck, FindsDatasetsThatAreMissingOrShort) {
  const std::string whole = read();
  for (const char* name :
       {"actions", "rewards", "dones", "obs", "obs/q", "obs/skin", "final_obs/v"}) {
    write(whole);
    const std::string path = std::string("data/demo_9/") + name;
    change([&](hid_t file) { H5Ldelete(file, path.c_str(), H5P_DEFAULT); });
    EXPECT_NE(complaint(), "") << name;
    if (std::strcmp(name, "obs") == 0) continue;
    change([&](hid_t file) {
      const hsize_t dims[] = {2};
      const hid_t space = H5Screate_simple(1, dims, nullptr);
      H5Dclose(H5Dcreate(file, path.c_str(), H5T_IEEE_F32LE, space, H5P_DEFAULT, H5P_DEFAULT,
                         H5P_DEFAULT));
      H5Sclose(space);
    });
    EXPECT_THAT(complaint(), HasSubstr("does not have ")) << name;
  }
}

TEST_F(ShardCheck, FindsFilesThatAreCutOrSomethingElse) {
  const std::string whole = read();
  for (const double part : {0.0, 0.001, 0.3, 0.9, 0.9999}) {
    write(whole.substr(0, static_cast<std::size_t>(part * static_cast<double>(whole.size()))));
    EXPECT_NE(complaint(), "") << part;
  }
  write("no hdf5");
  EXPECT_NE(complaint(), "");
  std::filesystem::remove(path_);
  EXPECT_NE(complaint(), "");
  TrajectoryFile trajectory(path_, testing::recording(), false);
  testing::write_run(trajectory, testing::recording());
  trajectory.commit();
  EXPECT_NE(complaint(), "");
}

}  // namespace
}  // namespace tangere
