// SPDX-License-Identifier: Apache-2.0
// A column's unit stands behind its name: after an underscore, a blank, or in brackets. What is no
// unit makes another column.
#include "apps/press_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

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
/// A field takes the place of the forces.
constexpr Column<PressRecording> kFieldColumns[] = {{"time", "s", &PressRecording::time},
                                                    {"depth", "m", &PressRecording::depth, true},
                                                    {"displacement", "m", &PressRecording::depth},
                                                    {"shear", "m", &PressRecording::shear},
                                                    {"x", "m", &PressRecording::x},
                                                    {"y", "m", &PressRecording::y}};
constexpr Column<ChannelRecording> kChannelColumns[] = {
    {"depth", "m", &ChannelRecording::depth, true},
    {"displacement", "m", &ChannelRecording::depth},
    {"x", "m", &ChannelRecording::x},
    {"y", "m", &ChannelRecording::y},
    {"shear", "m", &ChannelRecording::shear}};
constexpr const char *kChannel = "channel_", *kField = "field";
constexpr const char* kBetween = "_ [](),";  // a name and its unit
constexpr std::size_t kMostNotes = 4;        // columns that are named one by one

/// A column of the table that stands for one of another name, and the factor of its numbers.
struct Alias {
  std::string name, column;
  double factor = 1;
};

Alias read_alias(const std::string& text) {
  const std::size_t equals = text.find('=');
  Alias out{text.substr(0, equals), equals == std::string::npos ? "" : text.substr(equals + 1), 1};
  if (const std::size_t times = out.column.find('*'); times != std::string::npos) {
    const std::string factor = out.column.substr(0, times);
    char* end = nullptr;
    out.factor = std::strtod(factor.c_str(), &end);
    out.column = end == factor.c_str() + factor.size() ? out.column.substr(times + 1) : "";
  }
  if (out.name.empty() || out.column.empty())
    throw InputError(
        fmt::format("--column '{}'; expected NAME=COLUMN or NAME=FACTOR*COLUMN", text));
  if (!std::isfinite(out.factor) || out.factor == 0)
    throw InputError(fmt::format(
        "--column '{}': a factor of {}; expected a finite one other than 0", text, out.factor));
  return out;
}

std::vector<Alias> read_aliases(std::span<const std::string> texts) {
  std::vector<Alias> out;
  for (const std::string& text : texts) {
    out.push_back(read_alias(text));
    for (std::size_t k = 0; k + 1 < out.size(); ++k)
      if (out[k].name == out.back().name)
        throw InputError(fmt::format("--column '{}' and --column '{}'; expected one column for {}",
                                     texts[k], text, out[k].name));
  }
  return out;
}

/// A column of a table, with the factor and the unit of its numbers.
template <class Recording>
struct Found {
  const Column<Recording>* column = nullptr;
  double factor = 1;
  std::string unit{};  ///< as it stands in the table
};

/// Returns the column that a name of the table stands for; none for others, such as force_std.
template <class Recording>
Found<Recording> find_column(std::span<const Column<Recording>> columns, const std::string& name) {
  for (const Column<Recording>& column : columns) {
    if (!name.starts_with(column.name)) continue;
    const std::string rest = name.substr(std::string(column.name).size());
    const std::size_t first = rest.find_first_not_of(kBetween);
    if (first == 0) continue;  // another word
    const std::string unit = first == std::string::npos
                                 ? ""
                                 : rest.substr(first, rest.find_last_not_of(kBetween) + 1 - first);
    if (unit.empty() || unit == column.unit) return {&column, 1, unit};
    if (unit == std::string("m") + column.unit) return {&column, 1e-3, unit};
  }
  return {};
}

/// "; the field 'taxel/0_mN' is read by --column field=0.001*taxel": where no other was found.
std::string field_hint(const NamedColumns& table) {
  for (const std::string& name : table.names) {
    const std::size_t at = name.find("/0");
    if (at == 0 || at == std::string::npos) continue;
    const std::string rest = name.substr(at + 2);
    if (!rest.empty() && std::string(kBetween).find(rest[0]) == std::string::npos) continue;
    return fmt::format("; the field '{}' is read by --column {}={}{}", name, kField,
                       name.find("mN") == std::string::npos ? "" : "0.001*", name.substr(0, at));
  }
  return "";
}

