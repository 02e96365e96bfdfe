// SPDX-License-Identifier: Apache-2.0
// Faces of cuboids that lie flush on another cuboid of the same link, where nothing can touch them.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Sets PairContact::beyond of contacts by area, where another cuboid on the link of the touched
/// one, which the same body touches as well, covers one of its faces. So a body that slides over
/// the seam of flush cuboids is not pushed along by faces inside the solid. A cuboid inside another
/// one loses its contact.
void find_inner_faces(CompiledModel& m);

}  // namespace tangere
