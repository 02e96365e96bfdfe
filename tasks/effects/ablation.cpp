// SPDX-License-Identifier: Apache-2.0
// Each kind of effect names what it removes: coefficients, elements of the scene, or both.
#include "tasks/effects/ablation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "engine/scene/field_form.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"

namespace tangere {
namespace {

using Field = NumberField;
using Kind = EffectKind;
using Fields = std::vector<Field>;

/// Whether element `k` is the one meant; -1: all are.
bool is_meant(int element, std::size_t k) { return element < 0 || std::size_t(element) == k; }

/// Removes the variations of an owner's numbers.
void keep_constant(Scene& scene, const SceneNumber& owner, const Fields& fields) {
  std::erase_if(scene.randomizations, [&](const RandomizationDescription& d) {
    return d.number.owner == owner.owner && d.number.name == owner.name &&
           d.number.second_name == owner.second_name &&
           std::ranges::find(fields, d.number.field) != fields.end();
  });
}

// --- joints and motors ---

void drop_limits(JointEffects& e, Ablation way) {
  constexpr double kNeverMet = 1e6;
  if (way == Ablation::removed) e.limits.reset();
  if (way == Ablation::idle && e.limits) e.limits = {-kNeverMet, kNeverMet};
}

void drop_from_joints(Scene& scene, Field field, Ablation way) {
  const auto drop = [&](JointEffects& e) {
    if (field == Field::lim_stiffness) drop_limits(e, way);
    if (way != Ablation::idle) e[effect_index(field)] = 0;
  };
  for (LinkDescription& link : scene.links) {
    JointDescription& joint = link.joint;
    drop(joint);
    if (joint.turning) drop(*joint.turning);
    if (way == Ablation::removed && field == Field::stiffness) joint.rest.clear();
    if (way != Ablation::idle)
      keep_constant(scene, {NumberOwner::joint, field, joint.name}, {field});
  }
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

void drop_motors(Scene& scene, MotorControl control, Ablation way) {
  std::vector<bool> kept;
  for (MotorDescription& motor : scene.motors) {
    const bool goes = motor.control == control;
    kept.insert(kept.end(), std::size_t(dofs_driven(scene, motor)), !goes);
    if (!goes) continue;
    keep_constant(scene, {NumberOwner::motor, Field::P, motor.joint}, {Field::P, Field::D});
    if (way == Ablation::zero) still_motor(motor);
  }
  if (way == Ablation::zero) return;
  std::erase_if(scene.motors, [&](const auto& motor) { return motor.control == control; });
  keep_controls(scene, kept);
}

// --- loops and transmissions ---

void drop_loops(Scene& scene) {
  std::erase_if(scene.randomizations,
                [](const auto& d) { return d.number.owner == NumberOwner::loop; });
  scene.loops.clear();
}

/// Removes transmissions with their joints, which carry nothing, and all that names these.
void drop_transmissions(Scene& scene) {
  const auto is_one = [&](const std::string& joint) {
    return std::ranges::any_of(scene.transmissions,
                               [&](const auto& d) { return d.joint == joint; });
  };
  std::vector<bool> kept;
  for (const MotorDescription& motor : scene.motors)
    kept.insert(kept.end(), std::size_t(dofs_driven(scene, motor)), !is_one(motor.joint));
  keep_controls(scene, kept);
  std::erase_if(scene.motors, [&](const auto& motor) { return is_one(motor.joint); });
  std::erase_if(scene.initial, [&](const auto& start) { return is_one(start.joint); });
  std::erase_if(scene.end_effectors, [&](const auto& tip) { return is_one(tip.joint); });
  std::vector<int> place;  // of every link in what is left
  int left = 0;
  for (const LinkDescription& link : scene.links)
    place.push_back(is_one(link.joint.name) ? left : left++);
  const auto is_gone = [&](const LinkDescription& link) { return is_one(link.joint.name); };
  std::erase_if(scene.randomizations, [&](const RandomizationDescription& d) {
    const bool names_body = std::ranges::any_of(scene.links, [&](const LinkDescription& link) {
      return is_gone(link) && link.body.name == d.number.name;
    });
    return d.number.owner == NumberOwner::body
               ? names_body
               : (d.number.owner == NumberOwner::joint || d.number.owner == NumberOwner::motor) &&
                     is_one(d.number.name);
  });
  std::erase_if(scene.links, is_gone);
  for (LinkDescription& link : scene.links)
    if (link.parent >= 0) link.parent = place[std::size_t(link.parent)];
  scene.transmissions.clear();
}

// --- contacts and sensors ---

void drop_imperfections(Scene& scene, int element, Ablation way) {
  for (std::size_t k = 0; k < scene.sensors.size(); ++k) {
    if (!is_meant(element, k)) continue;
    SensorImperfections& of = scene.sensors[k].imperfections;
    const Source source = of.source;
    of = {};
    if (way == Ablation::zero) of.source = source;
  }
}

void drop_layer(Scene& scene, int element) {
  for (std::size_t k = 0; k < scene.sensors.size(); ++k) {
    TactileDescription& sensor = scene.sensors[k];
    if (!is_meant(element, k)) continue;
    sensor.layer.reset(), sensor.table.reset();
    // Nothing else moves its markers.
    if (sensor.markers && sensor.markers->stiffness == 0 && !(sensor.coefficients.ks > 0))
      sensor.markers.reset();
  }
}

void drop_markers(Scene& scene, int element, Ablation way) {
  constexpr double kRigid = 1e300;  // [N/m] what markers have is a compliance
  for (std::size_t k = 0; k < scene.sensors.size(); ++k) {
    std::optional<MarkersDescription>& markers = scene.sensors[k].markers;
    if (!is_meant(element, k) || !markers) continue;
    if (way == Ablation::zero && !scene.sensors[k].layer)
      markers->stiffness = kRigid;
    else
      markers.reset();
  }
}

void drop_feedback(Scene& scene, int element, Ablation way) {
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
    if (way == Ablation::removed) std::erase_if(scene.pair_contacts, is_of);
  }
}

/// The coefficients to set to zero for one of the effects of contacts or sensors.
Fields zeros_of(EffectKind kind, Ablation way) {
  Fields fields = coefficients_of(kind);
  if (!is_part(kind)) {
    fields.clear();
    for (int k = 0; k < kCoefficients; ++k) fields.push_back(coefficient_field(k));
  } else if (kind == Kind::pair_friction || kind == Kind::ground_friction ||
             kind == Kind::tactile_shear) {
    fields.push_back(Field::ks);  // the shear springs go with it
    if (way != Ablation::removed) std::erase(fields, Field::mu);
  }
  return fields;
}

/// The first of the elements that an effect is of, and how many they are: both halves of a contact
/// of surfaces are one.
template <class Element>
std::pair<std::size_t, std::size_t> meant_elements(const std::vector<Element>& all, int element) {
  if (element < 0) return {0, all.size()};
  auto first = std::size_t(element);
  std::size_t count = 1;
  if constexpr (std::is_same_v<Element, PairContactDescription>) {
    if (all[first].second_half) --first;
    if (first + 1 < all.size() && all[first + 1].second_half) ++count;
  }
  return {first, count};
}

/// Removes an effect of contacts or sensors: coefficients, or the elements themselves.
template <class Element>
void drop_elements(Scene& scene, std::vector<Element>& all, const Effect& effect, Ablation way) {
  const Fields fields = zeros_of(effect.kind, way);
  const auto [first, count] = meant_elements(all, effect.element);
  for (std::size_t k = first; k < first + count; ++k) {
    if constexpr (std::is_same_v<Element, TactileDescription>) {
      // Markers that took the sensor's ks as their stiffness keep it.
      if (all[k].markers && all[k].markers->stiffness == 0 && !all[k].layer)
        all[k].markers->stiffness = all[k].coefficients.ks;
    }
    for (const Field field : fields) all[k].coefficients[coefficient_index(field)] = 0;
    keep_constant(scene, first_number(all[k]), fields);
  }
  if (is_part(effect.kind) || way != Ablation::removed) return;
  all.erase(all.begin() + std::ptrdiff_t(first), all.begin() + std::ptrdiff_t(first + count));
}

void drop_of_elements(Scene& scene, const Effect& effect, Ablation way) {
  if (element_owner(effect.kind) == NumberOwner::contact)
    drop_elements(scene, scene.pair_contacts, effect, way);
  else if (element_owner(effect.kind) == NumberOwner::ground)
    drop_elements(scene, scene.ground_contacts, effect, way);
  else if (element_owner(effect.kind) == NumberOwner::tactile)
    drop_elements(scene, scene.sensors, effect, way);
}

void drop_varying(Scene& scene, Ablation way) {
  if (way == Ablation::removed)
    std::erase_if(scene.randomizations, [](const auto& d) { return !is_of_start(d.number); });
  for (RandomizationDescription& d : scene.randomizations)
    if (!is_of_start(d.number)) {
      d.distribution = {Distribution::Kind::list, 0, 0, {number_in(scene, d.number)}};
      d.tie.clear();
    }
}

/// Removes outputs of sensors and markers that are gone.
void keep_known_outputs(Scene& scene) {
  if (!scene.outputs) return;
  std::erase_if(scene.outputs->record, [&](const std::string& word) {
    if (!has_output(scene, word)) return true;
    const std::optional<FieldOutput> of = find_output(scene, split_times(word).name);
    return of && !reason_against(scene, *of).empty();
  });
}

void drop(Scene& scene, const Effect& effect, Ablation way) {
  switch (effect.kind) {
    case Kind::gravity: scene.gravity = {0, 0, 0}; break;
    case Kind::joint_damping: drop_from_joints(scene, Field::damping, way); break;
    case Kind::joint_springs: drop_from_joints(scene, Field::stiffness, way); break;
    case Kind::joint_limits: drop_from_joints(scene, Field::lim_stiffness, way); break;
    case Kind::joint_friction: drop_from_joints(scene, Field::friction, way); break;
    case Kind::armature: drop_from_joints(scene, Field::armature, way); break;
    case Kind::force_motors: drop_motors(scene, MotorControl::force, way); break;
    case Kind::position_motors: drop_motors(scene, MotorControl::position, way); break;
    case Kind::loops: drop_loops(scene); break;
    case Kind::transmissions: drop_transmissions(scene); break;
    case Kind::sensor_imperfections: drop_imperfections(scene, effect.element, way); break;
    case Kind::markers: drop_markers(scene, effect.element, way); break;
    case Kind::layer: drop_layer(scene, effect.element); break;
    case Kind::feedback: drop_feedback(scene, effect.element, way); break;
    case Kind::varying_parameters: drop_varying(scene, way); break;
    case Kind::sleeping: scene.solver.sleep = 0, scene.solver.sleep_source = {}; break;
    case Kind::tactile: drop_imperfections(scene, effect.element, way); [[fallthrough]];
    default: drop_of_elements(scene, effect, way);
  }
}

}  // namespace

bool has_way(EffectKind kind, Ablation way) {
  if (kind == Kind::velocity_products) return false;
  if (way == Ablation::zero)
    return kind != Kind::gravity && kind != Kind::sleeping && kind != Kind::layer &&
           kind != Kind::loops && kind != Kind::transmissions;
  return way == Ablation::removed || kind == Kind::joint_limits;
}

Scene without(Scene scene, const Effect& effect, Ablation way) {
  if (!has_way(effect.kind, way) || effect.element >= element_count(scene, effect.kind))
    throw InputError(fmt::format("a scene cannot be made without element {} of '{}' in this way",
                                 effect.element, to_string(effect.kind)));
  drop(scene, effect, way);
  keep_known_outputs(scene);
  return scene;
}

}  // namespace tangere
