// SPDX-License-Identifier: Apache-2.0
// F = Σ Rᵢᵀ fᵢ and c = Σ pᵢ xᵢ / Σ pᵢ with pᵢ = max(0, sign f₃): fᵢ are a point's stored numbers,
// Rᵢ its axes, xᵢ its place. Eight points are added side by side, which compilers turn into
// vectors. A tile's missing points have no force, so they add nothing. NaN in a field makes the
// force NaN.
#include "engine/sense/field_sum.hpp"

#include <algorithm>

namespace tangere {

namespace {

using kernels::kTactileTile;
using kernels::PadTiles;
using kernels::Vec3;

constexpr int kWide = 8;

/// Sums of force, of pressure, and of pressure times place, each from eight partial ones.
template <class N>
struct Partial {
  N force[3][kWide] = {}, pressure[kWide] = {}, moment[3][kWide] = {};
};

template <class N>
double total(const N (&x)[kWide]) {
  double wide[kWide];
  for (int l = 0; l < kWide; ++l) wide[l] = static_cast<double>(x[l]);
  return ((wide[0] + wide[1]) + (wide[2] + wide[3])) + ((wide[4] + wide[5]) + (wide[6] + wide[7]));
}

/// Sums in double precision, pad axes.
struct Sums {
  Vec3<double> force{0, 0, 0}, moment{0, 0, 0};
  double pressure = 0;
};

/// Adds the points of a flat tile in the precision of the field: eight of them are one partial sum,
/// so little is lost. Places are relative to the tile's centre.
template <class Real>
void add_flat_tile(const PadTiles& pad, int tile, Real sign, const Real* values,
                   const Real* offsets, Sums& sums) {
  Partial<Real> of;
  for (int k = 0; k < kTactileTile; k += kWide)
    for (int l = 0; l < kWide; ++l) {
      const Real x = values[k + l], y = values[kTactileTile + k + l],
                 z = values[2 * kTactileTile + k + l];
      const Real w = std::max(Real(0), sign * z);
      of.force[0][l] += x, of.force[1][l] += y, of.force[2][l] -= z;
      of.pressure[l] += w;
      of.moment[0][l] += w * offsets[k + l];
      of.moment[1][l] += w * offsets[kTactileTile + k + l];
    }
  const double pressure = total(of.pressure);
  sums.pressure += pressure;
  sums.force += Vec3<double>{total(of.force[0]), total(of.force[1]), total(of.force[2])};
  sums.moment += pressure * Vec3<double>{pad.x[tile], pad.y[tile], pad.z[tile]} +
                 Vec3<double>{total(of.moment[0]), total(of.moment[1]), 0};
}

/// Adds the points of a tile of a list. Each has axes of its own, whose rows are in pad.frames.
template <class Real>
void add_curved_tile(const PadTiles& pad, int tile, double sign, const Real* values, Sums& sums) {
  const double* const offsets = pad.offsets + 3 * kTactileTile * tile;
  const double* const frames = pad.frames + 9 * kTactileTile * tile;
  for (int k = 0; k < pad.points_of(tile); ++k) {
    double f[3], g[3] = {0, 0, 0};
    for (int r = 0; r < 3; ++r) {
      f[r] = static_cast<double>(values[r * kTactileTile + k]);
      for (int c = 0; c < 3; ++c) g[c] += frames[(3 * r + c) * kTactileTile + k] * f[r];
    }
    const double w = std::max(0.0, sign * f[2]);
    sums.force += Vec3<double>{g[0], g[1], -g[2]};
    sums.pressure += w;
    sums.moment +=
        w * Vec3<double>{pad.x[tile] + offsets[k], pad.y[tile] + offsets[kTactileTile + k],
                         pad.z[tile] + offsets[2 * kTactileTile + k]};
  }
}

const double* offsets_of(const PadTiles& pad, const double*) { return pad.offsets; }
const float* offsets_of(const PadTiles& pad, const float*) { return pad.offsets_f; }

}  // namespace

template <class Real>
FieldSum field_sum(const PadTiles& pad, const kernels::Frame<double>& in_body, int pressure_sign,
                   std::span<const int> tiles, const Real* values) {
  Sums sums;
  for (const int tile : tiles) {
    if (pad.curved()) {
      add_curved_tile(pad, tile, pressure_sign, values, sums);
    } else {
      add_flat_tile(pad, tile, static_cast<Real>(pressure_sign), values,
                    offsets_of(pad, values) + 2 * kTactileTile * pad.kind[tile], sums);
    }
    values += 3 * kTactileTile;
  }
  const Vec3<double> force = in_body.R * sums.force;
  if (!(sums.pressure > 0)) return {force.x, force.y, force.z, 0, 0, 0};
  const Vec3<double> at = in_body.R * ((1 / sums.pressure) * sums.moment) + in_body.p;
  return {force.x, force.y, force.z, at.x, at.y, at.z};
}

template FieldSum field_sum(const PadTiles&, const kernels::Frame<double>&, int,
                            std::span<const int>, const double*);
template FieldSum field_sum(const PadTiles&, const kernels::Frame<double>&, int,
                            std::span<const int>, const float*);

}  // namespace tangere
