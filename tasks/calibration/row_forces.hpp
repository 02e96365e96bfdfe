// SPDX-License-Identifier: Apache-2.0
// Forces at the rows of a recorded press, by numbers of the skin and of the recording: the zeros,
// the lag, and a slider beside the skin (docs/calibration.md#what-is-fitted).
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "tasks/calibration/force_fit.hpp"
#include "tasks/calibration/press.hpp"

namespace tangere {

/// Makes the scene of placed_indenter() with these numbers.
using SkinScene = std::function<Scene(const SkinNumbers&)>;

double number_or(const SkinNumbers& numbers, const std::string& name, double otherwise);

/// Returns the largest size of the numbers.
double peak_of(std::span<const double> force);

bool varies(std::span<const double> column);

/// Returns the depths that act at the rows [m]: those of the lag earlier, and the zero added.
std::vector<double> acting_depths(const PressRecording& recording, const SkinNumbers& numbers);

/// What is added to all depths [m], to the rate of the depth at all rows [m/s], and to the depth of
/// each row, from which rates follow as well [m]; empty: nothing.
struct DepthShift {
  double depth = 0, rate = 0;
  std::span<const double> rows{};
};

/// Computes what a recording's normal() compares, without friction [N].
std::vector<double> normal_forces(const SkinScene& scene, const PressRecording& recording,
                                  const SkinNumbers& numbers);
/// The same with each of several shifts, for the price of one model.
std::vector<std::vector<double>> shifted_forces(const SkinScene& scene,
                                                const PressRecording& recording,
                                                const SkinNumbers& numbers,
                                                std::span<const DepthShift> shifts);

/// Computes what normal() and tangential() compare, with friction along the path of the rows, with
/// their times if there are any [N]. A shift of the rate leaves it as it is. Throws as
/// path_forces().
PathForces sheared_forces(const SkinScene& scene, const PressRecording& recording,
                          const SkinNumbers& numbers, const DepthShift& shift = {});

/// Computes what friction adds to the normal forces [N]. Throws as path_forces().
std::vector<double> friction_added(const SkinScene& scene, const PressRecording& recording,
                                   const SkinNumbers& numbers);

}  // namespace tangere
