// SPDX-License-Identifier: Apache-2.0
// What a calibration found, for people and for programs.
#pragma once

#include <string>

#include "apps/console.hpp"
#include "tasks/calibration/calibration.hpp"

namespace tangere::apps {

/// "modulus [Pa]", "ks [N/m³]" …; `by_area`: coefficients count per area.
std::string label_of(const std::string& number, bool by_area);
/// A table of the numbers, beside those at which the fit began, the errors, and what the recording
/// does not tell.
std::string report_text(const Calibration& found, const SkinAttributes& start, bool by_area);
/// Prints the JSON object.
void report_json(const Calibration& found, const Console& console);

}  // namespace tangere::apps
