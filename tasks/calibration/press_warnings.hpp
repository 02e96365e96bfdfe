// SPDX-License-Identifier: Apache-2.0
// Warnings of a recorded press: sizes in other units, and points or cells that are too
// coarse for its contact.
#pragma once

#include <string>
#include <vector>

#include "tasks/calibration/press.hpp"

namespace tangere {

/// Returns what is implausible about a recording and its indenter, each with its line and value,
/// what was expected and the likely factor: a ball that is large or tiny against the skin, depths
/// beyond the skin or below 5 µm, speeds above 2 m/s, and a contact of few points or cells.
/// `scene`: of placed_indenter().
std::vector<std::string> press_warnings(const Scene& scene, const PressRecording& recording);

/// Returns what makes a fitted friction of a layout's scene unlikely.
std::vector<std::string> friction_warnings(const Scene& scene);

/// Returns what is implausible about a skin that was fitted to a recording: a stiffness that no
/// skin has, or one that is more than 100 times that of the layout or less than a hundredth, where
/// another unit of the forces leads back to the layout's within a factor of 3. The unit is named:
/// mN or kN, and of a field also kPa and Pa on the area of a point. `scene`, `layout`: of
/// placed_indenter(), with the fitted numbers and as it was. Empty if nothing is.
std::vector<std::string> skin_warnings(const Scene& scene, const Scene& layout,
                                       const PressRecording& recording);

/// Returns what rates do that a fit of a recording with times does not contain: rows that are
/// farther apart than the relaxation, and rates that are noisy because depths are. `scene`: of
/// placed_indenter(), with the fitted numbers. `depth_errors`: whether the fit contains errors of
/// the depth. Empty for a skin without relaxation.
std::vector<std::string> rate_warnings(const Scene& scene, const PressRecording& recording,
                                       bool depth_errors);

/// Why an indenter that goes `depth` [m] deep touches no point of the sensor; "" if it does.
/// `scene`: of placed_indenter().
std::string why_no_touch(const Scene& scene, double depth);

}  // namespace tangere
