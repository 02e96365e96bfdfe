// SPDX-License-Identifier: Apache-2.0
// Output of `tangere identify`: a table, a JSON object and a picture of a fit.
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

/// A fit has failed if it did not converge, its parameters are not identifiable, or its residual is
/// more than noise.
ExitCode exit_code(const IdentifyReport& report);

/// Prints the numbers, their deviations and what is left of the fields, and the JSON object.
void print(const Console& console, const IdentifyReport& report);

/// Draws the fit, the numbers and the forces on the sensors. fitted: fields at the end of the fit.
std::string draw(const IdentifyReport& report, const FieldSequence& fitted, double timestep);

}  // namespace tangere::apps
