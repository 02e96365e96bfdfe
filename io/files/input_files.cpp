// SPDX-License-Identifier: Apache-2.0
// A map from device and inode to the first name under which a file was read.
#include "io/files/input_files.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <map>
#include <mutex>
#include <utility>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

struct Inputs {
  std::mutex mutex;
  bool kept = false;
  std::map<std::pair<dev_t, ino_t>, std::string> files;
};

Inputs& inputs() {
  static Inputs all;
  return all;
}

}  // namespace

void keep_inputs() {
  const std::lock_guard lock(inputs().mutex);
  inputs().kept = true;
}

void add_input(const std::string& path, const struct stat& info) {
  const std::lock_guard lock(inputs().mutex);
  if (inputs().kept) inputs().files.try_emplace({info.st_dev, info.st_ino}, path);
}

void add_input(const std::string& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) == 0) add_input(path, info);
}

void refuse_input(const std::string& output) {
  struct stat info {};
  if (stat(output.c_str(), &info) != 0) return;
  const std::lock_guard lock(inputs().mutex);
  const auto found = inputs().files.find({info.st_dev, info.st_ino});
  if (found != inputs().files.end())
    throw InputError(fmt::format("the output '{}' is the input '{}'; expected another file", output,
                                 found->second));
}

}  // namespace tangere
