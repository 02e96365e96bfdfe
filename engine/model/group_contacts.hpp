// SPDX-License-Identifier: Apache-2.0
// Puts contacts of the same links side by side. Folding leaves many shapes on one link, which all
// move alike. A step of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Finds the contacts that share their links. Fills link_pairs, grounded and the orders.
void group_contacts(CompiledModel& m);

}  // namespace tangere
