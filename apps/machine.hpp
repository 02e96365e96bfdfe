// SPDX-License-Identifier: Apache-2.0
// Describes the machine, because a speed means nothing without the machine it was measured on.
#pragma once

#include <string>
#include <vector>

namespace tangere::apps {

/// The processor's name as Linux reports it, else "unknown processor".
std::string processor_name();

/// Processors that this process may use, at least 1.
int processor_count();

/// 1, 2, 4, … up to the number of processors, and that number itself.
std::vector<int> default_thread_counts();

}  // namespace tangere::apps
