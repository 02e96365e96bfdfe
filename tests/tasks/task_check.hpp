// SPDX-License-Identifier: Apache-2.0
// Shared by the tests of tasks: a task by name, its episodes, derivatives of its reward by
// differences.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "io/scene/scene_reader.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/run/policy.hpp"

namespace tangere::testing {

inline std::unique_ptr<Task> task_named(const std::string& name) {
  return make_task(name, read_scene(TANGERE_SOURCE_DIR "/scenes/" + task_spec(name).scene).scene);
}

/// Everything that an environment showed, episode by episode. Equality compares every bit.
struct Shown {
  std::vector<double> numbers;
  int resets = 0, ends = 0;
  bool operator==(const Shown&) const = default;
};

inline std::vector<Shown> play(const Task& task, PolicyKind kind, int environments, int steps,
                               const VectorOptions& options) {
  VectorTask vector(task, environments, options);
  const Policy policy(task, kind);
  std::vector<Shown> shown(std::size_t(environments), Shown{});
  std::vector<double> actions(std::size_t(environments) * task.spec().action.size());
  for (int t = 0; t <= steps; ++t) {
    if (t > 0) {
      policy.act(vector, actions);
      vector.step(actions);
    }
    for (int e = 0; e < environments; ++e) {
      const std::size_t i = std::size_t(e);
      const auto o = vector.observation(e);
      shown[i].numbers.insert(shown[i].numbers.end(), o.begin(), o.end());
      shown[i].numbers.push_back(vector.rewards()[i]);
      shown[i].resets += vector.starting()[i];
      shown[i].ends += vector.terminated()[i] + vector.truncated()[i];
    }
  }
  return shown;
}

/// Episodes that a policy played to their ends, one per environment.
struct Played {
  int episodes = 0, successes = 0, failures = 0;
  double mean_return = 0, mean_length = 0;
  [[nodiscard]] double rate() const { return double(successes) / episodes; }
  /// Half of the 95 % interval of the rate.
  [[nodiscard]] double half_width() const {
    return 1.96 * std::sqrt(rate() * (1 - rate()) / episodes);
  }
};

inline Played play_episodes(const Task& task, PolicyKind kind, int episodes,
                            std::uint64_t seed = 0) {
  VectorOptions options;
  options.seed = seed;
  options.autoreset = false;
  options.threads = 2;
  VectorTask vector(task, episodes, options);
  const Policy policy(task, kind);
  std::vector<double> actions(std::size_t(episodes) * task.spec().action.size());
  for (int t = 0; t < task.spec().horizon; ++t) {
    policy.act(vector, actions);
    vector.step(actions);
  }
  Played p{episodes};
  for (int e = 0; e < episodes; ++e) {
    p.successes += vector.success()[std::size_t(e)];
    p.failures += failed(vector.status(e));
    p.mean_return += vector.returns()[std::size_t(e)] / episodes;
    p.mean_length += double(vector.lengths()[std::size_t(e)]) / episodes;
    EXPECT_EQ(vector.terminated()[std::size_t(e)] + vector.truncated()[std::size_t(e)], 1)
        << "episode " << e;
  }
  return p;
}

/// Owns the numbers of one environment that a view can look at.
struct OwnView {
  std::vector<double> memory, action;
  std::vector<std::vector<double>> q, v, end_effectors, tactile;  // per moment
  std::vector<Snapshot> moments;
  std::int64_t actions = 0;

  explicit OwnView(const Task& task)
      : memory(std::size_t(task.spec().task_state)), action(task.spec().action.size()) {
    for (std::size_t m = 0; m < task.spec().snapshots.size(); ++m) {
      q.emplace_back(std::size_t(task.model().nq()));
      v.emplace_back(std::size_t(task.model().nv()));
      end_effectors.emplace_back(task.end_effectors_size());
      tactile.emplace_back(task.tactile_size());
    }
  }
  [[nodiscard]] TaskView view() {
    moments.clear();
    for (std::size_t m = 0; m < q.size(); ++m)
      moments.push_back({q[m], v[m], end_effectors[m], tactile[m]});
    return {0, 0, actions, memory, action, moments};
  }
};

}  // namespace tangere::testing
