// SPDX-License-Identifier: Apache-2.0
// Writes lines to streams. main detects a stream that cannot be written when it flushes stdout.
#include "apps/console.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "io/files/printable_text.hpp"

namespace tangere::apps {
namespace {

void write_line(std::FILE* stream, const std::string& text) {
  // In JSON such a character stands within a string, where its escape means the same.
  std::fputs((printable(text) + '\n').c_str(), stream);
}

}  // namespace

Json finite(double x) { return std::isfinite(x) ? Json(x) : Json(); }

std::string percent(double error) {
  if (!std::isfinite(error)) return "-";
  return error < 0.1 ? fmt::format("{:.2g} %", 100 * error) : fmt::format("{:.0f} %", 100 * error);
}

void Console::fail(const std::string& text) const { write_line(stderr, text); }

void Console::note(const std::string& text) const {
  if (!quiet) write_line(stderr, text);
}

void Console::detail(const std::string& text) const {
  if (verbose) write_line(stderr, text);
}

void Console::print(const std::string& text) const {
  if (!quiet) write_line(json ? stderr : stdout, text);
}

void Console::result(const Json& object) const {
  // Names from files may not be UTF-8, but the object must be JSON.
  if (json) write_line(stdout, object.dump(2, ' ', false, Json::error_handler_t::replace));
}

}  // namespace tangere::apps
