// SPDX-License-Identifier: Apache-2.0
// Shapes are checked here, numbers by Batch::set_sleep().
#include "io/trajectory/sleep_rows.hpp"

#include <fmt/format.h>

#include <span>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

/// Row `at` of a dataset (rows, E, …): the numbers of all environments.
template <class T>
std::vector<T> get(const h5::Id& group, const char* name, std::int64_t at, std::size_t rows,
                   const h5::Dims& row) {
  const h5::Id dataset = h5::open_dataset(group, name);
  h5::Dims dims = row, offset(row.size() + 1, 0);
  dims.insert(dims.begin(), rows);
  if (h5::dimensions(dataset) != dims)
    throw IoError(fmt::format("{}: its shape is not that of the run: the file is damaged",
                              h5::place_of(dataset)));
  offset[0] = static_cast<hsize_t>(at);
  dims[0] = 1;
  hsize_t numbers = 1;
  for (const hsize_t n : row) numbers *= n;
  std::vector<T> values(numbers);
  if (!values.empty()) h5::read_box<T>(dataset, offset, dims, values.data());
  return values;
}

}  // namespace

std::optional<SavedSleep> read_sleep(const h5::Id& file, std::int64_t at, std::size_t rows,
                                     int environments) {
  if (!h5::has_link(file, "sleep")) return {};
  const h5::Id group = h5::open_group(file, "sleep");
  SavedSleep saved{h5::read_texts(group, "trees"), {}};
  const auto E = static_cast<hsize_t>(environments);
  const h5::Dims u_dims = h5::dimensions(h5::open_dataset(group, "u"));
  const hsize_t trees = saved.trees.size(), nu = u_dims.empty() ? 0 : u_dims.back();
  const auto islands = get<std::int32_t>(group, "island", at, rows, {E, trees}),
             rested = get<std::int32_t>(group, "rested", at, rows, {E, trees});
  const auto u = get<double>(group, "u", at, rows, {E, nu}),
             clearance = get<double>(group, "clearance", at, rows, {E});
  const auto flags = get<std::int8_t>(group, "resting", at, rows, {E});
  for (std::size_t e = 0; e < E; ++e) {
    SleepState state;
    const auto part = [e](const auto& all, std::size_t width) {
      return std::span(all).subspan(e * width, width);
    };
    if (flags[e] >= 0) {
      for (const std::int32_t island : part(islands, trees)) {
        state.island.push_back(island);
        state.asleep.push_back(island >= 0 ? 1 : 0);
      }
      const auto rests = part(rested, trees);
      const auto controls = part(u, nu);
      state.rested.assign(rests.begin(), rests.end());
      state.u.assign(controls.begin(), controls.end());
      state.clearance = clearance[e];
      state.resting = flags[e] > 0;
    }
    saved.environments.push_back(std::move(state));
  }
  return saved;
}

}  // namespace tangere
