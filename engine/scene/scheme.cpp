// SPDX-License-Identifier: Apache-2.0
// The table of schemes.
//
// Runge-Kutta: X_i = h Σ a_ij ẋ_j, V_i = v₀ + h Σ a_ij v̇_j. η solves η a_jk = a_ik over the rows
// before i. Then
//   ẋ_i = (X_i - Σ η_j X_j)/(a_ii h),  v̇_i = (V_i - v₀ - Σ η_j (V_j - v₀))/(a_ii h)
// The estimate compares X_s with the rule that is exact for the first terms of ẋ = λx, where the
// stages have the rates λ (A 1)ᵏ xₖ:
//   e = X_s - h (w_0 v₀ + Σ w_i ẋ_i),  w_0 + Σ w_i = 1,  Σ w_i (Aᵏ 1)_i = 1/(k + 1)! for k = 1 … s
#include "engine/scene/scheme.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "engine/base/error.hpp"

namespace tangere {

const Scheme& Scheme::fallback() const {
  return order > 1 ? Integrator::bdf1.scheme() : Integrator::sdirk2.scheme();
}

int Scheme::most_inner_stages() const {
  return std::max({inner_stages(), start == nullptr ? 0 : start->inner_stages(),
                   substep_scheme().inner_stages(), fallback().inner_stages()});
}

namespace {

/// Solves equations, each a row of coefficients and the right-hand side. Not finite where they
/// determine nothing.
std::vector<double> solution_of(std::vector<std::vector<double>> rows) {
  const std::size_t n = rows.size();
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t largest = k;
    for (std::size_t i = k + 1; i < n; ++i)
      if (std::abs(rows[i][k]) > std::abs(rows[largest][k])) largest = i;
    std::swap(rows[k], rows[largest]);
    for (std::size_t i = 0; i < n; ++i) {
      if (i == k) continue;
      const double share = rows[i][k] / rows[k][k];
      for (std::size_t j = k; j <= n; ++j) rows[i][j] -= share * rows[k][j];
    }
  }
  std::vector<double> x;
  for (std::size_t k = 0; k < n; ++k) x.push_back(rows[k][n] / rows[k][k]);
  return x;
}

/// Weights, on the rates at the start and at the stages' ends, of the rule that is exact for the
/// first terms of ẋ = λx.
std::vector<double> rule_of(const std::vector<std::vector<double>>& a) {
  std::vector<std::vector<double>> conditions;
  std::vector<double> power(a.size(), 1.0);  // Aᵏ 1
  double integral = 1;                       // 1/(k + 1)!
  for (std::size_t k = 1; k <= a.size(); ++k) {
    for (std::size_t i = a.size(); i-- > 0;) {  // row i reads what rows above it still hold
      double sum = 0;
      for (std::size_t j = 0; j <= i; ++j) sum += a[i][j] * power[j];
      power[i] = sum;
    }
    integral /= static_cast<double>(k + 1);
    conditions.push_back(power);
    conditions.back().push_back(integral);
  }
  std::vector<double> weights = solution_of(std::move(conditions));
  weights.insert(weights.begin(), 1 - std::accumulate(weights.begin(), weights.end(), 0.0));
  return weights;
}

/// Weights of e on h v₀ and on the stages' x. `eta`: η of every stage.
std::vector<double> estimate_of(const std::vector<std::vector<double>>& a,
                                const std::vector<std::vector<double>>& eta) {
  const std::vector<double> w = rule_of(a);
  std::vector<double> estimate(w.size(), 0.0);
  estimate[0] = -w[0];
  estimate.back() = 1;
  for (std::size_t i = 0; i < a.size(); ++i) {  // h w_i ẋ_i in terms of x
    const double share = w[i + 1] / a[i][i];
    estimate[i + 1] -= share;
    for (std::size_t j = 0; j < i; ++j) estimate[j + 1] += share * eta[i][j];
  }
  return estimate;
}

}  // namespace

Scheme runge_kutta(const char* name, int order, std::initializer_list<std::vector<double>> matrix) {
  const std::vector<std::vector<double>> a(matrix);
  if (a.empty() || a.size() > kMostStages)
    throw InputError(std::string(name) + ": " + std::to_string(a.size()) +
                     " stages; expected 1 to " + std::to_string(kMostStages));
  Scheme scheme{name, order, {}, 0, nullptr, nullptr, {}};
  std::vector<std::vector<double>> etas;
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
    etas.push_back(std::move(eta));
    scheme.stages.push_back(std::move(stage));
    if (i + 1 == a.size() && !(std::abs(end - 1) < 1e-9))
      throw InputError(std::string(name) + ": the last stage ends at " + std::to_string(end) +
                       " steps; expected 1");
  }
  scheme.estimate = estimate_of(a, etas);
  if (!std::ranges::all_of(scheme.estimate, [](double x) { return std::isfinite(x); }))
    scheme.estimate.clear();
  return scheme;
}

namespace {

const double kGamma = 1 - std::sqrt(0.5);

const Scheme kBdf1 = runge_kutta("BDF1", 1, {{1}});

const Scheme kSdirk2 = runge_kutta("SDIRK2", 2, {{kGamma}, {1 - kGamma, kGamma}});

// Alexander 1977: the root of g³ - 3g² + 3g/2 - 1/6 that makes three stages L-stable, of order 3.
const double kThird = 0.43586652150845899942;
const Scheme kSdirk3 = runge_kutta("SDIRK3", 3,
                                   {{kThird},
                                    {(1 - kThird) / 2, kThird},
                                    {-(6 * kThird * kThird - 16 * kThird + 1) / 4,
                                     (6 * kThird * kThird - 20 * kThird + 5) / 4, kThird}});

// Hairer and Wanner, Solving Ordinary Differential Equations II, table IV.6.5: L-stable, order 4.
const Scheme kSdirk4 = runge_kutta("SDIRK4", 4,
                                   {{1.0 / 4},
                                    {1.0 / 2, 1.0 / 4},
                                    {17.0 / 50, -1.0 / 25, 1.0 / 4},
                                    {371.0 / 1360, -137.0 / 2720, 15.0 / 544, 1.0 / 4},
                                    {25.0 / 24, -49.0 / 48, 125.0 / 16, -85.0 / 12, 1.0 / 4}});

// The parts of a split step must keep order 2, and so must the history of the next step.
const Scheme kBdf2 = {.name = "BDF2",
                      .order = 2,
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

}  // namespace

constinit const Integrator Integrator::bdf1{kBdf1};
constinit const Integrator Integrator::bdf2{kBdf2};
constinit const Integrator Integrator::sdirk2{kSdirk2};
constinit const Integrator Integrator::sdirk3{kSdirk3};
constinit const Integrator Integrator::sdirk4{kSdirk4};
constinit const Integrator Integrator::default_integrator{kBdf1};
constinit const Integrator Integrator::reference{kSdirk4};
constinit const Integrator Integrator::second_reference{kSdirk2};

Integrator keeping_accuracy(Integrator integrator, double accuracy) {
  const bool keeps = !integrator.scheme().estimate.empty() && integrator.scheme().order > 1;
  return accuracy > 0 && !keeps ? Integrator::sdirk3 : integrator;
}

std::span<const Integrator> integrators() {
  static constexpr Integrator kAll[] = {Integrator(kBdf1), Integrator(kBdf2), Integrator(kSdirk2),
                                        Integrator(kSdirk3)};
  return kAll;
}

}  // namespace tangere
