// SPDX-License-Identifier: Apache-2.0
// How far a run is, for people who wait.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "apps/console.hpp"

namespace tangere::apps {

/// One line that rewrites itself, at most ten times a second, where stderr is a terminal; elsewhere
/// nothing, or a line every ten seconds when verbose; never when quiet.
class Progress {
 public:
  /// `unit`: what is counted to `steps`, each of them a step of `environments`.
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
