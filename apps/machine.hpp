// SPDX-License-Identifier: Apache-2.0
// A speed means nothing without the machine it was measured on.
#pragma once

#include <string>
#include <vector>

namespace tangere::apps {

/// The processor's name as Linux tells it; "unknown processor" where it does not.
std::string processor_name();

/// Processors that this process may use, at least 1.
int processor_count();

/// 1, 2, 4, … up to the processors that there are, and that number itself.
std::vector<int> default_thread_counts();

}  // namespace tangere::apps
