// SPDX-License-Identifier: Apache-2.0
// Rows hardly differ from one to the next, so chunks of many rows compress well.
#include "io/trajectory/sleep_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

constexpr hsize_t kChunk = 1U << 20;  // [bytes]

h5::Storage storage_of(h5::Dims dims, std::size_t element) {
  hsize_t environment = element;
  for (std::size_t i = 2; i < dims.size(); ++i) environment *= dims[i];
  if (dims[0] == 0 || environment == 0) return {};
  dims[1] = std::clamp<hsize_t>(kChunk / environment, 1, dims[1]);
  dims[0] = std::clamp<hsize_t>(kChunk / (environment * dims[1]), 1, dims[0]);
  return {dims, true};
}

template <class T>
h5::Id create(const h5::Id& group, const char* name, const h5::Dims& dims, const char* meaning) {
  h5::Id dataset = h5::create_dataset<T>(group, name, dims, storage_of(dims, sizeof(T)));
  h5::write_attribute(dataset, "meaning", meaning);
  return dataset;
}

template <class T>
void put(const h5::Id& dataset, std::int64_t at, h5::Dims row, const std::vector<T>& numbers) {
  if (numbers.empty()) return;
  h5::Dims offset(row.size() + 1, 0);
  offset[0] = static_cast<hsize_t>(at);
  row.insert(row.begin(), 1);
  h5::write_box<T>(dataset, offset, row, numbers.data());
}

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

SleepRows::SleepRows(const h5::Id& file, const TrajectoryLayout& layout) : layout_(layout) {
  const auto R = static_cast<hsize_t>(layout.rows(layout.states)),
             E = static_cast<hsize_t>(layout.environments);
  const hsize_t trees = layout.trees.size(), nu = layout.u_names.size();
  const h5::Id group = h5::create_group(file, "sleep");
  h5::write_attribute(group, "trees", std::span<const std::string>(layout.trees));
  h5::write_attribute(group, "meaning",
                      "at each row of /q; a tree is a body, named, with all that joints connect "
                      "it with");
  island_ = create<std::int32_t>(group, "island", {R, E, trees},
                                 "-1: awake; else the lowest tree of those that fell asleep "
                                 "together");
  rested_ = create<std::int32_t>(group, "rested", {R, E, trees},
                                 "steps in a row in which the tree hardly moved");
  controls_ = create<double>(group, "u", {R, E, nu},
                             "controls of the last step before which some tree rested; NaN: none");
  clearance_ = create<double>(group, "clearance", {R, E},
                              "what awake bodies may move before one may reach a sleeping one [m]");
  resting_ = create<std::int8_t>(group, "resting", {R, E},
                                 "1: a tree that is awake rested in the last step; -1: nothing is "
                                 "known yet of this environment");
  islands_.resize(E * trees);
  rests_.resize(E * trees);
  u_.resize(E * nu);
  clearances_.resize(E);
  flags_.resize(E);
}

void SleepRows::write(std::int64_t at, const SleepRow& row) {
  const std::size_t trees = layout_.trees.size(), nu = layout_.u_names.size();
  std::fill(islands_.begin(), islands_.end(), -1);
  std::fill(rests_.begin(), rests_.end(), 0);
  std::fill(u_.begin(), u_.end(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t e = 0; e < row.sleep.size(); ++e) {
    const SleepState& s = row.sleep[e];
    flags_[e] = s.asleep.empty() ? std::int8_t{-1} : static_cast<std::int8_t>(s.resting);
    clearances_[e] = s.clearance;
    const auto place = [e](auto& all, std::size_t width) {
      return all.begin() + static_cast<std::ptrdiff_t>(e * width);
    };
    std::copy(s.island.begin(), s.island.end(), place(islands_, trees));
    std::copy(s.rested.begin(), s.rested.end(), place(rests_, trees));
    std::copy(s.u.begin(), s.u.end(), place(u_, nu));
  }
  const hsize_t E = row.sleep.size();
  put(island_, at, {E, trees}, islands_);
  put(rested_, at, {E, trees}, rests_);
  put(controls_, at, {E, nu}, u_);
  put(clearance_, at, {E}, clearances_);
  put(resting_, at, {E}, flags_);
}

std::optional<SavedSleep> read_sleep(const h5::Id& file, std::int64_t at, std::size_t rows,
                                     int environments) {
  if (!h5::has_link(file, "sleep")) return {};
  const h5::Id group = h5::open_group(file, "sleep");
  SavedSleep saved{h5::read_texts(group, "trees"), {}};
  const auto E = static_cast<hsize_t>(environments);
  const h5::Dims of_u = h5::dimensions(h5::open_dataset(group, "u"));
  const hsize_t trees = saved.trees.size(), nu = of_u.empty() ? 0 : of_u.back();
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
