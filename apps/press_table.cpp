// SPDX-License-Identifier: Apache-2.0
// A column's unit stands behind its name: after an underscore, a blank, or in brackets. What is no
// unit makes another column.
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
constexpr Column kColumns[] = {{"time", "s", &PressRecording::time},
                               {"depth", "m", &PressRecording::depth},
                               {"displacement", "m", &PressRecording::depth},
                               {"force", "N", &PressRecording::force},
                               {"shear_force", "N", &PressRecording::shear_force},
                               {"shear", "m", &PressRecording::shear}};

/// Returns the column that a name of the table stands for, and the factor of its unit; null for
/// others, such as force_std.
const Column* find_column(const std::string& name, double& factor) {
  constexpr const char* kBetween = "_ [](),";
  for (const Column& column : kColumns) {
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

}  // namespace

PressRecording read_press(const std::string& path, const Console& console) {
  const NamedColumns table = read_named_columns(path);
  PressRecording out;
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    double factor = 1;
    const Column* const column = find_column(table.names[c], factor);
    if (column == nullptr) {
      console.note(fmt::format("{}: column '{}' is not used", path, table.names[c]));
      continue;
    }
    std::vector<double>& to = out.*column->member;
    if (!to.empty())
      throw InputError(fmt::format("{}: a second column for {}: '{}'; expected one", path,
                                   column->name, table.names[c]));
    to = table.columns[c];
    for (double& x : to) x *= factor;
  }
  for (const Column& column : {kColumns[1], kColumns[3]})
    if ((out.*column.member).empty())
      throw InputError(fmt::format("{}: no column '{}' among {}; expected one in {} or m{}", path,
                                   column.name, fmt::join(table.names, ", "), column.unit,
                                   column.unit));
  return out;
}

}  // namespace tangere::apps
