// SPDX-License-Identifier: Apache-2.0
// A place for one block on its way: its batch, a stepper and a readout, and the rows of one piece.
// Made once and used for block after block; only begin() allocates.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/sense/readout.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere {

inline constexpr int kBlockEpisodes = 16;  // lanes of a block of a Batch: one stepper's work

/// Sizes that all blocks of a run share.
struct EpisodeShape {
  std::int64_t rows = 0;  ///< R, actions of an episode
  int piece_rows = 0;     ///< rows of a piece, fewer at the end
  std::size_t nu = 0;     ///< numbers of an action
  std::vector<std::size_t>
      widths;  ///< numbers per row of q, v, the end effectors if there are any, and each sensor
  std::size_t first_sensor = 0;  ///< its place in widths

  EpisodeShape(const Model& model, const EpisodeOptions& options);
  /// Buffers of one slot [bytes].
  [[nodiscard]] double piece_bytes(const EpisodeOptions& options) const;
};

/// What a piece took.
struct PieceCounts {
  std::int64_t environment_steps = 0, newton_iterations = 0, split_steps = 0;
};

class EpisodeSlot {
 public:
  EpisodeSlot(const Model& model, const StepperOptions& solver, const ControlProgram& controls,
              const EpisodeOptions& options, const EpisodeShape& shape);

  /// Starts block b: episodes 16 b … of the run.
  void begin(std::int64_t block);
  /// Steps through the rows of the next piece. False: `stop` wanted it to end, the piece is void.
  [[nodiscard]] bool simulate(const StopRequest& stop);
  /// Turns the piece into the numbers that are stored.
  void encode();

  [[nodiscard]] EpisodeRows piece() const;  ///< valid until the next simulate()
  [[nodiscard]] bool last() const { return next_row_ > shape_.rows; }  ///< of the block's pieces
  [[nodiscard]] const PieceCounts& counts() const { return counts_; }
  /// Of the whole block, ascending.
  [[nodiscard]] const std::vector<FailedEpisode>& failures() const { return failures_; }

 private:
  template <class T>
  [[nodiscard]] std::span<T> numbers(std::size_t name, int episode, int row);
  void observe(int row);
  template <class T>
  void read_field(int sensor, int row);
  [[nodiscard]] bool act(int row, const StopRequest& stop);
  void count(std::int64_t step);

  const Model& model_;
  const ControlProgram& controls_;
  const EpisodeOptions& options_;
  const EpisodeShape& shape_;
  Stepper stepper_;
  Readout readout_;
  std::optional<Batch> batch_;
  std::int64_t first_row_ = 0, next_row_ = 0;
  int rows_ = 0, action_rows_ = 0;  // of the piece
  std::vector<double> randomized_;  // (episodes, what varies)
  std::vector<double> u_;           // (episodes, nu)
  std::vector<std::vector<double>>
      values_;  // per name: (episodes, rows, width); fields only where float64 is stored
  std::vector<std::vector<float>> singles_;  // the same, where float32 is stored
  std::vector<float> actions_;               // (episodes, action rows, nu)
  std::vector<Observation> observations_;
  std::vector<bool> live_;
  std::vector<FailedEpisode> failures_;
  PieceCounts counts_;
};

}  // namespace tangere
