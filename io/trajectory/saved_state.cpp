// SPDX-License-Identifier: Apache-2.0
// Reads one row of each dataset and checks it against the model before any of it is used.
#include "io/trajectory/saved_state.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <string_view>

#include "engine/base/error.hpp"
#include "engine/step/sleeping_trees.hpp"
#include "io/hdf5/h5.hpp"
#include "io/trajectory/memory_rows.hpp"
#include "io/trajectory/row_steps.hpp"
#include "io/trajectory/sleep_rows.hpp"

namespace tangere {
namespace {

constexpr std::int64_t kMost = std::int64_t{1} << 53;  // steps, episodes; more is damage
constexpr std::size_t kListed = 5;                     // rows that a message names

/// Throws IoError unless `found` lies in [least, most].
std::int64_t within(const std::string& path, const char* what, std::int64_t found,
                    std::int64_t least, std::int64_t most) {
  if (found < least || found > most)
    throw IoError(fmt::format("{}: attribute '{}' is {}; expected {} to {}: the file is damaged",
                              path, what, found, least, most));
  return found;
}

/// Reads row `row` of a (rows, E, width) dataset.
std::vector<double> read_row(const h5::Id& dataset, std::int64_t row) {
  const h5::Dims dims = h5::dimensions(dataset);
  std::vector<double> values(dims[1] * dims[2]);
  if (!values.empty())
    h5::read_box<double>(dataset, {static_cast<hsize_t>(row), 0, 0}, {1, dims[1], dims[2]},
                         values.data());
  return values;
}

std::vector<StepStatus> read_status(const h5::Id& file, std::int64_t step,
                                    std::size_t environments) {
  std::vector<std::int8_t> values(environments);
  h5::read_box<std::int8_t>(h5::open_dataset(h5::open_group(file, "solver"), "status"),
                            {static_cast<hsize_t>(step), 0}, {1, environments}, values.data());
  std::vector<StepStatus> status;
  for (const std::int8_t value : values) {
    status.push_back(static_cast<StepStatus>(value));
    if (std::string_view(to_string(status.back())) == "unknown")
      throw IoError(fmt::format("{}: solver status {} of row {}: the file is damaged",
                                h5::place_of(file), value, step + 1));
  }
  return status;
}

void check_names(const SavedState& from, const char* what, const std::vector<std::string>& names,
                 std::span<const std::string> expected) {
  if (names.size() != expected.size())
    throw InputError(fmt::format("{}: {} numbers in {}; the scene has {}", from.path, names.size(),
                                 what, expected.size()));
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i] != expected[i])
      throw InputError(fmt::format("{}: number {} of {} is '{}'; in the scene it is '{}'",
                                   from.path, i, what, names[i], expected[i]));
}

/// Throws InputError unless the points of a file are those of the scene.
void check_points(const SavedState& from, const ShearStateArrays& points) {
  constexpr double kSamePlace = 1e-9;  // [m]
  const std::vector<ShearSpringPlaces>& saved = from.memory->contacts;
  if (saved.size() != points.contacts.size())
    throw InputError(fmt::format("{}: {} contacts remember; in the scene {} do", from.path,
                                 saved.size(), points.contacts.size()));
  for (std::size_t c = 0; c < saved.size(); ++c) {
    const ShearSpringPlaces &one = saved[c], &other = points.contacts[c];
    if (one.name != other.name || one.places.size() != other.places.size())
      throw InputError(fmt::format("{}: '{}' remembers, with {} points; in the scene '{}', with {}",
                                   from.path, one.name, one.places.size(), other.name,
                                   other.places.size()));
    for (std::size_t k = 0; k < one.places.size(); ++k)
      for (std::size_t i = 0; i < 3; ++i)
        if (!(std::abs(one.places[k][i] - other.places[k][i]) <= kSamePlace))
          throw InputError(fmt::format("{}: point {} of '{}' lies elsewhere than in the scene",
                                       from.path, k, one.name));
  }
}

}  // namespace

