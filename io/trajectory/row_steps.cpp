// SPDX-License-Identifier: Apache-2.0
// Lists of steps are channels, too: "bodies/step" belongs to all of "bodies",
// "tactile/pad/sum_step" to "tactile/pad/sum" alone.
#include "io/trajectory/row_steps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <numeric>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

/// Opens a dataset by its path. None if a part of it is missing.
h5::Id find(const h5::Id& parent, const std::string& path) {
  const std::size_t slash = path.find('/');
  const std::string name = path.substr(0, slash);
  if (!h5::has_link(parent, name)) return {};
  if (slash == std::string::npos) return h5::open_dataset(parent, name);
  return find(h5::open_group(parent, name), path.substr(slash + 1));
}

std::vector<std::int64_t> listed(const h5::Id& dataset, std::int64_t steps) {
  std::vector<std::int64_t> list;
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

}  // namespace

bool is_trajectory(const h5::Id& file) {
  return H5Aexists(file.get(), "format") > 0 &&
         h5::read_text(file, "format") == "tangere trajectory";
}

h5::Id open_trajectory(const std::string& path) {
  h5::Id file = h5::open_file(path);
  if (!is_trajectory(file)) throw IoError(path + ": not a trajectory file of 'tangere simulate'");
  return file;
}

std::int64_t steps_of_run(const h5::Id& file) {
  constexpr std::int64_t kMost = std::int64_t{1} << 53;
  const auto steps = h5::read_number<std::int64_t>(file, "steps");
  if (steps < 0 || steps > kMost)
    throw IoError(fmt::format("{}: attribute 'steps' is {}; expected 0 to {}: the file is damaged",
                              h5::place_of(file), steps, kMost));
  return steps;
}

std::vector<std::int64_t> row_steps(const h5::Id& file, const std::string& channel) {
  const std::int64_t steps = steps_of_run(file);
  const std::size_t slash = channel.rfind('/');
  const std::string group = slash == std::string::npos ? "" : channel.substr(0, slash + 1);
  // The status has the times of the states.
  for (const std::string& list :
       {channel + "_step", (channel == "solver/status" ? "" : group) + "step"})
    if (const h5::Id dataset = find(file, list); dataset.get() >= 0) return listed(dataset, steps);
  const h5::Id dataset = find(file, channel);
  const h5::Dims dims = dataset.get() < 0 ? h5::Dims{} : h5::dimensions(dataset);
  const auto last = static_cast<hsize_t>(steps);
  if (dims.empty() || (dims[0] != last && dims[0] != last + 1))
    throw IoError(fmt::format("{}: the states are damaged: expected {} or {} rows of {}",
                              h5::place_of(file), last + 1, last, channel));
  std::vector<std::int64_t> list(dims[0]);
  std::iota(list.begin(), list.end(), static_cast<std::int64_t>(last + 1 - dims[0]));
  return list;
}

}  // namespace tangere
