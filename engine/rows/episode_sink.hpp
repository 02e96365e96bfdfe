// SPDX-License-Identifier: Apache-2.0
// The interface between a run of many episodes and their storage: tasks/ produces the rows, io/
// stores them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "engine/step/batch.hpp"

namespace tangere {

/// The numbers of one observation as they are stored: float64, float32, bytes of colours, or
/// numbers of bodies.
using Observation = std::variant<std::span<const double>, std::span<const float>,
                                 std::span<const std::uint8_t>, std::span<const std::int16_t>>;

/// How an episode of a task ended.
struct EpisodeEnd {
  std::int64_t length = 0;  ///< number of actions taken; rows after these are meaningless
  double total = 0;         ///< sum of its rewards
  bool terminated = false;  ///< the task ended it; false if time ran out
  bool success = false;
  int policy = 0;  ///< which of the run's policies played it, from 0
};

/// Derivatives that are stored beside an episode's numbers, as float64.
struct GradientArray {
  std::string name;                  ///< "grad_actions"
  std::vector<std::uint64_t> shape;  ///< of one row, or of the whole array
  bool per_row = false;              ///< one array for every row with an action
  std::string meaning;
  /// Names and units of the numbers that the derivatives are by, along the last dimension.
  std::vector<std::string> wrt_names, wrt_units;
  [[nodiscard]] std::size_t width() const {
    std::size_t numbers = 1;
    for (const std::uint64_t n : shape) numbers *= n;
    return numbers;
  }
};

/// Rows [first_row, first_row + rows) of consecutive episodes. Row j is the state after j K steps,
/// with K steps per action. An episode of R actions has R + 1 rows; the last one has no action.
struct EpisodeRows {
  std::int64_t first_episode = 0;  ///< a multiple of 16
  int episodes = 0;                ///< 16, fewer at the end of the run
  std::int64_t first_row = 0;
  int rows = 0;
  int action_rows = 0;             ///< `rows`, or one less when the last row is among them
  std::span<const float> actions;  ///< (episodes, action_rows, nu), within bounds
  /// q and v, then the observations of a task, or the end effectors (if any), bodies (if requested)
  /// and sensors of a scene. Each is (episodes, rows at which it is taken, width).
  std::span<const Observation> observations;
  std::span<const float> rewards = {};  ///< (episodes, action_rows); tasks only
  /// (episodes, as many as the scene varies) numbers that vary between episodes.
  std::span<const double> randomized = {};
  /// (episodes); tasks only, whose blocks come whole and in ascending order.
  std::span<const EpisodeEnd> ends = {};
  /// Set with the last row, for whole episodes: (episodes, [most actions of an episode,] shape) for
  /// each GradientArray of the run.
  std::span<const std::span<const double>> gradients = {};
};

/// Consecutive episodes [first, end) of a run. Both are multiples of 16, except at the end of the
/// run.
struct EpisodeRange {
  std::int64_t first = 0, end = 0;
};

/// An episode for which no solution was found.
struct FailedEpisode {
  std::int64_t episode = 0;
  std::int64_t step = 0;  ///< first step that failed
  StepStatus status = StepStatus::not_converged;
  std::vector<double> q, v;  ///< the state before that step: (nq), (nv)
};

/// Sums over episodes. Motion with steps of the last two kinds is not that of the bodies in the
/// scene.
struct EpisodeSteps {
  std::int64_t taken = 0;        ///< of the simulation, without those that failed
  std::int64_t tunnelled = 0;    ///< steps with status StepStatus::tunnelled
  std::int64_t overlapping = 0;  ///< after which bodies overlap (StepStatus::overlapping)

  EpisodeSteps& operator+=(const EpisodeSteps& other) {
    taken += other.taken;
    tunnelled += other.tunnelled;
    overlapping += other.overlapping;
    return *this;
  }
  bool operator==(const EpisodeSteps&) const = default;
};

/// Receives episodes in pieces. Pieces of one block of 16 come in ascending rows; blocks come in
/// any order and may interleave. One thread at a time calls it, except prepare(). What is stored
/// must depend on the pieces alone, not on the order of blocks. A sink that cannot store throws
/// IoError; the run stops and passes it on.
class EpisodeSink {
 public:
  virtual ~EpisodeSink() = default;
  /// Work on a piece that many threads can do at once, before write() gets the same piece:
  /// compression.
  virtual void prepare(const EpisodeRows&) {}
  virtual void write(const EpisodeRows& rows) = 0;
  /// Called when the last row of the block that begins with this episode has been written.
  /// `steps`: of all its episodes.
  virtual void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures,
                      const EpisodeSteps& steps) = 0;
};

}  // namespace tangere
