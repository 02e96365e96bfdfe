// SPDX-License-Identifier: Apache-2.0
// One target as a program of libFuzzer: it writes its corpus into the first folder that it is given
// and is empty.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "tests/fuzz/targets.hpp"
#include "tests/io/synthetic_run.hpp"

namespace {

namespace fs = std::filesystem;

struct Place {
  tangere::testing::Folder scratch;
  std::string folder = scratch / "folder";
  tangere::fuzz::Target target;
  std::vector<std::string> corpus;

  Place() {
    for (tangere::fuzz::Target& one : tangere::fuzz::targets())
      if (one.name == TANGERE_FUZZ_TARGET) target = one;
    fs::create_directory(folder);
    corpus = target.prepare(folder);
  }
};

Place& place() {
  static Place one;
  return one;
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  for (int i = 1; i < *argc; ++i) {
    const fs::path folder = (*argv)[i];
    if (std::string_view((*argv)[i]).starts_with('-') || !fs::is_directory(folder)) continue;
    if (!fs::is_empty(folder)) break;
    for (std::size_t k = 0; k < place().corpus.size(); ++k)
      std::ofstream(folder / std::to_string(k), std::ios::binary) << place().corpus[k];
    break;
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(data, data + size);
  static_cast<void>(tangere::fuzz::read_mutant(place().target, place().folder, bytes));
  return 0;
}
