// SPDX-License-Identifier: Apache-2.0
// Shear state: the elastic displacement of every touching point of contacts with a tangential
// stiffness k_s (docs/shear.md). All other inputs of the contact law follow from q and v.
#pragma once

#include <cstdint>
#include <vector>

namespace tangere {

/// One touching point. Points of all contacts with shear springs are numbered consecutively.
struct ShearEntry {
  std::int32_t point;
  double s[3];  ///< elastic displacement, axes of the link that carries the point [m]
};
/// Of one environment, by rising point. A point that is not in it has not moved or does not touch.
using ShearState = std::vector<ShearEntry>;

}  // namespace tangere
