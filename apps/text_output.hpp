// SPDX-License-Identifier: Apache-2.0
// A picture or table that is written at the end of a run, in place of which nothing half-written
// can be.
#pragma once

#include <optional>
#include <string>

#include "apps/console.hpp"
#include "io/files/part_file.hpp"

namespace tangere::apps {

/// A file that is reserved before the first step. At the end it is complete or absent.
class TextOutput {
 public:
  /// An empty path stands for no output. Throws IoError like PartFile.
  TextOutput(const std::string& path, bool overwrite);
  [[nodiscard]] bool requested() const { return file_.has_value(); }
  /// Writes the text and prints a line about it; does nothing without an output path.
  void write(const std::string& text, const Console& console);

 private:
  std::optional<PartFile> file_;
};

/// Throws InputError if --svg and --csv are one file. An empty name stands for an option that was
/// not given.
void check_outputs(const std::string& svg, const std::string& csv);

}  // namespace tangere::apps
