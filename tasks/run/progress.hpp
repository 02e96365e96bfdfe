// SPDX-License-Identifier: Apache-2.0
// Progress callback of long runs. A std::stop_token whose stop is requested ends a run before its
// next step.
#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>

namespace tangere {

/// Is called with the steps done so far, by one thread at a time.
using ProgressCallback = std::function<void(std::int64_t steps)>;

}  // namespace tangere
