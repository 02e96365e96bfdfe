// SPDX-License-Identifier: Apache-2.0
// Points that do not touch are zeros, which a chunk of whole environments compresses away.
#include "io/trajectory/memory_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

constexpr hsize_t kMemoryChunk = 1U << 20;
constexpr std::size_t kMostMemoryPoints = std::size_t{1} << 26;  // more is damage

[[noreturn]] void damaged(const h5::Id& object, const std::string& why) {
  throw IoError(fmt::format("{}: {}: the file is damaged", h5::place_of(object), why));
}

/// Reads names and places of the points.
std::vector<ShearSpringPlaces> read_contacts(const h5::Id& group) {
  const std::vector<std::string> names = h5::read_texts(group, "contacts");
  const auto first = h5::read_numbers<std::int64_t>(group, "first");
  const h5::Id dataset = h5::open_dataset(group, "place");
  const h5::Dims dims = h5::dimensions(dataset);
  const bool fits = dims.size() == 2 && dims[0] <= kMostMemoryPoints && dims[1] == 3 &&
                    first.size() == names.size() + 1 && first.front() == 0 &&
                    first.back() == static_cast<std::int64_t>(dims[0]) &&
                    std::is_sorted(first.begin(), first.end());
  if (!fits) damaged(group, "contacts, first and place do not belong together");
  std::vector<double> places(3 * dims[0]);
  h5::read_box<double>(dataset, {0, 0}, dims, places.data());
  std::vector<ShearSpringPlaces> contacts;
  const double* place = places.data();
  for (std::size_t c = 0; c < names.size(); ++c) {
    contacts.push_back({names[c], std::vector<Vector3>(std::size_t(first[c + 1] - first[c]))});
    for (Vector3& p : contacts.back().places)
      for (double& x : p) x = *place++;
  }
  return contacts;
}

}  // namespace

MemoryRows::MemoryRows(const h5::Id& file, const TrajectoryLayout& layout) : layout_(layout) {
  const ShearStateArrays& memory = layout.memory;
  const hsize_t E = static_cast<hsize_t>(layout.environments), P = memory.count(),
                M = static_cast<hsize_t>(layout.rows(layout.of_memory));
  const h5::Id group = h5::create_group(file, "memory");
  std::vector<std::string> names;
  std::vector<std::int64_t> first = {0};
  std::vector<double> places;
  for (const ShearSpringPlaces& c : memory.contacts) {
    names.push_back(c.name);
    first.push_back(first.back() + static_cast<std::int64_t>(c.places.size()));
    for (const Vector3& p : c.places) places.insert(places.end(), p.begin(), p.end());
  }
  h5::write_attribute(group, "contacts", std::span<const std::string>(names));
  h5::write_list<std::int64_t>(group, "first", first);
  const h5::Id place = h5::create_dataset<double>(group, "place", {P, 3});
  h5::write_attribute(place, "units", "m");
  h5::write_attribute(place, "frame", "axes of the moving frame that carries the point");
  h5::write_box<double>(place, {0, 0}, {P, 3}, places.data());
  together_ = std::clamp<hsize_t>(kMemoryChunk / (P * 3 * sizeof(double)), 1, E);
  numbers_.resize(together_ * P * 3);
  const h5::Storage storage =
      M > 0 ? h5::Storage{{1, together_, std::min<hsize_t>(P, kMemoryChunk / (3 * sizeof(double))),
                           3},
                          true}
            : h5::Storage{};
  s_ = h5::create_dataset<double>(group, "s", {M, E, P, 3}, storage);
  h5::write_attribute(s_, "units", "m");
  h5::write_attribute(s_, "meaning", "elastic displacement of each point; 0: none, or no touch");
  h5::write_attribute(s_, "frame", "axes of the moving frame that carries the point");
  step_ = h5::create_dataset<std::int64_t>(group, "step", {M});
  h5::write_attribute(step_, "meaning", "steps of this run before each row");
}

void MemoryRows::write(const MemoryRow& row) {
  const ShearStateArrays& memory = layout_.memory;
  const hsize_t E = static_cast<hsize_t>(layout_.environments), P = memory.count();
  const auto at =
      static_cast<hsize_t>(layout_.of_memory.before(row.step, layout_.steps, layout_.first_step));
  for (hsize_t first = 0; first < E; first += together_) {
    const hsize_t count = std::min(together_, E - first);
    for (hsize_t k = 0; k < count; ++k)
      memory.write(row.memory[first + k], std::span(numbers_).subspan(k * P * 3, P * 3));
    h5::write_box<double>(s_, {at, first, 0, 0}, {1, count, P, 3}, numbers_.data());
  }
  h5::write_box<std::int64_t>(step_, {at}, {1}, &row.step);
  ++written_;
}

std::vector<std::int64_t> read_steps(const h5::Id& dataset, std::int64_t steps) {
  std::vector<std::int64_t> list;
  const h5::Dims dims = h5::dimensions(dataset);
  const bool fits = dims.size() == 1 && dims[0] <= static_cast<hsize_t>(steps) + 1;
  if (fits) list.resize(dims[0]);
  if (!list.empty()) h5::read_box<std::int64_t>(dataset, {0}, {dims[0]}, list.data());
  const bool ascends =
      std::adjacent_find(list.begin(), list.end(), std::greater_equal<>()) == list.end();
  if (!fits || !ascends || (!list.empty() && (list.front() < 0 || list.back() > steps)))
    damaged(dataset, fmt::format("expected ascending steps from 0 to {}", steps));
  return list;
}

std::optional<SavedMemory> read_memory(const h5::Id& file, std::int64_t steps, int environments,
                                       std::int64_t row, std::vector<std::int64_t>& rows) {
  if (!h5::has_link(file, "memory")) return {};
  const h5::Id group = h5::open_group(file, "memory");
  rows = read_steps(h5::open_dataset(group, "step"), steps);
  const auto found = std::lower_bound(rows.begin(), rows.end(), row);
  if (found == rows.end() || *found != row) return {};
  SavedMemory memory{read_contacts(group), {}};
  ShearStateArrays in_order;
  in_order.row_of.resize(h5::dimensions(h5::open_dataset(group, "place"))[0]);
  std::iota(in_order.row_of.begin(), in_order.row_of.end(), 0);
  const h5::Id dataset = h5::open_dataset(group, "s");
  const h5::Dims dims = h5::dimensions(dataset);
  const hsize_t P = in_order.count();
  const auto E = static_cast<hsize_t>(environments);
  if (dims != h5::Dims{rows.size(), E, P, 3})
    damaged(dataset,
            fmt::format("expected {} rows of {} points of {} environments", rows.size(), P, E));
  std::vector<double> numbers(P * 3);
  for (hsize_t e = 0; e < E; ++e) {
    h5::read_box<double>(dataset, {static_cast<hsize_t>(found - rows.begin()), e, 0, 0},
                         {1, 1, P, 3}, numbers.data());
    if (!std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); }))
      damaged(dataset, fmt::format("row {} has a number that is not finite", row));
    memory.environments.push_back(in_order.read(numbers));
  }
  return memory;
}

}  // namespace tangere
