// SPDX-License-Identifier: Apache-2.0
// Lets Ctrl-C and a scheduler's SIGTERM end a run between two steps, where nothing is half-written.
#pragma once

#include <array>
#include <csignal>

namespace tangere::apps {

/// While an object lives, SIGINT and SIGTERM are remembered instead of ending the program (unless
/// the parent ignored them), and exceeding a file-size limit fails the write instead of raising
/// SIGXFSZ.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// The first SIGINT or SIGTERM that came; 0 if none came.
  [[nodiscard]] int received() const;

 private:
  std::array<struct sigaction, 3> previous_{};
};

}  // namespace tangere::apps
