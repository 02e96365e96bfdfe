// SPDX-License-Identifier: Apache-2.0
// Table of a sensor's imperfections, used by reader, files, effects and checks.
#include "engine/model/sensor_imperfections.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace tangere {
namespace {

using Of = SensorImperfections;
constexpr double kNoLimit = std::numeric_limits<double>::max();

constexpr ImperfectionKind kImperfectionKinds[] = {
    {"hysteresis", "1", 1, &Of::hysteresis, nullptr},
    {"hysteresis_time", "s", 1e3, &Of::hysteresis_time, nullptr},
    {"low_pass", "s", 1e3, &Of::low_pass, nullptr},
    {"delay", "s", 1e3, &Of::delay, nullptr},
    {"spread", "m", 1e3, &Of::spread, nullptr},
    {"crosstalk", "1", 0.25, &Of::crosstalk, nullptr},
    {"gain", "1", 1, &Of::gain, nullptr},
    {"sensor_gain", "1", 1, &Of::sensor_gain, nullptr},
    {"bias", "N", kNoLimit, nullptr, &Of::bias},
    {"noise", "N", kNoLimit, nullptr, &Of::noise},
    {"dead", "1", 1, &Of::dead, nullptr},
    {"saturation", "N", kNoLimit, nullptr, &Of::saturation},
    {"quantisation", "N", kNoLimit, nullptr, &Of::quantisation},
};

}  // namespace

std::span<const ImperfectionKind> imperfection_kinds() { return kImperfectionKinds; }

NormalAndShear value_of(const SensorImperfections& imperfections, const ImperfectionKind& kind) {
  if (kind.pair != nullptr) return imperfections.*kind.pair;
  return {imperfections.*kind.number, imperfections.*kind.number};
}

bool is_imperfect(const SensorImperfections& imperfections) {
  for (const ImperfectionKind& kind : kImperfectionKinds)
    if (!(value_of(imperfections, kind) == NormalAndShear{})) return true;
  return false;
}

bool has_lag(const SensorImperfections& imperfections) {
  return imperfections.hysteresis != 0 || imperfections.low_pass != 0 || imperfections.delay != 0;
}

std::string text_of(const SensorImperfections& imperfections) {
  std::string text;
  for (const ImperfectionKind& kind : kImperfectionKinds) {
    const NormalAndShear value = value_of(imperfections, kind);
    if (value == NormalAndShear{}) continue;
    const std::string unit = kind.unit, second = fmt::format(" {}", value.shear);
    text += fmt::format("{}{} {}{}{}", text.empty() ? "" : ", ", kind.name, value.normal,
                        value.shear == value.normal ? "" : second, unit == "1" ? "" : " " + unit);
  }
  return text;
}

void check_imperfections(const SensorImperfections& imperfections, const std::string& sensor,
                         bool grid) {
  const std::string where =
      fmt::format("{}imperfections of '{}': ", imperfections.source.prefix(), sensor);
  for (const ImperfectionKind& kind : kImperfectionKinds) {
    const NormalAndShear value = value_of(imperfections, kind);
    for (const double x : {value.normal, value.shear}) {
      if (x >= 0 && x <= kind.most) continue;
      const bool bounded = kind.most < kNoLimit;
      const std::string unit = kind.unit;
      throw InputError(fmt::format("{}{}=\"{}\"; expected a number from 0{}{}", where, kind.name, x,
                                   bounded ? fmt::format(" to {}", kind.most) : " on",
                                   unit == "1" ? "" : " " + unit));
    }
  }
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
