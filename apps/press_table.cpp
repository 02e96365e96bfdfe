// SPDX-License-Identifier: Apache-2.0
// A column's unit stands behind its name: after an underscore, a blank, or in brackets. What is no
// unit makes another column.
#include "apps/press_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <span>

#include "engine/base/error.hpp"
#include "io/files/csv.hpp"

namespace tangere::apps {
namespace {

template <class Recording>
struct Column {
  const char *name, *unit;  ///< unit: without a prefix
  std::vector<double> Recording::*member;
  bool needed = false;
};
constexpr Column<PressRecording> kColumns[] = {{"time", "s", &PressRecording::time},
                                               {"depth", "m", &PressRecording::depth, true},
                                               {"displacement", "m", &PressRecording::depth},
                                               {"force", "N", &PressRecording::force, true},
                                               {"shear_force", "N", &PressRecording::shear_force},
                                               {"shear", "m", &PressRecording::shear}};
constexpr Column<ChannelRecording> kChannelColumns[] = {
    {"depth", "m", &ChannelRecording::depth, true},
    {"displacement", "m", &ChannelRecording::depth},
    {"x", "m", &ChannelRecording::x},
    {"y", "m", &ChannelRecording::y},
    {"shear", "m", &ChannelRecording::shear}};
constexpr const char* kChannel = "channel_";

/// Returns the column that a name of the table stands for, and the factor of its unit; null for
/// others, such as force_std.
template <class Recording>
const Column<Recording>* find_column(std::span<const Column<Recording>> columns,
                                     const std::string& name, double& factor) {
  constexpr const char* kBetween = "_ [](),";
  for (const Column<Recording>& column : columns) {
    if (!name.starts_with(column.name)) continue;
    const std::string rest = name.substr(std::string(column.name).size());
    const std::size_t first = rest.find_first_not_of(kBetween);
    if (first == 0) continue;  // another word
    const std::string unit = first == std::string::npos
                                 ? std::string(column.unit)
                                 : rest.substr(first, rest.find_last_not_of(kBetween) + 1 - first);
    factor = unit == column.unit ? 1 : 1e-3;
    if (factor == 1 || unit == std::string("m") + column.unit) return &column;
  }
  return nullptr;
}

/// Copies the columns that a recording has. Calls other(number, name) for the rest.
template <class Recording, class F>
void copy_columns(const NamedColumns& table, std::span<const Column<Recording>> columns,
                  const std::string& path, Recording& out, const F& other) {
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    double factor = 1;
    const Column<Recording>* const column = find_column(columns, table.names[c], factor);
    if (column == nullptr) {
      other(c, table.names[c]);
      continue;
    }
    std::vector<double>& to = out.*column->member;
    if (!to.empty())
      throw InputError(fmt::format("{}: a second column for {}: '{}'; expected one", path,
                                   column->name, table.names[c]));
    to = table.columns[c];
    for (double& x : to) x *= factor;
  }
  for (const Column<Recording>& column : columns)
    if (column.needed && (out.*column.member).empty())
      throw InputError(fmt::format("{}: no column '{}' among {}; expected one in {} or m{}", path,
                                   column.name, fmt::join(table.names, ", "), column.unit,
                                   column.unit));
}

void note_unused(const Console& console, const std::string& path, const std::string& name) {
  console.note(fmt::format("{}: column '{}' is not used", path, name));
}

}  // namespace

PressRecording read_press(const std::string& path, const Console& console) {
  PressRecording out;
  copy_columns<PressRecording>(
      read_named_columns(path), kColumns, path, out,
      [&](std::size_t, const std::string& name) { note_unused(console, path, name); });
  return out;
}

ChannelRecording read_channel_press(const std::string& path, const Console& console) {
  const NamedColumns table = read_named_columns(path);
  ChannelRecording out;
  copy_columns<ChannelRecording>(table, kChannelColumns, path, out,
                                 [&](std::size_t c, const std::string& name) {
                                   if (!name.starts_with(kChannel))
                                     return note_unused(console, path, name);
                                   out.names.push_back(name.substr(std::string(kChannel).size()));
                                   out.channels.push_back(table.columns[c]);
                                 });
  if (out.channels.empty())
    throw InputError(fmt::format("{}: no column 'channel_NAME' among {}; expected one at least",
                                 path, fmt::join(table.names, ", ")));
  return out;
}

}  // namespace tangere::apps
