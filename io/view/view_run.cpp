// SPDX-License-Identifier: Apache-2.0
// An environment of a run is an episode of the page.
#include "io/view/view_run.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/checks.hpp"
#include "io/view/view_frames.hpp"

namespace tangere {
namespace {

/// A sensor of the page and its fields.
struct Shown {
  std::span<const double> values;  ///< (environments, F, points, 3)
  int pressure_sign;
};

std::vector<Shown> take_sensors(const Model& model, const ViewScene& scene, const ViewRun& run,
                                ViewData& data) {
  std::vector<Shown> shown;
  const std::vector<ViewSensor> sensors = scene.sensors();
  for (const auto& [name, values] : run.fields) {
    const auto found = std::ranges::find(sensors, name, &ViewSensor::name);
    if (found == sensors.end())
      throw InputError(fmt::format("a field of '{}', which is no sensor of the scene", name));
    check_size("fields of a sensor", values.size(),
               run.environments.size() * run.time.size() * 3 * std::size_t(found->points));
    data.sensors.push_back(*found);
    const auto index = std::size_t(found - sensors.begin());
    shown.push_back({values, model.sensors()[index].pressure_sign});
  }
  return shown;
}

/// Appends fields of one environment, at every frame, and the forces that they add up to.
void add_fields(const ViewSensor& sensor, int pressure_sign, std::span<const double> values,
                std::span<const std::int64_t> frames, ViewEpisode& episode) {
  const std::size_t width = 3 * std::size_t(sensor.points);
  ViewField field;
  ViewTrace normal{"force [N]", sensor.name + " normal", "N", {}},
      shear{"force [N]", sensor.name + " shear", "N", {}};
  for (const std::int64_t frame : frames) {
    const auto own = values.subspan(std::size_t(frame) * width, width);
    check_finite_field(own, "the run");
    const auto sums = add_field(sensor, pressure_sign, own, field);
    field.at.push_back(static_cast<std::int32_t>(field.at.size()));
    normal.values.push_back(static_cast<float>(sums[0]));
    shear.values.push_back(static_cast<float>(sums[1]));
  }
  episode.fields.push_back(std::move(field));
  episode.traces.push_back(std::move(normal));
  episode.traces.push_back(std::move(shear));
}

}  // namespace

ViewData view_run(const Model& model, const ViewRun& run, const ViewOptions& options) {
  const Scene& source = model.scene();
  const std::size_t nq = std::size_t(model.nq()), frames = run.time.size(),
                    count = run.environments.size(), width = run.names.size();
  check_size("coordinates of a run", run.q.size(), count * frames * nq);
  check_size("numbers of environments", run.values.size(), count * width);
  ViewScene scene(source.text, source.path.empty() ? source.name : source.path, source.name,
                  options);
  ViewData data;
  data.title = source.name, data.source = source.path, data.kind = "run";
  data.scene = scene.scene();
  const std::vector<Shown> shown = take_sensors(model, scene, run, data);
  const std::vector<std::string> names(model.q_names().begin(), model.q_names().end());
  data.stride = stride_for(
      std::vector<std::int64_t>(count, std::int64_t(frames)),
      numbers_per_frame(data.scene, data.sensors, nq + 2 * data.sensors.size()), options);
  const std::vector<std::int64_t> rows = frames_of(std::int64_t(frames), data.stride);
  for (std::size_t e = 0; e < count; ++e) {
    ViewEpisode episode;
    episode.label = fmt::format("environment {}", run.environments[e]);
    const auto own = run.values.subspan(e * width, width);
    episode.shapes = scene.begin_episode({run.names, {own.begin(), own.end()}}, data);
    episode.rows = rows;
    episode.traces = coordinate_traces(names, scene.q_units());
    for (const std::int64_t row : rows) {
      const auto state = run.q.subspan((e * frames + std::size_t(row)) * nq, nq);
      episode.time.push_back(static_cast<float>(run.time[std::size_t(row)]));
      scene.add_state(state, episode);
      for (std::size_t k = 0; k < nq; ++k)
        episode.traces[k].values.push_back(static_cast<float>(state[k]));
    }
    for (std::size_t s = 0; s < shown.size(); ++s) {
      const std::size_t size = shown[s].values.size() / count;
      add_fields(data.sensors[s], shown[s].pressure_sign, shown[s].values.subspan(e * size, size),
                 rows, episode);
    }
    data.episodes.push_back(std::move(episode));
  }
  return data;
}

}  // namespace tangere
