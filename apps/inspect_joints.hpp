// SPDX-License-Identifier: Apache-2.0
// What `tangere inspect` says about joints and motors.
#pragma once

#include <string>

#include "apps/console.hpp"
#include "engine/model/model.hpp"

namespace tangere::apps {

/// What acts on the dofs of every joint that has such effects; SI, limits and rest null where there
/// are none.
Json joint_effects_json(const Scene& scene);
std::string joint_effects_text(const Scene& scene);

/// Motors in file order; a bound of a range that is not there is null.
Json motors_json(const Scene& scene);
std::string motors_text(const Scene& scene);

}  // namespace tangere::apps
