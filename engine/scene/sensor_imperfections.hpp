// SPDX-License-Identifier: Apache-2.0
// Imperfections of real tactile sensors. From the ideal field x a reading y is computed, number by
// number, in this order (docs/sensors.md):
//   x₀ = (1 - a) x + a Σ_k l_k x(t - k h)   a: hysteresis; l_k ~ exp(-k h / hysteresis_time)
//   x₁ = Σ_k w_k x₀(t - delay - k h)    w_k ~ β^k, Σ w_k = 1, β = exp(-h / low_pass)
//   x₂ = S x₁                           S_ij ~ exp(-|p_i - p_j|² / (2 spread²)), Σ_i S_ij = 1
//   x₃ = x₂ + c Σ over the neighbours (x₂ of the neighbour - x₂)        c: crosstalk
//   x₄ = (1 + G + g) x₃ + b + e         G ~ N(0, sensor_gain²) of the sensor; g ~ N(0, gain²) and
//                                       b ~ N(0, bias²) of the point, all three of the episode;
//                                       e ~ N(0, noise²), new in every step
//   y  = 0 where the point is dead, else Q round(clamp(x₄, ±s) / Q), Q: quantisation, s: the
//       largest multiple of Q up to the saturation
#pragma once

#include "engine/base/error.hpp"

namespace tangere {

/// A number for the third component of a field and one for the first two.
struct NormalAndShear {
  double normal = 0, shear = 0;
  friend bool operator==(const NormalAndShear&, const NormalAndShear&) = default;
};

/// The imperfections of one sensor. A coefficient of 0 leaves its part out.
struct SensorImperfections {
  double hysteresis = 0;       ///< share of the answer that comes late [1]
  double hysteresis_time = 0;  ///< time constant with which it comes [s]
  double low_pass = 0;         ///< time constant [s]
  double delay = 0;            ///< [s]
  double spread = 0;           ///< distance over which a force spreads in the skin [m]
  double crosstalk = 0;        ///< share of a point that each of its 4 neighbours gets, at most 1/4
  double gain = 0;             ///< standard deviation from point to point [1]
  double sensor_gain = 0;      ///< standard deviation from episode to episode [1]
  NormalAndShear bias;         ///< standard deviation from point to point [N]
  NormalAndShear noise;        ///< standard deviation from step to step [N]
  double dead = 0;             ///< probability that a point always reads 0 [1]
  NormalAndShear saturation;   ///< largest magnitude of a reading [N]; 0: none
  NormalAndShear quantisation;  ///< readings are multiples of it [N]; 0: not rounded
  Source source;
};

}  // namespace tangere
