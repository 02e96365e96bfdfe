// SPDX-License-Identifier: Apache-2.0
// Force of a layer that is the contact, at one point (docs/layer.md). With the load P of a point,
// its depth and slant, and force N n and friction T of a spring with the sensor's coefficients
// there, the force on the pad's body is
//   f = P slant + min(P, a k depth) T'/N,   T' = T - m (m·T),  m = slant/|slant|
// and acts at the place of the depth. a k is the stiffness of a point on the layer: a bulge presses
// without friction, so that friction does not jump where a point enters the shape. Where N is 0
// there is no friction.
#pragma once

#include "kernels/layer/layer_types.hpp"
#include "kernels/numbers/dual.hpp"

namespace tangere::kernels {

/// Returns a number without derivatives.
template <class N>
N constant_of(const N& x) {
  return x;
}
template <class N>
Dual<N> constant_of(const Dual<N>& x) {
  return {x.value, N(0.0)};
}

/// Friction at a point.
template <class N>
struct LayerFriction {
  Vec3<N> ratio;  ///< T'/N
  N normal;       ///< N [N]; 0: without friction
};

/// Returns the friction of a point where `by` is not the gap.
template <class Shape, class N>
LayerFriction<N> layer_friction(const Shape& shape, const LayerShape& of, const Touch<N>& t,
                                const Vec3<N>& xi, const N& by, const Anchor<N>& anchor,
                                const Vec3<N>& slant) {
  const LawParameters<N> law = {t.law, of.law, of.ramp};
  ElasticPoint<N> p;
  find_place(shape, t.Q, t.c, xi, p);
  find_motion(law, t.omega, t.v, p);
  const auto acting = (p.normal.force > N(0.0)) & (t.law.mu > N(0.0)) & (by < N(2.5));
  LayerFriction<N> out{zero3<N>(), select(acting, p.normal.force, N(0.0))};
  if (!any(acting)) return out;
  N scale;
  if (of.elastic) {
    add_spring(law, t.Q, t.c, anchor, p);
    scale = p.hold;
  } else {
    scale = friction(law, p.normal, p.vt).scale;
    p.w = p.vt;
  }
  if (of.secant) scale = constant_of(scale);
  const N inverse = N(1.0) / select(acting, p.normal.force, N(1.0));
  const Vec3<N> whole = -(scale * inverse) * p.w;
  const N along = dot(slant, whole) / dot(slant, slant);
  out.ratio = select(acting, whole - along * slant, zero3<N>());
  return out;
}

}  // namespace tangere::kernels
