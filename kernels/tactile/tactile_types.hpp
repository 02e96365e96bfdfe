// SPDX-License-Identifier: Apache-2.0
// A pad as the tactile kernels see it, and what is put to it. Plain arrays, no ownership.
//
// Flat pads: axes axis0, axis1 and axis0 × axis1 made orthonormal, origin in the pad's plane, every
// point has z = 0. Curved pads: the body's axes; every point has its own offset in three
// directions, its own axes, perhaps its own ξ.
#pragma once

#include "kernels/contact/shapes/tile.hpp"

namespace tangere::kernels {

inline constexpr int kTileSide = 8;
inline constexpr int kTactileTile = kTileSide * kTileSide;  ///< points in a tile

/// Points in tiles of 64: 8×8, row-major, or as many of a list that are near each other. A point is
/// its tile's centre plus an offset; flat tiles alike share their offsets.
struct PadTiles {
  int rows, cols;  ///< points; of a list, cols = 1
  int tile_rows, tile_cols;
  const double *x, *y, *z;  ///< (n_tiles, padded to 8 with tiles far away) centres, pad axes [m]
  const double* radius;  ///< (the same) distance of the farthest point, with a margin for rounding
  const int* kind;  ///< (n_tiles) which of the offsets; flat: bit 0 last column, bit 1 last row
  const double*
      offsets;  ///< (4, 2, 64) flat, (n_tiles, 3, 64) curved: x, y, z; missing points are far away
  const float* offsets_f;  ///< the same in single precision
  const int* index;        ///< curved: (n_tiles, 64) the point's place in the list; nullptr: flat
  const double* frames;    ///< curved: (n_tiles, 9, 64) rows axis0, axis1, -normal of (f·x, f·y,
                           ///< -f·z), pad axes
  const float* frames_f;
  const double* factors;  ///< (n_tiles, 4, 64) of the coefficients; nullptr: all 1
  const float* factors_f;
  bool skewed;     ///< axis0 and axis1 are not quite unit and perpendicular: forces need `axes`
  double axes[9];  ///< rows: axis0, axis1, -(axis0 × axis1), pad axes

  [[nodiscard]] int tiles() const { return tile_rows * tile_cols; }
  [[nodiscard]] bool curved() const { return index != nullptr; }
  /// Points of a tile of a list.
  [[nodiscard]] int points_of(int tile) const {
    const int left = rows - kTactileTile * tile;
    return left < kTactileTile ? left : kTactileTile;
  }
  /// Points of a tile along axis0 and axis1.
  [[nodiscard]] int rows_of(int tile) const {
    return shorter(rows - kTileSide * (tile / tile_cols));
  }
  [[nodiscard]] int cols_of(int tile) const {
    return shorter(cols - kTileSide * (tile % tile_cols));
  }
  /// Index of its first point in the array.
  [[nodiscard]] int first_of(int tile) const {
    return kTileSide * (tile / tile_cols * cols + tile % tile_cols);
  }

 private:
  static int shorter(int n) { return n < kTileSide ? n : kTileSide; }
};

/// One environment's field, Real = double or float. The tiles that something touches are returned,
/// in rising order.
template <class Real>
struct TactileArgs {
  const PadTiles* pad;
  ContactLaw law;
  int n_touches;
  const TouchShape* shapes;      ///< (n_touches)
  const Touch<double>* touches;  ///< (n_touches)
  int* active;                   ///< (n_tiles) out
  Real* values;                  ///< (n_tiles, 3, 64) out [N], those of active[k] at k; or nullptr
  Real* dense;  ///< (rows, cols, 3) out [N], active tiles alone are written; or nullptr
};

/// The fields of a group of eight environments (double) or of a block of sixteen (float).
template <class Real>
struct TactileBlockArgs {
  const PadTiles* pad;
  ContactLaw law;
  int n_touches;
  const TouchShape* shapes;              ///< (n_touches)
  const Touch<LaneRow>* const* touches;  ///< (n_touches) of one group, or of two in a row
  Real* const* dense;  ///< (lanes) (rows, cols, 3) out [N], or nullptr for a lane nobody asks for;
                       ///< tiles that nothing touches in any lane are not written
};

/// Of a pad's shape, or of a pair: what all its points add up to.
template <class N>
struct TouchCotangent {
  Vec6<N> displacement;  ///< (θ̄; ρ̄) of body 2 relative to body 1, body 1's axes and origin
  Vec6<N> twist;         ///< W̄
  Coefficients<N> law;
  Vec3<N> size;  ///< of body 2, as in PairContact
};

/// Numbers of a tactile point with a derivative: its place x y z, then its own coefficients.
inline constexpr int kPointNumbers = 3 + kCoefficients;

/// One environment's field on its way back: cotangents of its touched tiles to those of each
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
  bool of_law;                   ///< by the coefficients and the shapes' sizes too; else zeros
  double*
      of_points;  ///< (count, kPointNumbers, 64) by every point's own numbers, added to; or nullptr
  TouchCotangent<double>* out;  ///< (n_touches), pad axes and origin; body 1 is the sensor's
};

/// How a shape moves against a pad: displacement ε and change of twist δW, pad axes and origin.
struct TouchTangent {
  Vec6<double> displacement, twist;
};

/// One environment's field along a change of its shapes' motion.
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
