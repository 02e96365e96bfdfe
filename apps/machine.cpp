// SPDX-License-Identifier: Apache-2.0
// Reads /proc/cpuinfo and the processors that this process is bound to.
#include "apps/machine.hpp"

#include <algorithm>
#include <fstream>
#include <thread>

namespace tangere::apps {

std::string processor_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown processor";
}

int processor_count() { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

std::vector<int> default_thread_counts() {
  const int most = processor_count();
  std::vector<int> counts;
  for (int n = 1; n < most; n *= 2) counts.push_back(n);
  counts.push_back(most);
  return counts;
}

}  // namespace tangere::apps
