// SPDX-License-Identifier: Apache-2.0
// How deep a shape's underside is below a point of a pad, along the pad's outward normal o
// (docs/layer.md). For a point ξ inside the shape, δ > 0 is the root of φ(δ) = d(ξ - δ o), with
// the distance d and its gradient n. The surface there moves by u against the pad. So
//   δ̇ = n·u/φ',  φ' = -n·o,   depth = δ + τ δ̇,   slant = n/φ'
// where slant is the force on the pad's body by a pressing force of 1 N without friction.
//
// Where the layer is the contact, no depth may jump as the shape moves, or energy would not be
// kept. At a steep side a point would fall off at once, and beside a press the gel bulges, so that
// points press before they are inside the shape. There
//   δ = min(δ, -c d(ξ)) inside, -d(ξ) outside;   depth = δ + τ δ̇ max(0, min(1, δ/δ₀))
// and -c d(ξ) has the slant c n(ξ) and acts at ξ.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/model/compiled_layer.hpp"
#include "kernels/contact/distance.hpp"
#include "kernels/tactile/tactile_types.hpp"

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

/// c, and δ₀ by the thickness.
inline constexpr double kSteepest = 3, kFading = 0.1;

/// Which surface of a shape determines the depth at a point.
enum class DepthBy : std::uint8_t {
  underside,
  end,   ///< the shape goes on below the layer, or the depths of a table
  side,  ///< -c d(ξ)
  gap,   ///< -d(ξ), outside
};
struct KnownDepth {
  double depth;  ///< δ [m]
  DepthBy by;
};

/// Returns the factor of δ̇ at a depth δ [s].
template <class N>
N relaxation_at(const CompiledLayer& layer, const N& depth) {
  const N whole(layer.relaxation);
  if (!layer.feedback) return whole;
  const N share = depth * N(1 / (kFading * layer.grid.thickness));
  return share < N(0.0) ? N(0.0) : share < N(1.0) ? whole * share : whole;
}

/// A depth of a contact, and the distance with its gradient where it ends, shape axes.
struct ContactDepth {
  KnownDepth known;
  kernels::Distance<double> found;
};

/// Finds δ of a point ξ = `start` of a layer that is the contact, with -o = `down`, both in the
/// axes of a convex shape; none where the point is farther than the bulge. The distance is convex
/// along the normal. So the root of its tangent at ξ is below the shape's underside, and Newton's
/// method descends to the underside from there.
template <class Shape>
std::optional<ContactDepth> find_contact_depth(const Shape& shape,
                                               const kernels::Vec3<double>& start,
                                               const kernels::Vec3<double>& down, double bulge) {
  const kernels::Distance<double> at = distance_at(shape, start);
  if (!(at.d < 0)) {
    if (!(at.d < bulge)) return std::nullopt;
    return ContactDepth{{-at.d, DepthBy::gap}, at};
  }
  const double most = -kSteepest * at.d, slope = dot(at.n, down);
  double depth = slope * most > -at.d ? -at.d / slope : most;
  kernels::Distance<double> found = at;
  for (int step = 0; step < 50; ++step) {
    found = distance_at(shape, start + depth * down);
    if (depth == most && found.d < 0) return ContactDepth{{most, DepthBy::side}, at};
    if (step == 0 && found.d < -kClose * depth) {  // a distance that is not quite convex
      depth = most;
      continue;
    }
    const double next = depth - found.d / dot(found.n, down);
    if (std::abs(found.d) <= kClose * depth || !(next < depth && next > 0)) break;
    depth = next;
  }
  return ContactDepth{{depth, DepthBy::underside}, found};
}

/// Returns a place of the pad in the axes of a shape, and the direction into the pad.
inline kernels::Vec3<double> in_shape(const kernels::Touch<double>& t,
                                      const kernels::Vec3<double>& place) {
  return transposed_times(t.Q, place - t.c);
}
inline kernels::Vec3<double> down_in_shape(const kernels::Touch<double>& t, double outward) {
  return transposed_times(t.Q, kernels::Vec3<double>{0, 0, -outward});
}

/// Finds δ of a point; none where the point is outside the shape, or farther than the bulge. The
/// shapes of a contact are convex.
template <class Shape>
std::optional<KnownDepth> find_depth(const Shape& shape, const kernels::Touch<double>& t,
                                     const kernels::Vec3<double>& xi, const CompiledLayer& layer) {
  if (layer.feedback) {
    const auto found =
        find_contact_depth(shape, in_shape(t, xi), down_in_shape(t, layer.outward), layer.bulge());
    return found ? std::optional(found->known) : std::nullopt;
  }
  const auto found = find_underside(shape, t, xi, layer.outward, layer.deepest);
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

/// Returns depth and slant at a point whose δ is known. With dual numbers their derivatives follow
/// from one more step of Newton's method. δ does not change with a shape that goes on below.
template <class Shape, class N>
LayerDepth<N> layer_depth(const Shape& shape, const kernels::Touch<N>& t,
                          const kernels::Vec3<double>& xi, const CompiledLayer& layer,
                          const KnownDepth& known) {
  const N outward(layer.outward);
  const auto below = [&](const N& depth) {
    return kernels::Vec3<N>{N(xi.x), N(xi.y), N(xi.z) - outward * depth};
  };
  if (known.by == DepthBy::end) {
    const N depth(known.depth);
    return {depth, {N(0.0), N(0.0), -outward}, below(depth)};
  }
  LayerDepth<N> out;
  N depth;
  if (known.by != DepthBy::underside) {
    out.place = below(N(0.0));
    const N slope(known.by == DepthBy::side ? kSteepest : 1);
    const kernels::Distance<N> found = distance_in_pad(shape, t, out.place);
    depth = -slope * found.d;
    out.slant = slope * found.n;
  } else {
    out = underside_at(shape, t, xi, outward, known.depth);
    depth = out.depth;
  }
  out.depth = depth + relaxation_at(layer, depth) * dot(out.slant, t.v + cross(t.omega, out.place));
  return out;
}

/// Depth and slant of a point of a contact, and by which surface.
struct DepthOfContact {
  KnownDepth known;
  LayerDepth<double> at;
};

/// Finds δ of a point of a contact, and depth and slant there, as find_depth() and layer_depth() do
/// one after the other. `down`: of down_in_shape().
template <class Shape>
std::optional<DepthOfContact> contact_depth(const Shape& shape, const kernels::Touch<double>& t,
                                            const kernels::Vec3<double>& xi,
                                            const CompiledLayer& layer,
                                            const kernels::Vec3<double>& down) {
  const kernels::Vec3<double> start = in_shape(t, xi);
  std::optional<ContactDepth> found = find_contact_depth(shape, start, down, layer.bulge());
  if (!found) return std::nullopt;
  DepthOfContact out{found->known, {}};
  double depth = found->known.depth, scale = found->known.by == DepthBy::side ? kSteepest : 1;
  if (found->known.by == DepthBy::underside) {
    depth -= found->found.d / dot(found->found.n, down);
    found->found = distance_at(shape, start + depth * down);
    scale = 1 / dot(found->found.n, down);
    out.at.place = {xi.x, xi.y, xi.z - layer.outward * depth};
  } else {
    out.at.place = xi;
  }
  out.at.slant = scale * (t.Q * found->found.n);
  out.at.depth =
      depth + relaxation_at(layer, depth) * dot(out.at.slant, t.v + cross(t.omega, out.at.place));
  return out;
}

}  // namespace tangere
