// SPDX-License-Identifier: Apache-2.0
// Contacts of the same links, side by side: folding leaves many shapes on one link, which all move
// alike. A step of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Which contacts share their links: fills link_pairs, grounded and the orders.
void group_contacts(CompiledModel& m);

}  // namespace tangere
