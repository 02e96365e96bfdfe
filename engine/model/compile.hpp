// SPDX-License-Identifier: Apache-2.0
// A scene becomes a compiled model.
#pragma once

#include <memory>

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Turns names into indices and joints into elementary links. Throws InputError. The model must not
/// be copied: its view points into its own vectors.
std::shared_ptr<const CompiledModel> compile(const Scene& scene);

}  // namespace tangere
