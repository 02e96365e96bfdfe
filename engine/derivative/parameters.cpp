// SPDX-License-Identifier: Apache-2.0
// Names, places in the scene, and how each number enters what the kernels differentiate by.
#include "engine/derivative/parameters.hpp"

#include <algorithm>
#include <optional>

#include "engine/model/compiled_model.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

using kernels::kBlock;

int parameter_rows(const Model& model) {
  const CompiledModel& m = compiled(model);
  return kernels::parameter_numbers(m.view) +
         kernels::kContactNumbers * static_cast<int>(m.sensors.size());
}

Parameters::Parameters(const Model& model) : model_(model) {
  add_contacts();
  add_bodies();
  add_joints();
  add_motors();
  Scene scene = model.scene();
  for (int k = 0; k < count(); ++k) infos_[std::size_t(k)].value = in(scene, k);
}

void Parameters::add(std::string name, std::string unit, Entry entry) {
  infos_.push_back({std::move(name), std::move(unit), 0});
  entries_.push_back(std::move(entry));
}

void Parameters::add_coefficients(const std::string& of, bool linear, Place place, int index,
                                  int row) {
  const char* const names[] = {"kn", "kt", "mu", linear ? "c" : "kd"};
  const char* const units[] = {"N/m", "N s/m", "1", linear ? "N s/m" : "N s/m^2"};
  for (int k = 0; k < 4; ++k) add(of + " " + names[k], units[k], {place, index, k, {{row + k, 1}}});
}

void Parameters::add_contacts() {
  const CompiledModel& m = compiled(model_);
  int row = 0;
  for (std::size_t k = 0; k < m.pairs.size(); ++k, row += kernels::kContactNumbers) {
    const PairContactDescription& c = m.scene.pair_contacts[k];
    add_coefficients("contact " + c.general_body + " " + c.primitive_body,
                     c.law == ContactLaw::linear, Place::pair, static_cast<int>(k), row);
  }
  for (std::size_t k = 0; k < m.grounds.size(); ++k, row += kernels::kContactNumbers) {
    const GroundContactDescription& c = m.scene.ground_contacts[k];
    add_coefficients("ground " + c.body, c.law == ContactLaw::linear, Place::ground,
                     static_cast<int>(k), row);
  }
  for (std::size_t k = 0; k < m.sensors.size(); ++k) {
    const TactileDescription& t = m.scene.sensors[k];
    add_coefficients(
        "tactile " + t.name, t.law == ContactLaw::linear, Place::sensor, static_cast<int>(k),
        kernels::parameter_numbers(m.view) + kernels::kContactNumbers * static_cast<int>(k));
  }
}

namespace {

/// Whether anything in the scene looks at a body's size.
bool size_matters(const CompiledModel& m, int body) {
  const CompiledBody& b = m.bodies[std::size_t(body)];
  const auto touches = [body](const kernels::PairContact& p) {
    return p.body1 == body || p.body2 == body;
  };
  const auto feels = [body](const CompiledSensor& s) {
    return std::find(s.targets.begin(), s.targets.end(), body) != s.targets.end();
  };
  return (b.link >= 0 && b.mass > 0) || std::any_of(m.pairs.begin(), m.pairs.end(), touches) ||
         std::any_of(m.grounds.begin(), m.grounds.end(),
                     [body](const auto& g) { return g.body == body; }) ||
         std::any_of(m.sensors.begin(), m.sensors.end(), feels);
}

bool varies(const Scene& scene, const std::string& body) {
  return std::any_of(
      scene.randomizations.begin(), scene.randomizations.end(),
      [&](const RandomizationDescription& r) {
        return (r.target == RandomTarget::density || r.target == RandomTarget::size) &&
               r.name == body;
      });
}

}  // namespace

/// Density, or the mass of an abstract body, and every number of a size.
void Parameters::add_bodies() {
  const CompiledModel& m = compiled(model_);
  const int first_size = kernels::first_size_number(m.view);
  for (int b = 0; b < static_cast<int>(m.bodies.size()); ++b) {
    const BodyDescription& d = m.scene.links[std::size_t(b)].body;
    const bool massive = m.bodies[std::size_t(b)].link >= 0 && m.bodies[std::size_t(b)].mass > 0,
               own = varies(m.scene, d.name);
    const auto with_masses = [&](Entry entry) {
      entry.varies = massive && own;
      if (!massive || own) return entry;
      const Masses masses = masses_by(entry, d.shape, d.density);
      for (std::size_t k = 0; k < masses.size(); ++k)
        entry.terms.push_back({mass_row(entry) + static_cast<int>(k), masses[k]});
      return entry;
    };
    const bool given =
        std::holds_alternative<AbstractShape>(d.shape);  // its inertia stays as given
    if (massive && given)
      add("body " + d.name + " mass", "kg", with_masses({Place::mass, b, 0, {}}));
    if (massive && !given)
      add("body " + d.name + " density", "kg/m^3", with_masses({Place::density, b, 0, {}}));
    Shape shape = d.shape;
    for (int which = 0; which < kSizeNames && size_matters(m, b); ++which) {
      if (size_number(shape, which) == nullptr) continue;
      const Term of_contacts = {
          first_size + kernels::kSizeNumbers * b + (which < 2 ? which : which - 2),
          which == 0 ? 1.0 : 0.5};
      add("body " + d.name + " " + size_name(which), "m",
          with_masses({Place::size, b, which, {of_contacts}}));
    }
  }
}

