// SPDX-License-Identifier: Apache-2.0
// The contact law at every point of a pad, with tangents of states, numbers, sizes and points.
#include "engine/derivative/dual_field.hpp"

#include <algorithm>

#include "kernels/contact/pair_contact.hpp"
#include "kernels/step/arguments.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere {

using kernels::kBlock;
using D = kernels::Dual<double>;

namespace {

/// A point of a pad in pad axes, and the rows that turn a force into its field.
struct PadPoint {
  kernels::Vec3<double> at;
  double rows[9];
  double factors[kPointCoefficients];
  int index;  ///< in the field; -1: filler
};
PadPoint pad_point(const kernels::PadTiles& pad, int tile, int k) {
  using kernels::kTactileTile;
  PadPoint p{
      {pad.x[tile], pad.y[tile], pad.z[tile]}, {1, 0, 0, 0, 1, 0, 0, 0, -1}, {1, 1, 1, 1}, -1};
  const double* s = pad.offsets + (pad.curved() ? 3 : 2) * kTactileTile * pad.kind[tile] + k;
  p.at.x += s[0], p.at.y += s[kTactileTile];
  if (pad.curved()) {
    p.at.z += s[2 * kTactileTile];
    if (k < pad.points_of(tile)) p.index = pad.index[kTactileTile * tile + k];
    for (int i = 0; i < 9; ++i) {  // rows act on (f·x, f·y, -f·z)
      const double row = pad.frames[(9 * tile + i) * kTactileTile + k];
      p.rows[i] = i % 3 == 2 ? -row : row;
    }
    for (int i = 0; i < kPointCoefficients && pad.factors != nullptr; ++i)
      p.factors[i] = pad.factors[(kPointCoefficients * tile + i) * kTactileTile + k];
    return p;
  }
  if (pad.skewed) std::copy(pad.axes, pad.axes + 9, p.rows);
  const int row = k / kernels::kTileSide, col = k % kernels::kTileSide;
  if (row < pad.rows_of(tile) && col < pad.cols_of(tile))
    p.index = pad.first_of(tile) + row * pad.cols + col;
  return p;
}

}  // namespace

void read_dual_field(const CompiledModel& m, int sensor,
                     std::span<const kernels::LinkScratch<D>> links,
                     const Coefficients<D>& coefficients, const double* column,
                     std::span<const double> numbers, std::span<const double> points,
                     std::span<double> field, std::span<double> field_dot) {
  const CompiledSensor& skin = m.sensors[std::size_t(sensor)];
  const kernels::PadTiles pad = skin.tiles();
  const kernels::Mat3<double> turn =
      transpose(skin.pad.R) * m.bodies[std::size_t(skin.body)].frame.R;
  std::fill(field.begin(), field.end(), 0.0);
  std::fill(field_dot.begin(), field_dot.end(), 0.0);
  const kernels::LinkPose<D> hand = dual_pose(links, skin.link);
  for (const int number : skin.targets) {
    const CompiledBody& body = m.bodies[std::size_t(number)];
    const kernels::LinkPose<D> other = dual_pose(links, body.link);
    kernels::Touch<D> t;
    kernels::pad_touch(&hand, skin.pad, &other, body.frame, t);
    const kernels::Vec3<D> size = dual_size(m, number, column, numbers);
    const auto add = [&](const auto& shape) {
      for (int k = 0; k < pad.tiles() * kernels::kTactileTile; ++k) {
        const PadPoint p = pad_point(pad, k / kernels::kTactileTile, k % kernels::kTactileTile);
        if (p.index < 0) continue;
        const auto own = [&](int n) {
          return points.empty() ? 0.0 : points[std::size_t(p.index * kernels::kPointNumbers + n)];
        };
        const kernels::Vec3<double> moves = turn * kernels::Vec3<double>{own(0), own(1), own(2)};
        kernels::LawParameters<D> law = {coefficients, skin.law, 0.0};
        for (std::size_t n = 0; n < kCoefficients; ++n)
          law[n] = D(p.factors[factor_index(n)]) * law[n] +
                   D(0.0, n < kPointCoefficients ? own(3 + int(n)) : 0.0);
        const kernels::Vec3<D> xi = {{p.at.x, moves.x}, {p.at.y, moves.y}, {p.at.z, moves.z}};
        const auto at = kernels::point_contact(shape, law, t.Q, t.c, t.omega, t.v, xi);
        const D f[3] = {at.force.x, at.force.y, at.force.z};
        for (int c = 0; c < 3; ++c)
          for (int e = 0; e < 3; ++e) {
            const auto at_c = std::size_t(3 * p.index + c);
            if (!field.empty()) field[at_c] += p.rows[3 * c + e] * f[e].value;
            field_dot[at_c] += p.rows[3 * c + e] * f[e].epsilon;
          }
      }
    };
    kernels::with_distance<D>(body.shape, size, add, body.grid);
  }
}

}  // namespace tangere
