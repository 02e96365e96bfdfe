// SPDX-License-Identifier: Apache-2.0
// Reports what the pitch of tactile points buys: rows and a sentence for people, a list for
// programs.
#pragma once

#include <span>
#include <string>

#include "apps/console.hpp"
#include "tasks/accuracy/pitch_sweep.hpp"

namespace tangere::apps {

/// A table for each sensor; for one that is left out, why.
std::string pitch_table(std::span<const PitchSweep> sweeps, const Model& model);
/// A sentence for each sensor, with the coarsest pad whose force error is at most `target`; "" if
/// no pad was swept.
std::string pitch_advice(std::span<const PitchSweep> sweeps, const Model& model, double target);
Json pitches_json(std::span<const PitchSweep> sweeps, const Model& model);

}  // namespace tangere::apps
