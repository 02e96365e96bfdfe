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
  std::size_t points;      ///< of a recorded field; 0: forces
  PressError written;      ///< of the layout as it is written, as --score gives it
  PressError other;        ///< of another recording
  std::string beside;      ///< how the score of the layout differs from the fit
  std::vector<std::string> warnings;
  std::string output{};  ///< file that is written; "" for none
  int exit_code = 0;
};

/// A table of the numbers, the errors, and what the recording does not tell.
std::string report_text(const CalibrationReport& report);
/// Prints the JSON object.
void report_json(const CalibrationReport& report, const Console& console);

}  // namespace tangere::apps
