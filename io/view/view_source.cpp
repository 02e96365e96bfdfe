// SPDX-License-Identifier: Apache-2.0
// Rows of HDF5 datasets.
#include "io/view/view_source.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "engine/base/error.hpp"

namespace tangere {

std::vector<double> row_numbers(const h5::Id& dataset, std::int64_t row, std::size_t width) {
  const h5::Dims dims = h5::dimensions(dataset);
  h5::Dims offset(dims.size(), 0), count = dims;
  offset[0] = static_cast<hsize_t>(row), count[0] = 1;
  std::vector<double> values(width);
  h5::read_box<double>(dataset, offset, count, values.data());
  return values;
}

void check_shape(const h5::Id& dataset, const h5::Dims& expected, const std::string& what) {
  const h5::Dims dims = h5::dimensions(dataset);
  if (dims != expected)
    throw IoError(fmt::format("{} of {} has the shape ({}); expected ({}): the file is damaged",
                              what, h5::place_of(dataset), fmt::join(dims, ", "),
                              fmt::join(expected, ", ")));
}

}  // namespace tangere
