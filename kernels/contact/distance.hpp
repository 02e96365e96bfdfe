// SPDX-License-Identifier: Apache-2.0
// The list of shapes, and the one place that chooses between them.
#pragma once

#include <array>
#include <type_traits>

#include "kernels/contact/shapes/capsule.hpp"
#include "kernels/contact/shapes/cuboid.hpp"
#include "kernels/contact/shapes/cylinder.hpp"
#include "kernels/contact/shapes/ellipsoid.hpp"
#include "kernels/contact/shapes/mesh.hpp"
#include "kernels/contact/shapes/plane.hpp"
#include "kernels/contact/shapes/sphere.hpp"

namespace tangere::kernels {

template <template <class> class... S>
struct ShapeList {};
/// In the order of PrimitiveShape.
using Shapes = ShapeList<SphereDistance, CuboidDistance, PlaneDistance, CylinderDistance,
                         CapsuleDistance, EllipsoidDistance, MeshDistance>;

template <template <class> class... S>
constexpr bool in_order(ShapeList<S...>) {
  int next = 0;
  return ((static_cast<int>(S<double>::kShape) == next++) && ...) && next == kPrimitiveShapes;
}
static_assert(in_order(Shapes{}));

template <class N, class F, template <class> class First, template <class> class... Rest>
auto with_distance_of(PrimitiveShape shape, const Vec3<N>& size, const DistanceGrid* grid,
                      const F& f, ShapeList<First, Rest...>) {
  if constexpr (sizeof...(Rest) > 0)
    if (shape != First<N>::kShape)
      return with_distance_of<N>(shape, size, grid, f, ShapeList<Rest...>{});
  if constexpr (First<N>::kShape == PrimitiveShape::mesh) {
    return f(First<N>::of(size, grid));
  } else {
    return f(First<N>::of(size));
  }
}
/// Calls f with the distance of a shape. `size` is as in PairContact. `grid`: of a mesh.
template <class N, class F>
auto with_distance(PrimitiveShape shape, const Vec3<N>& size, const F& f,
                   const DistanceGrid* grid = nullptr) {
  return with_distance_of<N>(shape, size, grid, f, Shapes{});
}
/// The same with one size for every lane.
template <class N, class F>
requires(!std::is_same_v<N, double>) auto with_distance(PrimitiveShape shape,
                                                        const Vec3<double>& size, const F& f,
                                                        const DistanceGrid* grid = nullptr) {
  return with_distance<N>(shape, broadcast<N>(size), f, grid);
}

/// Returns value and gradient alone.
template <class Shape, class N>
Distance<N> distance_at(const Shape& shape, const Vec3<N>& y) {
  N curvature, straight;
  if constexpr (Shape::kBending == Bending::general) {
    return shape.evaluate(y);
  } else if constexpr (Shape::kBending == Bending::rod) {
    return shape.evaluate(y, curvature, straight);
  } else {
    return shape.evaluate(y, curvature);
  }
}

/// Returns f<Pad>() for the Pad of every shape, in the order of PrimitiveShape.
template <class P, class F, template <class> class... S>
constexpr auto per_pad(const F& f, ShapeList<S...>) {
  return std::array{f.template operator()<typename S<double>::template Pad<P>>()...};
}

/// Whether a shape is invariant under rotations.
inline bool is_ball(PrimitiveShape shape) {
  return with_distance<double>(shape, Vec3<double>{1, 1, 1}, []<class Shape>(const Shape&) {
    return Shape::kBending == Bending::ball;
  });
}

}  // namespace tangere::kernels
