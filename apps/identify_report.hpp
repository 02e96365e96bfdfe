// SPDX-License-Identifier: Apache-2.0
// What `tangere identify` says of a fit: a table, a JSON object and a picture.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "engine/scene/scene.hpp"
#include "tasks/gradients/identification.hpp"

namespace tangere::apps {

/// A fit and what it was made from.
struct IdentifyReport {
  const Scene& scene;
  std::vector<std::string> names;  ///< of the sought numbers
  std::vector<double> truth;       ///< of a trial; empty for a recording
  FieldSequence recorded;
  double peak = 0;  ///< largest number of the recorded fields [N]
  Identification fit;
};

/// A fit that has not come to an end, whose numbers cannot be told apart or that leaves more than
/// noise has failed.
ExitCode exit_code(const IdentifyReport& report);

/// Prints the numbers, their deviations and what is left of the fields, and the JSON object.
void print(const Console& console, const IdentifyReport& report);

/// Draws the fit, the numbers and the forces on the sensors. fitted: fields at the end of the fit.
std::string draw(const IdentifyReport& report, const FieldSequence& fitted, double timestep);

}  // namespace tangere::apps
