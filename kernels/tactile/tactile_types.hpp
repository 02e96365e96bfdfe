// SPDX-License-Identifier: Apache-2.0
// View of a pad for the tactile kernels, and the arguments of those kernels. Plain arrays, no
// ownership.
//
// Flat pads use the axes axis0, axis1 and axis0 × axis1, made orthonormal. The origin is in the
// pad's plane, and every point has z = 0. Curved pads use the body's axes. Every point has its own
// offset in three directions, its own axes and perhaps its own ξ.
#pragma once

#include "kernels/contact/shapes/tile.hpp"

namespace tangere::kernels {

inline constexpr int kTileSide = 8;
inline constexpr int kTactileTile = kTileSide * kTileSide;  ///< points in a tile

/// Points in tiles of 64: 8×8, row-major, or for a list as many points that are near each other. A
/// point is its tile's centre plus an offset. Flat tiles of the same kind share their offsets.
struct PadTiles {
  int rows, cols;  ///< of points; for a list, cols = 1
  int tile_rows, tile_cols;
  const double *x, *y, *z;  ///< (n_tiles, padded to 8 with far tiles) centres, pad axes [m]
  const double* radius;  ///< (the same) distance of the farthest point, with a margin for rounding
  const int* kind;  ///< (n_tiles) which offsets; flat: bit 0 is the last column, bit 1 the last row
  const double*
      offsets;  ///< (4, 2, 64) flat, (n_tiles, 3, 64) curved: x, y, z; missing points are far away
  const float* offsets_f;  ///< the same in single precision
  const int* index;        ///< curved: (n_tiles, 64) the point's place in the list; nullptr: flat
  const double* frames;    ///< curved: (n_tiles, 9, 64) rows axis0, axis1, -normal of (f·x, f·y,
                           ///< -f·z), pad axes
  const float* frames_f;
  const double* factors;  ///< (n_tiles, kPointCoefficients, 64) factors; nullptr: all 1
  const float* factors_f;
  /// (n_tiles / 8, padded to 8 with far spheres) centres and radii of spheres around eight tiles
  /// each, with a margin for rounding, pad axes [m]
  const double *eight_x, *eight_y, *eight_z, *eight_radius;
  /// (4, 8) x, y, z and radii of eight spheres that hold all points between them, with a margin for
  /// rounding, pad axes [m]; some may be the same
  const double* parts;
  double middle[3];  ///< of one sphere around all points, pad axes [m]
  double reach;      ///< its radius, with a margin for rounding [m]
  bool skewed;       ///< axis0 and axis1 are not exactly unit and perpendicular: forces need `axes`
  double axes[9];    ///< rows: axis0, axis1, -(axis0 × axis1), pad axes

  [[nodiscard]] int tiles() const { return tile_rows * tile_cols; }
  [[nodiscard]] bool curved() const { return index != nullptr; }
  /// Number of points in a tile of a list.
  [[nodiscard]] int points_of(int tile) const {
    const int left = rows - kTactileTile * tile;
    return left < kTactileTile ? left : kTactileTile;
  }
  /// Numbers of points of a tile along axis0 and axis1.
  [[nodiscard]] int rows_of(int tile) const {
    return shorter(rows - kTileSide * (tile / tile_cols));
  }
  [[nodiscard]] int cols_of(int tile) const {
    return shorter(cols - kTileSide * (tile % tile_cols));
  }
  /// Index of the tile's first point in the array.
  [[nodiscard]] int first_of(int tile) const {
    return kTileSide * (tile / tile_cols * cols + tile % tile_cols);
  }

 private:
  static int shorter(int n) { return n < kTileSide ? n : kTileSide; }
};

/// Arguments for one environment's field, Real = double or float. The touched tiles are returned in
/// rising order.
template <class Real>
struct TactileArgs {
  const PadTiles* pad;
  ContactLaw law;
  int n_touches;
  const TouchShape* shapes;      ///< (n_touches)
  const Touch<double>* touches;  ///< (n_touches)
  int* active;                   ///< (n_tiles) out
  Real* values;                  ///< (n_tiles, 3, 64) out [N], tile active[k] at k; or nullptr
  Real* dense;  ///< (rows, cols, 3) out [N], only active tiles are written; or nullptr
  /// Only the third component, and that without friction: `values` is (n_tiles, 1, 64), `dense` is
  /// (rows, cols).
  bool pressure = false;
};

/// Arguments for the fields of a group of eight environments (double) or a block of sixteen
/// (float).
template <class Real>
struct TactileBlockArgs {
  const PadTiles* pad;
  ContactLaw law;
  int n_touches;
  const TouchShape* shapes;              ///< (n_touches)
  const Touch<LaneRow>* const* touches;  ///< (n_touches) of one group, or of two groups in a row
  Real* const* dense;     ///< (lanes) (rows, cols, 3) out [N], or nullptr for a lane that is not
                          ///< wanted; tiles that nothing touches in any lane are not written
  bool pressure = false;  ///< as in TactileArgs
};

/// Sums over all points of one shape on a pad, or of one pair.
template <class N>
struct TouchCotangent {
  Vec6<N> displacement;  ///< (θ̄; ρ̄) of body 2 relative to body 1, body 1's axes and origin
  Vec6<N> twist;         ///< W̄
  Coefficients<N> law;
  Vec3<N> size;  ///< of body 2, as in PairContact
};

/// Numbers of a tactile point that have a derivative: its place x y z, then its own coefficients.
inline constexpr int kPointNumbers = 3 + kPointCoefficients;

/// One environment's field in reverse: turns cotangents of its touched tiles into those of every
/// shape's motion.
struct TactilePullback {
  const PadTiles* pad;
  ContactLaw law;
  int n_touches;
  const TouchShape* shapes;      ///< (n_touches)
  const Touch<double>* touches;  ///< (n_touches)
  int count;                     ///< tiles
  const int* tiles;              ///< (count)
  const double* cotangents;      ///< (count, 3, 64) of the field [loss/N]
  bool with_law;  ///< also differentiate by coefficients and shapes' sizes; else those are zero
  /// (count, kPointNumbers, 64) derivatives by every point's own numbers, added to; or nullptr.
  double* points_bar;
  TouchCotangent<double>* out;  ///< (n_touches), pad axes and origin; body 1 is the sensor's
};

/// How a shape moves against a pad: displacement ε and change of twist δW, in pad axes at its
/// origin.
struct TouchTangent {
  Vec6<double> displacement, twist;
};

/// How one environment's field changes with its shapes' motion.
struct TactileTangent {
  const PadTiles* pad;
  ContactLaw law;
  int n_touches;
  const TouchShape* shapes;      ///< (n_touches)
  const Touch<double>* touches;  ///< (n_touches)
  const TouchTangent* tangents;  ///< (n_touches)
  int count;                     ///< tiles
  const int* tiles;              ///< (count)
  double* change;                ///< (count, 3, 64) out [N]
};

}  // namespace tangere::kernels
