// SPDX-License-Identifier: Apache-2.0
// The table of all kinds of numbers, and the lookups that use it.
#include "engine/scene/scene_number.hpp"

#include <algorithm>

#include "engine/scene/schema.hpp"

namespace tangere {
namespace {

using Owner = NumberOwner;
using Field = NumberField;

constexpr const char* kOwners[] = {"contact", "ground", "tactile", "body",
                                   "joint",   "motor",  "loop",    "camera"};

bool is_turning(Field field) {
  return field == Field::turning_damping || field == Field::turning_stiffness;
}

const char* owner_name(Owner owner) { return kOwners[static_cast<int>(owner)]; }

const LinkDescription* link_of(const Scene& scene, const SceneNumber& n) {
  for (const LinkDescription& link : scene.links)
    if ((n.owner == Owner::body ? link.body.name : link.joint.name) == n.name) return &link;
  return nullptr;
}

/// Finds the contact or the sensor that owns a number and calls f(coefficients, law).
template <class Function>
bool with_law(const Scene& scene, const SceneNumber& n, const Function& f) {
  const auto use = [&](const auto& list, const auto& matches) {
    const auto at = std::find_if(list.begin(), list.end(), matches);
    if (at == list.end()) return false;
    f(at->coefficients, at->law);
    return true;
  };
  switch (n.owner) {
    case Owner::contact:
      return use(scene.pair_contacts, [&](const PairContactDescription& c) {
        return c.first_name() == n.name && c.primitive_body == n.second_name;
      });
    case Owner::ground:
      return use(scene.ground_contacts,
                 [&](const GroundContactDescription& c) { return c.body == n.name; });
    case Owner::tactile:
      return use(scene.sensors, [&](const TactileDescription& t) { return t.name == n.name; });
    default: return false;
  }
}

const double* body_number(const BodyDescription& body, const SceneNumber& n) {
  if (n.field == Field::density) return &body.density;
  if (n.field != Field::mass)
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): returned as const
    return size_number(const_cast<Shape&>(body.shape), size_index(n));
  const auto* const abstract = std::get_if<AbstractShape>(&body.shape);
  return abstract == nullptr ? nullptr : &abstract->mass;
}

const double* start_number(const Scene& scene, const SceneNumber& n) {
  for (const InitialState& state : scene.initial) {
    const std::vector<double>& x = n.field == Field::q ? state.q : state.v;
    if (state.joint == n.name && n.component >= 0 && std::size_t(n.component) < x.size())
      return &x[std::size_t(n.component)];
  }
  return nullptr;
}

const double* joint_number(const Scene& scene, const JointDescription& joint,
                           const SceneNumber& n) {
  const JointEffects* const turning = joint.turning ? &*joint.turning : nullptr;
  switch (n.field) {
    case Field::q:
    case Field::v: return start_number(scene, n);
    case Field::pos:
      return n.component < 0 || n.component > 2 ? nullptr
                                                : &joint.pose.position[std::size_t(n.component)];
    case Field::turning_damping: return turning == nullptr ? nullptr : &turning->damping;
    case Field::turning_stiffness: return turning == nullptr ? nullptr : &turning->stiffness;
    case Field::damping: return &joint.damping;
    case Field::armature: return &joint.armature;
    case Field::stiffness: return &joint.stiffness;
    case Field::friction: return &joint.friction;
    default: return &joint.limit_stiffness;
  }
}

const double* loop_number(const Scene& scene, const SceneNumber& n) {
  const auto at = std::ranges::find(scene.loops, n.name, &LoopDescription::name);
  if (at == scene.loops.end()) return nullptr;
  const bool turns = n.field == Field::turning_stiffness || n.field == Field::turning_damping;
  if (turns && !at->weld) return nullptr;
  return &((*at).*kLoopNumbers[loop_index(n.field)]);
}

/// A number of the material of a coupled layer.
const double* layer_number(const Scene& scene, const SceneNumber& n) {
  const auto at = std::ranges::find(scene.sensors, n.name, &TactileDescription::name);
  if (at == scene.sensors.end() || !at->layer || !at->material) return nullptr;
  return n.field == Field::thickness ? &at->material->thickness : &at->layer->poisson;
}

const double* number_of_camera(const Scene& scene, const SceneNumber& n) {
  const auto at = std::ranges::find(scene.cameras, n.name, &CameraDescription::name);
  if (at == scene.cameras.end() || n.component < 0 || n.component > 2) return nullptr;
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): returned as const
  return camera_number(const_cast<CameraDescription&>(*at), n.field, n.component);
}

