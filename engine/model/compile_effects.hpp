// SPDX-License-Identifier: Apache-2.0
// Effects and stages of a compiled model, as `inspect` reports them: the last steps of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Fills `effects`: which effects are on, and the reason.
void decide_effects(CompiledModel& m);

/// Lists the stages of a step, what each works on and which variant of its kernel it runs. Fills
/// `stages`.
void list_stages(CompiledModel& m);

}  // namespace tangere
