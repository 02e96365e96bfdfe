// SPDX-License-Identifier: Apache-2.0
// Shows waiting people how far a run is.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "apps/console.hpp"

namespace tangere::apps {

/// On a terminal this is one line that rewrites itself at most ten times a second. Elsewhere it
/// prints a line every ten seconds when verbose, else nothing. When quiet it prints nothing.
class Progress {
 public:
  /// `unit` names what is counted up to `steps`. Each step counts for `environments` environments.
  Progress(const Console& console, std::string unit, std::int64_t steps, int environments);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void update(std::int64_t done);

 private:
  using Clock = std::chrono::steady_clock;
  std::string unit_;
  std::int64_t steps_;
  int environments_;
  bool terminal_, silent_;
  bool line_open_ = false;
  Clock::time_point start_, last_;
};

}  // namespace tangere::apps
