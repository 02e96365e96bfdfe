// SPDX-License-Identifier: Apache-2.0
// One attempt at a step, or at a part of one: solves the stages of a scheme
// (engine/scene/scheme.hpp), checks the root and estimates its error. group_step.cpp chooses which
// attempt follows which.
#pragma once

#include "engine/step/error_estimate.hpp"
#include "engine/step/newton.hpp"
#include "engine/step/step_checks.hpp"
#include "engine/step/step_settings.hpp"

namespace tangere {

/// A displacement from q0, v0 of a workspace over a time h.
template <int L>
struct Attempt {
  const Scheme* scheme;
  kernels::Row<L> h;  ///< [s]
  int depth;          ///< how often the step was halved because it had no acceptable root
};

/// The result of an attempt, per lane. q1, v1 of the workspace hold the state of lanes with a root.
template <int L>
struct Outcome {
  std::array<unsigned, L> failures;  ///< bits of Failure; 0: accepted
  /// Estimated error over the one that the accuracy allows; infinite where another check failed. 0
  /// where no accuracy is kept.
  kernels::Row<L> error{};
};

class AttemptSolver {
 public:
  AttemptSolver(const CompiledModel& model, const StepSettings& settings)
      : model_(model),
        settings_(settings),
        checks_(model, settings),
        estimate_(model, settings.integrator.scheme()) {}

  /// Makes an attempt in `lanes`. Lanes without a root have a failure in `report.status`.
  template <int L>
  Outcome<L> solve(const Attempt<L>& attempt, const kernels::KernelTable& table,
                   BasicWorkspace<L>& w, LaneBits lanes, NewtonReport& report) const;

 private:
  const CompiledModel& model_;
  StepSettings settings_;
  StepChecks checks_;
  ErrorEstimate estimate_;
};

}  // namespace tangere
