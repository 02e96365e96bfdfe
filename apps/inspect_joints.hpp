// SPDX-License-Identifier: Apache-2.0
// Reports joints, motors, loops and transmissions for `tangere inspect`.
#pragma once

#include <string>

#include "apps/console.hpp"
#include "engine/model/model.hpp"

namespace tangere::apps {

/// The effects of every joint that has any, in SI. Missing limits and rest positions are null.
Json joint_effects_json(const Scene& scene);
std::string joint_effects_text(const Scene& scene);

/// Motors in file order. A missing bound of a range is null.
Json motors_json(const Scene& scene);
std::string motors_text(const Scene& scene);

/// Loops in file order, with the gap at the start [m].
Json loops_json(const Model& model);
std::string loops_text(const Model& model);

/// Transmissions in file order, with their lengths at the start [m].
Json transmissions_json(const Model& model);
std::string transmissions_text(const Model& model);

}  // namespace tangere::apps
