// SPDX-License-Identifier: Apache-2.0
// Tiles of a (points, components) array: zeroes them, fills them from (components, 64), reads them
// into it, or normalises their shear.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "kernels/tactile/tactile_types.hpp"

namespace tangere {

template <class T>
void clear_tile(const kernels::PadTiles& pad, int tile, int components, T* dense) {
  if (pad.curved()) {
    for (int k = 0; k < pad.points_of(tile); ++k)
      std::fill_n(dense + components * pad.index[kernels::kTactileTile * tile + k], components,
                  T(0));
    return;
  }
  const int rows = pad.rows_of(tile), numbers = components * pad.cols_of(tile);
  T* row = dense + components * pad.first_of(tile);
  for (int i = 0; i < rows; ++i, row += components * pad.cols) std::fill(row, row + numbers, T(0));
}

/// Zeroes every tile that is not in `tiles` (rising). Rows of tiles without any of them are zeroed
/// in one piece.
template <class T>
void clear_tiles_between(const kernels::PadTiles& pad, std::span<const int> tiles, int components,
                         T* dense) {
  std::size_t next = 0;
  for (int first = 0; first < pad.tiles(); first += pad.tile_cols) {
    const int end = first + pad.tile_cols;
    if (!pad.curved() && (next == tiles.size() || tiles[next] >= end)) {
      T* row = dense + components * pad.first_of(first);
      std::fill(row, row + components * pad.rows_of(first) * pad.cols, T(0));
      continue;
    }
    for (int tile = first; tile < end; ++tile) {
      if (next < tiles.size() && tiles[next] == tile) {
        ++next;
      } else {
        clear_tile(pad, tile, components, dense);
      }
    }
  }
}

/// Calls put(to, number) for the first `Components` of a tile's (…, 64), `to` being a number of its
/// rows in `dense`.
template <int Components, class Real, class T, class Put>
void put_tile(const kernels::PadTiles& pad, int tile, const Real* from, T* dense, const Put& put) {
  if (pad.curved()) {
    const int* index = pad.index + kernels::kTactileTile * tile;
    for (int k = 0; k < pad.points_of(tile); ++k)
      for (int c = 0; c < Components; ++c)
        put(dense[Components * index[k] + c], from[c * kernels::kTactileTile + k]);
    return;
  }
  const int rows = pad.rows_of(tile), cols = pad.cols_of(tile);
  T* row = dense + Components * pad.first_of(tile);
  for (int i = 0; i < rows; ++i, row += Components * pad.cols, from += kernels::kTileSide)
    for (int j = 0; j < cols; ++j)
      for (int c = 0; c < Components; ++c)
        put(row[Components * j + c], from[c * kernels::kTactileTile + j]);
}

/// Writes the same numbers, converted to T.
template <int Components, class Real, class T>
void expand_tile(const kernels::PadTiles& pad, int tile, const Real* from, T* dense) {
  put_tile<Components>(pad, tile, from, dense, [](T& to, Real x) { to = static_cast<T>(x); });
}

/// Calls f(slot in the tile, point of the array) for all points of a tile.
template <class F>
void for_points_of_tile(const kernels::PadTiles& pad, int tile, const F& f) {
  if (pad.curved()) {
    for (int k = 0; k < pad.points_of(tile); ++k) f(k, pad.index[kernels::kTactileTile * tile + k]);
    return;
  }
  const int rows = pad.rows_of(tile), cols = pad.cols_of(tile), first = pad.first_of(tile);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) f(i * kernels::kTileSide + j, first + i * pad.cols + j);
}

/// Divides the shear of some tiles, (points, 2), by its largest length among them
/// (engine/sense/flow_map.hpp). Where all is zero it stays so.
template <class T>
void normalise_shear(const kernels::PadTiles& pad, std::span<const int> tiles, T* shear) {
  const auto for_points = [&](const auto& f) {
    for (const int tile : tiles)
      for_points_of_tile(pad, tile, [&](int, int point) { f(shear + 2 * point); });
  };
  double longest = 0;
  for_points([&](const T* s) {
    longest = std::max(longest, std::hypot(static_cast<double>(s[0]), static_cast<double>(s[1])));
  });
  if (!(longest > 0)) return;
  for_points([&](T* s) {
    for (int k = 0; k < 2; ++k) s[k] = static_cast<T>(static_cast<double>(s[k]) / longest);
  });
}

/// Reads a tile into (3, 64), with zeros where it has no point. Returns false where all of it is
/// zero.
template <class T, class Real>
bool gather_tile(const kernels::PadTiles& pad, int tile, const T* dense, Real* to) {
  std::fill_n(to, 3 * kernels::kTactileTile, Real(0));
  bool any = false;
  const auto take = [&](int slot, const T* from) {
    for (int c = 0; c < 3; ++c) {
      to[c * kernels::kTactileTile + slot] = static_cast<Real>(from[c]);
      any = any || from[c] != T(0);
    }
  };
  for_points_of_tile(pad, tile, [&](int slot, int point) { take(slot, dense + 3 * point); });
  return any;
}

}  // namespace tangere
