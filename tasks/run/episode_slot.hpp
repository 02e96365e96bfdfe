// SPDX-License-Identifier: Apache-2.0
// Holds one block while it is processed: its batch, a stepper, a readout, and the rows of one
// piece. It is made once and used for block after block; only begin() allocates.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "engine/sense/readout.hpp"
#include "tasks/run/episode_source.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

/// T: type of the numbers in pieces, double or float.
template <class T>
class EpisodeSlot {
 public:
  EpisodeSlot(const EpisodeSource& source, const EpisodeOptions& options);

  /// Starts a block with the episodes of `range`, at most 16.
  void begin(EpisodeRange range);
  /// Steps through the rows of the next piece. `on_steps` gets the environment steps of each.
  /// Returns false if `stopped` did before any step; the piece is then void.
  [[nodiscard]] bool simulate(const std::function<bool()>& stopped,
                              const std::function<void(std::int64_t)>& on_steps);

  [[nodiscard]] EpisodeRows piece() const;  ///< valid until the next simulate()
  [[nodiscard]] bool last() const { return next_row_ > source_.rows; }  ///< of the block's pieces
  /// Adds the results of the whole block to the run's summary, with returns as a sum. Call it after
  /// the last piece.
  void add_to(EpisodeSummary& summary) const;
  /// Of the whole block, as add_to().
  [[nodiscard]] EpisodeSteps steps() const;
  /// In ascending order.
  [[nodiscard]] const std::vector<FailedEpisode>& failures() const { return failures_; }

 private:
  /// The numbers of an episode's row in values_ or bytes_.
  template <class Number>
  [[nodiscard]] std::span<Number> numbers(std::vector<std::vector<Number>>& values,
                                          std::size_t name, int episode, int row);
  [[nodiscard]] std::size_t width(std::size_t name) const { return source_.channels[name].width(); }
  [[nodiscard]] std::size_t taken_rows(std::size_t name, int rows) const;
  [[nodiscard]] bool takes(std::size_t name, int row) const;
  void observe_bodies(std::size_t name, int row);
  void put(std::size_t name, int episode, int row, std::span<const double> from);
  void observe(int row);
  void observe_scene(int row);
  void observe_task(const TaskProgram& task, int row);
  void observe_reading(std::size_t name, int row);
  void read_windows(std::int64_t step);
  void read_window(std::size_t name, std::size_t place);
  [[nodiscard]] bool act(int row, const std::function<bool()>& stopped);
  [[nodiscard]] bool take_steps(std::int64_t from, std::int64_t count,
                                const std::function<bool()>& stopped);
  void keep_action(int row);
  void collect();
  [[nodiscard]] std::int64_t step_of_failure(int episode) const;

  const EpisodeSource& source_;
  const EpisodeOptions& options_;
  int piece_rows_;
  bool windowed_;  // whether something is read within rows
  Stepper stepper_;
  Readout readout_;
  std::int64_t loads_before_ = 0;  // not carried, of the readout in earlier blocks
  std::optional<Batch> batch_;
  std::unique_ptr<EpisodeProgram> program_;
  std::optional<StepTally> tally_;
  std::int64_t first_row_ = 0, next_row_ = 0;
  int rows_ = 0, action_rows_ = 0;      // of the piece
  std::vector<double> randomized_;      // (episodes, what varies)
  std::vector<double> u_;               // (episodes, nu)
  std::vector<double> small_;           // one episode, before conversion
  std::vector<std::vector<T>> values_;  // per name: (episodes, rows at which it is taken, width)
  std::vector<std::vector<std::uint8_t>> bytes_;  // the same of pictures in colours
  std::vector<std::vector<std::int16_t>> ids_;    // the same of numbers of bodies
  std::vector<std::vector<T>> windows_;           // per name: (episodes, window, reading)
  std::vector<float> actions_;                    // (episodes, action rows, action)
  std::vector<float> rewards_;                    // of a task: (episodes, action rows)
  std::vector<Observation> observations_;
  std::vector<bool> playing_;
  std::vector<EpisodeEnd> ends_;
  std::vector<FailedEpisode> failures_;
};

}  // namespace tangere
