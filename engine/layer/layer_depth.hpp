// SPDX-License-Identifier: Apache-2.0
// How deep a shape's underside is below a point of a pad, along the pad's outward normal o
// (docs/layer.md). For a point ξ inside the shape, δ > 0 is the root of φ(δ) = d(ξ - δ o), with
// the distance d and its gradient n. The surface there moves by u against the pad. So
//   δ̇ = n·u/φ',  φ' = -n·o,   depth = δ + τ δ̇,   slant = n/φ'
// where slant is the force on the pad's body by a pressing force of 1 N without friction.
//
// A layer that is the contact has the depths of kernels/layer/contact_depth.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/model/compiled_layer.hpp"
#include "kernels/layer/contact_depth.hpp"

namespace tangere {

using kernels::DepthBy;
using kernels::LayerDepth;

/// Returns d and its gradient in pad axes at a place in pad axes.
template <class Shape, class N>
kernels::Distance<N> distance_in_pad(const Shape& shape, const kernels::Touch<N>& t,
                                     const kernels::Vec3<N>& at) {
  kernels::Distance<N> found = distance_at(shape, transposed_times(t.Q, at - t.c));
  found.n = t.Q * found.n;
  return found;
}

/// Distance at which find_underside() begins Newton's method, by the largest depth. It ends at
/// kClose: layer_depth() takes one more step.
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
    if (std::abs(found.d) <= kernels::kClose * depth) break;
    (found.d > 0 ? high : low) = depth;
    double next = depth - found.d / (-outward * found.n.z);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == depth) break;
    depth = next;
  }
  return depth;
}

/// Returns δ < 0 of a point outside of a convex shape that is above it by less than `reach`, else
/// none. The distance is convex along the normal, so Newton's method rises to the underside.
template <class Shape>
std::optional<double> find_underside_above(const Shape& shape, const kernels::Touch<double>& t,
                                           const kernels::Vec3<double>& xi, double outward,
                                           double reach) {
  double depth = 0;
  for (int step = 0; step < 100; ++step) {
    const kernels::Distance<double> found =
        distance_in_pad(shape, t, {xi.x, xi.y, xi.z - outward * depth});
    const double slope = -outward * found.n.z;
    if (!(found.d < reach + depth && slope > 0)) return std::nullopt;
    if (std::abs(found.d) <= kernels::kClose * reach) break;
    depth = std::min(0.0, depth - found.d / slope);
    if (!(depth > -reach)) return std::nullopt;
  }
  return depth;
}

/// δ₀ by the thickness.
inline constexpr double kFading = 0.1;

struct KnownDepth {
  double depth;  ///< δ [m]
  DepthBy by;
};

/// Returns the law of a layer that is the contact.
inline kernels::LayerLaw contact_law(const CompiledLayer& layer) {
  return {double(layer.outward), layer.bulge(), layer.relaxation, kFading * layer.grid.thickness};
}

/// Returns the factor of δ̇ at a depth δ [s]; of a contact as fading_relaxation(), for a layer of
/// this thickness.
template <class N>
N relaxation_at(const CompiledLayer& layer, const N& depth, const N& thickness) {
  if (!layer.feedback) return N(layer.relaxation);
  const N share = depth * (N(1.0) / (N(kFading) * thickness));
  using kernels::max, kernels::min;
  return N(layer.relaxation) * min(max(share, N(0.0)), N(1.0));
}

/// Finds δ of a point; none where the point is outside the shape, or farther than the bulge. The
/// shapes of a contact are convex. `above`: under load control, how far above the surface a convex
/// shape may be [m].
template <class Shape>
std::optional<KnownDepth> find_depth(const Shape& shape, const kernels::Touch<double>& t,
                                     const kernels::Vec3<double>& xi, const CompiledLayer& layer,
                                     double above = 0) {
  if (layer.feedback) {
    const kernels::ContactDepth<double> found =
        contact_depth(shape, t, xi, contact_law(layer), kernels::down_in_shape(t, layer.outward));
    if (!(found.touches > 0)) return std::nullopt;
    return KnownDepth{found.known, static_cast<DepthBy>(found.by)};
  }
  auto found = find_underside(shape, t, xi, layer.outward, layer.deepest);
  if (!found && above > 0) found = find_underside_above(shape, t, xi, layer.outward, above);
  if (!found) return std::nullopt;
  return KnownDepth{*found, *found < layer.deepest ? DepthBy::underside : DepthBy::end};
}

/// Returns δ and its slant at a point whose underside has the depth `known`. With dual numbers
/// their derivatives follow from one more step of Newton's method.
template <class Shape, class N>
LayerDepth<N> underside_at(const Shape& shape, const kernels::Touch<N>& t,
                           const kernels::Vec3<double>& xi, const N& outward, double known) {
  const auto below = [&](const N& depth) {
    return kernels::Vec3<N>{N(xi.x), N(xi.y), N(xi.z) - outward * depth};
  };
  LayerDepth<N> out;
  const kernels::Distance<N> first = distance_in_pad(shape, t, below(N(known)));
  out.depth = N(known) - first.d / (-outward * first.n.z);
  out.place = below(out.depth);
  const kernels::Distance<N> found = distance_in_pad(shape, t, out.place);
  const N inverse = N(1.0) / (-outward * found.n.z);
  out.slant = inverse * found.n;
  return out;
}

/// Returns depth and slant at a point whose δ is known, on a layer of this thickness. With dual
/// numbers their derivatives follow from one more step of Newton's method. Where a shape goes on
/// below, δ is the thickness.
template <class Shape, class N>
LayerDepth<N> layer_depth(const Shape& shape, const kernels::Touch<N>& t,
                          const kernels::Vec3<double>& xi, const CompiledLayer& layer,
                          const KnownDepth& known, const N& thickness) {
  const N outward(layer.outward);
  const auto below = [&](const N& depth) {
    return kernels::Vec3<N>{N(xi.x), N(xi.y), N(xi.z) - outward * depth};
  };
  if (known.by == DepthBy::end) {
    const N depth = layer.table ? N(known.depth) : thickness;
    return {depth, {N(0.0), N(0.0), -outward}, below(depth)};
  }
  LayerDepth<N> out;
  N depth;
  if (known.by != DepthBy::underside) {
    out.place = below(N(0.0));
    const N slope(known.by == DepthBy::side ? kernels::kSteepest : 1);
    const kernels::Distance<N> found = distance_in_pad(shape, t, out.place);
    depth = -slope * found.d;
    out.slant = slope * found.n;
  } else {
    out = underside_at(shape, t, xi, outward, known.depth);
    depth = out.depth;
  }
  out.depth = depth + relaxation_at(layer, depth, thickness) *
                          dot(out.slant, t.v + cross(t.omega, out.place));
  return out;
}

}  // namespace tangere