int Parameters::mass_row(const Entry& entry) const {
  const CompiledModel& m = compiled(model_);
  return kernels::first_inertia_number(m.view) +
         kernels::kInertiaNumbers * m.bodies[std::size_t(entry.index)].link;
}

Parameters::Masses Parameters::masses_by(const Entry& entry, const Shape& shape,
                                         double density) const {
  const CompiledBody& body = compiled(model_).bodies[std::size_t(entry.index)];
  if (entry.place == Place::mass)
    return inertia_rows(body, {1, body.centre, kernels::zero33<double>()});
  return inertia_rows(body, entry.place == Place::density
                                ? mass_properties(shape, 1)
                                : mass_properties_by_size(shape, density, entry.field));
}

Parameters::Masses Parameters::masses_by(const Entry& entry, const Batch& batch,
                                         int environment) const {
  const Scene& scene = model_.scene();
  const BodyDescription& d = scene.links[std::size_t(entry.index)].body;
  std::optional<Shape> sized;  // a mesh, whose size cannot vary, is not copied
  double density = d.density;
  for (std::size_t k = 0; k < scene.randomizations.size(); ++k) {  // the last one holds
    const RandomizationDescription& r = scene.randomizations[k];
    if (r.name != d.name) continue;
    if (r.target == RandomTarget::density)
      density = batch.randomized_value(environment, static_cast<int>(k));
    if (r.target != RandomTarget::size) continue;
    if (!sized) sized = d.shape;
    *size_number(*sized, r.index) = batch.randomized_value(environment, static_cast<int>(k));
  }
  return masses_by(entry, sized ? *sized : d.shape, density);
}

Parameters::Entry Parameters::of_dofs(Place place, int joint, int field, int first, int end) const {
  const CompiledModel& m = compiled(model_);
  Entry entry{place, joint, field, {}};
  for (int k = first; k < end; ++k)
    entry.terms.push_back({kernels::first_dof_number(m.view) +
                               kernels::kDofNumbers * (m.joints[std::size_t(joint)].v + k) + field,
                           1});
  return entry;
}

void Parameters::add_joints() {
  const CompiledModel& m = compiled(model_);
  for (int i = 0; i < static_cast<int>(m.joints.size()); ++i) {
    const JointDescription& d = m.scene.links[std::size_t(i)].joint;
    const int n = dof_count(d.type),
              slides = d.turning ? n - (d.type == JointType::free ? 3 : 1) : n;
    if (n == 0) continue;
    const bool turns = n == 1 ? d.type == JointType::revolute : d.type == JointType::spherical;
    const bool both = slides < n || d.type == JointType::free || d.type == JointType::free2d;
    const char* const damping = both && slides == n ? "N s/m, N m s/rad"
                                : turns             ? "N m s/rad"
                                                    : "N s/m";
    const char* const stiffness = both && slides == n ? "N/m, N m/rad" : turns ? "N m/rad" : "N/m";
    add("joint " + d.name + " damping", damping, of_dofs(Place::joint, i, 0, 0, slides));
    if (d.stiffness > 0)
      add("joint " + d.name + " stiffness", stiffness, of_dofs(Place::joint, i, 1, 0, slides));
    if (!d.turning) continue;
    add("joint " + d.name + " turning damping", "N m s/rad",
        of_dofs(Place::turning, i, 0, slides, n));
    if (d.turning->stiffness > 0)
      add("joint " + d.name + " turning stiffness", "N m/rad",
          of_dofs(Place::turning, i, 1, slides, n));
  }
}

