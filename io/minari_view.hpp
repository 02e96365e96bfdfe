// SPDX-License-Identifier: Apache-2.0
// A data set as Minari lays it out: links and virtual datasets, no number twice.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/dataset_files.hpp"

namespace tangere {

/// Where the numbers of a demo are.
struct DemoPlace {
  std::int64_t number = 0;  ///< of the episode
  std::string file;         ///< in the data set's folder, without its path
};

/// Writes FOLDER/minari/tangere/NAME-v0/data and returns "tangere/NAME-v0". Throws IoError.
std::string write_minari_view(const DatasetFiles& dataset, const std::vector<DemoPlace>& demos, bool overwrite);

}  // namespace tangere
