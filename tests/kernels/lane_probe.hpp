// SPDX-License-Identifier: Apache-2.0
// Arithmetic of lanes as functions of plain arrays, one set per instruction set, so that tests can compare them.
#pragma once

#include <span>

namespace tangere::testing {

struct LaneProbe {
  const char* name;  ///< as in KernelTable
  void (*inverse_sqrt)(const double* x, double* y);  ///< (8) each, 64-byte aligned
};

/// Those this machine can run; the first is the scalar one.
std::span<const LaneProbe* const> lane_probes();

}  // namespace tangere::testing
