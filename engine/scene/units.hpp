// SPDX-License-Identifier: Apache-2.0
// Units of the numbers of a scene, and what one of each is where a scene counts in cm and g.
#pragma once

#include <cstdint>

namespace tangere {

enum class Unit : std::uint8_t {
  one,
  s,
  m,
  m_per_s,
  m_per_s2,
  rad,
  rad_per_s,
  N,
  N_m,
  N_per_m,
  N_s_per_m,
  N_s_per_m2,
  N_per_m3,
  Pa,
  N_s_per_m3,
  N_s_per_m4,
  N_m_per_rad,
  N_m_s_per_rad,
  kg,
  kg_m2,
  kg_per_m3,
};

struct UnitRow {
  const char* text;
  double in_si;  ///< the same unit of a scene in cm and g, in SI
};
/// A moment of inertia is an inertia of one dof that turns, and the inertia of a body.
inline constexpr UnitRow kUnits[] = {{"1", 1},
                                     {"s", 1},
                                     {"m", 1e-2},
                                     {"m/s", 1e-2},
                                     {"m/s^2", 1e-2},
                                     {"rad", 1},
                                     {"rad/s", 1},
                                     {"N", 1e-5},
                                     {"N m", 1e-7},
                                     {"N/m", 1e-3},
                                     {"N s/m", 1e-3},
                                     {"N s/m^2", 0.1},
                                     {"N/m^3", 10},
                                     {"Pa", 0.1},
                                     {"N s/m^3", 10},
                                     {"N s/m^4", 1e3},
                                     {"N m/rad", 1e-7},
                                     {"N m s/rad", 1e-7},
                                     {"kg", 1e3 * 1e-2 * 1e-2 * 1e-2},
                                     {"kg m^2", 1e-7},
                                     {"kg/m^3", 1e3}};

constexpr const char* to_string(Unit unit) { return kUnits[static_cast<int>(unit)].text; }

}  // namespace tangere
