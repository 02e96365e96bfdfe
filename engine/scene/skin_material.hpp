// SPDX-License-Identifier: Apache-2.0
// Coefficients of a soft skin from its material: a layer of rubber of thickness t that is bonded to
// a stiff back, as a bed of springs (docs/skin.md).
//
// Under a ball of radius R that is pressed in by d, with χ = √(R d)/t, the springs carry π K R d²,
// and a bonded incompressible layer (Dimitriadis et al., Biophys. J. 2002)
//   F = 16/9 E √R d^(3/2) (1 + 1.133 χ + 1.283 χ² + 0.769 χ³ + 0.0975 χ⁴)
// so that K = c E/t with c = 0.566 (1/χ + 1.133 + 1.283 χ + 0.769 χ² + 0.0975 χ³), which is 2.19 to
// 2.43 for χ from 0.4 to 1. For a contact narrower than the layer is thick, k_s is 0.4 K.
#pragma once

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns c = K t/E at a contact's size χ > 0.
constexpr double stiffness_ratio(double size) {
  return 16 / (9 * 3.14159265358979323846) *
         (1 / size + 1.133 + size * (1.283 + size * (0.769 + size * 0.0975)));
}
/// c within 5 % for χ from 0.43 to 0.95.
inline constexpr double kUsualStiffnessRatio = 2.3;
inline constexpr double kShearShare = 0.4;  ///< k_s/K
/// Depth at which the damper relaxes in the time of relaxation, by the thickness.
inline constexpr double kUsualDampingDepth = 0.1;

/// Returns kn = K, ks, kt = ks τ, damping = K τ/depth by area, from K [N/m³], τ [s] and depth [m].
/// mu is 0.
constexpr ContactCoefficients skin_springs(double stiffness, double relaxation, double depth) {
  const double ks = kShearShare * stiffness;
  return {.kn = stiffness,
          .kt = ks * relaxation,
          .mu = 0,
          .damping = stiffness * relaxation / depth,
          .ks = ks};
}

/// The same from a material, whose modulus and thickness are positive.
constexpr ContactCoefficients skin_springs(const SkinMaterial& m) {
  return skin_springs(kUsualStiffnessRatio * m.modulus / m.thickness, m.relaxation,
                      kUsualDampingDepth * m.thickness);
}

}  // namespace tangere
