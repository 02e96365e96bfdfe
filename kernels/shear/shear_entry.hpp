// SPDX-License-Identifier: Apache-2.0
// An entry of a shear state: the elastic displacement of one touching point.
#pragma once

#include <cstdint>

namespace tangere::kernels {

/// One touching point of an environment. Points that do not touch have no entry.
struct ShearEntry {
  std::int32_t point;  ///< number among the points of all contacts with shear springs, in order
  double s[3];         ///< elastic displacement, axes of the link that carries the point [m]
};

}  // namespace tangere::kernels
