// SPDX-License-Identifier: Apache-2.0
// Lines to streams. A stream that cannot be written is noticed once, when main flushes stdout.
#include "apps/console.hpp"

#include <cstdio>
#include <nlohmann/json.hpp>

namespace tangere::apps {
namespace {

void write_line(std::FILE* stream, const std::string& text) {
  std::fputs((text + '\n').c_str(), stream);
}

}  // namespace

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
  // Names from files may be no UTF-8; the object must be JSON all the same.
  if (json) write_line(stdout, object.dump(2, ' ', false, Json::error_handler_t::replace));
}

}  // namespace tangere::apps
