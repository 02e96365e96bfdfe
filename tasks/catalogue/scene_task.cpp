// SPDX-License-Identifier: Apache-2.0
// Observations are copies of a snapshot, so their derivatives are copies of the weights.
#include "tasks/catalogue/scene_task.hpp"

#include <algorithm>

#include "engine/step/displacement.hpp"

namespace tangere {

namespace {

TaskSpec declared(const Scene& scene, int steps, int horizon) {
  const Model model(scene);
  if (model.nu() == 0)
    throw InputError((scene.path.empty() ? "" : scene.path + ": ") +
                     "the scene has no motor; expected controls by which it can be moved");
  TaskSpec spec;
  spec.name = "scene";
  spec.summary = "A scene without a reward.";
  spec.scene = scene.path.empty() ? scene.name : scene.path;
  spec.success = "never";
  spec.action = {"controls", {std::size_t(model.nu())}, "1", "controls of the motors"};
  spec.observations = {{"state.q", {std::size_t(model.nq())}, "m, rad, 1", "coordinates"},
                       {"state.v", {std::size_t(model.nv())}, "m/s, rad/s", "velocities"}};
  if (const std::size_t n = model.end_effectors().size(); n > 0) {
    spec.observations.push_back({"variables", {n, 3}, "m", "places of end effectors"});
    spec.reads_end_effectors = true;
  }
  for (const SensorInfo& s : model.sensors()) {
    std::vector<std::size_t> shape = {std::size_t(s.points), 3};
    if (s.rows > 0) shape = {std::size_t(s.rows), std::size_t(s.cols), 3};
    spec.observations.push_back({s.name, std::move(shape), "N", "field of a sensor"});
    spec.observations.back().touch = true;
    spec.reads_tactile = true;
  }
  spec.steps_per_action = steps;
  spec.snapshots = {steps};
  spec.horizon = horizon;
  return spec;
}

}  // namespace

SceneTask::SceneTask(const Scene& scene, int steps, int horizon)
    : Task(scene, declared(scene, steps, horizon)) {}

void SceneTask::start(const TaskStart& start) const {
  const std::size_t k = start.varying.size(), first = std::size_t(start.episode) * k;
  if (k == 0 || first + k > varying_.size()) return;
  std::copy_n(varying_.begin() + std::ptrdiff_t(first), k, start.varying.begin());
}

void SceneTask::controls(const TaskView& view, int, std::span<double> u) const {
  std::ranges::copy(view.action, u.begin());
}

void SceneTask::controls_vjp(const TaskView&, int, std::span<const double> weight,
                             const ViewCotangent& out) const {
  for (std::size_t k = 0; k < weight.size(); ++k) out.action[k] += weight[k];
}

void SceneTask::observe(const TaskView& view, std::span<double> observation) const {
  const Snapshot& now = view.now();
  auto to = observation.begin();
  for (const auto& part : {now.q, now.v, now.end_effectors, now.tactile})
    to = std::ranges::copy(part, to).out;
}

void SceneTask::observe_vjp(const TaskView& view, std::span<const double> weight,
                            const ViewCotangent& out) const {
  const Snapshot& now = view.now();
  const SnapshotCotangent& bar = out.snapshots.back();
  add_along_dofs(model(), now.q, weight.first(now.q.size()), bar.q);
  std::size_t at = now.q.size();
  for (const auto& part : {bar.v, bar.end_effectors, bar.tactile}) {
    for (double& x : part) x += weight[at++];
  }
}

}  // namespace tangere
