// SPDX-License-Identifier: Apache-2.0
// Included once by each generated lane_probe.<isa>.cpp.
#pragma once

#include "kernels/numbers/one_lane.hpp"
#include "tests/kernels/lane_probe.hpp"

namespace tangere::testing {

using kernels::ScalarArch;

template <class Arch>
struct LaneProbeOf {
  using N = kernels::Lanes<Arch>;
  using One = kernels::OneLane<Arch>;

  static void inverse_sqrt(const double* x, double* y) {
    kernels::store_lanes(kernels::inverse_sqrt(kernels::load_lanes<Arch>(x)), y);
  }
  template <class Number>
  static void rows(const DistanceProbe& probe, const kernels::Vec3<Number>& y, Number* row) {
    kernels::with_distance<Number>(probe.shape, probe.size, [&]<class Shape>(const Shape& shape) {
      kernels::Distance<Number> at;
      Number straight;
      if constexpr (Shape::kBending == kernels::Bending::general) {
        kernels::Mat3<Number> H;
        at = shape.evaluate(y, H);
        row[4] = H.m[0][0] + H.m[1][1] + H.m[2][2];
      } else if constexpr (Shape::kBending == kernels::Bending::rod) {
        at = shape.evaluate(y, row[4], straight);
      } else {
        at = shape.evaluate(y, row[4]);
      }
      row[0] = at.d, row[1] = at.n.x, row[2] = at.n.y, row[3] = at.n.z;
      row[5] = select(nearer_than(shape, y, Number(0.01)), Number(1.0), Number(0.0));
    });
  }
  static void distance(const DistanceProbe& probe, const double* y, double* out) {
    const auto load = [](const double* p) { return kernels::load_lanes<Arch>(p); };
    N row[kDistanceRows];
    rows<N>(probe, {load(y), load(y + 8), load(y + 16)}, row);
    for (int i = 0; i < kDistanceRows; ++i) kernels::store_lanes(row[i], out + 8 * i);
  }
  static void distance_alone(const DistanceProbe& probe, const double* y, double* out) {
    for (int l = 0; l < 8; ++l) {
      One row[kDistanceRows];
      rows<One>(probe, {One(y[l]), One(y[8 + l]), One(y[16 + l])}, row);
      for (int i = 0; i < kDistanceRows; ++i) out[8 * i + l] = row[i].x;
    }
  }
  static constexpr LaneProbe make(const char* name) {
    return {name, inverse_sqrt, distance, distance_alone};
  }
};

}  // namespace tangere::testing
