// SPDX-License-Identifier: Apache-2.0
// What all targets share.
#include "tests/fuzz/targets.hpp"

#include <fstream>

#include "engine/base/error.hpp"

namespace tangere::fuzz {

std::vector<Target> targets() {
  std::vector<Target> all = text_targets();
  for (auto* const more : {hdf5_targets, viewed_targets})
    for (Target& target : more()) all.push_back(std::move(target));
  return all;
}

bool read_mutant(const Target& target, const std::string& folder, const std::string& bytes) {
  const std::string path = folder + "/" + target.file;
  if (!(std::ofstream(path, std::ios::binary) << bytes))
    throw std::runtime_error("cannot write " + path);
  try {
    target.read(folder);
    return true;
  } catch (const InputError&) {
    return false;
  } catch (const IoError&) {
    return false;
  }
}

}  // namespace tangere::fuzz
