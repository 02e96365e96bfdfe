// SPDX-License-Identifier: Apache-2.0
// The table of all kinds of numbers, and the lookups that use it.
#include "engine/model/scene_number.hpp"

#include <algorithm>

namespace tangere {
namespace {

using Owner = NumberOwner;
using Field = NumberField;

constexpr NumberKind kKinds[] = {
    {Owner::contact, Field::kn, "kn", "N/m", nullptr, false},
    {Owner::contact, Field::kt, "kt", "N s/m", nullptr, false},
    {Owner::contact, Field::mu, "mu", "1", nullptr, false},
    {Owner::contact, Field::damping, "damping", "N s/m^2", "N s/m", false},
    {Owner::contact, Field::ks, "ks", "N/m", nullptr, false},
    {Owner::ground, Field::kn, "kn", "N/m", nullptr, false},
    {Owner::ground, Field::kt, "kt", "N s/m", nullptr, false},
    {Owner::ground, Field::mu, "mu", "1", nullptr, false},
    {Owner::ground, Field::damping, "damping", "N s/m^2", "N s/m", false},
    {Owner::ground, Field::ks, "ks", "N/m", nullptr, false},
    {Owner::tactile, Field::kn, "kn", "N/m", nullptr, false},
    {Owner::tactile, Field::kt, "kt", "N s/m", nullptr, false},
    {Owner::tactile, Field::mu, "mu", "1", nullptr, false},
    {Owner::tactile, Field::damping, "damping", "N s/m^2", "N s/m", false},
    {Owner::tactile, Field::ks, "ks", "N/m", nullptr, false},
    {Owner::body, Field::density, "density", "kg/m^3", nullptr, false},
    {Owner::body, Field::mass, "mass", "kg", nullptr, false},
    {Owner::body, Field::radius, "radius", "m", nullptr, false},
    {Owner::body, Field::length, "length", "m", nullptr, false},
    {Owner::body, Field::size, "size", "m", nullptr, true},
    {Owner::body, Field::scale, "scale", "1", nullptr, false},
    {Owner::joint, Field::q, "q", "m", "rad", true},
    {Owner::joint, Field::v, "v", "m/s", "rad/s", true},
    {Owner::joint, Field::pos, "pos", "m", nullptr, true},
    {Owner::joint, Field::damping, "damping", "N s/m", "N m s/rad", false},
    {Owner::joint, Field::armature, "armature", "kg", "kg m^2", false},
    {Owner::joint, Field::stiffness, "stiffness", "N/m", "N m/rad", false},
    {Owner::joint, Field::lim_stiffness, "lim_stiffness", "N/m", "N m/rad", false},
    {Owner::joint, Field::turning_damping, "turning damping", "N m s/rad", nullptr, false},
    {Owner::joint, Field::turning_stiffness, "turning stiffness", "N m/rad", nullptr, false},
    {Owner::motor, Field::P, "P", "N/m", "N m/rad", false},
    {Owner::motor, Field::D, "D", "N s/m", "N m s/rad", false},
};
constexpr const char* kOwners[] = {"contact", "ground", "tactile", "body", "joint", "motor"};

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

const double* of_body(const BodyDescription& body, const SceneNumber& n) {
  if (n.field == Field::density) return &body.density;
  if (n.field != Field::mass)
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): returned as const
    return size_number(const_cast<Shape&>(body.shape), size_index(n));
  const auto* const abstract = std::get_if<AbstractShape>(&body.shape);
  return abstract == nullptr ? nullptr : &abstract->mass;
}

const double* of_start(const Scene& scene, const SceneNumber& n) {
  for (const InitialState& state : scene.initial) {
    const std::vector<double>& x = n.field == Field::q ? state.q : state.v;
    if (state.joint == n.name && n.component >= 0 && std::size_t(n.component) < x.size())
      return &x[std::size_t(n.component)];
  }
  return nullptr;
}

const double* of_joint(const Scene& scene, const JointDescription& joint, const SceneNumber& n) {
  const JointEffects* const turning = joint.turning ? &*joint.turning : nullptr;
  switch (n.field) {
    case Field::q:
    case Field::v: return of_start(scene, n);
    case Field::pos:
      return n.component < 0 || n.component > 2 ? nullptr
                                                : &joint.pose.position[std::size_t(n.component)];
    case Field::turning_damping: return turning == nullptr ? nullptr : &turning->damping;
    case Field::turning_stiffness: return turning == nullptr ? nullptr : &turning->stiffness;
    case Field::damping: return &joint.damping;
    case Field::armature: return &joint.armature;
    case Field::stiffness: return &joint.stiffness;
    default: return &joint.limit_stiffness;
  }
}

/// Returns nullptr where the scene has no such number.
const double* find_number(const Scene& scene, const SceneNumber& n) {
  number_kind(n.owner, n.field);  // throws if there is no such kind
  const double* found = nullptr;
  if (n.owner == Owner::motor) {
    for (const MotorDescription& motor : scene.motors)
      if (motor.joint == n.name) found = n.field == Field::P ? &motor.P : &motor.D;
    return found;
  }
  if (n.owner == Owner::body || n.owner == Owner::joint) {
    const LinkDescription* const link = link_of(scene, n);
    if (link == nullptr) return nullptr;
    return n.owner == Owner::body ? of_body(link->body, n) : of_joint(scene, link->joint, n);
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

std::span<const NumberKind> number_kinds() { return kKinds; }

const NumberKind& number_kind(NumberOwner owner, NumberField field) {
  const NumberKind* of_field = nullptr;
  for (const NumberKind& kind : kKinds) {
    if (kind.field == field) of_field = &kind;
    if (kind.field == field && kind.owner == owner) return kind;
  }
  throw InputError(std::string("a ") + owner_name(owner) + " has no '" + of_field->name + "'; a " +
                   owner_name(of_field->owner) + " has one");
}

SceneNumber size_of_body(const std::string& body, int which) {
  if (which == kScaleIndex) return {Owner::body, Field::scale, body};
  const int edge = std::max(0, which - offset_from(Field::radius, Field::size));
  return {Owner::body, static_cast<Field>(static_cast<int>(Field::radius) + which - edge), body,
          edge};
}

std::string owner_of(const SceneNumber& n) {
  std::string text = std::string(owner_name(n.owner)) + ' ' + n.name;
  if (n.owner == Owner::contact) text.append(1, ' ').append(n.second_name);
  return text;
}

std::string name_of(const SceneNumber& n) {
  const NumberKind& kind = number_kind(n.owner, n.field);
  std::string text = owner_of(n) + ' ' + kind.name;
  if (kind.indexed) text.append(1, '[').append(std::to_string(n.component)).append(1, ']');
  return text;
}

std::string unit_of(const Scene& scene, const SceneNumber& n) {
  const NumberKind& kind = number_kind(n.owner, n.field);
  if (n.owner != Owner::joint && n.owner != Owner::motor) {
    bool linear = false;
    with_law(scene, n, [&](const ContactCoefficients&, ContactLaw law) {
      linear = law == ContactLaw::linear;
    });
    return kind.unit_of(linear);
  }
  const LinkDescription* const link = link_of(scene, n);
  if (link == nullptr) fail_to_find(scene, n);
  const JointType type = link->joint.type;
  if (n.field == Field::q) return coordinate_unit(type, n.component);
  if (n.field == Field::v) return kind.unit_of(dof_turns(type, n.component));
  bool slides = false, turns = false;
  for (int k = 0; k < dof_count(type); ++k) (dof_turns(type, k) ? turns : slides) = true;
  // Dofs that turn may have a field of their own.
  if (link->joint.turning && n.owner == Owner::joint) turns = false;
  if (slides && turns && kind.other != nullptr) return std::string(kind.unit) + ", " + kind.other;
  return kind.unit_of(turns);
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

}  // namespace tangere
