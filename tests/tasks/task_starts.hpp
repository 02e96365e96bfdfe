// SPDX-License-Identifier: Apache-2.0
// Draws starts of many episodes of a task, and measures whether they follow their distribution.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "engine/step/batch.hpp"
#include "tasks/catalogue/task.hpp"

namespace tangere::testing {

/// Largest distance between the distribution of `x` and the one that is below y with probability
/// `below(y)`, times √n. It is below 1.63 with probability 0.99 (Kolmogorov, Smirnov).
inline double distance_from(std::vector<double> x, const std::function<double(double)>& below) {
  std::sort(x.begin(), x.end());
  double most = 0;
  const auto n = double(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double expected = below(x[i]);
    most = std::max({most, expected - double(i) / n, double(i + 1) / n - expected});
  }
  return most * std::sqrt(n);
}
/// Distance from the uniform distribution on [low, high].
inline double uniform_distance(std::vector<double> x, double low, double high) {
  return distance_from(std::move(x), [=](double y) { return (y - low) / (high - low); });
}
/// Distance from the normal distribution.
inline double normal_distance(std::vector<double> x, double mean, double deviation) {
  return distance_from(std::move(x), [=](double y) {
    return 0.5 * std::erfc((mean - y) / (deviation * std::sqrt(2.0)));
  });
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
            std::vector<double>(std::size_t(task.spec().task_state))};
    batch.get_q(0, s.q);
    batch.get_v(0, s.v);
    for (std::size_t k = 0; k < task.model().scene().randomizations.size(); ++k)
      s.varying.push_back(batch.randomized_value(0, int(k)));
    task.start({3, episode, s.q, s.v, s.varying, s.memory});
    all.push_back(std::move(s));
  }
  return all;
}
inline std::vector<double> column(const std::vector<Start>& all,
                                  const std::function<double(const Start&)>& of) {
  std::vector<double> x;
  for (const Start& s : all) x.push_back(of(s));
  return x;
}

}  // namespace tangere::testing
