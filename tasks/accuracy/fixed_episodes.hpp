// SPDX-License-Identifier: Apache-2.0
// Episodes with fixed initial states and controls, which any scheme can repeat with any step
// length.
#pragma once

#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/step/batch.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/policy.hpp"
#include "tasks/run/step_tally.hpp"
#include "tasks/run/thread_time.hpp"

namespace tangere {

/// Controls hold for a timestep each. Samples are taken every `every` timesteps.
struct FixedEpisodes {
  Batch start;
  double timestep = 0;             ///< of the controls [s]
  int every = 1;                   ///< timesteps between samples
  int samples = 0;                 ///< of the longest episode
  std::vector<int> samples_of;     ///< (E) before the episode ends
  std::vector<double> controls{};  ///< (samples * every, E, nu)

  /// Time between samples [s].
  [[nodiscard]] double interval() const { return timestep * every; }
  /// Whether the time between samples can be cut into `parts` steps in none of which a control
  /// changes.
  [[nodiscard]] bool can_cut(int parts) const;
  /// Controls (E, nu) of one of the steps into which the time before sample `sample` is cut.
  [[nodiscard]] std::span<const double> controls_of(int sample, int parts, int part) const;

  /// Plays a block of `batch`, which begins as `start`, with `parts` steps between samples. Holds
  /// environments whose episode is over. Calls after_step(step) after every step, and
  /// after_sample(sample) after every sample; only steps and after_step() add to `seconds` (CPU
  /// time). `stop` ends it before any sample; play() then returns false.
  template <class AfterStep, class AfterSample>
  bool play(Stepper& stepper, int parts, Batch& batch, int block, double& seconds,
            const std::stop_token& stop, const AfterStep& after_step,
            const AfterSample& after_sample) const {
    const int first = block * kernels::kBlock, last = first + lanes_of(batch, block);
    for (int sample = 0; sample < samples; ++sample) {
      if (stop.stop_requested()) return false;
      for (int e = first; e < last; ++e)
        if (sample >= samples_of[static_cast<std::size_t>(e)]) batch.hold(e);
      const double begin = thread_seconds();
      for (int part = 0; part < parts; ++part) {
        stepper.step_block(batch, block, controls_of(sample, parts, part));
        after_step(std::int64_t{sample} * parts + part);
      }
      seconds += thread_seconds() - begin;
      after_sample(sample);
    }
    return true;
  }
};

/// Episodes of a scene from the states of `start`. Throws InputError when the controls are too
/// short, `steps` does not reach the first sample, or there are too many of them.
FixedEpisodes scene_episodes(const Batch& start, const ControlProgram& controls, std::int64_t steps,
                             int every);

/// Episodes of a task from `start`, whose states are replaced. The controls are those of the policy
/// at the scene's own scheme and step. For a task whose actions restart, an episode is its warm-up,
/// or its first action if it has none. If `stop` is requested, returns no value. Throws like
/// scene_episodes.
std::optional<FixedEpisodes> task_episodes(const Batch& start, const Task& task,
                                           const Policy& policy, int every,
                                           const std::stop_token& stop = {});

/// Timesteps between samples: those between fields if all sensors agree and that is 10 ms or more,
/// else as many as make about 25 ms.
int sample_interval(const Model& model);

}  // namespace tangere
