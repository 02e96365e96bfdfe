// SPDX-License-Identifier: Apache-2.0
// Detects the kind of a path before reading it.
#include "io/view/view_reader.hpp"

#include <filesystem>

#include "engine/base/error.hpp"
#include "io/view/view_source.hpp"

namespace tangere {

ViewData read_view(const std::string& path, const ViewOptions& options) {
  if (std::filesystem::is_directory(path)) return read_dataset_view(path, options);
  std::string format;
  {
    const h5::Id file = h5::open_file(path);
    if (H5Aexists(file.get(), "format") > 0) format = h5::read_text(file, "format");
    // The merged file of a data set has its format in /scene.
    if (format.empty() && h5::has_link(file, "data") && h5::has_link(file, "scene"))
      format = "tangere dataset";
  }
  if (format == "tangere trajectory") return read_trajectory_view(path, options);
  if (format.starts_with("tangere dataset")) return read_dataset_view(path, options);
  throw IoError(path +
                ": neither a trajectory file of 'tangere simulate' nor a data set of 'tangere "
                "generate'");
}

}  // namespace tangere
