// SPDX-License-Identifier: Apache-2.0
// How far computed forces of a press are off, and what a recording has to be.
#pragma once

#include <span>
#include <vector>

#include "tasks/calibration/press.hpp"

namespace tangere {

/// How far computed forces are off, over the largest recorded one.
struct PressError {
  int rows = 0;
  double root_mean_square = 0, largest = 0;
  double relative = 0;        ///< root mean square over that of the recorded forces
  double largest_by_row = 0;  ///< over the row's own force, of rows above a twentieth of the peak
};

/// `computed`, `recorded`: forces of all rows [N]. `width`: forces of a row.
PressError error_of(std::span<const double> computed, std::span<const double> recorded,
                    std::span<const int> rows, std::size_t width);

/// Forces of a row of PressRecording::normal() and of PressRecording::tangential().
std::size_t normal_width(const PressRecording& recording);
std::size_t shear_width(const PressRecording& recording);

/// Returns the largest ratio of shear to normal force, of rows whose normal force is above a
/// twentieth of the largest.
double largest_ratio(const PressRecording& recording);

/// Throws InputError for columns of unlike lengths, for a shear without its force, for places
/// without a field or beside a shear, for times that do not ascend, and for no force at all.
void check_recording(const PressRecording& recording);

}  // namespace tangere
