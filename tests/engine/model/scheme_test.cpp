// SPDX-License-Identifier: Apache-2.0
// Tests the rows of schemes: uniform motion, and what is refused.
#include "engine/model/scheme.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/base/error.hpp"
#include "tests/engine/runs.hpp"

namespace tangere {
namespace {

/// For x = ẋ t with v = ẋ throughout, every stage must find that rate and no acceleration.
TEST(Schemes, EveryStageKeepsUniformMotion) {
  for (const Integrator integrator : testing::all_integrators()) {
    const Scheme& scheme = integrator.scheme();
    SCOPED_TRACE(scheme.name);
    for (std::size_t k = 0; k < scheme.stages.size(); ++k) {
      const SchemeStage& stage = scheme.stages[k];
      ASSERT_EQ(stage.inner.size(), k);
      double rate = stage.c0 * stage.end - stage.r_before;
      for (std::size_t j = 0; j < k; ++j) rate += stage.inner[j].r * scheme.stages[j].end;
      EXPECT_NEAR(rate, 1, 1e-14);
      EXPECT_NEAR(stage.c0 + (stage.s_centre + stage.s_before) / stage.s_divisor, 0, 1e-14);
      EXPECT_EQ(stage.r_before != 0, scheme.needs_history());
    }
    EXPECT_EQ(scheme.stages.back().end, 1);
    EXPECT_LE(scheme.of_parts().order, scheme.order);
    EXPECT_FALSE(scheme.of_parts().needs_history()) << "parts have no state one step before";
    if (scheme.needs_history()) {
      EXPECT_FALSE(scheme.start->needs_history());
    }
  }
}

/// For ẋ = tᵖ a stage's rate is endᵖ. The estimate is then the exact error of the result, up to the
/// power that the rule through all stages integrates.
TEST(Schemes, EstimatesAreErrorsOfPowers) {
  int with_estimate = 0;
  for (const Integrator integrator : testing::all_integrators()) {
    const Scheme& scheme = integrator.scheme();
    if (scheme.estimate.empty()) continue;
    SCOPED_TRACE(scheme.name);
    ++with_estimate;
    ASSERT_EQ(scheme.estimate.size(), scheme.stages.size() + 1);
    for (std::size_t p = 0; p <= scheme.stages.size(); ++p) {
      std::vector<double> x;
      for (const SchemeStage& stage : scheme.stages) {  // c₀ x + Σ r x_j = endᵖ
        double rate = std::pow(stage.end, static_cast<double>(p));
        for (std::size_t j = 0; j < x.size(); ++j) rate -= stage.inner[j].r * x[j];
        x.push_back(rate / stage.c0);
      }
      double e = p == 0 ? scheme.estimate[0] : 0;
      for (std::size_t k = 0; k < x.size(); ++k) e += scheme.estimate[k + 1] * x[k];
      EXPECT_NEAR(e, x.back() - 1 / static_cast<double>(p + 1), 1e-13) << "power " << p;
    }
  }
  EXPECT_EQ(with_estimate, 4) << "BDF1, SDIRK2, SDIRK3 and SDIRK4";
}

TEST(Schemes, HaveNamesOfTheirOwn) {
  for (const Integrator a : integrators())
    for (const Integrator b : integrators())
      EXPECT_EQ(std::string(to_string(a)) == to_string(b), a == b);
  for (const Integrator a : integrators()) EXPECT_NE(a, Integrator::sdirk4);
}

TEST(Schemes, RefuseWhatNoStageSolves) {
  EXPECT_THROW((runge_kutta("none", 1, {})), InputError);
  EXPECT_THROW((runge_kutta("explicit", 2, {{0}, {0.5, 0.5}})), InputError);
  EXPECT_THROW((runge_kutta("full", 2, {{0.5, -0.1}, {0.5, 0.5}})), InputError);
  EXPECT_THROW(
      (runge_kutta("long", 1,
                   {{1}, {0, 1}, {0, 0, 1}, {0, 0, 0, 1}, {0, 0, 0, 0, 1}, {0, 0, 0, 0, 0, 1}})),
      InputError);
  EXPECT_THROW((runge_kutta("short", 1, {{0.5}})), InputError);
}

}  // namespace
}  // namespace tangere
