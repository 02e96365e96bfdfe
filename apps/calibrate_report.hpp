// SPDX-License-Identifier: Apache-2.0
// What a calibration found, for people and for programs.
#pragma once

#include <string>

#include "apps/console.hpp"
#include "tasks/calibration/calibration.hpp"

namespace tangere::apps {

struct CalibrationReport {
  const Calibration& found;
  const SkinNumbers& own;  ///< of the layout, where it has any
  bool per_area;           ///< whether coefficients count by area
  int knots;               ///< of a table
  PressError written;      ///< of the layout as it is written, at the fitted rows
  PressError other;        ///< of another recording
  std::vector<std::string> doubts;
};

/// A table of the numbers, the errors, and what the recording does not tell.
std::string report_text(const CalibrationReport& report);
/// Prints the JSON object.
void report_json(const CalibrationReport& report, const Console& console);

}  // namespace tangere::apps
