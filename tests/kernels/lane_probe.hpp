// SPDX-License-Identifier: Apache-2.0
// Arithmetic of lanes as functions of plain arrays, one set per instruction set, so that tests can
// compare them.
#pragma once

#include <span>

#include "kernels/contact/distance.hpp"

namespace tangere::testing {

struct DistanceProbe {
  PrimitiveShape shape;
  kernels::Vec3<double> size;
};
inline constexpr int kDistanceRows =
    6;  ///< d, n, κ or the trace of H, and whether the point is nearer than 0.01

struct LaneProbe {
  const char* name;                                  ///< as in KernelTable
  void (*inverse_sqrt)(const double* x, double* y);  ///< (8) each, 64-byte aligned
  /// Evaluates at y (3, 8) into out (kDistanceRows, 8), both 64-byte aligned.
  void (*distance)(const DistanceProbe& shape, const double* y, double* out);
  /// Does the same with lanes one at a time.
  void (*distance_alone)(const DistanceProbe& shape, const double* y, double* out);
};

/// The probes that this machine can run; the first is the scalar one.
std::span<const LaneProbe* const> lane_probes();

}  // namespace tangere::testing
