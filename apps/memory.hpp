// SPDX-License-Identifier: Apache-2.0
// Checks the memory requirement of a run against the available memory before it starts.
#pragma once

#include <string>

namespace tangere::apps {

/// Returns the available memory of the machine, the container (control group) or the process
/// (ulimit
/// -v), whichever is least [bytes]. Infinite if the system does not report it.
double available_memory();

/// Throws InputError naming both numbers when a request needs more bytes than are available.
void check_memory(double bytes, const std::string& request);

}  // namespace tangere::apps
