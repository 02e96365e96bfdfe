// SPDX-License-Identifier: Apache-2.0
// Starts of many episodes of a task, and whether what they draw follows its distribution.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/batch.hpp"
#include "tasks/task.hpp"

namespace tangere::testing {

/// Largest distance between the distribution of `x` and the uniform one on [low, high], times √n: below 1.63 with
/// probability 0.99 (Kolmogorov, Smirnov).
inline double uniform_distance(std::vector<double> x, double low, double high) {
  std::sort(x.begin(), x.end());
  double most = 0;
  const auto n = double(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double expected = (x[i] - low) / (high - low);
    most = std::max({most, expected - double(i) / n, double(i + 1) / n - expected});
  }
  return most * std::sqrt(n);
}
inline constexpr double kUnlikely = 1.63;
inline constexpr int kDraws = 10000;

/// Starts of 10 000 episodes.
struct Start {
  std::vector<double> q, v, varying, memory;
};
inline std::vector<Start> starts(const Task& task) {
  std::vector<Start> all;
  Batch batch(task.model(), 1, 3);
  for (std::int64_t episode = 0; episode < kDraws; ++episode) {
    batch.reset(0, episode);
    Start s{std::vector<double>(std::size_t(task.model().nq())),
            std::vector<double>(std::size_t(task.model().nv())),
            {},
            std::vector<double>(std::size_t(task.spec().memory))};
    batch.get_q(0, s.q);
    batch.get_v(0, s.v);
    for (std::size_t k = 0; k < task.model().scene().randomizations.size(); ++k)
      s.varying.push_back(batch.randomized_value(0, int(k)));
    task.start({3, episode, s.q, s.v, s.varying, s.memory});
    all.push_back(std::move(s));
  }
  return all;
}
inline std::vector<double> column(const std::vector<Start>& all, const std::function<double(const Start&)>& of) {
  std::vector<double> x;
  for (const Start& s : all) x.push_back(of(s));
  return x;
}

}  // namespace tangere::testing
