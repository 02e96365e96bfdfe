// SPDX-License-Identifier: Apache-2.0
// Reads /proc/meminfo, the files of control groups, version 2, and limits of the process.
#include "apps/memory.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>

#include "engine/base/error.hpp"

namespace tangere::apps {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::infinity();

double machine_memory() {
  std::ifstream file("/proc/meminfo");
  std::string label, unit;
  for (double kilobytes = 0; file >> label >> kilobytes;) {
    if (label == "MemAvailable:") return kilobytes * 1024;
    std::getline(file, unit);
  }
  return kUnknown;
}

double container_memory() {
  double limit = 0, used = 0;  // "max" is no number: no limit
  if (!(std::ifstream("/sys/fs/cgroup/memory.max") >> limit)) return kUnknown;
  if (!(std::ifstream("/sys/fs/cgroup/memory.current") >> used)) return kUnknown;
  return std::max(0.0, limit - used);
}

/// Of the address space that this process may have.
double process_memory() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnknown;
  double pages = 0;
  if (!(std::ifstream("/proc/self/statm") >> pages)) return kUnknown;
  return std::max(0.0, static_cast<double>(limit.rlim_cur) -
                           pages * static_cast<double>(sysconf(_SC_PAGESIZE)));
}

}  // namespace

double available_memory() {
  return std::min({machine_memory(), container_memory(), process_memory()});
}

void check_memory(double bytes, const std::string& request) {
  const double available = available_memory();
  if (bytes > available)
    throw InputError(
        fmt::format("{} needs {:.0f} bytes ({:.1f} GB) of memory; {:.0f} bytes "
                    "({:.1f} GB) are available",
                    request, bytes, bytes / 1e9, available, available / 1e9));
}

}  // namespace tangere::apps
