// SPDX-License-Identifier: Apache-2.0
// Copies observations out, once, into an array for each key.
#include "python/module/observations.hpp"

#include <nanobind/stl/string.h>

namespace tangere::python {

double scale_of(const TensorSpec& tensor, std::size_t i) {
  if (tensor.scale.empty()) return 1;
  return tensor.scale[i % tensor.scale.size()];
}

nb::dict observation_arrays(const TaskSpec& spec, std::span<const double> rows,
                            std::size_t environments, bool scaled,
                            const std::optional<std::vector<std::string>>& keys) {
  std::vector<std::string> names;
  for (const TensorSpec& tensor : spec.observations) names.push_back(tensor.name);
  if (keys) {
    for (const std::string& key : *keys)
      if (std::find(names.begin(), names.end(), key) == names.end())
        throw InputError(fmt::format("task '{}' has no observation '{}'; expected one of: {}",
                                     spec.name, key, fmt::join(names, ", ")));
  }
  nb::dict arrays;
  const std::size_t width = spec.observation_size();
  std::size_t offset = 0;
  for (const TensorSpec& tensor : spec.observations) {
    const std::size_t size = tensor.size(), from = offset;
    offset += size;
    if (keys && std::find(keys->begin(), keys->end(), tensor.name) == keys->end()) continue;
    Shape shape = tensor.shape;
    shape.insert(shape.begin(), environments);
    std::span<float> to;
    arrays[tensor.name.c_str()] = new_array<float>(shape, to);
    std::vector<double> by(size, 1.0);
    for (std::size_t i = 0; i < size && scaled; ++i) by[i] = 1 / scale_of(tensor, i);
    for (std::size_t e = 0; e < environments; ++e) {
      const double* const row = rows.data() + e * width + from;
      float* const out = to.data() + e * size;
      for (std::size_t i = 0; i < size; ++i) out[i] = static_cast<float>(row[i] * by[i]);
    }
  }
  return arrays;
}

}  // namespace tangere::python
