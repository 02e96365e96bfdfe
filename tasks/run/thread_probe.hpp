// SPDX-License-Identifier: Apache-2.0
// Threads that the system refuses end oneTBB in std::terminate, in the middle of a run. So they are
// asked for beforehand.
#pragma once

namespace tangere {

/// Starts `threads` - 1 threads at once and ends them. Throws InputError, naming the limit that was
/// met, when the system refuses one.
void require_threads(int threads);

}  // namespace tangere
