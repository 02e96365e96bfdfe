// SPDX-License-Identifier: Apache-2.0
// The table of effects: how to find each in a scene.
#include "engine/scene/effects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <type_traits>

#include "engine/scene/imperfection_checks.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"

namespace tangere {
namespace {

using Field = NumberField;
using Owner = NumberOwner;

std::string number_and_word(std::size_t n, const char* one, const char* many) {
  return fmt::format("{} {}", n, n == 1 ? one : many);
}

void add_source(EffectInfo& info, const Source& source) {
  if (source.line > 0) info.sources.push_back(source);
}

/// Sums `count_of` each member of a list; the lines are those of members that count.
template <class List, class CountOf, class SourceOf>
EffectInfo counted(const List& list, const CountOf& count_of, const SourceOf& source_of,
                   const char* one, const char* many) {
  EffectInfo info;
  std::size_t sum = 0;
  for (const auto& member : list) {
    const auto count = static_cast<std::size_t>(count_of(member));
    if (count > 0) add_source(info, source_of(member));
    sum += count;
  }
  info.on = sum > 0;
  info.reason = number_and_word(sum, one, many);
  return info;
}
const Source& joint_source(const LinkDescription& link) { return link.joint.source; }

bool varies(const Scene& scene, SceneNumber number, Field field) {
  number.field = field;
  return randomization_of(scene, number) >= 0;
}

// --- gravity and velocity products ---

EffectInfo find_gravity(const Scene& scene, int /*element*/) {
  const Vector3& g = scene.gravity;
  EffectInfo info;
  info.on = g[0] != 0 || g[1] != 0 || g[2] != 0;
  info.reason = info.on ? fmt::format("{} {} {} m/s²", g[0], g[1], g[2]) : "option gravity is zero";
  if (info.on && scene.gravity_source.line == 0 && !scene.path.empty())
    info.reason += ", as no option gravity says otherwise";
  add_source(info, scene.gravity_source);
  return info;
}

EffectInfo find_velocity_products(const Scene& scene, int /*element*/) {
  const auto turns = [](const LinkDescription& link) {
    int count = 0;
    for (int k = 0; k < dof_count(link.joint.type); ++k) count += dof_turns(link.joint.type, k);
    return count > 0;
  };
  EffectInfo info = counted(scene.links, turns, joint_source, "joint turns", "joints turn");
  if (!info.on) info.reason = "no joint turns";
  return info;
}

// --- effects of joints ---

/// Whether number `k` of JointEffects acts on a joint, or varies.
bool has_effect(const Scene& scene, const JointDescription& joint, std::size_t k) {
  const SceneNumber number{Owner::joint, effect_field(k), joint.name};
  return dof_count(joint.type) > 0 && (joint.acts(k) || (joint.turning && joint.turning->acts(k)) ||
                                       randomization_of(scene, number) >= 0);
}

template <Field Of>
EffectInfo find_in_joints(const Scene& scene, int /*element*/) {
  const auto has = [&](const LinkDescription& link) {
    return has_effect(scene, link.joint, effect_index(Of));
  };
  return counted(scene.links, has, joint_source, "joint", "joints");
}

template <MotorControl Control>
EffectInfo find_motors(const Scene& scene, int /*element*/) {
  const auto controls = [&](const MotorDescription& motor) {
    return motor.control == Control ? dofs_driven(scene, motor) : 0;
  };
  return counted(scene.motors, controls, std::mem_fn(&MotorDescription::source), "control",
                 "controls");
}

// --- loops and transmissions ---

EffectInfo find_loops(const Scene& scene, int /*element*/) {
  return counted(
      scene.loops, [](const auto&) { return 1; }, std::mem_fn(&LoopDescription::source), "loop",
      "loops");
}

EffectInfo find_transmissions(const Scene& scene, int /*element*/) {
  return counted(
      scene.transmissions, [](const auto&) { return 1; },
      std::mem_fn(&TransmissionDescription::source), "transmission", "transmissions");
}

// --- contacts and sensors ---

using Kind = EffectKind;
template <Owner Of, class AnyScene>
auto& elements(AnyScene& scene) {
  if constexpr (Of == Owner::contact)
    return scene.pair_contacts;
  else if constexpr (Of == Owner::ground)
    return scene.ground_contacts;
  else
    return scene.sensors;
}

/// Returns "kt 1 N s/m" or "kt varies".
template <class Element>
std::string coefficient_text(const Scene& scene, const Element& d, Field field) {
  SceneNumber number = first_number(d);
  number.field = field;
  const char* const name = number_kind(number.owner, field).name;
  if (varies(scene, number, field)) return fmt::format("{} varies", name);
  bool per_area = false;
  if constexpr (std::is_same_v<Element, PairContactDescription>) per_area = d.per_area();
  const std::string unit = to_string(coefficient_unit(number.owner, field, d.law, per_area));
  return fmt::format("{} {}{}", name, d.coefficients[coefficient_index(field)],
                     unit == "1" ? "" : " " + unit);
}

template <class Element>
bool acts(const Scene& scene, const Element& d, Field field) {
  return d.coefficients[coefficient_index(field)] != 0 || varies(scene, first_number(d), field);
}

template <class Element>
bool element_on(const Scene& scene, const Element& d, Kind kind) {
  if (kind == Kind::pair_contact) return true;
  if (kind == Kind::pair_friction)  // from damping or a spring
    return (acts(scene, d, Field::kt) || acts(scene, d, Field::ks)) && acts(scene, d, Field::mu);
  return std::ranges::any_of(coefficients_of(kind),
                             [&](Field field) { return acts(scene, d, field); });
}

template <class Element>
std::string element_reason(const Scene& scene, const Element& d, Kind kind) {
  const auto text = [&](Field field) { return coefficient_text(scene, d, field); };
  const bool idle = !std::is_same_v<Element, TactileDescription> && !acts(scene, d, Field::kn) &&
                    !acts(scene, d, Field::damping);
  if (kind == Kind::pair_contact)
    return "declared, " + text(Field::kn) + (idle ? ", no damping: it never pushes" : "");
  if (kind == Kind::pair_friction)
    return text(Field::kt) + (acts(scene, d, Field::ks) ? ", " + text(Field::ks) : "") + ", " +
           text(Field::mu);
  std::string all;
  for (const Field field : coefficients_of(kind)) all += (all.empty() ? "" : ", ") + text(field);
  return all;
}

template <Owner Of>
std::string number_of_elements(std::size_t n) {
  if (Of == Owner::contact) return number_and_word(n, "pair declared", "pairs declared");
  if (Of == Owner::ground) return number_and_word(n, "body declared", "bodies declared");
  return number_and_word(n, "sensor declared", "sensors declared");
}

template <Owner Of, Kind K>
EffectInfo find_elements(const Scene& scene, int element) {
  const auto& all = elements<Of>(scene);
  EffectInfo info;
  std::size_t on = 0;
  const std::size_t first = element < 0 ? 0 : std::size_t(element),
                    end = element < 0 ? all.size() : first + 1;
  for (std::size_t k = first; k < end; ++k) {
    if (!element_on(scene, all[k], K)) continue;
    ++on;
    add_source(info, all[k].source);
  }
  info.on = on > 0;
  if (element >= 0)
    info.reason = element_reason(scene, all[std::size_t(element)], K);
  else if (K == Kind::pair_contact)
    info.reason = number_of_elements<Of>(all.size());
  else
    info.reason = fmt::format("{} of {}", on, number_of_elements<Of>(all.size()));
  return info;
}

// --- imperfections, markers and feedback of sensors ---

/// `source_of` returns the line of a sensor that requests the effect; no value: it has none.
/// `sensor_text` describes the effect of one sensor; `off` is the text without it.
template <class SourceOf, class TextOf>
EffectInfo find_in_sensors(const Scene& scene, int element, const SourceOf& source_of,
                           const TextOf& sensor_text, const char* off) {
  EffectInfo info;
  std::size_t on = 0;
  for (std::size_t k = 0; k < scene.sensors.size(); ++k) {
    if (element >= 0 && std::size_t(element) != k) continue;
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
    info.reason = info.on ? sensor_text(scene.sensors[std::size_t(element)]) : off;
  return info;
}

/// Returns "stiffness 100 N/m, thickness 0.002 m".
std::string marker_text(const TactileDescription& sensor) {
  const MarkersDescription& of = *sensor.markers;
  if (sensor.layer) return "moved by the layer";
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

EffectInfo find_imperfections(const Scene& scene, int element) {
  return find_in_sensors(
      scene, element,
      [](const TactileDescription& d) {
        return is_imperfect(d.imperfections) ? std::optional(d.imperfections.source) : std::nullopt;
      },
      [](const TactileDescription& d) { return text_of(d.imperfections); },
      "every coefficient is 0 or not given");
}

EffectInfo find_markers(const Scene& scene, int element) {
  return find_in_sensors(
      scene, element,
      [](const TactileDescription& d) {
        return d.markers ? std::optional(d.markers->source) : std::nullopt;
      },
      marker_text, "no <markers>");
}

EffectInfo find_layer(const Scene& scene, int element) {
  return find_in_sensors(
      scene, element,
      [](const TactileDescription& d) {
        if (d.layer) return std::optional(d.layer->source);
        return d.table ? std::optional(d.source) : std::nullopt;
      },
      [](const TactileDescription& d) {
        if (d.table) return fmt::format("a table of {} pressures", d.table->pressure.size());
        return d.material
                   ? fmt::format("{} Pa, {} m thick", d.material->modulus, d.material->thickness)
                   : std::string("no material");
      },
      "no <layer> and no table of pressures");
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

// --- numbers that vary ---

EffectInfo find_varying(const Scene& scene, int /*element*/) {
  return counted(
      scene.randomizations, [](const auto& d) { return !is_of_start(d.number); },
      std::mem_fn(&RandomizationDescription::source), "number varies by environment",
      "numbers vary by environment");
}

// --- sleeping ---

EffectInfo find_sleeping(const Scene& scene, int /*element*/) {
  EffectInfo info;
  info.on = scene.solver.sleep > 0;
  info.reason = info.on ? fmt::format("sleep {}", scene.solver.sleep) : "solver_option sleep is 0";
  if (info.on) add_source(info, scene.solver.sleep_source);
  return info;
}

// --- the table ---

struct Row {
  EffectKind kind;
  const char* name;
  const char* suffix;  ///< what follows an element's name; not empty for a part
  EffectInfo (*find)(const Scene&, int element);
  std::optional<Owner> owner{};  ///< element_owner()
};

template <Owner Of, Kind K>
constexpr Row element_row(const char* name, const char* suffix = "") {
  return {K, name, suffix, find_elements<Of, pair_kind(K)>, Of};
}

constexpr Row kTable[] = {
    {Kind::gravity, "gravity", "", find_gravity},
    {Kind::velocity_products, "velocity products", "", find_velocity_products},
    {Kind::joint_damping, "joint damping", "", find_in_joints<Field::damping>},
    {Kind::joint_springs, "joint springs", "", find_in_joints<Field::stiffness>},
    {Kind::joint_limits, "joint limits", "", find_in_joints<Field::lim_stiffness>},
    {Kind::joint_friction, "joint friction", "", find_in_joints<Field::friction>},
    {Kind::armature, "armature", "", find_in_joints<Field::armature>},
    {Kind::force_motors, "force motors", "", find_motors<MotorControl::force>},
    {Kind::position_motors, "position motors", "", find_motors<MotorControl::position>},
    {Kind::loops, "closed loops", "", find_loops},
    {Kind::transmissions, "transmissions", "", find_transmissions},
    element_row<Owner::contact, Kind::pair_contact>("pair contact"),
    element_row<Owner::contact, Kind::pair_friction>("pair friction", " friction"),
    element_row<Owner::contact, Kind::pair_damping>("pair damping", " damping"),
    element_row<Owner::contact, Kind::pair_memory>("pair memory", " memory"),
    element_row<Owner::ground, Kind::ground_contact>("ground contact"),
    element_row<Owner::ground, Kind::ground_friction>("ground friction", " friction"),
    element_row<Owner::ground, Kind::ground_damping>("ground damping", " damping"),
    element_row<Owner::ground, Kind::ground_memory>("ground memory", " memory"),
    element_row<Owner::tactile, Kind::tactile>("tactile"),
    element_row<Owner::tactile, Kind::tactile_shear>("tactile shear", " shear"),
    element_row<Owner::tactile, Kind::tactile_damping>("tactile damping", " damping"),
    element_row<Owner::tactile, Kind::tactile_memory>("tactile memory", " memory"),
    {Kind::sensor_imperfections, "sensor imperfections", " imperfections", find_imperfections,
     Owner::tactile},
    {Kind::markers, "markers", " markers", find_markers, Owner::tactile},
    {Kind::layer, "layer", " layer", find_layer, Owner::tactile},
    {Kind::feedback, "feedback", " feedback", find_feedback, Owner::tactile},
    {Kind::varying_parameters, "varying parameters", "", find_varying},
    {Kind::sleeping, "sleeping", "", find_sleeping},
};

constexpr bool table_is_in_order() {
  for (std::size_t k = 0; k < std::size(kTable); ++k)
    if (kTable[k].kind != static_cast<EffectKind>(k)) return false;
  return std::size(kTable) == kEffectKinds;
}
static_assert(table_is_in_order());

const Row& row_of(EffectKind kind) { return kTable[static_cast<std::size_t>(kind)]; }

/// Returns the words with which the names of a kind's elements begin; none for other kinds.
std::vector<std::string> element_names(const Scene& scene, EffectKind kind) {
  std::vector<std::string> names;
  const auto add = [&](const auto& all) {
    for (const auto& d : all) names.push_back(owner_of(first_number(d)) + row_of(kind).suffix);
  };
  const std::optional<Owner> owner = row_of(kind).owner;
  if (owner == Owner::contact) add(scene.pair_contacts);
  if (owner == Owner::ground) add(scene.ground_contacts);
  if (owner == Owner::tactile) add(scene.sensors);
  return names;
}

}  // namespace

std::vector<EffectInfo> effects_of(const Scene& scene) {
  std::vector<EffectInfo> effects;
  const auto add = [&](const Row& row, int element, std::string name) {
    EffectInfo info = row.find(scene, element);
    info.name = std::move(name);
    info.effect = {row.kind, element};
    effects.push_back(std::move(info));
  };
  for (const Row& row : kTable) {
    add(row, -1, row.name);
    const std::vector<std::string> names = element_names(scene, row.kind);
    for (std::size_t k = 0; k < names.size(); ++k) add(row, static_cast<int>(k), names[k]);
  }
  return effects;
}

int element_count(const Scene& scene, EffectKind kind) {
  return static_cast<int>(element_names(scene, kind).size());
}
std::optional<NumberOwner> element_owner(EffectKind kind) { return row_of(kind).owner; }
bool is_part(EffectKind kind) { return *row_of(kind).suffix != '\0'; }

const char* to_string(EffectKind kind) { return row_of(kind).name; }

std::string lines_of(const EffectInfo& effect) {
  std::string text, file;
  int line = 0;
  for (const Source& source : effect.sources) {
    if (source.file == file && source.line == line) continue;
    if (source.file != file)
      text += fmt::format("{}{}:{}", text.empty() ? "" : ", ", source.file, source.line);
    else
      text += fmt::format(", {}", source.line);
    file = source.file;
    line = source.line;
  }
  return text;
}

}  // namespace tangere
