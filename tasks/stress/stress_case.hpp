// SPDX-License-Identifier: Apache-2.0
// Hard cases: scene, duration, schemes, step lengths, criterion and bound.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "tasks/stress/criteria.hpp"

namespace tangere {

/// Factors on numbers of a scene, so that one file serves several cases.
struct StressVariant {
  double kn = 1, kt = 1;  ///< of all contacts
  double speed = 1;       ///< of all starting velocities
  /// Of all contacts, as a share of kn; kt is then ks times 5 ms. 0: those of the scene.
  double ks = 0;
};

struct StressCase {
  std::string name;
  std::string scene;        ///< file below scenes/
  std::string criterion{};  ///< in words; the bound follows it
  /// Of each environment; the worst counts. None: passes a step over those of the scene without
  /// its variant.
  Criterion measure{};
  double bound = 0;
  double seconds = 0;           ///< simulated; 0: as long as the scene's controls
  std::vector<double> steps{};  ///< [s]; none: the scene's own. The first is that of a quick run
  std::vector<Integrator> schemes{};  ///< none: the scene's own
  StressVariant variant{};
  int environments = 1;
  double may_fail = 0;  ///< share of environments that may fail
  bool quick = false;   ///< belongs to a quick run
};

/// All cases, by kind.
std::span<const StressCase> stress_cases();

/// The scene with the factors of a variant, also on what <randomize> draws.
Scene varied(Scene scene, const StressVariant& variant);

}  // namespace tangere
