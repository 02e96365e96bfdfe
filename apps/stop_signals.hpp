// SPDX-License-Identifier: Apache-2.0
// Handles SIGINT and SIGTERM: runs end between two steps with complete files; other work ends at
// once and its incomplete files are removed.
#pragma once

#include <array>
#include <csignal>
#include <functional>
#include <stop_token>
#include <string>

#include "apps/console.hpp"

namespace tangere::apps {

/// The line for programs that goes with a code and a message; empty without --json.
using ObjectOfError = std::function<std::string(ExitCode code, const std::string& what)>;

/// Installs handlers: SIGINT and SIGTERM (unless the parent ignored them) remove the .part of every
/// output and end the process with kInterrupted or kTerminated, a message and the error object of
/// `object`. So do crashes, with kUsage, because HDF5 does not check all allocations. In a `child`,
/// whose parent reports crashes, they only remove the .parts. Exceeding a file-size limit fails the
/// write instead of raising SIGXFSZ.
void end_by_signals(const ObjectOfError& object, bool child);
/// Ignores SIGINT and SIGTERM from now on, because the result has been printed.
void ignore_signals();

/// During the lifetime of this object, SIGINT and SIGTERM request a stop instead of ending the
/// program (unless the parent ignored them).
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Stop is requested from the first SIGINT or SIGTERM on.
  [[nodiscard]] std::stop_token token() const;
  /// The first SIGINT or SIGTERM that came; 0 if none came.
  [[nodiscard]] int received() const;

 private:
  std::array<struct sigaction, 2> previous_{};
};

}  // namespace tangere::apps
