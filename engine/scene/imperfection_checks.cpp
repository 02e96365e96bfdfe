// SPDX-License-Identifier: Apache-2.0
// Both numbers of a value are checked and printed, normal before shear.
#include "engine/scene/imperfection_checks.hpp"

#include <fmt/format.h>

#include "engine/scene/schema.hpp"

namespace tangere {
namespace {

/// Calls f(row, value) for each coefficient; both numbers of a value are the same where it has one.
template <class F>
void for_each(const SensorImperfections& of, const F& f) {
  for_each_member<SensorImperfections>(kImperfections, [&](const Attribute& row, auto member) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(of.*member)>, NormalAndShear>)
      f(row, of.*member);
    else
      f(row, NormalAndShear{of.*member, of.*member});
  });
}

}  // namespace

bool is_imperfect(const SensorImperfections& imperfections) {
  bool found = false;
  for_each(imperfections, [&](const Attribute&, const NormalAndShear& value) {
    found = found || !(value == NormalAndShear{});
  });
  return found;
}

bool has_lag(const SensorImperfections& imperfections) {
  return imperfections.hysteresis != 0 || imperfections.low_pass != 0 || imperfections.delay != 0;
}

std::string text_of(const SensorImperfections& imperfections) {
  std::string text;
  for_each(imperfections, [&](const Attribute& row, const NormalAndShear& value) {
    if (value == NormalAndShear{}) return;
    const std::string unit = to_string(row.unit), second = fmt::format(" {}", value.shear);
    text += fmt::format("{}{} {}{}{}", text.empty() ? "" : ", ", row.name, value.normal,
                        value.shear == value.normal ? "" : second, unit == "1" ? "" : " " + unit);
  });
  return text;
}

void check_imperfections(const SensorImperfections& imperfections, const std::string& sensor,
                         bool grid) {
  const std::string where =
      fmt::format("{}imperfections of '{}': ", imperfections.source.prefix(), sensor);
  if (const std::string fault = value_fault(kImperfections, imperfections); !fault.empty())
    throw InputError(where + fault);
  if ((imperfections.hysteresis != 0) != (imperfections.hysteresis_time != 0))
    throw InputError(fmt::format(
        "{}hysteresis=\"{}\" with hysteresis_time=\"{}\" s; expected both above 0, or neither",
        where, imperfections.hysteresis, imperfections.hysteresis_time));
  for (const auto& [limit, step] :
       {std::pair{imperfections.saturation.normal, imperfections.quantisation.normal},
        {imperfections.saturation.shear, imperfections.quantisation.shear}})
    if (limit != 0 && step > limit)
      throw InputError(fmt::format(
          "{}quantisation=\"{}\" with saturation=\"{}\" N: every reading is 0; expected "
          "a quantisation of no more than the saturation",
          where, step, limit));
  const char* const needs = imperfections.crosstalk != 0 ? "crosstalk"
                            : imperfections.spread != 0  ? "spread"
                                                         : nullptr;
  if (needs != nullptr && !grid)
    throw InputError(where + needs +
                     " on a list of points, which have no neighbours; expected it on type "
                     "rect_array");
}

}  // namespace tangere
