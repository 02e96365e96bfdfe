// SPDX-License-Identifier: Apache-2.0
// What both kinds of files share on their way to a page.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/hdf5/h5.hpp"
#include "io/view/view_frames.hpp"

namespace tangere {

/// Reads row `row` of a dataset whose other dimensions are `width` numbers.
std::vector<double> row_numbers(const h5::Id& dataset, std::int64_t row, std::size_t width);
/// Throws IoError unless the dataset has this shape, which `what` names.
void check_shape(const h5::Id& dataset, const h5::Dims& expected, const std::string& what);

/// The two readers behind read_view().
ViewData read_trajectory_view(const std::string& path, const ViewOptions& options);
ViewData read_dataset_view(const std::string& path, const ViewOptions& options);

}  // namespace tangere
