// SPDX-License-Identifier: Apache-2.0
// Arrays of HDF5 files that the program wrote.
#pragma once

#include <string>
#include <vector>

#include "io/hdf5/h5.hpp"

namespace tangere::apps {

struct Array {
  h5::Dims dims;
  std::vector<double> values;
};

/// Reads a dataset of a file, numbers as doubles.
inline Array array_of(const std::string& path, const std::string& name) {
  const h5::Id file = h5::open_file(path);
  const h5::Id dataset = h5::open_dataset(file, name);
  Array array{h5::dimensions(dataset), {}};
  std::size_t size = 1;
  for (const hsize_t n : array.dims) size *= n;
  array.values.resize(size);
  h5::read_box(dataset, h5::Dims(array.dims.size(), 0), array.dims, array.values.data());
  return array;
}

/// Rows from `first` on of a dataset.
inline std::vector<double> rows_from(const Array& array, std::size_t first) {
  const std::size_t width = array.values.size() / array.dims[0];
  return {array.values.begin() + static_cast<std::ptrdiff_t>(first * width), array.values.end()};
}

}  // namespace tangere::apps
