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

/// The schemes of the table, and the one that they are compared with.
inline std::vector<Integrator> all_integrators() {
  std::vector<Integrator> all(integrators().begin(), integrators().end());
  all.push_back(Integrator::sdirk4);
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