/// Copies the columns that a recording has. Calls other(number, name) for the rest, and
/// unit(name, unit) for units that the table names.
template <class Recording, class F, class G>
void copy_columns(const NamedColumns& table, std::span<const Column<Recording>> columns,
                  std::span<const Alias> aliases, const std::string& path, Recording& out,
                  const F& other, const G& unit) {
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    Found<Recording> found = find_column(columns, table.names[c]);
    for (const Alias& alias : aliases) {
      if (found.column != nullptr && alias.name == found.column->name) found = {};  // another's
      if (alias.column == table.names[c])
        for (const Column<Recording>& column : columns)
          if (alias.name == column.name) found = {&column, alias.factor, ""};
      if (alias.column == table.names[c]) break;
    }
    if (found.column == nullptr) {
      other(c, table.names[c]);
      continue;
    }
    std::vector<double>& to = out.*found.column->member;
    if (!to.empty())
      throw InputError(fmt::format("{}: a second column for {}: '{}'; expected one", path,
                                   found.column->name, table.names[c]));
    to = table.columns[c];
    for (double& x : to) x *= found.factor;
    unit(found.column->name, found.unit);
  }
  for (const Column<Recording>& column : columns)
    if (column.needed && (out.*column.member).empty())
      throw InputError(fmt::format("{}: no column '{}' among {}; expected one in {} or m{}{}", path,
                                   column.name, fmt::join(table.names, ", "), column.unit,
                                   column.unit,
                                   column.name == std::string("force") ? field_hint(table) : ""));
}

void note_unused(const Console& console, const std::string& path,
                 const std::vector<std::string>& names) {
  if (names.size() > kMostNotes)
    console.note(fmt::format("{}: {} columns are not used: '{}' to '{}'", path, names.size(),
                             names.front(), names.back()));
  else
    for (const std::string& name : names)
      console.note(fmt::format("{}: column '{}' is not used", path, name));
}

/// The number behind the '/' of a column's name; none for others. `unit`: whether one may follow.
std::optional<std::size_t> number_in(const std::string& name, const std::string& before,
                                     bool unit) {
  if (!name.starts_with(before + "/")) return std::nullopt;
  std::string digits = name.substr(before.size() + 1);
  if (unit) digits.resize(std::min(digits.find_first_of(kBetween), digits.size()));
  if (digits.empty() || digits.size() > 6 ||
      digits.find_first_not_of("0123456789") != std::string::npos)
    return std::nullopt;
  return std::stoul(digits);
}

/// Columns of a field, by their number.
struct FieldColumns {
  std::string name;
  double factor = 1;
  std::vector<std::size_t> at;

  [[nodiscard]] bool has(std::size_t column) const { return std::ranges::count(at, column) > 0; }
};