/// Returns nullptr where the scene has no such number.
const double* find_number(const Scene& scene, const SceneNumber& n) {
  number_kind(n.owner, n.field);  // throws if there is no such kind
  const double* found = nullptr;
  if (n.owner == Owner::motor) {
    for (const MotorDescription& motor : scene.motors)
      if (motor.joint == n.name && motor.has_gains() &&
          (n.field == Field::D || motor.control == MotorControl::position))
        found = n.field == Field::P ? &motor.P : &motor.D;
    return found;
  }
  if (n.owner == Owner::loop) return loop_number(scene, n);
  if (n.owner == Owner::camera) return number_of_camera(scene, n);
  if (n.field == Field::thickness || n.field == Field::poisson) return layer_number(scene, n);
  if (n.owner == Owner::body || n.owner == Owner::joint) {
    const LinkDescription* const link = link_of(scene, n);
    if (link == nullptr) return nullptr;
    return n.owner == Owner::body ? body_number(link->body, n)
                                  : joint_number(scene, link->joint, n);
  }
  with_law(scene, n, [&](const ContactCoefficients& c, ContactLaw) {
    found = &c[coefficient_index(n.field)];
  });
  return found;
}

[[noreturn]] void fail_to_find(const Scene& scene, const SceneNumber& number) {
  throw InputError((scene.path.empty() ? "" : scene.path + ": ") + "the scene has no number '" +
                   name_of(number) + "'");
}
const double& found_number(const Scene& scene, const SceneNumber& number) {
  const double* const found = find_number(scene, number);
  if (found == nullptr) fail_to_find(scene, number);
  return *found;
}

}  // namespace

std::uint64_t element_of(NumberOwner owner) {
  constexpr std::uint64_t kElementOf[] = {
      kPairContact, kGroundContact, kTactile | kLayer, kBody, kJoint | kInitialJoint, kMotor,
      kLoops,       kCamera};
  return kElementOf[static_cast<int>(owner)];
}

const Attribute& number_kind(NumberOwner owner, NumberField field) {
  // Dofs that turn may have effects of their own, which files give by the same attribute.
  if (owner != Owner::loop && field == Field::turning_damping) field = Field::damping;
  if (owner != Owner::loop && field == Field::turning_stiffness) field = Field::stiffness;
  const Attribute* same_field = nullptr;
  for (const Attribute& row : schema()) {
    // Numbers of a <surface_contact> are those of a contact, whose rows come first.
    if (row.field != field || row.elements == kSurfaceContact) continue;
    if ((row.elements & element_of(owner)) != 0) return row;
    same_field = &row;
  }
  int other = 0;
  while (same_field != nullptr && (same_field->elements & element_of(Owner(other))) == 0) ++other;
  throw InputError(std::string("a ") + owner_name(owner) + " has no '" +
                   (same_field == nullptr ? "?" : same_field->name) + "'; a " + kOwners[other] +
                   " has one");
}

SceneNumber size_of_body(const std::string& body, int which) {
  constexpr Field kFields[kSizeIndices] = {Field::radius, Field::length, Field::size,
                                           Field::size,   Field::size,   Field::scale};
  return {Owner::body, kFields[which], body, kFields[which] == Field::size ? which - 2 : 0};
}

int size_index(const SceneNumber& n) {
  for (int which = 0; which < kSizeIndices; ++which)
    if (size_of_body(n.name, which) == n) return which;
  return -1;
}

