// SPDX-License-Identifier: Apache-2.0
// Who reads what: people read text, programs read one JSON object, and the two never share a
// stream.
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

struct Console {
  bool json = false, quiet = false, verbose = false;

  /// Errors and failures, on stderr, always.
  void fail(const std::string& text) const;
  /// Warnings and remarks, on stderr; not when quiet.
  void note(const std::string& text) const;
  /// Details, on stderr; only when verbose.
  void detail(const std::string& text) const;
  /// What was asked for, on stdout, or on stderr when that belongs to the JSON object; not when
  /// quiet.
  void print(const std::string& text) const;
  /// The one JSON object, on stdout, when asked for.
  void result(const Json& object) const;
};

}  // namespace tangere::apps
