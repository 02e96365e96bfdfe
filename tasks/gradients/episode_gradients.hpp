// SPDX-License-Identifier: Apache-2.0
// Derivatives of the episodes of a data set, block by block, between those who simulate them and
// those who store them.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <vector>

#include "engine/derivative/loss.hpp"
#include "engine/step/control.hpp"
#include "tasks/gradients/task_gradients.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere {

/// What is stored of each episode: derivatives of a return or a loss, or of every row's state by
/// the row before.
enum class GradientKind { none, returns, jacobians };
const char* to_string(GradientKind kind);

/// Fills in derivatives of up to 16 episodes, which it plays again: one list of numbers per array,
/// as EpisodeRows::gradients has them, all rows, zeros to begin with. Holds the scratch of one
/// thread.
using EpisodeGradients = std::function<void(std::int64_t first_episode, int episodes,
                                            std::vector<std::vector<double>>& out)>;

/// What is stored and who computes it: `make` is called once for each thread.
struct GradientPlan {
  std::vector<GradientArray> arrays;
  std::int64_t rows = 0;  ///< of an episode, at most
  std::function<EpisodeGradients()> make;
  double bytes = 0;  ///< memory of one thread's scratch and of its blocks' results
};

/// Of a scene's episodes. `loss`, of returns alone, and all else must outlive the plan;
/// `loss_meaning` says what it is.
GradientPlan scene_gradients(const Model& model, const ControlProgram& controls,
                             const EpisodeOptions& run, GradientKind kind, const RolloutLoss* loss,
                             const std::string& loss_meaning, double tape_bytes);
/// Of a task's episodes that `actions` plays.
GradientPlan task_episode_gradients(const Task& task, const TaskActions& actions,
                                    const EpisodeOptions& run, GradientKind kind,
                                    double tape_bytes);

/// Adds them to the pieces on their way to another sink, as many blocks at a time as there are
/// threads that prepare.
class GradientSink : public EpisodeSink {
 public:
  /// Both must outlive it.
  GradientSink(const GradientPlan& plan, EpisodeSink& next) : plan_(plan), next_(next) {}

  void prepare(const EpisodeRows& rows) override;
  void write(const EpisodeRows& rows) override;
  void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures) override;

 private:
  struct Block {
    std::vector<std::vector<double>> numbers;
    std::vector<std::span<const double>> spans;
  };
  [[nodiscard]] EpisodeRows with_gradients(const EpisodeRows& rows);

  const GradientPlan& plan_;
  EpisodeSink& next_;
  std::mutex mutex_;
  std::vector<EpisodeGradients> idle_;
  std::map<std::int64_t, Block> blocks_;  // by their first episode
};

}  // namespace tangere
