// SPDX-License-Identifier: Apache-2.0
// Eight points side by side, which compilers turn into vectors. A tile's missing points have no
// force, so they add nothing.
#include "engine/sense/field_sum.hpp"

#include <algorithm>

namespace tangere {

namespace {

using kernels::kTactileTile;
using kernels::PadTiles;
using kernels::Vec3;

constexpr int kWide = 8;

/// Partial sums of force, of pressure, and of pressure times place, pad axes.
struct Partial {
  double force[3][kWide] = {}, pressure[kWide] = {}, moment[3][kWide] = {};
};

double total(const double (&x)[kWide]) {
  return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
}

/// Turns stored components into a force in pad axes. Points of a list have axes of their own, whose
/// rows are `frame`, (9, 64).
void to_pad_axes(const double* frame, double (&f)[3][kWide]) {
  if (frame == nullptr) {
    for (double& z : f[2]) z = -z;
    return;
  }
  for (int l = 0; l < kWide; ++l) {
    double g[3];
    for (int k = 0; k < 3; ++k) {
      g[k] = 0;
      for (int r = 0; r < 3; ++r) g[k] += frame[(3 * r + k) * kTactileTile + l] * f[r][l];
    }
    f[0][l] = g[0], f[1][l] = g[1], f[2][l] = -g[2];
  }
}

/// Adds the eight points from k on of tile `tile`, whose numbers are `values`, (3, 64).
template <class Real>
void add_points(const PadTiles& pad, int tile, int k, int sign, const Real* values, Partial& sums) {
  double f[3][kWide];
  for (int c = 0; c < 3; ++c)
    for (int l = 0; l < kWide; ++l) f[c][l] = static_cast<double>(values[c * kTactileTile + k + l]);
  double w[kWide];
  for (int l = 0; l < kWide; ++l) w[l] = std::max(0.0, sign * f[2][l]);
  to_pad_axes(pad.curved() ? pad.frames + 9 * kTactileTile * tile + k : nullptr, f);
  const int dimensions = pad.curved() ? 3 : 2;
  const double* const offsets = pad.offsets + dimensions * kTactileTile * pad.kind[tile] + k;
  const double centre[3] = {pad.x[tile], pad.y[tile], pad.z[tile]};
  for (int c = 0; c < 3; ++c)
    for (int l = 0; l < kWide; ++l) {
      const double at = centre[c] + (c < dimensions ? offsets[c * kTactileTile + l] : 0.0);
      sums.force[c][l] += f[c][l];
      sums.moment[c][l] += w[l] * at;
    }
  for (int l = 0; l < kWide; ++l) sums.pressure[l] += w[l];
}

Vec3<double> totals(const double (&x)[3][kWide]) { return {total(x[0]), total(x[1]), total(x[2])}; }

}  // namespace

template <class Real>
FieldSum field_sum(const PadTiles& pad, const kernels::Frame<double>& in_body, int pressure_sign,
                   std::span<const int> tiles, const Real* values) {
  Partial sums;
  for (const int tile : tiles) {
    for (int k = 0; k < kTactileTile; k += kWide)
      add_points(pad, tile, k, pressure_sign, values, sums);
    values += 3 * kTactileTile;
  }
  const Vec3<double> force = in_body.R * totals(sums.force);
  const double pressure = total(sums.pressure);
  if (!(pressure > 0)) return {force.x, force.y, force.z, 0, 0, 0};
  const Vec3<double> at = in_body.R * ((1 / pressure) * totals(sums.moment)) + in_body.p;
  return {force.x, force.y, force.z, at.x, at.y, at.z};
}

template FieldSum field_sum(const PadTiles&, const kernels::Frame<double>&, int,
                            std::span<const int>, const double*);
template FieldSum field_sum(const PadTiles&, const kernels::Frame<double>&, int,
                            std::span<const int>, const float*);

}  // namespace tangere
