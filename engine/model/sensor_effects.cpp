// SPDX-License-Identifier: Apache-2.0
// Imperfections, markers and feedback of sensors: how to find each in a scene, and how to take it
// out.
#include "engine/model/sensor_effects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace tangere {
namespace {

bool is_meant(int element, std::size_t sensor) {
  return element < 0 || std::size_t(element) == sensor;
}

/// `source_of` returns the line of a sensor that requests the effect; no value: it has none.
/// `text_of_one` describes the effect of one sensor; `off` is the text without it.
template <class SourceOf, class TextOf>
EffectInfo find_in_sensors(const Scene& scene, int element, const SourceOf& source_of,
                           const TextOf& text_of_one, const char* off) {
  EffectInfo info;
  std::size_t on = 0;
  for (std::size_t k = 0; k < scene.sensors.size(); ++k) {
    if (!is_meant(element, k)) continue;
    const std::optional<Source> source = source_of(scene.sensors[k]);
    if (!source) continue;
    ++on;
    if (source->line > 0) info.sources.push_back(*source);
  }
  info.on = on > 0;
  if (element < 0)
    info.reason = fmt::format(
        "{} of {} declared", on,
        scene.sensors.size() == 1 ? "1 sensor" : fmt::format("{} sensors", scene.sensors.size()));
  else
    info.reason = info.on ? text_of_one(scene.sensors[std::size_t(element)]) : off;
  return info;
}

/// Returns "stiffness 100 N/m, thickness 0.002 m".
std::string marker_text(const TactileDescription& sensor) {
  const MarkersDescription& of = *sensor.markers;
  std::string text = of.stiffness > 0
                         ? fmt::format("stiffness {} N/m", of.stiffness)
                         : fmt::format("stiffness of ks {} N/m", sensor.coefficients.ks);
  if (of.thickness > 0) text += fmt::format(", thickness {} m", of.thickness);
  if (of.spread > 0) text += fmt::format(", spread {} m", of.spread);
  return text;
}

/// How many contacts the points of a sensor make.
std::ptrdiff_t contacts_of(const Scene& scene, const TactileDescription& sensor) {
  return std::count_if(scene.pair_contacts.begin(), scene.pair_contacts.end(),
                       [&](const auto& pair) { return pair.sensor == sensor.name; });
}

}  // namespace

EffectInfo find_imperfections(const Scene& scene, int element) {
  return find_in_sensors(
      scene, element,
      [](const TactileDescription& d) {
        return is_imperfect(d.imperfections) ? std::optional(d.imperfections.source) : std::nullopt;
      },
      [](const TactileDescription& d) { return text_of(d.imperfections); },
      "every coefficient is 0 or not given");
}

void drop_imperfections(Scene& scene, int element, Way way) {
  for (std::size_t k = 0; k < scene.sensors.size(); ++k) {
    if (!is_meant(element, k)) continue;
    SensorImperfections& of = scene.sensors[k].imperfections;
    const Source source = of.source;
    of = {};
    if (way == Way::zero) of.source = source;
  }
}

EffectInfo find_markers(const Scene& scene, int element) {
  return find_in_sensors(
      scene, element,
      [](const TactileDescription& d) {
        return d.markers ? std::optional(d.markers->source) : std::nullopt;
      },
      marker_text, "no <markers>");
}

void drop_markers(Scene& scene, int element, Way way) {
  constexpr double kRigid = 1e300;  // [N/m] what markers have is a compliance
  for (std::size_t k = 0; k < scene.sensors.size(); ++k) {
    std::optional<MarkersDescription>& markers = scene.sensors[k].markers;
    if (!is_meant(element, k) || !markers) continue;
    if (way == Way::zero)
      markers->stiffness = kRigid;
    else
      markers.reset();
  }
}

EffectInfo find_feedback(const Scene& scene, int element) {
  const auto source_of = [&](const TactileDescription& d) {
    return contacts_of(scene, d) > 0 ? std::optional(d.source) : std::nullopt;
  };
  const auto text = [&](const TactileDescription& d) {
    const std::ptrdiff_t n = contacts_of(scene, d);
    return fmt::format("its points touch {} {}", n, n == 1 ? "body" : "bodies");
  };
  return find_in_sensors(scene, element, source_of, text, "feedback is false");
}

void drop_feedback(Scene& scene, int element, Way way) {
  for (std::size_t k = 0; k < scene.sensors.size(); ++k) {
    if (!is_meant(element, k)) continue;
    const auto is_of = [&](const PairContactDescription& pair) {
      return pair.sensor == scene.sensors[k].name;
    };
    for (PairContactDescription& pair : scene.pair_contacts) {
      if (!is_of(pair)) continue;
      pair.coefficients = {};
      std::erase_if(scene.randomizations, [&](const RandomizationDescription& d) {
        return d.number.owner == NumberOwner::contact && d.number.name == pair.first_name();
      });
    }
    if (way == Way::removed) std::erase_if(scene.pair_contacts, is_of);
  }
}

}  // namespace tangere
