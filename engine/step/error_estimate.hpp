// SPDX-License-Identifier: Apache-2.0
// The estimated error of a part of a step (docs/solver.md).
#pragma once

#include "engine/step/contact_forces.hpp"
#include "engine/step/newton.hpp"

namespace tangere {

class ErrorEstimate {
 public:
  /// Of parts by `scheme`, which must have an estimate wherever error() is called.
  ErrorEstimate(const CompiledModel& model, const Scheme& scheme)
      : model_(model), scheme_(scheme), contact_forces_(model) {}

  /// Returns the relative error of parts of length h [s] in `lanes`, which have just been solved
  /// with the factors `factors`. Overwrites the stage.
  template <int L>
  kernels::Row<L> error(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                        const kernels::Row<L>& h, const StageFactors<L>& factors,
                        NewtonReport& report) const;

 private:
  const CompiledModel& model_;
  const Scheme& scheme_;
  ContactForces contact_forces_;
};

}  // namespace tangere
