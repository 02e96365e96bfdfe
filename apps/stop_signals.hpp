// SPDX-License-Identifier: Apache-2.0
// Lets Ctrl-C and a scheduler's SIGTERM end a run between two steps, where nothing is half-written,
// and every other work at once, with its half-written files removed.
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

/// From now on SIGINT and SIGTERM (unless the parent ignored them) remove the .part of every output
/// and end the process with kInterrupted or kTerminated, a message and what `object` gives for
/// them. So do crashes, with kUsage: HDF5 uses some memory without checking that it got it. In a
/// `child` whose parent explains crashes they only remove the .parts. Exceeding a file-size limit
/// fails the write instead of raising SIGXFSZ.
void end_by_signals(const ObjectOfError& object, bool child);
/// From now on SIGINT and SIGTERM change nothing any more: the result has been told.
void ignore_signals();

/// While an object lives, SIGINT and SIGTERM are remembered instead of ending the program (unless
/// the parent ignored them).
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Asks to stop from the first SIGINT or SIGTERM on.
  [[nodiscard]] std::stop_token token() const;
  /// The first SIGINT or SIGTERM that came; 0 if none came.
  [[nodiscard]] int received() const;

 private:
  std::array<struct sigaction, 2> previous_{};
};

}  // namespace tangere::apps
