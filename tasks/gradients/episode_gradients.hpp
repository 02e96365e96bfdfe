// SPDX-License-Identifier: Apache-2.0
// Computes derivatives of a data set's episodes block by block, between simulation and storage.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <vector>

#include "engine/derivative/loss.hpp"
#include "engine/step/control.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere {

/// Derivatives stored with each episode: of a return or a loss, or of every row's state by the row
/// before.
enum class GradientKind { none, returns, jacobians };
const char* to_string(GradientKind kind);

/// Plays up to 16 episodes again, with the tolerance of for_gradients(), and fills in their
/// derivatives: one list of numbers per array, in the layout of EpisodeRows::gradients, all rows,
/// zeros on entry. Holds the scratch of one thread.
using EpisodeGradients = std::function<void(std::int64_t first_episode, int episodes,
                                            std::vector<std::vector<double>>& out)>;

/// The stored results and the factory of their computation. `make` is called once per thread.
struct GradientPlan {
  std::vector<GradientArray> arrays;
  std::int64_t rows = 0;  ///< of an episode, at most
  std::function<EpisodeGradients()> make;
  double bytes = 0;  ///< memory of one thread's scratch and of its blocks' results
};

/// Plan for a scene's episodes. Only returns use `loss`; `loss_meaning` describes it in words.
/// Everything passed must outlive the plan.
GradientPlan scene_gradients(const Model& model, const ControlProgram& controls,
                             const EpisodeOptions& run, GradientKind kind, const RolloutLoss* loss,
                             const std::string& loss_meaning, double tape_bytes);
/// Plan for a task's episodes, which `actions` plays.
GradientPlan task_episode_gradients(const Task& task, const TaskActions& actions,
                                    const EpisodeOptions& run, GradientKind kind,
                                    double tape_bytes);

/// Adds derivatives to pieces on their way to another sink. It computes as many blocks at a time as
/// there are preparing threads.
class GradientSink : public EpisodeSink {
 public:
  /// `plan` and `next` must outlive this object.
  GradientSink(const GradientPlan& plan, EpisodeSink& next) : plan_(plan), next_(next) {}

  void prepare(const EpisodeRows& rows) override;
  void write(const EpisodeRows& rows) override;
  void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures,
              const EpisodeSteps& steps) override;

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
