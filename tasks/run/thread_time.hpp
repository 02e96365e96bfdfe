// SPDX-License-Identifier: Apache-2.0
// CPU clocks of threads and of the process, which are less sensitive to other processes than the
// wall clock.
#pragma once

#include <ctime>

namespace tangere {

inline double seconds_of(clockid_t clock) {
  std::timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Returns the CPU time of this thread [s].
inline double thread_seconds() { return seconds_of(CLOCK_THREAD_CPUTIME_ID); }
/// Returns the CPU time of all threads of this process [s].
inline double process_seconds() { return seconds_of(CLOCK_PROCESS_CPUTIME_ID); }

}  // namespace tangere
