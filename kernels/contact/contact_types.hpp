// SPDX-License-Identifier: Apache-2.0
// The enumerations that a scene and a kernel share: which law a contact follows, which shape is
// touched.
#pragma once

#include <cstdint>

namespace tangere {

/// Normal force N(d, ḋ) of a penalty contact, d < 0 the penetration [m] (SCENES: laws and signs).
enum class ContactLaw : std::uint8_t {
  clamped,  ///< max(0, (-kn + kd ḋ) d), eq. 1 of the paper without adhesion
  paper,    ///< (-kn + kd ḋ) d, eq. 1 to the letter: pulls when ḋ > kn/kd
  linear,   ///< max(0, -kn d - c min(1, |d|/ramp) ḋ); ramp = 0 is the published ground law
};

/// Shapes with a signed distance that a contact or tactile point may touch.
enum class PrimitiveShape : std::uint8_t { sphere, cuboid, plane, cylinder, capsule, ellipsoid };
inline constexpr int kPrimitiveShapes = 6;

}  // namespace tangere