void Parameters::add_motors() {
  const CompiledModel& m = compiled(model_);
  for (std::size_t k = 0; k < m.scene.motors.size(); ++k) {
    const MotorDescription& d = m.scene.motors[k];
    if (d.control != MotorControl::position) continue;
    int joint = 0;
    while (m.scene.links[std::size_t(joint)].joint.name != d.joint) ++joint;
    const JointType type = m.scene.links[std::size_t(joint)].joint.type;
    const bool turns = type == JointType::revolute || type == JointType::spherical;
    for (const int field : {2, 3}) {
      Entry entry = of_dofs(Place::motor, joint, field, 0, dof_count(type));
      entry.index = static_cast<int>(k);
      const char* const unit =
          field == 2 ? (turns ? "N m/rad" : "N/m") : (turns ? "N m s/rad" : "N s/m");
      add("motor " + d.joint + (field == 2 ? " P" : " D"), unit, std::move(entry));
    }
  }
}

double& Parameters::in(Scene& scene, int k) const {
  const Entry& e = entries_[std::size_t(k)];
  const auto at = static_cast<std::size_t>(e.index);
  const auto coefficient = [&](ContactCoefficients& c) -> double& {
    double* const fields[] = {&c.kn, &c.kt, &c.mu, &c.damping};
    return *fields[e.field];
  };
  const auto effect = [&](JointEffects& j) -> double& {
    return e.field == 0 ? j.damping : j.stiffness;
  };
  switch (e.place) {
    case Place::pair: return coefficient(scene.pair_contacts[at].coefficients);
    case Place::ground: return coefficient(scene.ground_contacts[at].coefficients);
    case Place::sensor: return coefficient(scene.sensors[at].coefficients);
    case Place::density: return scene.links[at].body.density;
    case Place::mass: return std::get<AbstractShape>(scene.links[at].body.shape).mass;
    case Place::size: return *size_number(scene.links[at].body.shape, e.field);
    case Place::joint: return effect(scene.links[at].joint);
    case Place::turning: return effect(*scene.links[at].joint.turning);
    case Place::motor: break;
  }
  return e.field == 2 ? scene.motors[at].P : scene.motors[at].D;
}

int Parameters::randomization(const Scene& scene, int k) const {
  const Entry& e = entries_[std::size_t(k)];
  const auto at = static_cast<std::size_t>(e.index);
  const auto follows = [&](const RandomizationDescription& r) {
    const bool same_field = static_cast<int>(r.field) == e.field;
    switch (e.place) {
      case Place::pair:
        return r.target == RandomTarget::pair_contact && same_field &&
               r.name == scene.pair_contacts[at].general_body &&
               r.second_name == scene.pair_contacts[at].primitive_body;
      case Place::ground:
        return r.target == RandomTarget::ground_contact && same_field &&
               r.name == scene.ground_contacts[at].body;
      case Place::sensor:
        return r.target == RandomTarget::tactile && same_field && r.name == scene.sensors[at].name;
      case Place::density:
        return r.target == RandomTarget::density && r.name == scene.links[at].body.name;
      case Place::mass: return false;
      case Place::size:
        return r.target == RandomTarget::size && r.index == e.field &&
               r.name == scene.links[at].body.name;
      case Place::joint:
        return r.target == RandomTarget::joint_effect && r.name == scene.links[at].joint.name &&
               r.joint_field == (e.field == 0 ? JointField::damping : JointField::stiffness);
      case Place::turning: return false;
      case Place::motor: break;
    }
    return r.target == RandomTarget::motor && r.name == scene.motors[at].joint &&
           r.joint_field == (e.field == 2 ? JointField::P : JointField::D);
  };
  for (std::size_t i = scene.randomizations.size(); i-- > 0;)  // the last one holds
    if (follows(scene.randomizations[i])) return static_cast<int>(i);
  return -1;
}

void Parameters::gradient(const BlockCotangent& cotangent, const Batch& batch, int environment,
                          std::span<double> out) const {
  const auto row = [&](int r) {
    return cotangent.parameters[std::size_t(r * kBlock + environment % kBlock)];
  };
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    double sum = 0;
    for (const Term& t : entries_[k].terms) sum += t.coefficient * row(t.row);
    if (entries_[k].varies) {
      const Masses masses = masses_by(entries_[k], batch, environment);
      for (std::size_t i = 0; i < masses.size(); ++i)
        sum += masses[i] * row(mass_row(entries_[k]) + static_cast<int>(i));
    }
    out[k] = sum;
  }
}

void Parameters::spread(std::span<const double> change, const Batch& batch, int environment,
                        std::span<double> rows) const {
  std::fill(rows.begin(), rows.end(), 0.0);
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    for (const Term& t : entries_[k].terms) rows[std::size_t(t.row)] += t.coefficient * change[k];
    if (!entries_[k].varies) continue;
    const Masses masses = masses_by(entries_[k], batch, environment);
    for (std::size_t i = 0; i < masses.size(); ++i)
      rows[std::size_t(mass_row(entries_[k])) + i] += masses[i] * change[k];
  }
}

}  // namespace tangere
