// SPDX-License-Identifier: Apache-2.0
// The norm in which residuals are measured. With D the diagonal of the mass matrix:
//   ‖D^-½ g‖ / (‖D^½ v‖ c₀/h + ‖D^½‖ |gravity| + ‖D^-½ f‖),
//       f the magnitudes of contact, motor and damping forces
// is free of units. A residual cannot be smaller than the effect of rounding a position once. It
// counts as zero below the floor ‖D^-½ φ‖², φ_i = 4 ε |A_ii - D_i (c₀/h)²| (extent of the scene, or
// 1 rad). Inertia is left out, because it acts on the displacement x, which is not rounded to
// positions. In steps of nanoseconds it would hide every force.
#pragma once

#include <limits>

#include "kernels/numbers/inverse_sqrt.hpp"
#include "kernels/step/model_view.hpp"

namespace tangere::kernels {

template <class N>
void set_weights(int n, const N* mass_diagonal, N* weight, N* inverse_weight) {
  for (int i = 0; i < n; ++i) {
    inverse_weight[i] = inverse_sqrt(mass_diagonal[i]);
    weight[i] = root_of(mass_diagonal[i], inverse_weight[i]);
  }
}

template <class N>
N rounding_floor(const Pattern& p, const N* A, const N* weight, const N* inverse_weight,
                 const N& c0_over_h, const double* unknown_scale) {
  N sum(0.0);
  const N inertia = c0_over_h * c0_over_h;
  for (int i = 0; i < p.n; ++i) {
    const N e = N(4 * std::numeric_limits<double>::epsilon() * unknown_scale[i]) *
                (A[p.diagonal_entry[i]] * inverse_weight[i] - inertia * weight[i]);
    sum = mul_add(e, e, sum);
  }
  return sum;
}

template <class N>
N norm_of(const N& square) {
  return root_of(square, inverse_sqrt(square));
}

template <class N>
N weighted_norm(int n, const N* weight, const N* a) {
  N sum(0.0);
  for (int i = 0; i < n; ++i) {
    const N x = weight[i] * a[i];
    sum = mul_add(x, x, sum);
  }
  return norm_of(sum);
}

template <class N>
struct ResidualScale {
  const N *v, *force_scale, *weight, *inverse_weight;
  N c0_over_h, gravity, floor;
};

/// A NaN in g is returned as NaN.
template <class N>
N scaled_residual(int n, const N* g, const ResidualScale<N>& s) {
  N residual(0.0), motion(0.0), mass(0.0), force(0.0);
  for (int i = 0; i < n; ++i) {
    const N r = s.inverse_weight[i] * g[i], m = s.weight[i] * s.v[i],
            f = s.inverse_weight[i] * s.force_scale[i];
    residual = mul_add(r, r, residual);
    motion = mul_add(m, m, motion);
    mass = mul_add(s.weight[i], s.weight[i], mass);
    force = mul_add(f, f, force);
  }
  const N scale =
      mul_add(norm_of(motion), s.c0_over_h, mul_add(s.gravity, norm_of(mass), norm_of(force)));
  return select(residual <= s.floor, N(0.0), norm_of(residual) / scale);
}

}  // namespace tangere::kernels
