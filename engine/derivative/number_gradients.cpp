// SPDX-License-Identifier: Apache-2.0
// Lists the numbers that have a gradient, and how each enters the kernels' derivatives.
#include "engine/derivative/number_gradients.hpp"

#include <algorithm>
#include <optional>

#include "engine/derivative/block_cotangent.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/link_inertia.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/shapes.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

using kernels::kBlock;
using Field = NumberField;
using Owner = NumberOwner;

int parameter_rows(const Model& model) { return compiled(model).view.rows.count; }

NumberGradients::NumberGradients(const Model& model) : model_(model) {
  add_contacts();
  add_bodies();
  add_joints();
  add_motors();
  add_loops();
}

void NumberGradients::add(const SceneNumber& number, Terms terms, int body) {
  const Scene& scene = model_.scene();
  infos_.push_back({number, name_of(number), unit_of(scene, number), number_in(scene, number)});
  entries_.push_back({std::move(terms), body});
}

/// Whether a coefficient has no derivative: with ks = 0 there is no shear state, and kn of a layer
/// or a table follows from its pressures. Where it varies, it scales E.
static bool is_constant(const Scene& scene, const SceneNumber& of) {
  const bool varies = randomization_of(scene, of) >= 0;
  if (of.field == Field::ks) return number_in(scene, of) == 0 && !varies;
  return of.field == Field::kn && of.owner == Owner::tactile && !varies &&
         std::ranges::any_of(scene.sensors, [&](const TactileDescription& sensor) {
           return sensor.name == of.name && (sensor.layer || sensor.table);
         });
}

void NumberGradients::add_coefficients(SceneNumber of, std::initializer_list<int> rows) {
  for (int k = 0; k < kCoefficients; ++k) {
    of.field = coefficient_field(k);
    if (is_constant(model_.scene(), of)) continue;
    Terms terms;
    for (const int row : rows) terms.push_back({row + k, 1});
    add(of, std::move(terms));
  }
}

void NumberGradients::add_contacts() {
  const CompiledModel& m = compiled(model_);
  const kernels::ParameterRows& rows = m.view.rows;
  // Both halves of a contact of surfaces have its coefficients.
  const auto& pairs = m.scene.pair_contacts;
  for (int k = 0; k < static_cast<int>(pairs.size()); ++k) {
    const auto at = std::size_t(k);
    if (pairs[at].second_half) continue;
    if (at + 1 < pairs.size() && pairs[at + 1].second_half) {
      add_coefficients(first_number(pairs[at]), {rows.pair(k), rows.pair(k + 1)});
    } else {
      add_coefficients(first_number(pairs[at]), {rows.pair(k)});
    }
  }
  int k = 0;
  for (const auto& c : m.scene.ground_contacts)
    add_coefficients(first_number(c), {rows.ground(k++)});
  k = 0;
  for (const auto& t : m.scene.sensors) add_coefficients(first_number(t), {rows.sensor(k++)});
  // The motion of a surface (markers, pictures) has no derivative by the material.
  for (k = 0; k < static_cast<int>(m.sensors.size()); ++k) {
    const TactileDescription& t = m.scene.sensors[std::size_t(k)];
    if (!t.layer || t.markers || t.picture) continue;
    add({Owner::tactile, Field::thickness, t.name}, {{m.layer_row(k), 1}});
    add({Owner::tactile, Field::poisson, t.name}, {{m.layer_row(k) + 1, 1}});
  }
}

namespace {

/// Whether anything in the scene depends on a body's size.
bool size_matters(const CompiledModel& m, int body) {
  const CompiledBody& b = m.bodies[std::size_t(body)];
  const auto touches = [body](const kernels::PairContact& p) {
    return p.body1 == body || p.body2 == body;
  };
  const auto senses_body = [body](const CompiledSensor& s) {
    return std::find(s.targets.begin(), s.targets.end(), body) != s.targets.end();
  };
  return (b.link >= 0 && b.mass > 0) || std::any_of(m.pairs.begin(), m.pairs.end(), touches) ||
         std::any_of(m.grounds.begin(), m.grounds.end(),
                     [body](const auto& g) { return g.body == body; }) ||
         std::any_of(m.sensors.begin(), m.sensors.end(), senses_body);
}

/// Whether some contact of a body has shear springs.
bool has_shear_springs(const CompiledModel& m, int body) {
  return std::any_of(m.shear_springs.begin(), m.shear_springs.end(), [body](const auto& of) {
    return of.contact.body1 == body || of.contact.body2 == body;
  });
}

/// Whether a tactile sensor's points touch for the body: they stay where they are when it grows.
bool has_feedback(const Scene& scene, const std::string& body) {
  return std::any_of(
      scene.pair_contacts.begin(), scene.pair_contacts.end(),
      [&](const PairContactDescription& c) { return !c.points.empty() && c.general_body == body; });
}

bool varies(const Scene& scene, const std::string& body) {
  return std::any_of(scene.randomizations.begin(), scene.randomizations.end(),
                     [&](const RandomizationDescription& r) {
                       return r.number.owner == Owner::body && r.number.name == body;
                     });
}

}  // namespace

