// SPDX-License-Identifier: Apache-2.0
// Force of a layer that is the contact, at one point (docs/layer.md). With the load P of a point,
// depth and slant of engine/layer/layer_depth.hpp, and force N n and friction T of a spring with
// the sensor's coefficients there, the force on the pad's body is
//   f = P slant + min(P, a k depth) T'/N,   T' = T - m (m·T),  m = slant/|slant|
// and acts at the place of the depth. a k is the stiffness of a point on the layer: a bulge presses
// without friction, so that friction does not jump where a point enters the shape. Where N is 0
// there is no friction.
#pragma once

#include "engine/layer/layer_depth.hpp"
#include "kernels/contact/elastic_contact.hpp"
#include "kernels/numbers/dual.hpp"

namespace tangere {

/// A body that presses a pad, in pad axes at the pad's origin. `touch.law`: of the springs.
template <class N>
struct LayerBody {
  kernels::Touch<N> touch;
  kernels::Vec3<N> size;  ///< as in PairContact
};

/// What stays the same while it moves.
struct LayerShape {
  PrimitiveShape shape;
  const kernels::DistanceGrid* grid;
  ContactLaw law;
  double ramp;
  bool elastic;  ///< its springs have anchors
  bool secant;   ///< derivatives take friction by its secant
};

template <class N>
struct LayerForce {
  LayerDepth<N> at;
  kernels::Vec3<N> friction;  ///< T'/N, pad axes
  N normal;                   ///< N [N]; 0: without friction
};

/// Returns a number without derivatives.
inline double constant_of(double x) { return x; }
inline kernels::Dual<double> constant_of(const kernels::Dual<double>& x) { return x.value; }

/// Returns T/N; zero where N is 0. `anchor`: b in pad axes. `normal`: receives N.
template <class Shape, class N>
kernels::Vec3<N> friction_by_load(const Shape& shape, const LayerShape& of,
                                  const kernels::Touch<N>& t, const kernels::Vec3<double>& xi,
                                  const kernels::Anchor<N>& anchor, N& normal) {
  const kernels::LawParameters<N> law = {t.law, of.law, of.ramp};
  kernels::ElasticPoint<N> p;
  kernels::find_place(shape, t.Q, t.c, kernels::broadcast<N>(xi), p);
  kernels::find_motion(law, t.omega, t.v, p);
  if (!(p.normal.force > N(0.0))) return kernels::zero3<N>();
  normal = p.normal.force;
  N scale;
  if (of.elastic) {
    kernels::add_spring(law, t.Q, t.c, anchor, p);
    scale = p.hold;
  } else {
    scale = kernels::friction(law, p.normal, p.vt).scale;
    p.w = p.vt;
  }
  if (of.secant) scale = constant_of(scale);
  return -(scale / normal) * p.w;
}

/// Sets the friction of a point whose depth and slant are set.
template <class Shape, class N>
void add_friction(const Shape& shape, const LayerShape& of, const kernels::Touch<N>& t,
                  const kernels::Vec3<double>& xi, const KnownDepth& known,
                  const kernels::Anchor<N>& anchor, LayerForce<N>& out) {
  out.friction = kernels::zero3<N>();
  out.normal = N(0.0);
  if (!(t.law.mu > N(0.0)) || known.by == DepthBy::gap) return;
  const kernels::Vec3<N>& slant = out.at.slant;
  const kernels::Vec3<N> friction = friction_by_load(shape, of, t, xi, anchor, out.normal);
  out.friction = friction - (dot(slant, friction) / dot(slant, slant)) * slant;
}

}  // namespace tangere
