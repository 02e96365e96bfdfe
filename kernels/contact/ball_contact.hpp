// SPDX-License-Identifier: Apache-2.0
// A ball that touches a shape of another body with its surface. It has one contact point ξ, its
// centre, and is as deep as the shape, grown by the ball's radius, is at the centre:
//   d = D(ξ) - r, where D is the distance to the shape, and x₂ = ξ - D n as for any point
// So forces act on the surface of the touched body (kernels/contact/pair_contact.hpp). The centre
// is outside of the shape unless the ball is deeper than r, so D and its Hessian are needed there.
#pragma once

#include "kernels/contact/distance.hpp"

namespace tangere::kernels {

/// A shape grown by a ball's radius. The shape is chosen at run time: one point is not worth the
/// code of every shape.
template <class N>
struct GrownShape {
  static constexpr Bending kBending = Bending::general;
  static constexpr PointSumForm kSums = PointSumForm::points;
  PrimitiveShape shape;
  Vec3<N> size;
  N grown;  ///< radius of the ball [m]

  Distance<N> evaluate(const Vec3<N>& y) const {
    return with([&](const auto& of) { return less_grown(distance_at(of, y)); });
  }
  Distance<N> evaluate(const Vec3<N>& y, Mat3<N>& H) const {
    return with([&]<class Shape>(const Shape& of) {
      if constexpr (Shape::kBending == Bending::general) {
        return less_grown(of.evaluate(y, H));
      } else {
        H = of.hessian(y);
        return less_grown(distance_at(of, y));
      }
    });
  }
  /// Of the shape alone.
  Vec3<N> size_share(const Vec3<N>& y, const Vec3<N>& n, const Vec3<N>& rho) const {
    return with([&](const auto& of) { return of.size_share(y, n, rho); });
  }

  template <class F>
  auto with(const F& f) const {
    return with_distance<N>(shape, size, [&]<class Shape>(const Shape& of) {
      // A mesh has a distance only near its surface (engine/model/compile.cpp refuses it).
      if constexpr (Shape::kShape == PrimitiveShape::mesh) {
        return f(PlaneDistance<N>{});
      } else {
        return f(of);
      }
    });
  }

 private:
  Distance<N> less_grown(const Distance<N>& at) const { return {at.d - grown, at.n}; }
};

template <class N>
auto nearer_than(const GrownShape<N>& shape, const Vec3<N>& y, const N& m) {
  return shape.with(
      [&](const auto& of) -> decltype(m < m) { return nearer_than(of, y, m + shape.grown); });
}

}  // namespace tangere::kernels