SceneNumber first_number(const PairContactDescription& d) {
  return {Owner::contact, Field::kn, d.first_name(), 0, d.primitive_body};
}
SceneNumber first_number(const GroundContactDescription& d) {
  return {Owner::ground, Field::kn, d.body};
}
SceneNumber first_number(const TactileDescription& d) {
  return {Owner::tactile, Field::kn, d.name};
}

std::string owner_of(const SceneNumber& n) {
  std::string text = std::string(owner_name(n.owner)) + ' ' + n.name;
  if (n.owner == Owner::contact) text.append(1, ' ').append(n.second_name);
  return text;
}

std::string name_of(const SceneNumber& n) {
  const Attribute& kind = number_kind(n.owner, n.field);
  const bool turns_by_word = is_turning(n.field) && n.owner != Owner::loop;
  std::string text = owner_of(n) + (turns_by_word ? " turning " : " ") + kind.name;
  if (kind.has(kIndexed)) text.append(1, '[').append(std::to_string(n.component)).append(1, ']');
  return text;
}

Unit coefficient_unit(Owner owner, Field field, ContactLaw law, bool per_area) {
  const Attribute& kind = number_kind(owner, field);
  return per_area ? attribute_of(kSurfaceContact, kind.name).unit
                  : kind.unit_of(law == ContactLaw::linear);
}

std::vector<Unit> units_of(const Scene& scene, const SceneNumber& n) {
  const Attribute& kind = number_kind(n.owner, n.field);
  if (n.owner == Owner::loop) return {kind.unit};
  if (n.owner != Owner::joint && n.owner != Owner::motor) {
    ContactLaw law{};
    with_law(scene, n, [&](const ContactCoefficients&, ContactLaw own) { law = own; });
    const bool area =
        n.owner == Owner::contact && std::ranges::any_of(scene.pair_contacts, [&](const auto& c) {
          return c.per_area() && first_number(c).name == n.name &&
                 c.primitive_body == n.second_name;
        });
    return {coefficient_unit(n.owner, n.field, law, area)};
  }
  const LinkDescription* const link = link_of(scene, n);
  if (link == nullptr) fail_to_find(scene, n);
  const JointType type = link->joint.type;
  if (is_of_start(n)) {
    const bool quaternion = std::string(coordinate_unit(type, n.component)) == "1";
    if (n.field == Field::q && quaternion) return {Unit::one};
    return {kind.unit_of(dof_turns(type, n.component))};
  }
  if (is_turning(n.field)) return {kind.other_unit};
  bool slides = false, turns = false;
  for (int k = 0; k < dof_count(type); ++k) (dof_turns(type, k) ? turns : slides) = true;
  // Dofs that turn may have a field of their own.
  if (link->joint.turning && n.owner == Owner::joint) turns = false;
  if (slides && turns && kind.other_unit != Unit::one) return {kind.unit, kind.other_unit};
  return {kind.unit_of(turns)};
}

std::string unit_of(const Scene& scene, const SceneNumber& n) {
  std::string text;
  for (const Unit unit : units_of(scene, n))
    text.append(text.empty() ? "" : ", ").append(to_string(unit));
  return text;
}

double& number_in(Scene& scene, const SceneNumber& number) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): the scene is not const
  return const_cast<double&>(found_number(scene, number));
}

double number_in(const Scene& scene, const SceneNumber& number) {
  return found_number(scene, number);
}

int randomization_of(const Scene& scene, const SceneNumber& number) {
  for (std::size_t k = scene.randomizations.size(); k-- > 0;)  // the last one applies
    if (scene.randomizations[k].number == number) return static_cast<int>(k);
  return -1;
}

std::size_t drawn_with(const Scene& scene, std::size_t k) {
  const std::string& tie = scene.randomizations[k].tie;
  std::size_t first = tie.empty() ? k : 0;
  while (scene.randomizations[first].tie != tie) ++first;
  return first;
}

}  // namespace tangere
