// SPDX-License-Identifier: Apache-2.0
// Exports rows of a data set as a table, for tools that cannot read HDF5. The table has names of
// columns and numbers alone, so that readers of tables need no options.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/dataset/dataset_files.hpp"

namespace tangere {

struct ExportOptions {
  std::optional<std::int64_t> episode;  ///< only this one; none: all
  bool overwrite = false;
};

struct ExportResult {
  std::int64_t rows = 0, columns = 0;
  std::vector<std::string> left_out;  ///< observations too wide for a table, mostly tactile fields
};

/// Writes one line per row: episode, row, actions, reward, done, then every observation of at most
/// 64 numbers. `path`.json says units of columns, counts, the data set's command, and size and sum
/// of the table. Reads each file whole, and compares it with its checksums. Throws IoError;
/// InputError if `path`.json is to be replaced and is something else.
ExportResult export_csv(const DatasetFiles& dataset, const std::string& path,
                        const ExportOptions& options);

}  // namespace tangere
