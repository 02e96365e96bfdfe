// SPDX-License-Identifier: Apache-2.0
// What a run of many episodes hands to whoever stores it. The only place where tasks/ (which
// produces) and io/ (which stores) meet when episodes are generated.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "engine/step/batch.hpp"

namespace tangere {

/// Numbers of one name as they are stored: float64 or float32.
using Observation = std::variant<std::span<const double>, std::span<const float>>;

/// How an episode of a task ended.
struct EpisodeEnd {
  std::int64_t length = 0;  ///< actions taken: rows behind belong to nothing
  double total = 0;         ///< sum of its rewards
  bool terminated = false;  ///< by itself, not for want of time
  bool success = false;
};

/// Derivatives that are stored beside an episode's numbers, as float64.
struct GradientArray {
  std::string name;                  ///< "grad_actions"
  std::vector<std::uint64_t> shape;  ///< of a row, or of all of it
  bool by_row = false;               ///< one for every row with an action
  std::string meaning;
  std::vector<std::string> by_names,
      by_units;  ///< what the derivatives are by, along the last dimension
  [[nodiscard]] std::size_t width() const {
    std::size_t numbers = 1;
    for (const std::uint64_t n : shape) numbers *= n;
    return numbers;
  }
};

/// Rows [first_row, first_row + rows) of consecutive episodes. Row j is the state after j K steps;
/// an episode of R actions has R + 1 of them, the last one without an action.
struct EpisodeRows {
  std::int64_t first_episode = 0;  ///< a multiple of 16
  int episodes = 0;                ///< 16, fewer at the end of the run
  std::int64_t first_row = 0;
  int rows = 0;
  int action_rows = 0;             ///< rows, one less when the last row is among them
  std::span<const float> actions;  ///< (episodes, action_rows, nu) in [-1, 1]
  /// q, v, then of a task its observations, of a scene end effectors if any and sensors: (episodes,
  /// rows, width)
  std::span<const Observation> observations;
  std::span<const float> rewards = {};  ///< of a task: (episodes, action_rows)
  std::span<const double> randomized =
      {};  ///< what varies between episodes: (episodes, as many as the scene varies)
  std::span<const EpisodeEnd> ends =
      {};  ///< of a task, whose blocks come whole and in ascending order: (episodes)
  /// With the last row, of the whole episodes: for each GradientArray of the run (episodes,
  /// [actions of an episode at most,] shape).
  std::span<const std::span<const double>> gradients = {};
};

/// Consecutive episodes [first, end) of a run; both are multiples of 16, the end of the run apart.
struct EpisodeRange {
  std::int64_t first = 0, end = 0;
};

/// An episode that no solution was found for.
struct FailedEpisode {
  std::int64_t episode = 0;
  std::int64_t step = 0;  ///< the first that failed
  StepStatus status = StepStatus::not_converged;
  std::vector<double> q, v;  ///< the state before that step: (nq), (nv)
};

/// Receives episodes in pieces: those of one block of 16 in ascending rows, blocks in any order
/// among each other. Called by one thread at a time, prepare() apart. What is stored must depend on
/// the pieces alone, not on the order of blocks. A sink that cannot store throws IoError; the run
/// stops and passes it on.
class EpisodeSink {
 public:
  virtual ~EpisodeSink() = default;
  /// What can be done to a piece by many threads at once, before write() gets the same piece:
  /// compressing it.
  virtual void prepare(const EpisodeRows&) {}
  virtual void write(const EpisodeRows& rows) = 0;
  /// The last row of the block that begins with this episode has been written.
  virtual void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures) = 0;
};

}  // namespace tangere
