// SPDX-License-Identifier: Apache-2.0
// Tactile fields of many environments with a small, flat pad. Each environment has one lane, and
// the points of a tile follow one another.
//
// The arithmetic is the same as across points, lane by lane, so an environment has the same bits
// either way.
#pragma once

#include "kernels/tactile/tactile.hpp"

namespace tangere::kernels {

/// Loads eight environments in double, or rounds two groups of eight to single precision.
template <class P, class Pick>
typename P::N lanes_of(const Touch<LaneRow>* touch, const Pick& pick) {
  using Arch = typename P::Architecture;
  if constexpr (P::kSingle) {
    return narrow(load_lanes<Arch>(pick(touch[0]).lane), load_lanes<Arch>(pick(touch[1]).lane));
  } else {
    return load_lanes<Arch>(pick(touch[0]).lane);
  }
}

template <class P>
Vec3<typename P::N> lanes_of(const Touch<LaneRow>* touch, Vec3<LaneRow> Touch<LaneRow>::*v) {
  return {lanes_of<P>(touch, [v](const auto& t) -> const LaneRow& { return (t.*v).x; }),
          lanes_of<P>(touch, [v](const auto& t) -> const LaneRow& { return (t.*v).y; }),
          lanes_of<P>(touch, [v](const auto& t) -> const LaneRow& { return (t.*v).z; })};
}

template <class P>
PointLaw<typename P::N> point_law(const Touch<LaneRow>* touch) {
  using N = typename P::N;
  const auto one = [&](std::size_t k) {
    return lanes_of<P>(touch, [k](const auto& t) -> const LaneRow& { return t.law[k]; });
  };
  return {lanes_of<P>(touch, &Touch<LaneRow>::omega), N(0.0) - one(0), one(1), one(2), one(3)};
}

/// Computes the brackets of one tile in every environment. Returns false where the tile is out of
/// reach in all of them.
template <class P, class Shape>
bool lane_brackets(const PadTiles& pad, int tile, const TouchShape& s, const Touch<LaneRow>* touch,
                   Shape& shape) {
  using Arch = typename P::Architecture;
  using D = Lanes<Arch>;
  constexpr int kGroups = P::kLanes / kGroup;
  const Vec3<D> t = {D(pad.x[tile]), D(pad.y[tile]), D(pad.z[tile])};
  const D reach(pad.radius[tile]);
  D row[kGroups][kBracketRows];
  bool near = false;
  for (int g = 0; g < kGroups; ++g) {
    const auto& at = reinterpret_cast<const Touch<D>&>(touch[g]);
    near |= any(Shape::bracket(s, at, t, reach, row[g]) < D(0.0));
    const Vec3<D> u = tile_velocity(at, t);
    row[g][Shape::kRows - 3] = u.x, row[g][Shape::kRows - 2] = u.y, row[g][Shape::kRows - 1] = u.z;
  }
  if (!near) return false;
  typename P::N narrowed[Shape::kRows];
  for (int i = 0; i < Shape::kRows; ++i) {
    if constexpr (P::kSingle) {
      narrowed[i] = narrow(row[0][i], row[1][i]);
    } else {
      narrowed[i] = row[0][i];
    }
  }
  shape.set(narrowed);
  shape.u = {narrowed[Shape::kRows - 3], narrowed[Shape::kRows - 2], narrowed[Shape::kRows - 1]};
  return true;
}

/// Computes one shape on one tile. `out`, (64, components) lanes, is written whole when `fresh` and
/// something touches, else added to.
template <class P, ContactLaw Law, class Shape>
bool tile_lanes(const TactileBlockArgs<typename P::Real>& a, int tile, int k, bool fresh,
                typename P::N* out) {
  using N = typename P::N;
  const PadTiles& pad = *a.pad;
  const Touch<LaneRow>* touch = a.touches[k];
  Mat3<N> pose;
  if constexpr (Shape::kTurns)
    for (int i = 0; i < 9; ++i)
      pose.m[i / 3][i % 3] =
          lanes_of<P>(touch, [i](const auto& t) -> const LaneRow& { return t.Q.m[i / 3][i % 3]; });
  Shape shape(a.shapes[k], pose);
  if (!lane_brackets<P>(pad, tile, a.shapes[k], touch, shape)) return false;
  const PointLaw<N> law = point_law<P>(touch);
  const auto* offsets = P::offsets(pad) + 2 * kTactileTile * pad.kind[tile];
  const int rows = pad.rows_of(tile), cols = pad.cols_of(tile);
  bool touched = false;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const int at = i * kTileSide + j;
      Vec3<N> f;
      const bool here = point_force<P, Law>(
          shape, law, {N(double(offsets[at])), N(double(offsets[kTactileTile + at]))}, f);
      touched |= here;
      if (!here) {
        if (!fresh) continue;
        f = zero3<N>();
      } else if (pad.skewed) {
        f = in_skewed_axes(pad.axes, f);
      }
      N* to = out + P::kComponents * at;
      for (int c = 0; c < P::kComponents; ++c)
        to[c] = fresh ? stored<P>(f, c) : to[c] + stored<P>(f, c);
    }
  return touched;
}

