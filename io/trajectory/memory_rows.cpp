// SPDX-License-Identifier: Apache-2.0
// Points are those of the file; restore_state() compares them with the model's.
#include "io/trajectory/memory_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "engine/base/error.hpp"
#include "io/trajectory/row_steps.hpp"

namespace tangere {
namespace {

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

std::optional<SavedMemory> read_memory(const h5::Id& file, int environments, std::int64_t row,
                                       std::vector<std::int64_t>& rows) {
  if (!h5::has_link(file, "memory")) return {};
  const h5::Id group = h5::open_group(file, "memory");
  rows = row_steps(file, "memory/s");
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
