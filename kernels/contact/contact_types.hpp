// SPDX-License-Identifier: Apache-2.0
// Types that scenes and kernels share: contact laws, their coefficients and the shapes that can be
// touched.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tangere {

/// Normal force N(d, ḋ) of a penalty contact, d < 0 the penetration [m] (docs/contact.md).
enum class ContactLaw : std::uint8_t {
  clamped,  ///< max(0, (-kn + kd ḋ) d), eq. 1 of the paper without adhesion
  paper,    ///< (-kn + kd ḋ) d, eq. 1 to the letter: pulls when ḋ > kn/kd
  linear,   ///< max(0, -kn d - c min(1, |d|/ramp) ḋ); ramp = 0 is the published ground law, which
            ///< pulls: -kn d - c ḋ
};

/// Coefficients of a contact or a tactile sensor, or one value for each of them. The order is the
/// same everywhere.
template <class N>
struct Coefficients {
  N kn;       ///< normal stiffness [N/m]
  N kt;       ///< tangential damping [N s/m]; not a stiffness
  N mu;       ///< friction coefficient [-]
  N damping;  ///< k_d [N s/m²]; law linear: c [N s/m]
  N ks{};     ///< tangential stiffness [N/m]; 0: no shear springs

  [[gnu::always_inline]] constexpr N& operator[](std::size_t k) { return this->*kOrder[k]; }
  [[gnu::always_inline]] constexpr const N& operator[](std::size_t k) const {
    return this->*kOrder[k];
  }

 private:
  static constexpr N Coefficients::*kOrder[] = {&Coefficients::kn, &Coefficients::kt,
                                                &Coefficients::mu, &Coefficients::damping,
                                                &Coefficients::ks};
};
inline constexpr int kCoefficients = 5;
/// The first 4 coefficients can be scaled per tactile point.
inline constexpr int kPointCoefficients = 4;
/// The factor of a point that scales coefficient k. That of kt scales ks too.
constexpr std::size_t factor_index(std::size_t k) { return k < kPointCoefficients ? k : 1; }
/// Whether coefficient k of a contact by area counts per area: all but mu.
constexpr bool scales_with_area(std::size_t k) { return k != 2; }

/// Applies f to each coefficient, in order.
template <class N, class F>
[[gnu::always_inline]] inline auto transformed(const Coefficients<N>& c, const F& f)
    -> Coefficients<decltype(f(c.kn))> {
  return {f(c.kn), f(c.kt), f(c.mu), f(c.damping), f(c.ks)};
}

/// Shapes with a signed distance, which contact points and tactile points can touch.
enum class PrimitiveShape : std::uint8_t {
  sphere,
  cuboid,
  plane,
  cylinder,
  capsule,
  ellipsoid,
  mesh
};
inline constexpr int kPrimitiveShapes = 7;

}  // namespace tangere
