// SPDX-License-Identifier: Apache-2.0
// A file without a list has them all.
#include "io/trajectory/state_steps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <numeric>

#include "engine/base/error.hpp"

namespace tangere {

std::vector<std::int64_t> state_steps(const h5::Id& file, std::int64_t steps) {
  std::vector<std::int64_t> list;
  if (!h5::has_link(file, "step")) {
    list.resize(static_cast<std::size_t>(steps) + 1);
    std::iota(list.begin(), list.end(), std::int64_t{0});
    return list;
  }
  const h5::Id dataset = h5::open_dataset(file, "step");
  const h5::Dims dims = h5::dimensions(dataset);
  const bool fits = dims.size() == 1 && dims[0] <= static_cast<hsize_t>(steps) + 1;
  if (fits) list.resize(dims[0]);
  if (!list.empty()) h5::read_box<std::int64_t>(dataset, {0}, {dims[0]}, list.data());
  const bool ascends =
      std::adjacent_find(list.begin(), list.end(), std::greater_equal<>()) == list.end();
  if (!fits || !ascends || (!list.empty() && (list.front() < 0 || list.back() > steps)))
    throw IoError(fmt::format("{}: expected ascending steps from 0 to {}: the file is damaged",
                              h5::place_of(dataset), steps));
  return list;
}

}  // namespace tangere
