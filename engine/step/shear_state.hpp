// SPDX-License-Identifier: Apache-2.0
// Shear state: the elastic displacement of every touching point of contacts with a tangential
// stiffness k_s (docs/shear.md). All other inputs of the contact law follow from q and v.
#pragma once

#include <vector>

#include "kernels/shear/shear_entry.hpp"

namespace tangere {

using kernels::ShearEntry;
/// Of one environment, by rising point. A point that is not in it has not moved or does not touch.
using ShearState = std::vector<ShearEntry>;

}  // namespace tangere
