// SPDX-License-Identifier: Apache-2.0
// Short runs for tests.
#pragma once

#include <ostream>
#include <vector>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {

inline void PrintTo(Integrator integrator, std::ostream* out) { *out << to_string(integrator); }

namespace testing {

/// A scheme that is in no table: Alexander's of order 3, three implicit stages, the last its
/// result.
inline Integrator sdirk3() {
  constexpr double kG = 0.43586652150845899942, kB = -1.5 * kG * kG + 4 * kG - 0.25;
  static const Scheme kScheme =
      runge_kutta("SDIRK3", 3, {{kG}, {0.5 * (1 - kG), kG}, {kB, 1 - kB - kG, kG}});
  return Integrator(kScheme);
}
/// The schemes of the table and that one.
inline std::vector<Integrator> all_integrators() {
  std::vector<Integrator> all(integrators().begin(), integrators().end());
  all.push_back(sdirk3());
  return all;
}

inline StepperOptions options(Integrator scheme, double timestep, double tolerance = 1e-12) {
  StepperOptions o;
  o.integrator = scheme;
  o.timestep = timestep;
  o.tolerance = tolerance;
  return o;
}

inline std::vector<double> q_of(const Batch& b, int e = 0) {
  std::vector<double> q(std::size_t(b.model().nq()));
  b.get_q(e, q);
  return q;
}
inline std::vector<double> v_of(const Batch& b, int e = 0) {
  std::vector<double> v(std::size_t(b.model().nv()));
  b.get_v(e, v);
  return v;
}

/// Steps with the same controls for every environment.
inline void step_all(Stepper& stepper, Batch& batch, const std::vector<double>& u) {
  std::vector<double> all;
  for (int e = 0; e < batch.environments(); ++e) all.insert(all.end(), u.begin(), u.end());
  stepper.step(batch, all);
}

}  // namespace testing
}  // namespace tangere
