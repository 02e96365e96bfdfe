// SPDX-License-Identifier: Apache-2.0
// The table of schemes.
//
// Runge-Kutta: X_i = h Σ a_ij ẋ_j, V_i = v₀ + h Σ a_ij v̇_j. η solves η a_jk = a_ik over the rows
// before i. Then
//   ẋ_i = (X_i - Σ η_j X_j)/(a_ii h),  v̇_i = (V_i - v₀ - Σ η_j (V_j - v₀))/(a_ii h)
#include "engine/model/scheme.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/base/error.hpp"

namespace tangere {

int Scheme::most_inner_stages() const {
  return std::max(
      {inner_stages(), start == nullptr ? 0 : start->inner_stages(), of_parts().inner_stages()});
}

Scheme runge_kutta(const char* name, int order, std::initializer_list<std::vector<double>> matrix) {
  const std::vector<std::vector<double>> a(matrix);
  if (a.empty() || a.size() > kMostStages)
    throw InputError(std::string(name) + ": " + std::to_string(a.size()) +
                     " stages; expected 1 to " + std::to_string(kMostStages));
  Scheme scheme{name, order, StageSolve::newton, {}, 0, nullptr, nullptr};
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].size() != i + 1 || !(a[i][i] > 0))
      throw InputError(std::string(name) + ": stage " + std::to_string(i) +
                       "; expected as many coefficients as stages so far, the last one positive");
    std::vector<double> eta(i);
    double end = a[i][i];
    for (std::size_t j = i; j-- > 0;) {
      eta[j] = a[i][j];
      for (std::size_t k = j + 1; k < i; ++k) eta[j] -= eta[k] * a[k][j];
      eta[j] /= a[j][j];
      end += a[i][j];
    }
    SchemeStage stage{i + 1 == a.size() ? 1 : end, 1 / a[i][i], 0, -1, 0, a[i][i], {}};
    for (const double weight : eta) stage.inner.push_back({-(weight / a[i][i]), -weight});
    scheme.stages.push_back(std::move(stage));
    if (i + 1 == a.size() && !(std::abs(end - 1) < 1e-9))
      throw InputError(std::string(name) + ": the last stage ends at " + std::to_string(end) +
                       " steps; expected 1");
  }
  return scheme;
}

namespace {

const double kGamma = 1 - std::sqrt(0.5);

const Scheme kBdf1 = runge_kutta("BDF1", 1, {{1}});

const Scheme kSdirk2 = runge_kutta("SDIRK2", 2, {{kGamma}, {1 - kGamma, kGamma}});

// The parts of a split step must keep order 2, and so must the history of the next step.
const Scheme kBdf2 = {.name = "BDF2",
                      .order = 2,
                      .solve = StageSolve::newton,
                      .stages = {{.end = 1,
                                  .c0 = 1.5,
                                  .r_before = 0.5,
                                  .s_centre = -2,
                                  .s_before = 0.5,
                                  .s_divisor = 1,
                                  .inner = {}}},
                      .extrapolation = 0.5,
                      .start = &kSdirk2,
                      .parts = &kSdirk2};

const Scheme kLinearImplicit = {.name = "linear-implicit",
                                .order = 1,
                                .solve = StageSolve::one_direction,
                                .stages = kBdf1.stages,
                                .extrapolation = 0,
                                .start = nullptr,
                                .parts = &kBdf1};

}  // namespace

constinit const Integrator Integrator::bdf1{kBdf1};
constinit const Integrator Integrator::bdf2{kBdf2};
constinit const Integrator Integrator::sdirk2{kSdirk2};
constinit const Integrator Integrator::linear_implicit{kLinearImplicit};

std::span<const Integrator> integrators() {
  static constexpr Integrator kAll[] = {Integrator(kBdf1), Integrator(kBdf2), Integrator(kSdirk2),
                                        Integrator(kLinearImplicit)};
  return kAll;
}

}  // namespace tangere
