// SPDX-License-Identifier: Apache-2.0
// Both files of a command are reserved before its first step, so a bad path costs no run.
#include "apps/text_output.hpp"

#include <fmt/format.h>

#include "engine/base/error.hpp"

namespace tangere::apps {

TextOutput::TextOutput(const std::string& path, bool overwrite) {
  if (!path.empty()) file_.emplace(path, overwrite);
}

void TextOutput::write(const std::string& text, const Console& console) {
  if (!file_) return;
  file_->write(text);
  file_->commit();
  console.print(fmt::format("wrote {} ({} bytes)", file_->output(), text.size()));
}

void check_outputs(const std::string& svg, const std::string& csv) {
  if (!svg.empty() && svg == csv)
    throw InputError(fmt::format("--svg and --csv are both '{}'; expected two files", svg));
}

}  // namespace tangere::apps
