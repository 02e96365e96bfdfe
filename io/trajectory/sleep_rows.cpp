// SPDX-License-Identifier: Apache-2.0
// Rows hardly differ from one to the next, so chunks of many rows compress well.
#include "io/trajectory/sleep_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>

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

template <class T>
RowsInChunks<T>::RowsInChunks(const h5::Id& group, const char* name, const h5::Dims& dims,
                              const char* meaning)
    : dims_(dims) {
  const h5::Storage storage = storage_of(dims, sizeof(T));
  dataset_ = h5::create_dataset<T>(group, name, dims, storage);
  h5::write_attribute(dataset_, "meaning", meaning);
  if (!storage.chunk.empty()) chunk_rows_ = storage.chunk[0];
  numbers_.resize(std::accumulate(dims.begin() + 1, dims.end(), chunk_rows_, std::multiplies<>()));
}

template <class T>
std::span<T> RowsInChunks<T>::next_row() {
  const std::size_t width = numbers_.size() / chunk_rows_;
  return std::span(numbers_).subspan(held_ * width, width);
}

template <class T>
void RowsInChunks<T>::add_row() {
  ++held_;
  if (held_ < chunk_rows_ && first_ + held_ < dims_[0]) return;
  h5::Dims offset(dims_.size(), 0), count = dims_;
  offset[0] = first_;
  count[0] = held_;
  if (!numbers_.empty()) h5::write_box<T>(dataset_, offset, count, numbers_.data());
  first_ += held_;
  held_ = 0;
}

SleepRows::SleepRows(const h5::Id& file, const TrajectoryLayout& layout) : layout_(layout) {
  const auto R = static_cast<hsize_t>(layout.rows(layout.states)),
             E = static_cast<hsize_t>(layout.environments);
  const hsize_t trees = layout.trees.size(), nu = layout.u_names.size();
  const h5::Id group = h5::create_group(file, "sleep");
  h5::write_attribute(group, "trees", std::span<const std::string>(layout.trees));
  h5::write_attribute(group, "meaning",
                      "at each row of /q; a tree is a body, named, with all that joints connect "
                      "it with");
  island_ = {group,
             "island",
             {R, E, trees},
             "-1: awake; else the lowest tree of those that fell asleep together"};
  rested_ = {group, "rested", {R, E, trees}, "steps in a row in which the tree hardly moved"};
  u_ = {
      group, "u", {R, E, nu}, "controls of the last step before which some tree rested; NaN: none"};
  clearance_ = {group,
                "clearance",
                {R, E},
                "what awake bodies may move before one may reach a sleeping one [m]"};
  resting_ = {group,
              "resting",
              {R, E},
              "1: a tree that is awake rested in the last step; -1: nothing is known yet of this "
              "environment"};
}

void SleepRows::write(const SleepRow& row) {
  const std::size_t trees = layout_.trees.size(), nu = layout_.u_names.size();
  const std::span<std::int32_t> islands = island_.next_row(), rested = rested_.next_row();
  const std::span<double> u = u_.next_row(), clearance = clearance_.next_row();
  const std::span<std::int8_t> resting = resting_.next_row();
  std::fill(islands.begin(), islands.end(), -1);
  std::fill(rested.begin(), rested.end(), 0);
  std::fill(u.begin(), u.end(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t e = 0; e < row.sleep.size(); ++e) {
    const SleepState& s = row.sleep[e];
    resting[e] = s.asleep.empty() ? std::int8_t{-1} : static_cast<std::int8_t>(s.resting);
    clearance[e] = s.clearance;
    const auto place = [e](const auto& all, std::size_t width) {
      return all.begin() + static_cast<std::ptrdiff_t>(e * width);
    };
    std::copy(s.island.begin(), s.island.end(), place(islands, trees));
    std::copy(s.rested.begin(), s.rested.end(), place(rested, trees));
    std::copy(s.u.begin(), s.u.end(), place(u, nu));
  }
  island_.add_row(), rested_.add_row(), u_.add_row(), clearance_.add_row(), resting_.add_row();
  ++written_;
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
