// SPDX-License-Identifier: Apache-2.0
// Finds the points of a body that may lie below the ground: balls around blocks of tiles are tested
// first, then those around tiles, then points. With m the ground's normal in the body's axes, a
// ball (c, r) lies above the ground where m·c + height ≥ r.
#pragma once

#include <cstdint>

#include "kernels/numbers/linalg.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// 64-bit words that hold a bit for each of so many points.
constexpr int low_words(int points) { return (points + 63) / 64; }

/// Sets the bits of the points that lie below the ground in some lane, and maybe of some above it.
/// The body has tiles.
template <class N>
[[gnu::noinline]] void mark_low_points(const GroundContact& ground, const Vec3<N>& m,
                                       const N& height, std::uint64_t* low) {
  const auto above = [&](const double* p, double radius) {
    return !any(dot(m, Vec3<N>{N(p[0]), N(p[1]), N(p[2])}) + height < N(radius));
  };
  const auto ball_above = [&](const double* ball) { return above(ball, ball[3]); };
  for (int w = 0; w < low_words(ground.n_points); ++w) low[w] = 0;
  for (int first = 0; first < ground.n_tiles; first += kLowBlock) {
    if (ball_above(ground.blocks + 4 * (first / kLowBlock))) continue;
    for (int t = first; t < first + kLowBlock && t < ground.n_tiles; ++t) {
      if (ball_above(ground.tiles + 4 * t)) continue;
      for (int i = t * kLowTile; i < (t + 1) * kLowTile && i < ground.n_points; ++i) {
        const int k = ground.in_tiles[i];
        if (!above(ground.points + 3 * k, kAboveRounding))
          low[k / 64] |= std::uint64_t{1} << k % 64;
      }
    }
  }
}

/// Calls f(k) for every point that lies below the ground in some lane, and maybe for some above it,
/// in rising order. `low`: scratch, low_words() of the body's points; null: f is called for all.
template <class N, class F>
void for_each_low_point(const GroundContact& ground, const Vec3<N>& m, const N& height,
                        std::uint64_t* low, const F& f) {
  const bool all = ground.n_tiles == 0 || low == nullptr;
  if (!all) mark_low_points(ground, m, height, low);
  const auto next = [&](int k) {
    if (all) return k;
    for (; k < ground.n_points; k = (k / 64 + 1) * 64)
      if (const std::uint64_t left = low[k / 64] >> k % 64; left != 0)
        return k + __builtin_ctzll(left);
    return k;
  };
  // One call of f, because its code is inlined.
  for (int k = next(0); k < ground.n_points; k = next(k + 1)) f(k);
}

}  // namespace tangere::kernels
