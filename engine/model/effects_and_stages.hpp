// SPDX-License-Identifier: Apache-2.0
// What a scene calls for, as `inspect` tells it: the last steps of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Which effects are on, and why: fills effects.
void decide_effects(CompiledModel& m);

/// The stages of a step, what each works on and which variant of its kernel it runs: fills stages.
void list_stages(CompiledModel& m);

}  // namespace tangere
