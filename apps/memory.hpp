// SPDX-License-Identifier: Apache-2.0
// Refuses requests that need too much memory, before the kernel kills the program in the middle of
// a run.
#pragma once

#include <string>

namespace tangere::apps {

/// Returns the memory that this process can still take without pushing others out [bytes]: that of
/// the machine, of the container (control group) or of the process (ulimit -v), whichever is least.
/// Infinite if the system does not say.
double available_memory();

/// Throws InputError naming both numbers when a request needs more bytes than are available.
void check_memory(double bytes, const std::string& request);

}  // namespace tangere::apps