/// Writes (64, components) lanes to rows of (point, components) in the array of each lane.
template <class P>
void write_lanes(const TactileBlockArgs<typename P::Real>& a, int tile, const typename P::N* from) {
  const PadTiles& pad = *a.pad;
  constexpr int kC = P::kComponents;
  const int rows = pad.rows_of(tile), numbers = kC * pad.cols_of(tile);
  const auto* values = reinterpret_cast<const typename P::Real*>(from);
  for (int l = 0; l < P::kLanes; ++l) {
    if (a.dense[l] == nullptr) continue;
    auto* to = a.dense[l] + kC * pad.first_of(tile);
    for (int i = 0; i < rows; ++i, to += kC * pad.cols)
      for (int j = 0; j < numbers; ++j) to[j] = values[(kC * kTileSide * i + j) * P::kLanes + l];
  }
}

template <class P>
NearShapes near_shapes(const TactileBlockArgs<typename P::Real>& a) {
  using D = Lanes<typename P::Architecture>;
  static constexpr auto kNear = per_shape<P>([]<class Shape>() { return &near_pad<P, Shape, D>; });
  NearShapes near = 0;
  for (int k = 0; k < a.n_touches && k < 64; ++k)
    for (int g = 0; g < P::kLanes / kGroup; ++g) {
      const bool here = kNear[std::size_t(a.shapes[k].shape)](
          *a.pad, a.shapes[k], reinterpret_cast<const Touch<D>&>(a.touches[k][g]));
      near |= NearShapes(here) << k;
    }
  return near;
}

template <class P, ContactLaw Law>
void tactile_block(const TactileBlockArgs<typename P::Real>& a) {
  static constexpr auto kForce =
      per_shape<P>([]<class Shape>() { return &tile_lanes<P, Law, Shape>; });
  const NearShapes near = near_shapes<P>(a);
  if (near == 0 && a.n_touches <= 64) return;
  typename P::N buffer[P::kComponents * kTactileTile];
  for (int tile = 0; tile < a.pad->tiles(); ++tile) {
    bool written = false;
    for (int k = 0; k < a.n_touches; ++k)
      if (may_touch(near, k))
        written |= kForce[std::size_t(a.shapes[k].shape)](a, tile, k, !written, buffer);
    if (written) write_lanes<P>(a, tile, buffer);
  }
}

template <class P>
void tactile_block_of(const TactileBlockArgs<typename P::Real>& a) {
  if (a.law == ContactLaw::paper) {
    tactile_block<P, ContactLaw::paper>(a);
  } else {
    tactile_block<P, ContactLaw::clamped>(a);
  }
}

template <class P>
void any_block(const TactileBlockArgs<typename P::Real>& a) {
  if (a.pressure) {
    tactile_block_of<PressureAlone<P>>(a);
  } else {
    tactile_block_of<P>(a);
  }
}

}  // namespace tangere::kernels
