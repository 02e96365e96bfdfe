// SPDX-License-Identifier: Apache-2.0
// Effects and stages of a compiled model, as `inspect` reports them: the last steps of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Fills `effects`: which effects are on, and the reason.
void decide_effects(CompiledModel& m);

/// Fills `stages`: the stages of a step, with the elements and the kernel variant of each.
void list_stages(CompiledModel& m);

}  // namespace tangere