SavedState read_state(const std::string& path, std::optional<std::int64_t> row) {
  const h5::Id file = open_trajectory(path);
  SavedState state;
  state.path = path;
  const auto number = [&](const char* name, std::int64_t least, std::int64_t most) {
    return within(path, name, h5::read_number<std::int64_t>(file, name), least, most);
  };
  const std::int64_t steps = steps_of_run(file);
  const std::vector<std::int64_t> rows = row_steps(file, "q");
  state.row = row.value_or(rows.empty() ? steps : rows.back());
  if (state.row < 0 || state.row > steps)
    throw InputError(fmt::format("row {} of {}; expected 0 to {}", state.row, path, steps));
  const auto found = std::lower_bound(rows.begin(), rows.end(), state.row);
  if (found == rows.end() || *found != state.row)
    throw InputError(
        rows.empty()
            ? fmt::format("{} recorded no state", path)
            : fmt::format("row {} of {} was not recorded; expected one of {}{}", state.row, path,
                          fmt::join(std::span(rows).first(std::min(rows.size(), kListed)), ", "),
                          rows.size() > kListed ? " …" : ""));
  const std::int64_t at = found - rows.begin();
  state.step = number("first_step", 0, kMost) + state.row;
  state.environments = static_cast<int>(number("environments", 1, std::numeric_limits<int>::max()));
  state.seed = h5::read_number<std::uint64_t>(file, "seed");
  state.first_episode = number("first_episode", 0, kMost);
  state.timestep = h5::read_number<double>(file, "timestep");
  state.tolerance = h5::read_number<double>(file, "tolerance");
  if (H5Aexists(file.get(), "accuracy") > 0)
    state.accuracy = h5::read_number<double>(file, "accuracy");
  if (H5Aexists(file.get(), "sleep") > 0) state.sleep = h5::read_number<double>(file, "sleep");
  state.integrator = h5::read_text(file, "integrator");
  state.scene_text = h5::read_text(file, "scene_text");
  const h5::Id q = h5::open_dataset(file, "q"), v = h5::open_dataset(file, "v");
  state.q_names = h5::read_texts(q, "names");
  state.v_names = h5::read_texts(v, "names");
  const h5::Dims dims = h5::dimensions(q), rates = h5::dimensions(v);
  const auto environments = static_cast<std::size_t>(state.environments);
  if (dims != h5::Dims{rows.size(), environments, state.q_names.size()} ||
      rates != h5::Dims{rows.size(), environments, state.v_names.size()})
    throw IoError(path + ": the states are damaged");
  state.q = read_row(q, at);
  state.v = read_row(v, at);
  state.status.assign(environments, StepStatus::converged);
  // Where rows are listed, each has the status of the step that it follows.
  const bool listed = h5::has_link(file, "step");
  if (state.row > 0) state.status = read_status(file, listed ? at : at - 1, environments);
  if (at > 0 && rows[static_cast<std::size_t>(at) - 1] == state.row - 1) {
    state.previous_q = read_row(q, at - 1);
    state.previous_v = read_row(v, at - 1);
  }
  if (state.sleep > 0) state.sleep_state = read_sleep(file, at, rows.size(), state.environments);
  state.memory = read_memory(file, state.environments, state.row, state.memory_rows);
  return state;
}

void restore_state(const SavedState& from, bool continues, Batch& batch) {
  const Model& model = batch.model();
  check_names(from, "q", from.q_names, model.q_names());
  check_names(from, "v", from.v_names, model.v_names());
  if (batch.environments() > from.environments)
    throw InputError(fmt::format("{} environments; {} has {}", batch.environments(), from.path,
                                 from.environments));
  const auto nq = static_cast<std::size_t>(model.nq()), nv = static_cast<std::size_t>(model.nv());
  const ShearStateArrays points = shear_state_arrays(model);
  const bool has_memory = model.has_shear_state() && from.memory;
  if (has_memory) check_points(from, points);
  const bool sleeps = continues && from.sleep_state;
  if (sleeps)
    check_names(from, "trees that may sleep", from.sleep_state->trees, sleeping_trees(model));
  std::vector<double> displacements(3 * points.count());
  for (int e = 0; e < batch.environments(); ++e) {
    const auto part = [e](const std::vector<double>& all, std::size_t width) {
      return std::span(all).subspan(static_cast<std::size_t>(e) * width, width);
    };
    if (continues && !from.previous_q.empty()) {
      batch.set_state(e, part(from.q, nq), part(from.v, nv), part(from.previous_q, nq),
                      part(from.previous_v, nv));
    } else {
      batch.set_state(e, part(from.q, nq), part(from.v, nv));
    }
    if (continues) batch.set_steps(e, from.step);  // the noise of sensors goes on
    if (has_memory) {
      std::fill(displacements.begin(), displacements.end(), 0.0);
      for (const ShearEntry& entry : from.memory->environments[static_cast<std::size_t>(e)])
        std::copy_n(entry.s, 3, &displacements[3 * static_cast<std::size_t>(entry.point)]);
      batch.set_shear_state(e, points.read(displacements));
    }
    if (sleeps) batch.set_sleep(e, from.sleep_state->environments[static_cast<std::size_t>(e)]);
    const StepStatus status = from.status[static_cast<std::size_t>(e)];
    if (failed(status)) batch.set_failed(e, status);
  }
}

}  // namespace tangere
