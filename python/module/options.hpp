// SPDX-License-Identifier: Apache-2.0
// Arguments that several classes take.
#pragma once

#include <optional>
#include <string>

#include "engine/base/precision.hpp"
#include "python/module/whole_number.hpp"

namespace tangere::python {

/// Threads of a `threads` argument: as many as the process may use, for None.
int threads_of(const std::optional<Whole<int>>& requested);

/// The precision of that name. Throws InputError for another name than "mixed" and "double".
Precision precision_named(const std::string& name);

}  // namespace tangere::python
