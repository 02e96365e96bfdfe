// SPDX-License-Identifier: Apache-2.0
// Tests which runs are called costly.
#include "tasks/run/costly_steps.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tangere {
namespace {

using ::testing::HasSubstr;

TEST(CostlySteps, AreThoseWithManyEvaluationsOrSplits) {
  EXPECT_EQ(costly_steps(Integrator::bdf1, {1000, 5000, 50}), "");
  EXPECT_THAT(costly_steps(Integrator::bdf1, {1000, 5100, 0}),
              HasSubstr("5.1 evaluations each, and 0 % of them are split"));
  EXPECT_THAT(costly_steps(Integrator::bdf1, {1000, 3000, 51}),
              HasSubstr("3 evaluations each, and 5.1 % of them are split"));
  EXPECT_EQ(costly_steps(Integrator::sdirk3, {1000, 15000, 0}), "") << "it has three stages";
  EXPECT_EQ(costly_steps(Integrator::bdf1, {0, 0, 0}), "");
  EXPECT_EQ(costly_steps(Integrator::bdf1, {19, 1900, 19}), "") << "a first touch is no rule";
}

}  // namespace
}  // namespace tangere
