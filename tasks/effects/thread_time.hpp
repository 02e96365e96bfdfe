// SPDX-License-Identifier: Apache-2.0
// The clock by which single steps are timed.
#pragma once

#include <ctime>

namespace tangere {

/// Returns the CPU time of this thread [s], which other processes do not disturb as they do the
/// wall clock.
inline double thread_seconds() {
  std::timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace tangere
