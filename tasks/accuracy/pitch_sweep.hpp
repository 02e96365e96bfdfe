// SPDX-License-Identifier: Apache-2.0
// Error and cost of tactile fields over the pitch of a pad's points, for one motion.
#pragma once

#include <array>
#include <stop_token>
#include <string>
#include <vector>

#include "tasks/accuracy/fixed_episodes.hpp"

namespace tangere {

/// A rectangular pad read with another number of points. Each point represents a cell around it:
/// the cells cover the same area as the scene's, and kn, kt and damping of a point are proportional
/// to the area of its cell. So all pads are equally stiff.
struct PitchPoint {
  int rows = 1, cols = 1;
  std::array<double, 2> pitch{};  ///< along axis0 and axis1 [m]; 0 where there is one point
  /// Of the whole force, relative; not exceeded in 95 % of the environments.
  double force_error = 0;
  double force_bound = 0;  ///< 95 % of all environments like these do not exceed it (sure_quantile)
  double centre_error = 0;  ///< of the centre of pressure [m], in 95 % of the environments
  double read_seconds = 0;  ///< CPU time of reading one field of touched tiles, in double [s]
  double rate = 0;          ///< simulated seconds per CPU second at the scene's own scheme and step
  bool own = false;         ///< the scene's
};

/// The pitches of one sensor.
struct PitchSweep {
  int sensor = 0;
  std::string left_out;            ///< why it is not swept; empty: it is
  std::vector<PitchPoint> points;  ///< coarsest first
  PitchPoint reference;            ///< the finest; its errors are distances from the next
  int advice = -1;                 ///< the coarsest pad whose bound meets the target; -1: none does
};

/// Plays the episodes at the scene's own scheme and step, and reads every rectangular sensor at
/// each sample with pitches from 8 times the scene's to a quarter of it, fewer where a pad would
/// have more than a million points. `stop` ends it before any sample, with nothing.
/// Throws like Model.
std::vector<PitchSweep> sweep_pitches(const FixedEpisodes& episodes, double target,
                                      const std::stop_token& stop);

}  // namespace tangere
