// SPDX-License-Identifier: Apache-2.0
// What a scene requires, as `inspect` reports it: the last steps of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Decides which effects are on, and why. Fills `effects`.
void decide_effects(CompiledModel& m);

/// Lists the stages of a step, what each works on and which variant of its kernel it runs. Fills
/// `stages`.
void list_stages(CompiledModel& m);

}  // namespace tangere
