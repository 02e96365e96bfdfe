// SPDX-License-Identifier: Apache-2.0
// Sends text to people and one JSON object to programs. The two never share a stream.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace tangere::apps {

/// Exit codes of the command (docs/command.md).
enum ExitCode {
  kDone = 0,
  kSomeFailed = 1,
  kUsage = 2,
  kInputOutput = 3,
  kTerminated = 75,
  kInterrupted = 130
};

/// Keys keep the order in which they are written.
using Json = nlohmann::ordered_json;

/// Returns a number, or null if it is infinite, because JSON has no infinity.
Json finite(double x);
/// A relative error for people; "-" where it is infinite or unknown.
std::string percent(double error);

struct Console {
  bool json = false, quiet = false, verbose = false;

  /// Prints errors and failures on stderr, always.
  void fail(const std::string& text) const;
  /// Prints warnings and remarks on stderr, unless quiet.
  void note(const std::string& text) const;
  /// Prints details on stderr, only when verbose.
  void detail(const std::string& text) const;
  /// Prints the result for people, unless quiet: on stdout, or on stderr when stdout belongs to the
  /// JSON object.
  void print(const std::string& text) const;
  /// Prints the one JSON object on stdout, if --json was given.
  void result(const Json& object) const;
};

}  // namespace tangere::apps