FieldColumns find_field(const NamedColumns& table, const PressTableSensor& sensor,
                        std::span<const Alias> aliases) {
  std::vector<Alias> names;
  for (const Alias& alias : aliases)
    if (alias.name == kField) names.push_back(alias);
  const bool named = !names.empty();
  if (!named)
    for (const std::string& name :
         {std::string("force"), std::string("pressure"), sensor.name, sensor.name + ".pressure"})
      names.push_back({kField, name, 1});
  FieldColumns out;
  for (const Alias& name : names) {
    std::vector<std::pair<std::size_t, std::size_t>> found;  // number, column
    for (std::size_t c = 0; c < table.names.size(); ++c)
      if (const auto number = number_in(table.names[c], name.column, named))
        found.push_back({*number, c});
    if (found.empty()) continue;
    if (!out.at.empty())
      throw InputError(fmt::format("{}two fields, '{}/0' and '{}/0'; expected --column {}=NAME",
                                   table.header, out.name, name.column, kField));
    std::ranges::sort(found);
    out.name = name.column, out.factor = name.factor;
    for (std::size_t k = 0; k < found.size(); ++k) {
      if (found[k].first != k)
        throw InputError(fmt::format("{}no column '{}/{}' before '{}'; expected all numbers from 0",
                                     table.header, out.name, k, table.names[found[k].second]));
      out.at.push_back(found[k].second);
    }
  }
  if (named && out.at.empty())
    throw InputError(fmt::format("{}no column '{}/0' among {}", table.header, names[0].column,
                                 fmt::join(table.names, ", ")));
  const std::size_t count = out.at.size();
  if (count > 0 && count != sensor.points && count != 3 * sensor.points)
    throw InputError(
        fmt::format("{}{} columns '{}/0' to '{}/{}'; expected {}, a pressing force for each point "
                    "of '{}', or {}, with those along axis0 and axis1 before it",
                    table.header, count, out.name, out.name, count - 1, sensor.points, sensor.name,
                    3 * sensor.points));
  return out;
}

void copy_field(const NamedColumns& table, const FieldColumns& columns, std::size_t points,
                PressRecording& out) {
  out.points = points;
  const bool vectors = columns.at.size() == 3 * points;
  for (std::size_t row = 0; row < table.columns[0].size(); ++row)
    for (std::size_t k = 0; k < columns.at.size(); ++k) {
      const double f = columns.factor * table.columns[columns.at[k]][row];
      (vectors && k % 3 != 2 ? out.shear_field : out.field).push_back(f);
    }
}

}  // namespace

PressRecording read_press(const std::string& path, const PressTableSensor& sensor,
                          const Console& console) {
  const NamedColumns table = read_named_columns(path);
  const std::vector<Alias> aliases = read_aliases(sensor.columns);
  const FieldColumns field = find_field(table, sensor, aliases);
  const std::span<const Column<PressRecording>> columns =
      field.at.empty() ? std::span<const Column<PressRecording>>(kColumns) : kFieldColumns;
  for (const Alias& alias : aliases) {
    std::vector<std::string> known{kField};
    for (const Column<PressRecording>& column : columns) known.emplace_back(column.name);
    if (std::ranges::count(known, alias.name) == 0)
      throw InputError(
          fmt::format("--column {}=…; expected one of {}", alias.name, fmt::join(known, ", ")));
    if (alias.name != kField && std::ranges::count(table.names, alias.column) == 0)
      throw InputError(fmt::format("{}no column '{}' among {}", table.header, alias.column,
                                   fmt::join(table.names, ", ")));
  }
  PressRecording out;
  std::vector<std::string> unused;
  copy_columns<PressRecording>(
      table, columns, aliases, path, out,
      [&](std::size_t c, const std::string& name) {
        if (!field.has(c)) unused.push_back(name);
      },
      [&](const std::string& name, const std::string& unit) {
        if (name == "time") out.units.time = unit;
        if (name == "force") out.units.force = unit;
        if (name == "depth" || name == "displacement") out.units.depth = unit;
      });
  if (!field.at.empty()) copy_field(table, field, sensor.points, out);
  out.lines = table.lines;
  note_unused(console, path, unused);
  return out;
}

ChannelRecording read_channel_press(const std::string& path, const Console& console) {
  const NamedColumns table = read_named_columns(path);
  ChannelRecording out;
  std::vector<std::string> unused;
  copy_columns<ChannelRecording>(
      table, kChannelColumns, {}, path, out,
      [&](std::size_t c, const std::string& name) {
        if (!name.starts_with(kChannel)) return unused.push_back(name);
        out.names.push_back(name.substr(std::string(kChannel).size()));
        out.channels.push_back(table.columns[c]);
      },
      [](const std::string&, const std::string&) {});
  note_unused(console, path, unused);
  if (out.channels.empty())
    throw InputError(fmt::format("{}: no column 'channel_NAME' among {}; expected one at least",
                                 path, fmt::join(table.names, ", ")));
  return out;
}

}  // namespace tangere::apps
