// SPDX-License-Identifier: Apache-2.0
// What friction remembers between steps (docs/shear.md): the elastic displacement of every point
// that touches, for contacts with a tangential stiffness. All else that the law needs follows from
// the state.
#pragma once

#include <cstdint>
#include <vector>

namespace tangere {

/// One point that touches. Points of all contacts that remember are numbered through.
struct ShearEntry {
  std::int32_t point;
  double s[3];  ///< elastic displacement, axes of the link that carries the point [m]
};
/// Of one environment, by rising point. A point that is not in it has not moved or does not touch.
using ShearState = std::vector<ShearEntry>;

}  // namespace tangere
