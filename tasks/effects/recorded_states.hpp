// SPDX-License-Identifier: Apache-2.0
// States and controls along a run of a scene, so that models of the scene with and without an
// effect can be compared from the same states.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/step/batch.hpp"

namespace tangere {

/// A batch's environments at one instant of a run.
struct RecordedInstant {
  std::int64_t step = 0;                       ///< that the instant is before
  std::vector<double> q, v;                    ///< (E, nq), (E, nv)
  std::vector<double> previous_q, previous_v;  ///< one step before; empty at the start of a run
  std::vector<double> controls;                ///< (E, nu) of the step that follows
  std::vector<std::uint8_t> failed;            ///< (E) 1: the environment failed before
};

struct RecordedStates {
  Model model;  ///< that was played
  int environments = 0;
  std::int64_t planned = -1;  ///< steps of the scene's controls; -1: they have no end
  std::int64_t steps = 0;     ///< that were played
  std::vector<RecordedInstant> instants;
  int failed = 0;                            ///< environments that failed by the end of the run
  std::vector<std::vector<double>> numbers;  ///< (randomized numbers, E): the values drawn
};

/// Steps of a run with open-ended controls, and the largest number of steps of any run.
inline constexpr std::int64_t kOpenRunSteps = 200, kMostRunSteps = 1000;

/// Plays a batch of a scene by its own controls and records instants in the middles of equal
/// stretches of the run.
RecordedStates record_states(const Model& model, int environments, int instants,
                             std::uint64_t seed);

}  // namespace tangere