/// Adds the density, or the mass of an abstract body, and every number of a size.
void NumberGradients::add_bodies() {
  const CompiledModel& m = compiled(model_);
  for (int b = 0; b < static_cast<int>(m.bodies.size()); ++b) {
    const BodyDescription& d = m.scene.links[std::size_t(b)].body;
    const bool massive = m.bodies[std::size_t(b)].link >= 0 && m.bodies[std::size_t(b)].mass > 0,
               own = varies(m.scene, d.name);
    const auto add_with_masses = [&](const SceneNumber& number, Terms terms) {
      if (massive && !own) {
        const Masses masses = masses_by(number, b, d.shape, d.density);
        for (std::size_t k = 0; k < masses.size(); ++k)
          terms.push_back({mass_row(b) + static_cast<int>(k), masses[k]});
      }
      add(number, std::move(terms), massive && own ? b : -1);
    };
    const bool given =
        std::holds_alternative<AbstractShape>(d.shape);  // its inertia stays as given
    if (massive) add_with_masses({Owner::body, given ? Field::mass : Field::density, d.name}, {});
    // How anchors depend on sizes is not worked out.
    const bool known =
        size_matters(m, b) && !has_shear_springs(m, b) && !has_feedback(m.scene, d.name);
    for (int which = 0; which < kSizeIndices && known; ++which) {
      const SizeNumber* const size = row_of(d.shape).size(which);
      if (size == nullptr) continue;
      add_with_masses(size_of_body(d.name, which),
                      {{m.view.rows.solid(b) + size->component, size->scale}});
    }
  }
}

int NumberGradients::mass_row(int body) const {
  const CompiledModel& m = compiled(model_);
  return m.view.rows.link(m.bodies[std::size_t(body)].link);
}

NumberGradients::Masses NumberGradients::masses_by(const SceneNumber& number, int body,
                                                   const Shape& shape, double density) const {
  const CompiledBody& at = compiled(model_).bodies[std::size_t(body)];
  if (number.field == Field::mass)
    return inertia_rows(at, {1, at.centre, kernels::zero33<double>()});
  if (number.field == Field::density) return inertia_rows(at, mass_properties(shape, 1));
  return inertia_slopes(at, mass_properties(shape, density),
                        mass_properties_by_size(shape, density, size_index(number)));
}

NumberGradients::Masses NumberGradients::masses_by(std::size_t k, const Batch& batch,
                                                   int environment) const {
  const Scene& scene = model_.scene();
  const int body = entries_[k].body;
  const BodyDescription& d = scene.links[std::size_t(body)].body;
  std::optional<Shape> sized;  // a mesh is copied only if its scale varies
  double density = d.density;
  for (std::size_t r = 0; r < scene.randomizations.size(); ++r) {  // the last one applies
    const SceneNumber& varied = scene.randomizations[r].number;
    if (varied.owner != Owner::body || varied.name != d.name) continue;
    const double value = batch.randomized_value(environment, static_cast<int>(r));
    if (varied.field == Field::density) {
      density = value;
      continue;
    }
    if (!sized) sized = d.shape;
    *size_number(*sized, size_index(varied)) = value;
  }
  return masses_by(infos_[k].number, body, sized ? *sized : d.shape, density);
}

NumberGradients::Terms NumberGradients::dof_terms(std::size_t joint, int which, int first,
                                                  int end) const {
  const CompiledModel& m = compiled(model_);
  Terms terms;
  for (int k = first; k < end; ++k)
    terms.push_back({m.view.rows.dof(m.joints[joint].v + k, which), 1});
  return terms;
}

