// SPDX-License-Identifier: Apache-2.0
// Tests the rows of schemes: uniform motion, and what is refused.
#include "engine/model/scheme.hpp"

#include <gtest/gtest.h>

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
