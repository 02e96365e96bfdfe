// SPDX-License-Identifier: Apache-2.0
// Compares the contents of shards with hashes in shards.txt, for every instruction set.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "kernels/table/kernel_table.hpp"
#include "tests/apps/program.hpp"
#include "tests/golden/hash.hpp"

namespace tangere {
namespace {

using testing::Hash;

/// Adds path, extent and bytes of a data set below `group` to a Hash.
herr_t add_data_set(hid_t group, const char* path, Hash& hash) {
  const hid_t object = H5Oopen(group, path, H5P_DEFAULT);
  if (object < 0) return -1;
  if (H5Iget_type(object) == H5I_DATASET) {
    const hid_t space = H5Dget_space(object), stored = H5Dget_type(object);
    const hid_t type = H5Tget_native_type(stored, H5T_DIR_ASCEND);
    std::vector<hsize_t> extent(std::size_t(H5Sget_simple_extent_ndims(space)));
    H5Sget_simple_extent_dims(space, extent.data(), nullptr);
    std::size_t bytes = H5Tget_size(type);
    hash.add(path);
    for (const hsize_t n : extent) {
      hash.add(std::to_string(n));
      bytes *= n;
    }
    std::string content(bytes, '\0');
    EXPECT_GE(H5Dread(object, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, content.data()), 0) << path;
    hash.add(content);
    H5Tclose(type), H5Tclose(stored), H5Sclose(space);
  }
  H5Oclose(object);
  return 0;
}

/// Hashes every data set of the episodes in a shard.
std::string hash_shard(const std::string& path) {
  Hash hash;
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  EXPECT_GE(file, 0) << path;
  const hid_t data = H5Gopen2(file, "data", H5P_DEFAULT);
  // The argument before the last has another type in HDF5 1.12.
  const auto visit = [](hid_t group, const char* name, const auto*, void* data_of) -> herr_t {
    return add_data_set(group, name, *static_cast<Hash*>(data_of));
  };
  EXPECT_GE(H5Lvisit(data, H5_INDEX_NAME, H5_ITER_INC, visit, &hash), 0) << path;
  H5Gclose(data);
  H5Fclose(file);
  return hash.text();
}

TEST(GoldenShards, KeepTheirContents) {
  std::ifstream file(TANGERE_SOURCE_DIR "/tests/golden/shards.txt");
  std::string line;
  while (std::getline(file, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream columns(line);
    std::map<std::string, std::string> expected;
    columns >> expected["fused"] >> expected["plain"];
    apps::Words words{"generate"};
    for (std::string word; columns >> word;)
      words.push_back(word.starts_with("scenes/") ? TANGERE_SOURCE_DIR "/" + word : word);
    words.insert(words.end(), {"--output", "set", "--shards", "1", "--quiet"});
    for (const kernels::KernelTable* kernels : kernels::available_kernels()) {
      const apps::Folder folder;
      const apps::Outcome outcome =
          run(folder, words, {std::string("TANGERE_ISA=") + kernels->name});
      ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
      EXPECT_EQ(hash_shard(folder.path("set/shard-00000.h5")),
                expected[testing::rounding(kernels->name)])
          << line << "\nkernels: " << kernels->name;
    }
  }
}

}  // namespace
}  // namespace tangere
