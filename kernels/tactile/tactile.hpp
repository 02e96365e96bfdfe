// SPDX-License-Identifier: Apache-2.0
// Tactile field of one environment: first the brackets of eight tiles at a time, then the points of
// the tiles within reach.
#pragma once

#include <cstdint>

#include "kernels/contact/distance.hpp"
#include "kernels/tactile/tactile_point.hpp"
#include "kernels/tactile/vector_pair.hpp"

namespace tangere::kernels {

/// Brackets of eight tiles, one column each, and how near they are.
template <class Real>
struct TileChunk {
  alignas(64) Real row[kBracketRows][kGroup];
  alignas(64) double gap[kGroup];  ///< < 0: within reach
};

template <class Real, class D>
void store_row(const D& x, Real* out) {
  alignas(64) double wide[kGroup];
  store_lanes(x, wide);
  for (int l = 0; l < kGroup; ++l) out[l] = static_cast<Real>(wide[l]);
}

/// Returns false where none of the eight tiles is within reach; then the rows are not written.
template <class P, class Shape>
bool chunk_brackets(const PadTiles& pad, int first, const TouchShape& shape,
                    const Touch<Lanes<typename P::Architecture>>& at,
                    TileChunk<typename P::Real>& out) {
  using Arch = typename P::Architecture;
  using D = Lanes<Arch>;
  const Vec3<D> t = {load_lanes<Arch>(pad.x + first), load_lanes<Arch>(pad.y + first),
                     load_lanes<Arch>(pad.z + first)};
  D row[kBracketRows];
  const D gap = Shape::bracket(shape, at, t, load_lanes<Arch>(pad.radius + first), row);
  if (!any(gap < D(0.0))) return false;
  store_lanes(gap, out.gap);
  const Vec3<D> u = tile_velocity(at, t);
  row[Shape::kRows - 3] = u.x, row[Shape::kRows - 2] = u.y, row[Shape::kRows - 1] = u.z;
  for (int i = 0; i < Shape::kRows; ++i) store_row(row[i], out.row[i]);
  return true;
}

template <class N>
Touch<N> broadcast_touch(const Touch<double>& t) {
  return {broadcast<N>(t.Q), broadcast<N>(t.c), broadcast<N>(t.omega), broadcast<N>(t.v),
          transformed(t.law, [](double a) { return N(a); })};
}
template <class N>
PointLaw<N> point_law(const Touch<double>& t) {
  return {broadcast<N>(t.omega), N(-t.law.kn), N(t.law.kt), N(t.law.mu), N(t.law.damping)};
}

/// Returns the points of a tile from k on. `offsets`: (2 or 3, 64).
template <class P>
typename P::Offset load_offset(const typename P::Real* offsets, int k) {
  if constexpr (P::kCurved) {
    return {P::load(offsets + k), P::load(offsets + kTactileTile + k),
            P::load(offsets + 2 * kTactileTile + k)};
  } else {
    return {P::load(offsets + k), P::load(offsets + kTactileTile + k)};
  }
}

/// Computes the force on the points of a tile from k on, in the axes in which it is stored. Returns
/// false where nothing touches.
template <class P, ContactLaw Law, class Shape, class N = typename P::N>
bool stored_force(const PadTiles& pad, int tile, int k, const Shape& shape, const PointLaw<N>& law,
                  Vec3<N>& f) {
  constexpr int kWidth = P::kCurved ? 3 : 2;
  const typename P::Offset s =
      load_offset<P>(P::offsets(pad) + kWidth * kTactileTile * pad.kind[tile], k);
  if constexpr (P::kCurved) {
    const bool own = pad.factors != nullptr;
    const auto at =
        own ? scaled_law<P>(law, P::factors(pad) + kPointCoefficients * kTactileTile * tile + k)
            : law;
    if (!point_force<P, Law>(shape, at, s, f)) return false;
    f = in_point_axes<P>(P::frames(pad) + 9 * kTactileTile * tile + k, f);
  } else {
    if (!point_force<P, Law>(shape, law, s, f)) return false;
    if (pad.skewed) f = in_skewed_axes(pad.axes, f);
  }
  return true;
}

/// Returns component c of those that are stored: the third one, where it is the only one.
template <class P, class N>
const N& stored(const Vec3<N>& force, int c) {
  return P::kComponents == 1 ? force.z : (&force.x)[c];
}

/// Computes the points of one tile. `out`, (components, 64), is written whole when `fresh` and
/// something touches, else added to.
template <class P, ContactLaw Law, class Shape>
bool tile_force(const PadTiles& pad, int tile, const Shape& shape,
                const PointLaw<typename P::N>& law, bool fresh, typename P::Real* out) {
  using N = typename P::N;
  bool touched = false;
  for (int k = 0; k < kTactileTile; k += P::kLanes) {
    Vec3<N> f;
    const bool here = stored_force<P, Law>(pad, tile, k, shape, law, f);
    touched |= here;
    if (!here) {
      if (!fresh) continue;
      f = zero3<N>();
    }
    for (int c = 0; c < P::kComponents; ++c) {
      auto* at = out + c * kTactileTile + k;
      const N& x = stored<P>(f, c);
      P::store(fresh ? x : P::load(at) + x, at);
    }
  }
  return touched;
}

/// Adds one shape to eight tiles from `first` on. Returns the bits of all touched tiles, those in
/// `written` included.
template <class P, ContactLaw Law, class Shape>
unsigned chunk_force(const TactileArgs<typename P::Real>& a, int touch, int first, unsigned written,
                     typename P::Real* buffer) {
  using N = typename P::N;
  using D = Lanes<typename P::Architecture>;
  const PadTiles& pad = *a.pad;
  const Touch<double>& at = a.touches[touch];
  TileChunk<typename P::Real> chunk;
  if (!chunk_brackets<P, Shape>(pad, first, a.shapes[touch], broadcast_touch<D>(at), chunk))
    return written;
  Shape shape(a.shapes[touch], broadcast<N>(at.Q));
  const PointLaw<N> law = point_law<N>(at);
  const int count = pad.tiles() - first < kGroup ? pad.tiles() - first : kGroup;
  for (int l = 0; l < count; ++l) {
    if (!(chunk.gap[l] < 0)) continue;
    N row[Shape::kRows];
    for (int i = 0; i < Shape::kRows; ++i) row[i] = N(double(chunk.row[i][l]));
    shape.set(row);
    shape.u = {row[Shape::kRows - 3], row[Shape::kRows - 2], row[Shape::kRows - 1]};
    const bool fresh = ((written >> l) & 1U) == 0;
    if (tile_force<P, Law>(pad, first + l, shape, law, fresh,
                           buffer + P::kComponents * kTactileTile * l))
      written |= 1U << l;
  }
  return written;
}

template <class Real>
struct EightOf;
template <>
struct EightOf<double> {
  typedef double Type __attribute__((vector_size(64)));
};
template <>
struct EightOf<float> {
  typedef float Type __attribute__((vector_size(32)));
};

/// Interleaves x, y, z of eight points to (8, 3) in registers: two shuffles for each third of the
/// result.
template <class Arch, class Real>
void interleave_row(const Real* from, Real* to) {
  using Eight = typename EightOf<Real>::Type;
  Eight x, y, z;
  __builtin_memcpy(&x, from, sizeof x);
  __builtin_memcpy(&y, from + kTactileTile, sizeof y);
  __builtin_memcpy(&z, from + 2 * kTactileTile, sizeof z);
  const Eight xy0 = __builtin_shufflevector(x, y, 0, 8, 0, 1, 9, 1, 2, 10),
              xy1 = __builtin_shufflevector(x, y, 0, 3, 11, 3, 4, 12, 4, 5),
              xy2 = __builtin_shufflevector(x, y, 13, 5, 6, 14, 6, 7, 15, 7);
  const Eight first = __builtin_shufflevector(xy0, z, 0, 1, 8, 3, 4, 9, 6, 7),
              second = __builtin_shufflevector(xy1, z, 10, 1, 2, 11, 4, 5, 12, 7),
              third = __builtin_shufflevector(xy2, z, 0, 13, 2, 3, 14, 5, 6, 15);
  __builtin_memcpy(to, &first, sizeof first);
  __builtin_memcpy(to + 8, &second, sizeof second);
  __builtin_memcpy(to + 16, &third, sizeof third);
}

/// Writes (components, 64) to rows of (point, components) in the array, or to the points' places in
/// a list.
template <class P, class Real>
void write_dense(const PadTiles& pad, int tile, const Real* from, Real* dense) {
  constexpr int kC = P::kComponents;
  if (pad.curved()) {
    const int* index = pad.index + kTactileTile * tile;
    for (int k = 0; k < pad.points_of(tile); ++k)
      for (int c = 0; c < kC; ++c) dense[kC * index[k] + c] = from[c * kTactileTile + k];
    return;
  }
  const int rows = pad.rows_of(tile), cols = pad.cols_of(tile);
  Real* to = dense + kC * pad.first_of(tile);
  for (int i = 0; i < rows; ++i, from += kTileSide, to += kC * pad.cols) {
    if (kC == 3 && cols == kTileSide) {
      interleave_row<typename P::Architecture>(from, to);
      continue;
    }
    for (int j = 0; j < cols; ++j)
      for (int c = 0; c < kC; ++c) to[kC * j + c] = from[c * kTactileTile + j];
  }
}

/// Returns f<Shape>() for every shape. A shape is then chosen once per tile or chunk of tiles.
template <class P, class F>
constexpr auto per_shape(const F& f) {
  return per_pad<P>(f, Shapes{});
}

/// Returns which of eight spheres a shape comes near to.
template <class P, class Shape>
unsigned near_spheres(const double* x, const double* y, const double* z, const double* radius,
                      const TouchShape& shape, const Touch<double>& at) {
  using Arch = typename P::Architecture;
  using D = Lanes<Arch>;
  const Vec3<D> t = {load_lanes<Arch>(x), load_lanes<Arch>(y), load_lanes<Arch>(z)};
  D row[kBracketRows];
  return lane_bits(Shape::bracket(shape, broadcast_touch<D>(at), t, load_lanes<Arch>(radius), row) <
                   D(0.0));
}

/// Whether a shape comes near the sphere around a pad in any lane.
template <class P, class Shape, class D>
bool near_pad(const PadTiles& pad, const TouchShape& shape, const Touch<D>& at) {
  D row[kBracketRows];
  const Vec3<D> middle = {D(pad.middle[0]), D(pad.middle[1]), D(pad.middle[2])};
  return any(Shape::bracket(shape, at, middle, D(pad.reach), row) < D(0.0));
}

/// Whether a shape comes near the spheres around the parts of a pad, which takes as long.
template <class P, class Shape>
bool near_parts(const PadTiles& pad, const TouchShape& shape, const Touch<double>& at) {
  const double* const x = pad.parts;
  return near_spheres<P, Shape>(x, x + kGroup, x + 2 * kGroup, x + 3 * kGroup, shape, at) != 0;
}

/// Returns which of eight spheres around eight tiles each, from sphere `first` on, a shape comes
/// near to.
template <class P, class Shape>
unsigned near_eights(const PadTiles& pad, int first, const TouchShape& shape,
                     const Touch<double>& at) {
  return near_spheres<P, Shape>(pad.eight_x + first, pad.eight_y + first, pad.eight_z + first,
                                pad.eight_radius + first, shape, at);
}

/// Bit k: shape k may touch the pad. From shape 64 on, all may.
using NearShapes = std::uint64_t;
inline bool may_touch(NearShapes near, int k) { return k >= 64 || ((near >> k) & 1U) != 0; }

template <class P>
NearShapes near_shapes(const TactileArgs<typename P::Real>& a) {
  static constexpr auto kNear = per_shape<P>([]<class Shape>() { return &near_parts<P, Shape>; });
  NearShapes near = 0;
  for (int k = 0; k < a.n_touches && k < 64; ++k) {
    const bool here = kNear[std::size_t(a.shapes[k].shape)](*a.pad, a.shapes[k], a.touches[k]);
    near |= NearShapes(here) << k;
  }
  return near;
}

/// Finds the shapes that may touch each group of eight tiles, for 64 tiles at a time.
template <class P>
class NearEights {
 public:
  NearEights(const TactileArgs<typename P::Real>& a, NearShapes near) : a_(a), near_(near) {}

