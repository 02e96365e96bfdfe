// SPDX-License-Identifier: Apache-2.0
// What contacts and pads require of a shape. Each file beside this one is one shape, over any
// number type: its signed distance d (< 0 inside) and the unit gradient n = ∇d. n is defined
// everywhere, also where the distance has a kink (centre, axis, edge, corner).
//
// A shape is a template S<N> with
//   kShape, kBending, kSums      its kind, the form of its Hessian, the family of its point sums
//   Pad<P>                       its distance under a pad, relative to a tile
//   of(size)                     the shape of a size as in PairContact
//   evaluate(y, …)               d and n; ball and flat: also κ; rod: also κ and e
//   size_share(y, n, ρ̄)          cotangent of the size from that of the shape's place, inside; a
//                                mesh, where |n| is not 1, takes (y, d, ρ̄, d̄)
//   nearer_than(shape, y, m)     whether d < m, m > 0; may also be true for slightly larger d
// and, for bodies whose own contact points follow their size,
//   stretched(to, from, y)       where the contact point y of a shape `from` is on a shape `to`
//   stretch_share(size, y, ȳ)    the same in reverse: Σ ȳ·∂y/∂size
// and for faces, inside(y, κ): like evaluate() where d < 0, elsewhere some d ≥ 0. A shape that does
// not specialise one of these gets a general form: Bending::general with evaluate(y, H), sums point
// by point, GeneralPad. A mesh also takes its DistanceGrid in of().
#pragma once

#include "kernels/contact/contact_types.hpp"
#include "kernels/contact/shapes/tile.hpp"
#include "kernels/numbers/inverse_sqrt.hpp"
#include "kernels/numbers/linalg.hpp"

namespace tangere::kernels {

/// Value and gradient. Curvature is returned separately.
template <class N>
struct Distance {
  N d;
  Vec3<N> n;
};

/// The form of the Hessian inside a shape. Contact evaluates it only there.
enum class Bending {
  flat,  ///< H = 0
  ball,  ///< H = κ (I - n nᵀ), and the shape is invariant under rotations: it needs no
         ///< orientation
  rod,  ///< H = κ (I - n nᵀ - e z zᵀ), z the shape's axis; e = 1 where the surface is straight
        ///< along z, else 0
  general,  ///< any symmetric H with H n = 0
};

/// How the forces of many points on a shape are summed, with their derivatives.
enum class PointSumForm {
  about_centre,  ///< products of vectors about a ball's centre (sphere_contact.hpp)
  faces,  ///< products of wrenches, for faces that bend in at most one direction (face_contact.hpp)
  points,  ///< one point after the other (pair_contact.hpp)
};

/// Where a contact point stays, relative to a shape's lengths along its axes, when its size
/// changes.
template <class N>
Vec3<N> stretched_along_axes(const Vec3<N>& to, const Vec3<double>& from, const Vec3<double>& y) {
  return {N(y.x / from.x) * to.x, N(y.y / from.y) * to.y, N(y.z / from.z) * to.z};
}
template <class N>
Vec3<N> axes_stretch_share(const Vec3<double>& size, const Vec3<N>& y, const Vec3<N>& bar) {
  return {bar.x * y.x * N(1 / size.x), bar.y * y.y * N(1 / size.y), bar.z * y.z * N(1 / size.z)};
}

}  // namespace tangere::kernels