void NumberGradients::add_joints() {
  for (std::size_t i = 0; i < model_.scene().links.size(); ++i) {
    const JointDescription& d = model_.scene().links[i].joint;
    const int n = dof_count(d.type),
              slides = d.turning ? n - (d.type == JointType::free ? 3 : 1) : n;
    if (n == 0) continue;
    const auto add_effect = [&](Field field, int which, int first, int end) {
      add({Owner::joint, field, d.name}, dof_terms(i, which, first, end));
    };
    add_effect(Field::damping, kernels::kDofDamping, 0, slides);
    add_effect(Field::armature, kernels::kDofArmature, 0, slides);
    add_effect(Field::stiffness, kernels::kDofStiffness, 0, slides);
    if (d.limits) add_effect(Field::lim_stiffness, kernels::kDofLimitStiffness, 0, slides);
    const auto first_link = std::size_t(compiled(model_).joints[i].first_link);
    if ((compiled(model_).links[first_link].effects & kernels::kDryFriction) != 0)
      add_effect(Field::friction, kernels::kDofFriction, 0, slides);
    if (d.turning) {
      add_effect(Field::turning_damping, kernels::kDofDamping, slides, n);
      add_effect(Field::turning_stiffness, kernels::kDofStiffness, slides, n);
    }
    add_place(i);
  }
}

/// A joint's place moves its first link, in the axes of the parent joint.
void NumberGradients::add_place(std::size_t joint) {
  const CompiledModel& m = compiled(model_);
  const LinkDescription& d = model_.scene().links[joint];
  const kernels::Mat3<double> R =
      d.parent < 0 ? kernels::diagonal(1.0) : m.joints[std::size_t(d.parent)].frame.R;
  const int row = m.view.rows.place(m.joints[joint].first_link);
  for (int axis = 0; axis < 3; ++axis)
    add({Owner::joint, Field::pos, d.joint.name, axis},
        {{row, R.m[0][axis]}, {row + 1, R.m[1][axis]}, {row + 2, R.m[2][axis]}});
}

void NumberGradients::add_motors() {
  const Scene& scene = model_.scene();
  for (const MotorDescription& d : scene.motors) {
    if (!d.has_gains()) continue;
    std::size_t joint = 0;
    while (scene.links[joint].joint.name != d.joint) ++joint;
    const int n = dof_count(scene.links[joint].joint.type);
    if (d.control == MotorControl::position)
      add({Owner::motor, Field::P, d.joint}, dof_terms(joint, kernels::kDofP, 0, n));
    add({Owner::motor, Field::D, d.joint}, dof_terms(joint, kernels::kDofD, 0, n));
  }
}

void NumberGradients::add_loops() {
  const Scene& scene = model_.scene();
  for (std::size_t i = 0; i < scene.loops.size(); ++i)
    for (std::size_t k = 0; k < (scene.loops[i].weld ? 4U : 2U); ++k)
      add({Owner::loop, loop_field(k), scene.loops[i].name},
          {{compiled(model_).view.rows.loop(static_cast<int>(i)) + static_cast<int>(k), 1}});
}

void NumberGradients::gradient(const BlockCotangent& cotangent, const Batch& batch, int environment,
                               std::span<double> out) const {
  const auto row = [&](int r) {
    return cotangent.parameters[std::size_t(r * kBlock + environment % kBlock)];
  };
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    double sum = 0;
    for (const Term& t : entries_[k].terms) sum += t.coefficient * row(t.row);
    if (entries_[k].body >= 0) {
      const Masses masses = masses_by(k, batch, environment);
      for (std::size_t i = 0; i < masses.size(); ++i)
        sum += masses[i] * row(mass_row(entries_[k].body) + static_cast<int>(i));
    }
    out[k] = sum;
  }
}

void NumberGradients::spread(std::span<const double> change, const Batch& batch, int environment,
                             std::span<double> rows) const {
  std::fill(rows.begin(), rows.end(), 0.0);
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    for (const Term& t : entries_[k].terms) rows[std::size_t(t.row)] += t.coefficient * change[k];
    if (entries_[k].body < 0) continue;
    const Masses masses = masses_by(k, batch, environment);
    for (std::size_t i = 0; i < masses.size(); ++i)
      rows[std::size_t(mass_row(entries_[k].body)) + i] += masses[i] * change[k];
  }
}

}  // namespace tangere
