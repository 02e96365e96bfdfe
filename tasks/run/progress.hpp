// SPDX-License-Identifier: Apache-2.0
// The two ways in which long runs speak with their callers: progress goes out through a callback,
// and a std::stop_token that is requested to stop ends the run before its next step.
#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>

namespace tangere {

/// Is called with the steps done so far, by one thread at a time.
using ProgressCallback = std::function<void(std::int64_t steps)>;

}  // namespace tangere
