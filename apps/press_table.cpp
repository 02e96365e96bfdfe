// SPDX-License-Identifier: Apache-2.0
// A column's unit stands behind its name: after an underscore, a blank, or in brackets.
#include "apps/press_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "engine/base/error.hpp"
#include "io/files/csv.hpp"

namespace tangere::apps {
namespace {

struct Column {
  const char *name, *unit;  ///< unit: without a prefix
  std::vector<double> PressRecording::*member;
};
constexpr Column kColumns[] = {
    {"time", "s", &PressRecording::time},
    {"depth", "m", &PressRecording::depth},
    {"displacement", "m", &PressRecording::depth},
    {"force", "N", &PressRecording::force},
    {"shear_force", "N", &PressRecording::shear_force},  // before shear, with which it begins
    {"shear", "m", &PressRecording::shear}};

/// Returns the column that a name of the table stands for, and its unit there; null for others.
const Column* find_column(const std::string& name, std::string& unit) {
  constexpr const char* kBetween = "_ [](),";
  for (const Column& column : kColumns) {
    if (!name.starts_with(column.name)) continue;
    const std::string rest = name.substr(std::string(column.name).size());
    const std::size_t first = rest.find_first_not_of(kBetween);
    if (first == 0) continue;  // another word
    unit = first == std::string::npos
               ? std::string(column.unit)
               : rest.substr(first, rest.find_last_not_of(kBetween) + 1 - first);
    return &column;
  }
  return nullptr;
}

}  // namespace

PressRecording read_press(const std::string& path, const Console& console) {
  const NamedColumns table = read_named_columns(path);
  PressRecording out;
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    std::string unit;
    const Column* const column = find_column(table.names[c], unit);
    if (column == nullptr) {
      console.note(fmt::format("{}: column '{}' is not used", path, table.names[c]));
      continue;
    }
    if (unit != column->unit && unit != std::string("m") + column->unit)
      throw InputError(fmt::format("{}: column '{}' is in '{}'; expected {} or m{}", path,
                                   table.names[c], unit, column->unit, column->unit));
    std::vector<double>& to = out.*column->member;
    if (!to.empty())
      throw InputError(fmt::format("{}: a second column for {}: '{}'; expected one", path,
                                   column->name, table.names[c]));
    to = table.columns[c];
    if (unit != column->unit)
      for (double& x : to) x *= 1e-3;
  }
  for (const Column& column : {kColumns[1], kColumns[3]})
    if ((out.*column.member).empty())
      throw InputError(fmt::format("{}: no column '{}' among {}; expected one in {} or m{}", path,
                                   column.name, fmt::join(table.names, ", "), column.unit,
                                   column.unit));
  return out;
}

}  // namespace tangere::apps
