// SPDX-License-Identifier: Apache-2.0
// Tactile field of one sensor against one shape: eight points at a time, tiles out of reach skipped.
//
// A tactile point is a contact point whose force is only read: T = (f·axis0, f·axis1, -f·(axis0 × axis1)).
#pragma once

#include "kernels/kernel_table.hpp"
#include "kernels/pair_contact.hpp"

namespace tangere::kernels {

template <class N, int Width, class Shape, class ScalarShape, class Load, class Store>
void tactile_tiles(const TactileArgs& a, const Shape& shape, const ScalarShape& scalar_shape, const Load& load,
                   const Store& store) {
  const Mat3<double> Q0 = {{{a.Q[0], a.Q[1], a.Q[2]}, {a.Q[3], a.Q[4], a.Q[5]}, {a.Q[6], a.Q[7], a.Q[8]}}};
  const Vec3<double> c0 = {a.c[0], a.c[1], a.c[2]};
  const Mat3<N> Q = broadcast<N>(Q0);
  const Vec3<N> c = broadcast<N>(c0);
  const Vec3<N> omega = {N(a.omega[0]), N(a.omega[1]), N(a.omega[2])};
  const Vec3<N> v = {N(a.v[0]), N(a.v[1]), N(a.v[2])};
  const LawParameters<N> law = {N(a.kn), N(a.kt), N(a.mu), N(a.damping), a.law, 0.0};
  Mat3<N> axes;
  for (int k = 0; k < 9; ++k) axes.m[k / 3][k % 3] = N(a.axes[k]);
  for (int tile = 0; tile < a.n_tiles; ++tile) {
    const double* b = a.bounds + 4 * tile;
    double unused;
    const double gap = scalar_shape.evaluate(transposed_times(Q0, Vec3<double>{b[0], b[1], b[2]} - c0), unused).d;
    if (!(gap < b[3])) continue;  // a distance grows at most as fast as the point moves
    const double* p = a.points + tile * 3 * kTactileTile;
    double* f = a.force + tile * 3 * kTactileTile;
    for (int k = 0; k < kTactileTile; k += Width) {
      const Vec3<N> xi = {load(p + k), load(p + kTactileTile + k), load(p + 2 * kTactileTile + k)};
      const PointContact<N> at = point_contact(shape, law, Q, c, omega, v, xi);
      if (!any(at.d < N(0.0))) continue;
      a.touched[tile] = 1;
      const Vec3<N> t = axes * at.force;
      store(load(f + k) + t.x, f + k);
      store(load(f + kTactileTile + k) + t.y, f + kTactileTile + k);
      store(load(f + 2 * kTactileTile + k) + t.z, f + 2 * kTactileTile + k);
    }
  }
}

template <class N, int Width, class Load, class Store>
void tactile_field(const TactileArgs& a, const Load& load, const Store& store) {
  if (a.shape == PrimitiveShape::sphere) {
    tactile_tiles<N, Width>(a, SphereDistance<N>{N(a.size[0])}, SphereDistance<double>{a.size[0]}, load, store);
  } else {
    tactile_tiles<N, Width>(a, CuboidDistance<N>{{N(a.size[0]), N(a.size[1]), N(a.size[2])}},
                            CuboidDistance<double>{{a.size[0], a.size[1], a.size[2]}}, load, store);
  }
}

}  // namespace tangere::kernels