  /// Goes on to the eight tiles from `first` on, a multiple of eight. Returns false where nothing
  /// may touch the 64 tiles that begin there.
  bool move(int first) {
    static constexpr auto kNear =
        per_shape<P>([]<class Shape>() { return &near_eights<P, Shape>; });
    const int eight = first / kGroup;
    bit_ = 1U << (eight % kGroup);
    if (!many_ || eight % kGroup != 0) return true;
    unsigned any = a_.n_touches > 64 ? 1 : 0;
    for (int k = 0; k < a_.n_touches && k < 64; ++k)
      if (may_touch(near_, k))
        any |= eights_[k] =
            kNear[std::size_t(a_.shapes[k].shape)](*a_.pad, eight, a_.shapes[k], a_.touches[k]);
    return any != 0;
  }
  [[nodiscard]] bool has(int k) const {
    return may_touch(near_, k) && (!many_ || k >= 64 || (eights_[k] & bit_) != 0);
  }

 private:
  const TactileArgs<typename P::Real>& a_;
  NearShapes near_;
  bool many_ = a_.pad->tiles() > 2 * kGroup;  // else the test costs as much as it saves
  unsigned bit_ = 0;
  unsigned eights_[64];
};

template <class P, ContactLaw Law>
int tactile_field(const TactileArgs<typename P::Real>& a) {
  using Real = typename P::Real;
  static constexpr auto kForce =
      per_shape<P>([]<class Shape>() { return &chunk_force<P, Law, Shape>; });
  const NearShapes near = near_shapes<P>(a);
  if (near == 0 && a.n_touches <= 64) return 0;
  NearEights<P> eights(a, near);
  constexpr int kNumbers = P::kComponents * kTactileTile;  // of a tile
  alignas(64) Real buffer[kGroup * kNumbers];
  int count = 0;
  for (int first = 0; first < a.pad->tiles(); first += kGroup) {
    unsigned written = 0;
    if (!eights.move(first)) {
      first += (kGroup - 1) * kGroup;
      continue;
    }
    for (int k = 0; k < a.n_touches; ++k)
      if (eights.has(k))
        written = kForce[std::size_t(a.shapes[k].shape)](a, k, first, written, buffer);
    for (int l = 0; written != 0; ++l, written >>= 1) {
      if ((written & 1U) == 0) continue;
      const Real* tile = buffer + kNumbers * l;
      if (a.values != nullptr)
        for (int i = 0; i < kNumbers; ++i) a.values[kNumbers * count + i] = tile[i];
      if (a.dense != nullptr) write_dense<P>(*a.pad, first + l, tile, a.dense);
      a.active[count++] = first + l;
    }
  }
  return count;
}

template <class P>
int tactile_field_of(const TactileArgs<typename P::Real>& a) {
  return a.law == ContactLaw::paper ? tactile_field<P, ContactLaw::paper>(a)
                                    : tactile_field<P, ContactLaw::clamped>(a);
}

/// Returns the number of tiles that something touches.
template <class P>
int any_field(const TactileArgs<typename P::Real>& a) {
  using Curved = OnCurvedPad<P>;
  using Flat = AcrossPoints<P>;
  if (a.pad->curved())
    return a.pressure ? tactile_field_of<PressureAlone<Curved>>(a) : tactile_field_of<Curved>(a);
  return a.pressure ? tactile_field_of<PressureAlone<Flat>>(a) : tactile_field_of<Flat>(a);
}

}  // namespace tangere::kernels
