// SPDX-License-Identifier: Apache-2.0
// How an observation changes, by differences of observe() alone.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/step/displacement.hpp"
#include "tasks/gradients/task_tangent.hpp"

namespace tangere::testing {

/// Observes a view that is moved by `by` times a change.
inline std::vector<double> observe_moved(const Task& task, const TaskView& at,
                                         const ViewTangent& change, double by) {
  using Numbers = std::vector<double>;
  const auto moved = [by](std::span<const double> x, const Numbers& d) {
    Numbers y(x.begin(), x.end());
    for (std::size_t i = 0; i < d.size(); ++i) y[i] += by * d[i];
    return y;
  };
  const Numbers memory = moved(at.task_state, change.memory),
                action = moved(at.action, change.action);
  std::vector<std::vector<Numbers>> kept;
  std::vector<Snapshot> moments;
  for (std::size_t m = 0; m < at.snapshots.size(); ++m) {
    const Snapshot& from = at.snapshots[m];
    Numbers q(from.q.begin(), from.q.end());
    for (std::size_t i = 0; i < change.q[m].size(); ++i)
      displace(task.model(), q, int(i), by * change.q[m][i]);
    kept.push_back({q, moved(from.v, change.v[m]),
                    moved(from.end_effectors, change.end_effectors[m]),
                    moved(from.tactile, change.tactile[m])});
  }
  for (const auto& k : kept) moments.push_back({k[0], k[1], k[2], k[3]});
  TaskView view = at;
  view.task_state = memory;
  view.action = action;
  view.snapshots = moments;
  Numbers o(task.spec().observation_size());
  task.observe(view, o);
  return o;
}

/// Central differences along a change of what a task looks at.
inline std::vector<double> observed_change(const Task& task, const TaskView& at,
                                           const ViewTangent& change) {
  double largest = 0;
  const auto measure = [&](const std::vector<double>& x) {
    for (const double y : x) largest = std::max(largest, std::abs(y));
  };
  for (const auto* parts : {&change.q, &change.v, &change.end_effectors, &change.tactile})
    for (const auto& x : *parts) measure(x);
  measure(change.memory);
  measure(change.action);
  if (largest == 0) return std::vector<double>(task.spec().observation_size());
  const double step = 1e-6 / largest;
  std::vector<double> above = observe_moved(task, at, change, step);
  const std::vector<double> below = observe_moved(task, at, change, -step);
  for (std::size_t k = 0; k < above.size(); ++k) above[k] = (above[k] - below[k]) / (2 * step);
  return above;
}

}  // namespace tangere::testing
