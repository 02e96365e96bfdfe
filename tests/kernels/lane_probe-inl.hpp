// SPDX-License-Identifier: Apache-2.0
// Included once by each generated lane_probe.<isa>.cpp.
#pragma once

#include "kernels/inverse_sqrt.hpp"
#include "tests/kernels/lane_probe.hpp"

namespace tangere::testing {

using kernels::ScalarArch;

template <class Arch>
struct LaneProbeOf {
  static void inverse_sqrt(const double* x, double* y) {
    kernels::store_lanes(kernels::inverse_sqrt(kernels::load_lanes<Arch>(x)), y);
  }
  static constexpr LaneProbe make(const char* name) { return {name, inverse_sqrt}; }
};

}  // namespace tangere::testing
