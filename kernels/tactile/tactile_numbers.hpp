// SPDX-License-Identifier: Apache-2.0
// The number types of tactile points, and forces in the axes of a field. Reverse kernels include
// this file but not tactile.hpp, so a change there does not recompile them.
#pragma once

#include "kernels/numbers/lanes_f32.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// Everything in double precision: eight points at a time.
template <class Arch>
struct InDouble {
  using Architecture = Arch;
  using N = Lanes<Arch>;
  using Real = double;
  using Offset = PointOffset<N, false>;
  static constexpr bool kSingle = false, kCurved = false;
  static constexpr int kComponents = 3;  ///< of a force that are wanted
  static constexpr int kLanes = kGroup;
  static constexpr double kSmallest = 1e-150;  ///< its square is still a normal number
  static N load(const double* p) { return load_lanes<Arch>(p); }
  static void store(const N& x, double* p) { store_lanes(x, p); }
  static const double* offsets(const PadTiles& pad) { return pad.offsets; }
  static const double* frames(const PadTiles& pad) { return pad.frames; }
  static const double* factors(const PadTiles& pad) { return pad.factors; }
};

/// Brackets in double, points in single precision, sixteen at a time.
template <class Arch>
struct InMixed {
  using Architecture = Arch;
  using N = LanesF<Arch>;
  using Real = float;
  using Offset = PointOffset<N, false>;
  static constexpr bool kSingle = true, kCurved = false;
  static constexpr int kComponents = 3;
  static constexpr int kLanes = kLanesF;
  static constexpr double kSmallest = 1e-18;
  static N load(const float* p) { return load_lanes<Arch>(p); }
  static void store(const N& x, float* p) { store_lanes(x, p); }
  static const float* offsets(const PadTiles& pad) { return pad.offsets_f; }
  static const float* frames(const PadTiles& pad) { return pad.frames_f; }
  static const float* factors(const PadTiles& pad) { return pad.factors_f; }
};

/// The number type P for points on a curved pad.
template <class P>
struct OnCurvedPad : P {
  using Offset = PointOffset<typename P::N, true>;
  static constexpr bool kCurved = true;
};

/// The number type P where only the third component is wanted, without friction.
template <class P>
struct PressureAlone : P {
  static constexpr int kComponents = 1;
};

/// Returns the force in the points' own axes. `frames`: (9, 64).
template <class P, class N = typename P::N>
Vec3<N> in_point_axes(const typename P::Real* frames, const Vec3<N>& f) {
  const auto component = [&](int row) {
    const auto at = [&](int k) { return P::load(frames + (3 * row + k) * kTactileTile); };
    return mul_add(at(0), f.x, mul_add(at(1), f.y, at(2) * f.z));
  };
  return {component(0), component(1), component(2)};
}

/// Returns the force in the sensor's own axes, when those are not orthonormal.
template <class N>
Vec3<N> in_skewed_axes(const double* axes, const Vec3<N>& force) {
  const N f[3] = {force.x, force.y, N(0.0) - force.z};
  N out[3];
  for (int i = 0; i < 3; ++i) {
    out[i] = N(0.0);
    for (int k = 0; k < 3; ++k) out[i] = mul_add(N(axes[3 * i + k]), f[k], out[i]);
  }
  return {out[0], out[1], out[2]};
}

}  // namespace tangere::kernels
