// SPDX-License-Identifier: Apache-2.0
// Depth of a convex shape at a point of a layer that is the contact (docs/layer.md). For a point ξ
// inside the shape the underside is at the root δ > 0 of φ(δ) = d(ξ - δ o), with the distance d and
// its gradient n; φ' = -n·o. The surface there moves by u against the pad. So
//   δ̇ = n·u/φ',   slant = n/φ'
// No depth may jump as the shape moves, or energy would not be kept. At a steep side a point would
// fall off at once, and beside a press the gel bulges, so that points press before they are inside
// the shape:
//   δ = min(δ, -c d(ξ)) inside, -d(ξ) outside;   depth = δ + τ δ̇ max(0, min(1, δ/δ₀))
// and -c d(ξ) has the slant c n(ξ) and acts at ξ.
#pragma once

#include "kernels/contact/distance.hpp"
#include "kernels/layer/layer_types.hpp"

namespace tangere::kernels {

/// Distance at which the search of an underside ends, by δ.
inline constexpr double kClose = 1e-10;
/// c
inline constexpr double kSteepest = 3;

/// Returns τ max(0, min(1, δ/δ₀)).
template <class N>
N fading_relaxation(const LayerLaw& law, const N& depth) {
  const N share = min(max(depth * N(1 / law.fading), N(0.0)), N(1.0));
  return N(law.relaxation) * share;
}

template <class N>
struct ContactDepth {
  N touches;    ///< 1 where the shape is nearer than the bulge, else 0
  N known, by;  ///< as in LayerPoint
  LayerDepth<N> at;
};

/// Returns a direction of the pad in the axes of a shape: -o.
template <class N>
Vec3<N> down_in_shape(const Touch<N>& t, double outward) {
  return transposed_times(t.Q, Vec3<N>{N(0.0), N(0.0), N(-outward)});
}

/// Finds the depth at ξ. The distance is convex along the normal. So the root of its tangent at ξ
/// is below the shape's underside, and Newton's method descends to the underside from there.
/// `down`: of down_in_shape().
template <class Shape, class N>
ContactDepth<N> contact_depth(const Shape& shape, const Touch<N>& t, const Vec3<N>& xi,
                              const LayerLaw& law, const Vec3<N>& down) {
  const N zero(0.0), one(1.0), side(double(DepthBy::side)), gap(double(DepthBy::gap));
  ContactDepth<N> out;
  const Vec3<N> start = transposed_times(t.Q, xi - t.c);
  const Distance<N> at = distance_at(shape, start);
  out.touches = select(at.d < N(law.bulge), one, zero);
  out.known = -at.d;
  out.by = select(at.d < zero, zero, gap);
  Vec3<N> n = at.n, place = xi;
  N scale = one;
  N running = select(at.d < zero, one, zero);
  if (any(running > zero)) {
    const N most = N(-kSteepest) * at.d, slope = dot(at.n, down);
    N depth = select(slope * most > -at.d, -at.d / slope, most);
    Distance<N> found = at;
    for (int step = 0; step < 50 && any(running > zero); ++step) {
      const Distance<N> here = distance_at(shape, mul_add(depth, down, start));
      const auto now = running > zero;
      found.d = select(now, here.d, found.d);
      found.n = select(now, here.n, found.n);
      const auto sideways = now & (depth >= most) & (here.d < zero);
      out.by = select(sideways, side, out.by);
      running = select(sideways, zero, running);
      const N change = here.d / dot(here.n, down), next = depth - change;
      if (step == 0) {  // a distance that is not quite convex begins again from the most
        const auto above = (running > zero) & (here.d < N(-kClose) * depth);
        const auto on =
            (running > zero) & (abs(here.d) > N(kClose) * depth) & (next < depth) & (next > zero);
        running = select(above, one, select(on, one, zero));
        depth = select(above, most, select(on, next, depth));
        continue;
      }
      const auto on =
          (running > zero) & (abs(here.d) > N(kClose) * depth) & (next < depth) & (next > zero);
      running = select(on, one, zero);
      depth = select(on, next, depth);
    }
    // One more step, and the gradient there.
    const auto under = out.by < N(0.5);
    const N last = depth - found.d / dot(found.n, down);
    const Distance<N> end = distance_at(shape, mul_add(last, down, start));
    const auto sideways = (out.by > N(1.5)) & (out.by < N(2.5));
    out.known = select(under, depth, select(sideways, most, out.known));
    n = select(under, end.n, n);
    scale = select(under, one / dot(end.n, down), select(sideways, N(kSteepest), one));
    place.z = select(under, xi.z - N(law.outward) * last, place.z);
    depth = select(under, last, out.known);
    out.at.depth = depth;
  } else {
    out.at.depth = out.known;
  }
  out.at.place = place;
  out.at.slant = scale * (t.Q * n);
  out.at.depth = mul_add(fading_relaxation(law, out.at.depth),
                         dot(out.at.slant, t.v + cross(t.omega, place)), out.at.depth);
  return out;
}

}  // namespace tangere::kernels
