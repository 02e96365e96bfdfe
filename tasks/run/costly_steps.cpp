// SPDX-License-Identifier: Apache-2.0
// Usual steps of the scenes here take 2 to 4 evaluations a stage, and one in 2 000 is split.
#include "tasks/run/costly_steps.hpp"

#include <fmt/format.h>

namespace tangere {

std::string costly_steps(Integrator integrator, const StepCounts& counts) {
  constexpr double kMany = 5, kOften = 0.05;
  constexpr std::int64_t kFewest = 20;
  if (counts.simulation_steps < kFewest) return "";
  const double steps = double(counts.simulation_steps),
               each = double(counts.newton_iterations) / steps,
               split = double(counts.split_steps) / steps;
  const int stages = 1 + integrator.scheme().inner_stages();
  if (each <= kMany * stages && split <= kOften) return "";
  return fmt::format(
      "steps are costly: {:.3g} evaluations each, and {:.2g} % of them are split; contacts are "
      "stiff for the step (kn, kt), or bodies turn far in it; expected a shorter step or softer "
      "contacts",
      each, 100 * split);
}

}  // namespace tangere
