// SPDX-License-Identifier: Apache-2.0
// A name with a dot or a slash is a file. Others may be either.
#include "apps/layout_text.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "apps/task_run.hpp"
#include "engine/base/error.hpp"
#include "io/files/nearest_name.hpp"
#include "io/files/text_file.hpp"

namespace tangere::apps {
namespace {

constexpr std::size_t kLargestLayout = std::size_t{16} << 20;

}  // namespace

std::string layout_text(const std::string& what, const std::string& layout) {
  if (const char* const text = program_scene("sensors/" + layout + ".xml")) return text;
  if (std::filesystem::exists(layout) || layout.find_first_of("./") != std::string::npos)
    return read_text_file(layout, kLargestLayout, "a layout");
  throw InputError(fmt::format("{}: '{}' is neither a file nor a layout of the program{}", what,
                               layout, suggestion(layout, program_sensors())));
}

}  // namespace tangere::apps
