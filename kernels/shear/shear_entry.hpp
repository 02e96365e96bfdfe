// SPDX-License-Identifier: Apache-2.0
// One touching point of a shear state, as the engine stores it.
#pragma once

#include <cstdint>

namespace tangere::kernels {

/// One touching point. Points of all contacts with shear springs are numbered consecutively.
struct ShearEntry {
  std::int32_t point;
  double s[3];  ///< elastic displacement, axes of the link that carries the point [m]
};

}  // namespace tangere::kernels
