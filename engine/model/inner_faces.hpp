// SPDX-License-Identifier: Apache-2.0
// Faces of cuboids that lie flush on another cuboid of the same link, where nothing can touch them.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Sets PairContact::inner_faces of contacts by area: the faces of the touched cuboid that another
/// cuboid on its link covers, which the same body touches as well. Without them a body that slides
/// over the seam of flush cuboids is pushed along, not up, by faces inside the solid.
void find_inner_faces(CompiledModel& m);

}  // namespace tangere
