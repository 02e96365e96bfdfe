// SPDX-License-Identifier: Apache-2.0
// A clear refusal beats a visit of the kernel's out-of-memory killer in the middle of a run.
#pragma once

#include <string>

namespace tangere::apps {

/// Memory that this process may still take without pushing others out [bytes]: of the machine, or
/// of the container (control group) where that is less. Infinite when the system does not say.
double available_memory();

/// Throws InputError naming both numbers when a request needs more bytes than there are.
void check_memory(double bytes, const std::string& request);

}  // namespace tangere::apps
