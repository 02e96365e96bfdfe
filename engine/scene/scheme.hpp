// SPDX-License-Identifier: Apache-2.0
// Time-stepping schemes as rows of coefficients, which step, tape, adjoint and tangent read, and
// the fallback schemes for steps that a scheme cannot take.
//
// A step of length h from (q₀, v₀) has one implicit solve per stage, for the displacement x from
// q₀:
//   ẋ = (c₀ x + r)/h    v = J(x) ẋ    a = (c₀ v + s)/h    g(q, v, a) = 0    q = q₀ ⊕ x
//   r = r_before (q_before ⊖ q₀) + Σ r_inner x_j
//   s = (s_centre v₀ + s_before v_before + Σ s_inner (v_j - v₀)) / s_divisor
// (q_before, v_before) is the state one step before. (x_j, v_j) is an earlier stage of the same
// step. The last stage's result is the state after the step.
//
// The error of a step is estimated by another rule for q₁ = q₀ ⊕ ∫ ẋ dt. It passes through the
// rates at the start (v₀) and at the end of every stage, and so is one order higher:
//   e = estimate[0] h v₀ + Σ estimate[1 + k] x_k
#pragma once

#include <initializer_list>
#include <span>
#include <vector>

namespace tangere {

inline constexpr int kMostStages = 5;

/// Weights of an earlier stage in a later one.
struct InnerWeight {
  double r, s;
};

/// One stage: c₀, the weights of older states, and the time `end`, in steps, at which it ends.
struct SchemeStage {
  double end;
  double c0;
  double r_before;
  double s_centre, s_before, s_divisor;
  std::vector<InnerWeight> inner;  ///< one for each stage before this one
};

struct Scheme {
  const char* name;  ///< the name in scenes and files
  int order;
  std::vector<SchemeStage> stages;
  /// The first guess moves with velocity v₀ + extrapolation (v₀ - v_before).
  double extrapolation;
  /// The scheme of a step that has no state one step before; null where none is needed.
  const Scheme* start;
  /// The scheme of the parts of a split step; null: this one.
  const Scheme* parts;
  /// Weights of the error's estimate, of the start and of every stage; empty: there is none.
  std::vector<double> estimate = {};

  /// Number of stages whose results a tape keeps.
  [[nodiscard]] int inner_stages() const { return static_cast<int>(stages.size()) - 1; }
  [[nodiscard]] bool needs_history() const { return start != nullptr; }
  [[nodiscard]] const Scheme& substep_scheme() const { return parts == nullptr ? *this : *parts; }
  /// The scheme of steps that this one cannot take: of order 1 if this one is of a higher order and
  /// would add energy, else SDIRK2, for bodies that rotate too far.
  [[nodiscard]] const Scheme& fallback() const;
  /// The largest number of inner stages of this scheme, its start, its parts and its fallback.
  [[nodiscard]] int most_inner_stages() const;
};

/// Makes the scheme of a Runge-Kutta method whose last stage is its result. `matrix` has its
/// coefficients row by row. It must be lower-triangular and have only implicit stages, at most
/// kMostStages of them. Throws InputError for any other.
Scheme runge_kutta(const char* name, int order, std::initializer_list<std::vector<double>> matrix);

/// A reference to a scheme: one of the table by name, or any other that outlives it.
class Integrator {
 public:
  explicit constexpr Integrator(const Scheme& scheme) : scheme_(&scheme) {}
  static const Integrator bdf1, bdf2, sdirk2, sdirk3;
  static const Integrator sdirk4;              ///< not in the table
  static const Integrator default_integrator;  ///< of scenes that name none
  /// Reference scheme of accuracy measurements, and a second one that estimates its error.
  static const Integrator reference, second_reference;

  [[nodiscard]] const Scheme& scheme() const { return *scheme_; }
  friend bool operator==(Integrator, Integrator) = default;

 private:
  const Scheme* scheme_;
};

/// The scheme with which steps of a scene keep an accuracy (0: they need not): SDIRK3 in place of
/// one that has no estimate or is of order 1.
Integrator keeping_accuracy(Integrator integrator, double accuracy);

/// Returns the schemes of the table.
std::span<const Integrator> integrators();

/// Returns the name that users write and read: "BDF1" …
inline const char* to_string(Integrator integrator) { return integrator.scheme().name; }

}  // namespace tangere
