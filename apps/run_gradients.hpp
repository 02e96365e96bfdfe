// SPDX-License-Identifier: Apache-2.0
// --gradients of `tangere simulate`: derivatives of a loss over the run that has just been made.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "apps/run_options.hpp"
#include "apps/stop_signals.hpp"
#include "io/trajectory/trajectory_file.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere::apps {

struct GradientArguments {
  std::string loss;     ///< "": none are wanted
  bool points = false;  ///< also by place and coefficients of tactile points
  std::optional<double> tape_memory;

  void add(CLI::App& app);
  [[nodiscard]] bool requested() const { return !loss.empty(); }
  /// Throws InputError for companions without --gradients.
  void check() const;
};

class RunGradients {
 public:
  /// Stores the initial state of the run. Throws InputError for an unknown or unsuitable loss, and
  /// if memory does not suffice.
  RunGradients(const GradientArguments& arguments, const Batch& batch, const Stepper& stepper,
               const RolloutOptions& rollout);
  [[nodiscard]] bool requested() const { return start_.has_value(); }
  /// Returns false if a signal stopped it.
  bool write(const ControlProgram& controls, const RolloutOptions& rollout,
             const StopSignals& signals, TrajectoryFile& output);
  /// What was written; null if nothing is wanted.
  [[nodiscard]] Json json() const;

 private:
  std::optional<Batch> start_;
  std::unique_ptr<RolloutLoss> loss_;
  std::optional<GradientRollouts> rollouts_;
  std::string name_;
  std::vector<double> value_;
  std::int64_t recomputed_steps_ = 0;
};

}  // namespace tangere::apps
