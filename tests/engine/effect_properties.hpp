// SPDX-License-Identifier: Apache-2.0
// Properties that every effect has: balance of energy, the bits of lone environments, named faults.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "engine/sense/energy_balance.hpp"
#include "tests/engine/gradient_run.hpp"
#include "tests/engine/runs.hpp"

namespace tangere::testing {

struct EnergyLoss {
  double lost = 0;   ///< of kinetic and potential energy [J]
  double taken = 0;  ///< by what dissipates, summed over steps [J]
};

/// Of a run with controls of zero, by SDIRK3 over 400 steps of 0.5 ms.
inline EnergyLoss energy_loss(const Model& model) {
  constexpr double kStep = 5e-4;
  Batch batch(model, 1);
  Stepper stepper(model, options(Integrator::sdirk3, kStep));
  EnergyBalanceReader reader(model);
  const std::vector<double> u(std::size_t(model.nu()), 0.0);
  EnergyBalance before = reader.read(batch, 0, u);
  EnergyLoss out{before.energy(), 0};
  for (int t = 0; t < 400; ++t) {
    stepper.step(batch, u);
    const EnergyBalance now = reader.read(batch, 0, u);
    out.taken += between(before, now, kStep).dissipated;
    before = now;
  }
  out.lost -= before.energy();
  return out;
}

/// Environments 0, 7 and 18 of 19 have the bits that they have when the others rest. A number of
/// the model must vary between environments.
inline void expect_bits_of_lone_environments(const Model& model, unsigned seed) {
  constexpr int kMany = 19;
  Batch batch(model, kMany, 3);
  Stepper stepper(model, options(Integrator::bdf2, 2e-3));
  const RunInput in = random_input(model, seed, 40);
  for (int e = 0; e < kMany; ++e) batch.set_state(e, in.q, in.v);
  for (const auto& u : in.u) step_all(stepper, batch, u);
  EXPECT_NE(q_of(batch, 0), q_of(batch, 1)) << "a number varies";
  for (const int e : {0, 7, 18}) {
    Batch alone(model, kMany, 3);
    Stepper one(model, options(Integrator::bdf2, 2e-3));
    alone.set_state(e, in.q, in.v);
    std::vector<double> zeros(std::size_t(model.nu() * kMany));
    for (const auto& u : in.u) {
      std::fill(zeros.begin(), zeros.end(), 0.0);
      std::copy(u.begin(), u.end(), zeros.begin() + e * model.nu());
      one.step(alone, zeros);
    }
    EXPECT_EQ(q_of(batch, e), q_of(alone, e)) << e;
    EXPECT_EQ(v_of(batch, e), v_of(alone, e)) << e;
  }
}

/// The message of the InputError that a model of `scene` after `change` throws; empty: none.
template <class Change>
std::string fault_of_model(Scene scene, const Change& change) {
  change(scene);
  try {
    const Model model(scene);
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

}  // namespace tangere::testing
