// SPDX-License-Identifier: Apache-2.0
// Reads no numbers.
#include "io/hdf5/h5_arrays.hpp"

#include "io/hdf5/h5_listing.hpp"

namespace tangere::h5 {

std::vector<ArrayFacts> arrays_of(const std::string& path, const std::vector<std::string>& names) {
  const Id file = open_file(path);
  std::vector<ArrayFacts> arrays;
  for (const std::string& name : names) {
    const Id dataset = open_dataset(file, name);
    const Dims dims = dimensions(dataset);
    arrays.push_back({name, type_text(dataset), {dims.begin(), dims.end()}});
  }
  return arrays;
}

}  // namespace tangere::h5
