// SPDX-License-Identifier: Apache-2.0
// Checks before a run that the system can start the requested threads. oneTBB calls std::terminate
// if it cannot.
#pragma once

namespace tangere {

/// Starts `threads` - 1 threads at once and ends them. Throws InputError, naming the limit that was
/// met, when the system refuses one.
void require_threads(int threads);

}  // namespace tangere
