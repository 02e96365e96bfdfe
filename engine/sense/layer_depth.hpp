// SPDX-License-Identifier: Apache-2.0
// How deep a shape's underside is below a point of a pad, along the pad's outward normal o
// (docs/layer.md). For a point ξ inside the shape, δ > 0 is the root of φ(δ) = d(ξ - δ o), with
// the distance d and its gradient n. The surface there moves by u against the pad. So
//   δ̇ = n·u/φ',  φ' = -n·o,   depth = δ + τ δ̇,   slant = n/φ'
// where slant is the force on the pad's body by a pressing force of 1 N without friction.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "kernels/contact/distance.hpp"

namespace tangere {

template <class N>
struct LayerDepth {
  N depth;                 ///< δ + τ δ̇ [m]
  kernels::Vec3<N> slant;  ///< pad axes
  kernels::Vec3<N> place;  ///< ξ - δ o, pad axes [m]
};

/// Returns d and its gradient in pad axes at a place in pad axes.
template <class Shape, class N>
kernels::Distance<N> distance_in_pad(const Shape& shape, const kernels::Touch<N>& t,
                                     const kernels::Vec3<N>& at) {
  kernels::Distance<N> found = distance_at(shape, transposed_times(t.Q, at - t.c));
  found.n = t.Q * found.n;
  return found;
}

/// Distance at which find_underside() ends, by δ: layer_depth() takes one more step.
inline constexpr double kClose = 1e-10;
/// Distance at which it begins Newton's method, by the largest depth.
inline constexpr double kNearby = 0.02;

/// Returns δ of a point of the pad's plane z = 0, o = (0, 0, outward), at most `deepest`: δ where
/// the shape goes on below. None where the point is outside the shape. The lowest surface of
/// several counts: steps of the distance lead to it from below, then Newton's method between
/// bounds.
template <class Shape>
std::optional<double> find_underside(const Shape& shape, const kernels::Touch<double>& t,
                                     const kernels::Vec3<double>& xi, double outward,
                                     double deepest) {
  const auto at = [&](double depth) {
    return distance_in_pad(shape, t, {xi.x, xi.y, xi.z - outward * depth});
  };
  if (!(at(0).d < 0)) return std::nullopt;
  double low = 0, high = deepest, depth = deepest;
  for (int step = 0; step < 100; ++step) {
    const double d = at(depth).d;
    if (depth == deepest && d < 0) return deepest;
    if (!(d > kNearby * deepest)) break;
    high = depth;
    depth = std::max(low, depth - d);
  }
  for (int step = 0; step < 200; ++step) {
    const kernels::Distance<double> found = at(depth);
    if (std::abs(found.d) <= kClose * depth) break;
    (found.d > 0 ? high : low) = depth;
    double next = depth - found.d / (-outward * found.n.z);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == depth) break;
    depth = next;
  }
  return depth;
}

/// Returns what stands for a shape that goes on below the layer: δ does not change with it.
template <class N>
LayerDepth<N> deepest_depth(const kernels::Vec3<double>& xi, double outward, double deepest) {
  return {
      N(deepest), {N(0.0), N(0.0), N(-outward)}, {N(xi.x), N(xi.y), N(xi.z - outward * deepest)}};
}

/// Returns depth and slant at a point whose δ is known. With dual numbers their derivatives follow
/// from one more step of Newton's method.
template <class Shape, class N>
LayerDepth<N> layer_depth(const Shape& shape, const kernels::Touch<N>& t,
                          const kernels::Vec3<double>& xi, double outward, double known,
                          double relaxation) {
  const auto below = [&](const N& depth) {
    return kernels::Vec3<N>{N(xi.x), N(xi.y), N(xi.z) - N(outward) * depth};
  };
  const kernels::Distance<N> first = distance_in_pad(shape, t, below(N(known)));
  const N depth = N(known) - first.d / (N(-outward) * first.n.z);
  LayerDepth<N> out;
  out.place = below(depth);
  const kernels::Distance<N> found = distance_in_pad(shape, t, out.place);
  const N inverse = N(1.0) / (N(-outward) * found.n.z);
  out.slant = inverse * found.n;
  out.depth = depth + N(relaxation) * dot(out.slant, t.v + cross(t.omega, out.place));
  return out;
}

}  // namespace tangere
