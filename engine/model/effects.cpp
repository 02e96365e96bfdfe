// SPDX-License-Identifier: Apache-2.0
// The table of effects: how to find each in a scene, and how to take it out.
#include "engine/model/effects.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <type_traits>
#include <utility>

#include "engine/model/field_form.hpp"
#include "engine/model/sensor_effects.hpp"

namespace tangere {
namespace {

using Field = NumberField;
using Owner = NumberOwner;
using Fields = std::vector<Field>;

std::string number_and_word(std::size_t n, const char* one, const char* many) {
  return fmt::format("{} {}", n, n == 1 ? one : many);
}

void add_source(EffectInfo& info, const Source& source) {
  if (source.line > 0) info.sources.push_back(source);
}

bool names_one_of(const SceneNumber& n, const SceneNumber& owner, Fields fields) {
  return n.owner == owner.owner && n.name == owner.name && n.second_name == owner.second_name &&
         std::find(fields.begin(), fields.end(), n.field) != fields.end();
}

bool varies(const Scene& scene, const SceneNumber& owner, Fields fields) {
  return std::any_of(scene.randomizations.begin(), scene.randomizations.end(),
                     [&](const auto& d) { return names_one_of(d.number, owner, fields); });
}

void keep_constant(Scene& scene, const SceneNumber& owner, Fields fields) {
  std::erase_if(scene.randomizations,
                [&](const auto& d) { return names_one_of(d.number, owner, fields); });
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

void drop_gravity(Scene& scene, int /*element*/, Way /*way*/) { scene.gravity = {0, 0, 0}; }

EffectInfo find_velocity_products(const Scene& scene, int /*element*/) {
  EffectInfo info;
  std::size_t joints = 0;
  for (const LinkDescription& link : scene.links) {
    bool turns = false;
    for (int k = 0; k < dof_count(link.joint.type); ++k)
      turns = turns || dof_turns(link.joint.type, k);
    if (!turns) continue;
    ++joints;
    add_source(info, link.joint.source);
  }
  info.on = joints > 0;
  info.reason = info.on ? number_and_word(joints, "joint turns", "joints turn") : "no joint turns";
  return info;
}

// --- effects of joints ---

/// A coefficient of JointEffects, and the numbers that vary it.
struct JointPart {
  double JointEffects::*coefficient;
  Field field, turning_field;  ///< of the dofs that turn; `field` where there is none
};
constexpr JointPart kDampingPart{&JointEffects::damping, Field::damping, Field::turning_damping};
constexpr JointPart kSpringPart{&JointEffects::stiffness, Field::stiffness,
                                Field::turning_stiffness};
constexpr JointPart kLimitPart{&JointEffects::limit_stiffness, Field::lim_stiffness,
                               Field::lim_stiffness};
constexpr JointPart kArmaturePart{&JointEffects::armature, Field::armature, Field::armature};

SceneNumber number_of(const JointDescription& joint) {
  return {Owner::joint, Field::damping, joint.name};
}

bool has_part(const Scene& scene, const JointDescription& joint, const JointPart& part) {
  if (dof_count(joint.type) == 0) return false;
  const bool limits = part.field == Field::lim_stiffness;
  const auto acts = [&](const JointEffects& e) {
    return e.*part.coefficient != 0 && (!limits || e.limits);
  };
  return acts(joint) || (joint.turning && acts(*joint.turning)) ||
         varies(scene, number_of(joint), {part.field, part.turning_field});
}

template <const JointPart& Part>
EffectInfo find_in_joints(const Scene& scene, int /*element*/) {
  EffectInfo info;
  std::size_t joints = 0;
  for (const LinkDescription& link : scene.links) {
    if (!has_part(scene, link.joint, Part)) continue;
    ++joints;
    add_source(info, link.joint.source);
  }
  info.on = joints > 0;
  info.reason = number_and_word(joints, "joint", "joints");
  return info;
}

void drop_limits(JointEffects& e, Way way) {
  constexpr double kNeverMet = 1e6;
  if (way == Way::removed) e.limits.reset();
  if (way == Way::idle && e.limits) e.limits = {-kNeverMet, kNeverMet};
}

template <const JointPart& Part>
void drop_from_joints(Scene& scene, int /*element*/, Way way) {
  constexpr bool limits = Part.field == Field::lim_stiffness;
  const auto drop = [&](JointEffects& e) {
    if (limits) drop_limits(e, way);
    if (way != Way::idle) e.*Part.coefficient = 0;
  };
  for (LinkDescription& link : scene.links) {
    JointDescription& joint = link.joint;
    drop(joint);
    if (joint.turning) drop(*joint.turning);
    if (way == Way::removed && Part.field == Field::stiffness) joint.rest.clear();
    if (way != Way::idle) keep_constant(scene, number_of(joint), {Part.field, Part.turning_field});
  }
}

// --- motors ---

int dofs_driven(const Scene& scene, const MotorDescription& motor) {
  for (const LinkDescription& link : scene.links)
    if (link.joint.name == motor.joint) return dof_count(link.joint.type);
  return 0;
}

template <MotorControl Control>
EffectInfo find_motors(const Scene& scene, int /*element*/) {
  EffectInfo info;
  std::size_t controls = 0;
  for (const MotorDescription& motor : scene.motors) {
    if (motor.control != Control) continue;
    controls += std::size_t(dofs_driven(scene, motor));
    add_source(info, motor.source);
  }
  info.on = controls > 0;
  info.reason = number_and_word(controls, "control", "controls");
  return info;
}

/// Keeps the controls for which `kept` is true.
void keep_controls(Scene& scene, const std::vector<bool>& kept) {
  const auto trim = [&](std::vector<double>& values) {
    std::vector<double> rest;
    for (std::size_t k = 0; k < values.size() && k < kept.size(); ++k)
      if (kept[k]) rest.push_back(values[k]);
    values = std::move(rest);
  };
  if (!scene.control) return;
  if (auto* constant = std::get_if<ConstantControl>(&*scene.control)) trim(constant->values);
  if (auto* piecewise = std::get_if<PiecewiseControl>(&*scene.control))
    for (std::vector<double>& values : piecewise->values) trim(values);
  if (auto* table = std::get_if<CsvControl>(&*scene.control))
    for (std::vector<double>& row : table->rows) trim(row);
}

void still_motor(MotorDescription& motor) {
  motor.P = motor.D = 0;
  const auto reach_zero = [&](double& low, double& high) {
    const bool force = motor.control == MotorControl::force;
    low = force ? 0 : std::min(low, 0.0);
    high = force ? 0 : std::max(high, 0.0);
  };
  reach_zero(motor.low, motor.high);
  if (motor.turning) reach_zero((*motor.turning)[0], (*motor.turning)[1]);
}

template <MotorControl Control>
void drop_motors(Scene& scene, int /*element*/, Way way) {
  std::vector<bool> kept;
  for (MotorDescription& motor : scene.motors) {
    const bool goes = motor.control == Control;
    kept.insert(kept.end(), std::size_t(dofs_driven(scene, motor)), !goes);
    if (!goes) continue;
    keep_constant(scene, {Owner::motor, Field::P, motor.joint}, {Field::P, Field::D});
    if (way == Way::zero) still_motor(motor);
  }
  if (way == Way::zero) return;
  std::erase_if(scene.motors, [](const auto& motor) { return motor.control == Control; });
  keep_controls(scene, kept);
}

// --- contacts and sensors ---

/// The effects of a contact or a sensor.
enum class Part { whole, tangential, damping, memory };

template <Owner Of, class AnyScene>
auto& elements(AnyScene& scene) {
  if constexpr (Of == Owner::contact)
    return scene.pair_contacts;
  else if constexpr (Of == Owner::ground)
    return scene.ground_contacts;
  else
    return scene.sensors;
}

SceneNumber number_of(const PairContactDescription& d) {
  return {Owner::contact, Field::kn, d.first_name(), 0, d.primitive_body};
}
SceneNumber number_of(const GroundContactDescription& d) {
  return {Owner::ground, Field::kn, d.body};
}
SceneNumber number_of(const TactileDescription& d) { return {Owner::tactile, Field::kn, d.name}; }

/// Returns "kt 1 N s/m" or "kt varies".
template <class Element>
std::string coefficient_text(const Scene& scene, const Element& d, Field field) {
  SceneNumber number = number_of(d);
  number.field = field;
  const char* const name = number_kind(number.owner, field).name;
  if (varies(scene, number, {field})) return fmt::format("{} varies", name);
  const std::string unit = unit_of(scene, number);
  return fmt::format("{} {}{}", name, d.coefficients[coefficient_index(field)],
                     unit == "1" ? "" : " " + unit);
}

template <class Element>
bool acts(const Scene& scene, const Element& d, Field field) {
  return d.coefficients[coefficient_index(field)] != 0 || varies(scene, number_of(d), {field});
}

template <Part Of, class Element>
bool element_on(const Scene& scene, const Element& d) {
  if (Of == Part::tangential)
    return (acts(scene, d, Field::kt) || acts(scene, d, Field::ks)) && acts(scene, d, Field::mu);
  if (Of == Part::memory) return acts(scene, d, Field::ks);
  return Of == Part::whole || acts(scene, d, Field::damping);
}

template <Part Of, class Element>
std::string element_reason(const Scene& scene, const Element& d) {
  const auto text = [&](Field field) { return coefficient_text(scene, d, field); };
  const bool idle = !std::is_same_v<Element, TactileDescription> && !acts(scene, d, Field::kn) &&
                    !acts(scene, d, Field::damping);
  if (Of == Part::whole)
    return "declared, " + text(Field::kn) + (idle ? ", no damping: it never pushes" : "");
  if (Of == Part::tangential)
    return text(Field::kt) + (acts(scene, d, Field::ks) ? ", " + text(Field::ks) : "") + ", " +
           text(Field::mu);
  return text(Of == Part::memory ? Field::ks : Field::damping);
}

template <Owner Of>
std::string number_of_elements(std::size_t n) {
  if (Of == Owner::contact) return number_and_word(n, "pair declared", "pairs declared");
  if (Of == Owner::ground) return number_and_word(n, "body declared", "bodies declared");
  return number_and_word(n, "sensor declared", "sensors declared");
}

template <Owner Of, Part P>
EffectInfo find_elements(const Scene& scene, int element) {
  const auto& all = elements<Of>(scene);
  EffectInfo info;
  std::size_t on = 0;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if ((element >= 0 && std::size_t(element) != k) || !element_on<P>(scene, all[k])) continue;
    ++on;
    add_source(info, all[k].source);
  }
  info.on = on > 0;
  if (element >= 0)
    info.reason = element_reason<P>(scene, all[std::size_t(element)]);
  else if (P == Part::whole)
    info.reason = number_of_elements<Of>(all.size());
  else
    info.reason = fmt::format("{} of {}", on, number_of_elements<Of>(all.size()));
  return info;
}

template <Part P, class Element>
void silence_element(Scene& scene, Element& d, Way way) {
  Fields fields;
  for (int k = 0; k < kCoefficients; ++k) fields.push_back(coefficient_field(k));
  if (P == Part::damping) fields = {Field::damping};
  if (P == Part::memory) fields = {Field::ks};
  if (P == Part::tangential) fields = {Field::kt, Field::ks};
  if (P == Part::tangential && way == Way::removed) fields.push_back(Field::mu);
  if constexpr (std::is_same_v<Element, TactileDescription>) {
    // Keep the stiffness of the gel for its markers when the shear springs are removed.
    if (d.markers && d.markers->stiffness == 0) d.markers->stiffness = d.coefficients.ks;
  }
  for (const Field field : fields) d.coefficients[coefficient_index(field)] = 0;
  keep_constant(scene, number_of(d), fields);
}

template <Owner Of, Part P>
void drop_elements(Scene& scene, int element, Way way) {
  auto& all = elements<Of>(scene);
  for (std::size_t k = 0; k < all.size(); ++k)
    if (element < 0 || std::size_t(element) == k) silence_element<P>(scene, all[k], way);
  if (Of == Owner::tactile && P == Part::whole) drop_imperfections(scene, element, way);
  if (P != Part::whole || way != Way::removed) return;
  if (element < 0)
    all.clear();
  else
    all.erase(all.begin() + element);
}

// --- numbers that vary ---

EffectInfo find_varying(const Scene& scene, int /*element*/) {
  EffectInfo info;
  std::size_t numbers = 0;
  for (const RandomizationDescription& d : scene.randomizations) {
    if (is_of_start(d.number)) continue;
    ++numbers;
    add_source(info, d.source);
  }
  info.on = numbers > 0;
  info.reason =
      number_and_word(numbers, "number varies by environment", "numbers vary by environment");
  return info;
}

void drop_varying(Scene& scene, int /*element*/, Way way) {
  if (way == Way::removed)
    std::erase_if(scene.randomizations, [](const auto& d) { return !is_of_start(d.number); });
  for (RandomizationDescription& d : scene.randomizations)
    if (!is_of_start(d.number))
      d.distribution = {Distribution::Kind::list, 0, 0, {number_in(scene, d.number)}};
}

// --- sleeping ---

EffectInfo find_sleeping(const Scene& scene, int /*element*/) {
  EffectInfo info;
  info.on = scene.solver.sleep > 0;
  info.reason = info.on ? fmt::format("sleep {}", scene.solver.sleep) : "solver_option sleep is 0";
  if (info.on) add_source(info, scene.solver.sleep_source);
  return info;
}

void drop_sleeping(Scene& scene, int /*element*/, Way /*way*/) {
  scene.solver.sleep = 0;
  scene.solver.sleep_source = {};
}

// --- the table ---

struct Row {
  EffectKind kind;
  const char* name;
  const char* of_element;  ///< what follows an element's name; not empty for a part
  bool zero, idle;         ///< has_way(); `removed` is there where `drop` is
  EffectInfo (*find)(const Scene&, int element);
  void (*drop)(Scene&, int element, Way);
  std::optional<Owner> owner{};  ///< element_owner()
};

template <Owner Of, Part P>
constexpr Row element_row(EffectKind kind, const char* name, const char* of_element) {
  return {kind, name, of_element, true, false, find_elements<Of, P>, drop_elements<Of, P>, Of};
}

using Kind = EffectKind;
constexpr Row kTable[] = {
    {Kind::gravity, "gravity", "", false, false, find_gravity, drop_gravity},
    {Kind::velocity_products, "velocity products", "", false, false, find_velocity_products,
     nullptr},
    {Kind::joint_damping, "joint damping", "", true, false, find_in_joints<kDampingPart>,
     drop_from_joints<kDampingPart>},
    {Kind::joint_springs, "joint springs", "", true, false, find_in_joints<kSpringPart>,
     drop_from_joints<kSpringPart>},
    {Kind::joint_limits, "joint limits", "", true, true, find_in_joints<kLimitPart>,
     drop_from_joints<kLimitPart>},
    {Kind::armature, "armature", "", true, false, find_in_joints<kArmaturePart>,
     drop_from_joints<kArmaturePart>},
    {Kind::force_motors, "force motors", "", true, false, find_motors<MotorControl::force>,
     drop_motors<MotorControl::force>},
    {Kind::position_motors, "position motors", "", true, false, find_motors<MotorControl::position>,
     drop_motors<MotorControl::position>},
    element_row<Owner::contact, Part::whole>(Kind::pair_contact, "pair contact", ""),
    element_row<Owner::contact, Part::tangential>(Kind::pair_friction, "pair friction",
                                                  " friction"),
    element_row<Owner::contact, Part::damping>(Kind::pair_damping, "pair damping", " damping"),
    element_row<Owner::contact, Part::memory>(Kind::pair_memory, "pair memory", " memory"),
    element_row<Owner::ground, Part::whole>(Kind::ground_contact, "ground contact", ""),
    element_row<Owner::ground, Part::tangential>(Kind::ground_friction, "ground friction",
                                                 " friction"),
    element_row<Owner::ground, Part::damping>(Kind::ground_damping, "ground damping", " damping"),
    element_row<Owner::ground, Part::memory>(Kind::ground_memory, "ground memory", " memory"),
    element_row<Owner::tactile, Part::whole>(Kind::tactile, "tactile", ""),
    element_row<Owner::tactile, Part::tangential>(Kind::tactile_shear, "tactile shear", " shear"),
    element_row<Owner::tactile, Part::damping>(Kind::tactile_damping, "tactile damping",
                                               " damping"),
    element_row<Owner::tactile, Part::memory>(Kind::tactile_memory, "tactile memory", " memory"),
    {Kind::sensor_imperfections, "sensor imperfections", " imperfections", true, false,
     find_imperfections, drop_imperfections, Owner::tactile},
    {Kind::markers, "markers", " markers", true, false, find_markers, drop_markers, Owner::tactile},
    {Kind::feedback, "feedback", " feedback", true, false, find_feedback, drop_feedback,
     Owner::tactile},
    {Kind::varying_parameters, "varying parameters", "", true, false, find_varying, drop_varying},
    {Kind::sleeping, "sleeping", "", false, false, find_sleeping, drop_sleeping},
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
    for (const auto& d : all) names.push_back(owner_of(number_of(d)) + row_of(kind).of_element);
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

std::optional<NumberOwner> element_owner(EffectKind kind) { return row_of(kind).owner; }
bool is_part(EffectKind kind) { return *row_of(kind).of_element != '\0'; }

bool has_way(EffectKind kind, Way way) {
  const Row& row = row_of(kind);
  if (way == Way::removed) return row.drop != nullptr;
  return way == Way::zero ? row.zero : row.idle;
}

/// Readings of sensors and markers that are gone are no outputs.
static void keep_known_outputs(Scene& scene) {
  if (!scene.outputs) return;
  const std::vector<std::string> sensors = sensor_names(scene);
  std::erase_if(scene.outputs->record, [&](const std::string& word) {
    if (!has_output(scene, word)) return true;
    const std::optional<FieldOutput> of = find_output(sensors, split_times(word).name);
    return of && !reason_against(scene, *of).empty();
  });
}

Scene without(Scene scene, const Effect& effect, Way way) {
  const Row& row = row_of(effect.kind);
  const int count = static_cast<int>(element_names(scene, effect.kind).size());
  if (!has_way(effect.kind, way) || effect.element >= count)
    throw InputError(fmt::format("a scene cannot be made without element {} of '{}' in this way",
                                 effect.element, row.name));
  row.drop(scene, effect.element, way);
  keep_known_outputs(scene);
  return scene;
}

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
