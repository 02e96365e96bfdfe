// SPDX-License-Identifier: Apache-2.0
// An existing export of a data set in the format of a learner: what it holds, without its numbers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/export/stored_files.hpp"

namespace tangere {

struct ExportedArray {
  std::string name;                  ///< "observation.tactile", "data/tactile", a column
  std::string type;                  ///< "float32", "bool", "image", "text"
  std::vector<std::uint64_t> shape;  ///< of a frame
  std::string unit;                  ///< empty where the export says none
};

struct ExportedSet {
  std::string format;                    ///< "lerobot", "zarr", "ftp1", "univtac", "csv"
  std::string title;                     ///< "LeRobotDataset v3.0"
  std::string command, tangere_version;  ///< of the data set that was exported; may be empty
  std::int64_t episodes = 0, frames = 0;
  double seconds_per_frame = 0;  ///< 0 where the export does not say
  std::int64_t files = 0;
  std::uintmax_t bytes = 0;  ///< of all files
  std::vector<ExportedArray> arrays;
  std::vector<StoredFiles> stored;  ///< what it says of its files; none: it does not
  std::string folder;               ///< in which they lie
};

/// Describes an export; none where the path is something else. Throws IoError for an export that is
/// damaged, unfinished (OUT.part) or that another program wrote; the message names the file. Counts
/// and sizes of files are compared, their numbers are not read.
std::optional<ExportedSet> find_export(const std::string& path);

}  // namespace tangere
