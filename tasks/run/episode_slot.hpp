// SPDX-License-Identifier: Apache-2.0
// A place for one block on its way: its batch, a stepper and a readout, and the rows of one piece.
// Made once and used for block after block; only begin() allocates.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "engine/sense/readout.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/episodes.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

inline constexpr int kBlockEpisodes = 16;  // lanes of a block of a Batch: one stepper's work

/// What is played: a scene's or a task's program, and what its rows hold. What it was made of must
/// outlive it.
struct EpisodeSource {
  const Model* model = nullptr;
  StepperOptions solver;
  std::int64_t rows = 0;         ///< R, actions of an episode at most
  std::size_t action = 0;        ///< numbers of one
  std::size_t first_sensor = 0;  ///< place of its fields in widths
  /// Numbers of a row of q, v, then of a scene its end effectors, if it has any, and every sensor's
  /// field; of a task its observations.
  std::vector<std::size_t> widths;
  /// Episodes end when they like: only then is it known how long they are, so their blocks are
  /// handed on whole and in ascending order.
  bool whole = false;
  /// For one block of a batch.
  std::function<std::unique_ptr<EpisodeProgram>(const Batch&)> program;
};

/// Throws InputError when steps is no multiple of every, or the controls are too short, were laid
/// out for another timestep, or change while an action is held.
EpisodeSource source_of(const Model& model, const StepperOptions& solver,
                        const ControlProgram& controls, const EpisodeOptions& options);
EpisodeSource source_of(const Task& task, const Policy& policy, const EpisodeOptions& options);

/// The same without a program: what memory is reckoned by.
EpisodeSource shape_of(const Model& model, const EpisodeOptions& options);
EpisodeSource shape_of(const Task& task);

/// Rows of a piece, fewer at the end: as many as fit, at least one; all of them where blocks come
/// whole.
int piece_rows(const EpisodeSource& source, const EpisodeOptions& options);
/// Buffers of one slot [bytes].
double piece_bytes(const EpisodeSource& source, const EpisodeOptions& options);

/// T: what numbers leave as, double or float.
template <class T>
class EpisodeSlot {
 public:
  EpisodeSlot(const EpisodeSource& source, const EpisodeOptions& options);

  /// Starts a block: the episodes of `range`, 16 at most.
  void begin(EpisodeRange range);
  /// Steps through the rows of the next piece; `told` gets the environment steps of each. False:
  /// `stop` wanted it to end, the piece is void.
  [[nodiscard]] bool simulate(const StopRequest& stop,
                              const std::function<void(std::int64_t)>& told);

  [[nodiscard]] EpisodeRows piece() const;  ///< valid until the next simulate()
  [[nodiscard]] bool last() const { return next_row_ > source_.rows; }  ///< of the block's pieces
  /// Of the whole block, after its last piece: what it adds to a run, returns as their sum.
  void add_to(EpisodeSummary& summary) const;
  /// Ascending.
  [[nodiscard]] const std::vector<FailedEpisode>& failures() const { return failures_; }

 private:
  [[nodiscard]] std::span<T> numbers(std::size_t name, int episode, int row);
  [[nodiscard]] std::int64_t environment_steps() const;
  void put(std::size_t name, int episode, int row, std::span<const double> from);
  void observe(int row);
  void observe_scene(int row);
  void observe_task(const TaskProgram& task, int row);
  [[nodiscard]] bool act(int row, const StopRequest& stop);
  [[nodiscard]] bool take_steps(std::int64_t from, std::int64_t count, const StopRequest& stop);
  void keep_action(int row);
  void collect();
  [[nodiscard]] std::int64_t step_of_failure(int episode) const;

  const EpisodeSource& source_;
  const EpisodeOptions& options_;
  int piece_rows_;
  Stepper stepper_;
  Readout readout_;
  std::optional<Batch> batch_;
  std::unique_ptr<EpisodeProgram> program_;
  std::optional<StepTally> tally_;
  std::int64_t first_row_ = 0, next_row_ = 0;
  int rows_ = 0, action_rows_ = 0;      // of the piece
  std::vector<double> randomized_;      // (episodes, what varies)
  std::vector<double> u_;               // (episodes, nu)
  std::vector<double> small_;           // of one episode, before it is converted
  std::vector<std::vector<T>> values_;  // per name: (episodes, rows, width)
  std::vector<float> actions_;          // (episodes, action rows, action)
  std::vector<float> rewards_;          // of a task: (episodes, action rows)
  std::vector<Observation> observations_;
  std::vector<bool> playing_;
  std::vector<EpisodeEnd> ends_;
  std::vector<FailedEpisode> failures_;
};

}  // namespace tangere
