// SPDX-License-Identifier: Apache-2.0
// Tests the rows of schemes: uniform motion, and what is refused.
#include "engine/scene/scheme.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

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
    EXPECT_LE(scheme.substep_scheme().order, scheme.order);
    EXPECT_FALSE(scheme.substep_scheme().needs_history()) << "parts have no state one step before";
    if (scheme.needs_history()) {
      EXPECT_FALSE(scheme.start->needs_history());
    }
  }
}

/// For ẋ = λ(1 + x) the exact result is e^λ - 1. A scheme of s stages leaves an error of order
/// λ^(order + 1); the estimate must be that error up to λ^(s + 2).
TEST(Schemes, EstimatesAreErrorsOfLinearEquations) {
  int with_estimate = 0;
  for (const Integrator integrator : testing::all_integrators()) {
    const Scheme& scheme = integrator.scheme();
    if (scheme.estimate.empty()) continue;
    SCOPED_TRACE(scheme.name);
    ++with_estimate;
    ASSERT_EQ(scheme.estimate.size(), scheme.stages.size() + 1);
    const auto off = [&](double lambda) {
      std::vector<double> x;
      for (const SchemeStage& stage : scheme.stages) {  // c₀ x + Σ r x_j = λ(1 + x)
        double known = lambda;
        for (std::size_t j = 0; j < x.size(); ++j) known -= stage.inner[j].r * x[j];
        x.push_back(known / (stage.c0 - lambda));
      }
      double e = scheme.estimate[0] * lambda;
      for (std::size_t k = 0; k < x.size(); ++k) e += scheme.estimate[k + 1] * x[k];
      return std::pair(e - (x.back() - std::expm1(lambda)), x.back() - std::expm1(lambda));
    };
    for (const double sign : {-1.0, 1.0}) {
      const auto [wrong, error] = off(0.2 * sign);
      const auto [half_wrong, half_error] = off(0.1 * sign);
      EXPECT_NEAR(std::log2(error / half_error), scheme.order + 1, 0.3);
      EXPECT_NEAR(std::log2(wrong / half_wrong), static_cast<double>(scheme.stages.size()) + 2,
                  0.3);
      EXPECT_LT(std::abs(half_wrong), 0.2 * std::abs(half_error));
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

TEST(Schemes, FallBackToOrderOneAndFromThereToTwo) {
  for (const Integrator integrator : integrators()) {
    const Scheme& scheme = integrator.scheme();
    EXPECT_EQ(scheme.fallback().order, scheme.order > 1 ? 1 : 2) << scheme.name;
    EXPECT_NE(&scheme, &Integrator::reference.scheme());
  }
  EXPECT_NE(Integrator::reference, Integrator::second_reference);
  EXPECT_EQ(Scene{}.integrator, Integrator::default_integrator);
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
