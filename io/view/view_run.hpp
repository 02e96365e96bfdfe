// SPDX-License-Identifier: Apache-2.0
// What a page shows of a run in memory.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "engine/model/model.hpp"
#include "io/view/view_data.hpp"

namespace tangere {

/// States and fields of some environments of one model, F frames each.
struct ViewRun {
  std::span<const double> time;            ///< (F) [s]
  std::vector<std::int64_t> environments;  ///< their numbers, for labels
  /// Names of numbers that vary by environment, and (environments, names) their values in SI units.
  std::vector<std::string> names;
  std::span<const double> values;
  std::span<const double> q;  ///< (environments, F, nq)
  std::map<std::string, std::span<const double>>
      fields{};  ///< sensor → (environments, F, points, 3)
};

/// Frames are thinned evenly as in read_view(). Throws InputError for another number of values and
/// for a sensor that the model does not have, and IoError where a file that the scene names is
/// gone.
ViewData view_run(const Model& model, const ViewRun& run, const ViewOptions& options = {});

}  // namespace tangere
