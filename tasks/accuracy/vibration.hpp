// SPDX-License-Identifier: Apache-2.0
// Finds oscillations of sensor forces between samples: sensor, frequency and share of energy.
#pragma once

#include "tasks/accuracy/fixed_episodes.hpp"

namespace tangere {

struct Vibration {
  int sensor = -1;       ///< -1: no sensor reads a force
  double frequency = 0;  ///< strongest one above half a swing between samples [Hz]
  double share = 0;      ///< of the force's energy that lies above that
};

/// Steps one environment with `parts` steps between samples and analyses the net force on each
/// sensor after every step, at most the last 8192. If `stop` is requested or the environment fails,
/// the steps before count.
Vibration strongest_vibration(const FixedEpisodes& episodes, int environment, Integrator integrator,
                              int parts, double tolerance, const std::stop_token& stop = {});

}  // namespace tangere
