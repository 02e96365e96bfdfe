// SPDX-License-Identifier: Apache-2.0
// Names, places in the scene, and how each number enters what the kernels differentiate by.
#include "engine/parameters.hpp"

#include <algorithm>

#include "engine/compiled_model.hpp"
#include "kernels/kernel_table.hpp"

namespace tangere {

using kernels::kBlock;

int parameter_rows(const CompiledModel& m) {
  return kernels::parameter_numbers(m.view) + kernels::kContactNumbers * static_cast<int>(m.sensors.size());
}

Parameters::Parameters(const Model& model) {
  const CompiledModel& m = model.compiled();
  int row = 0;
  for (std::size_t k = 0; k < m.pairs.size(); ++k, row += kernels::kContactNumbers) {
    const PairContactDescription& c = m.scene.pair_contacts[k];
    add_coefficients("contact " + c.general_body + " " + c.primitive_body, c.law == ContactLaw::linear, Place::pair,
                     static_cast<int>(k), row);
  }
  for (std::size_t k = 0; k < m.grounds.size(); ++k, row += kernels::kContactNumbers) {
    const GroundContactDescription& c = m.scene.ground_contacts[k];
    add_coefficients("ground " + c.body, c.law == ContactLaw::linear, Place::ground, static_cast<int>(k), row);
  }
  for (std::size_t k = 0; k < m.sensors.size(); ++k) {
    const TactileDescription& t = m.scene.sensors[k];
    add_coefficients("tactile " + t.name, t.law == ContactLaw::linear, Place::sensor, static_cast<int>(k),
                     kernels::parameter_numbers(m.view) + kernels::kContactNumbers * static_cast<int>(k));
  }
  add_densities(m, row);
  add_joints(m, row + kernels::kInertiaNumbers * static_cast<int>(m.links.size()));
  Scene scene = m.scene;
  for (int k = 0; k < count(); ++k) infos_[std::size_t(k)].value = in(scene, k);
}

void Parameters::add(std::string name, std::string unit, Entry entry) {
  infos_.push_back({std::move(name), std::move(unit), 0});
  entries_.push_back(std::move(entry));
}

void Parameters::add_coefficients(const std::string& of, bool linear, Place place, int index, int row) {
  const char* const names[] = {"kn", "kt", "mu", linear ? "c" : "kd"};
  const char* const units[] = {"N/m", "N s/m", "1", linear ? "N s/m" : "N s/m^2"};
  for (int k = 0; k < 4; ++k) add(of + " " + names[k], units[k], {place, index, k, {{row + k, 1}}});
}

/// Mass, moment and inertia of a body are proportional to its density; abstract bodies have none. Where sizes vary, the
/// factor is each environment's own: such a density is left out.
void Parameters::add_densities(const CompiledModel& m, int row) {
  for (std::size_t i = 0; i < m.bodies.size(); ++i) {
    const BodyDescription& d = m.scene.links[i].body;
    const CompiledBody& body = m.bodies[i];
    const MassProperties unit = mass_properties(d.shape, 1);
    if (body.link < 0 || body.mass <= 0 || body.size_row >= 0 || std::holds_alternative<AbstractShape>(d.shape)) continue;
    const kernels::Mat3<double>& R = body.frame.R;
    const kernels::Vec3<double> centre = R * unit.centre + body.frame.p, moment = unit.mass * centre;
    const kernels::Mat3<double> p = kernels::skew(centre);
    const kernels::Mat3<double> J = R * unit.inertia * kernels::transpose(R) - unit.mass * (p * p);
    const double numbers[] = {unit.mass, moment.x,  moment.y,  moment.z,  J.m[0][0],
                              J.m[0][1], J.m[0][2], J.m[1][1], J.m[1][2], J.m[2][2]};
    Entry entry{Place::body, static_cast<int>(i), 0, {}};
    for (int k = 0; k < kernels::kInertiaNumbers; ++k)
      entry.terms.push_back({row + kernels::kInertiaNumbers * body.link + k, numbers[k]});
    add("body " + d.name + " density", "kg/m^3", std::move(entry));
  }
}

void Parameters::add_joints(const CompiledModel& m, int row) {
  const auto of_dofs = [&](Place place, std::size_t joint, int field, int first, int end) {
    Entry entry{place, static_cast<int>(joint), field, {}};
    for (int k = first; k < end; ++k)
      entry.terms.push_back({row + kernels::kDofNumbers * (m.joints[joint].v + k) + field, 1});
    return entry;
  };
  for (std::size_t i = 0; i < m.joints.size(); ++i) {
    const JointDescription& d = m.scene.links[i].joint;
    const int n = dof_count(d.type), slides = d.turning ? n - (d.type == JointType::free ? 3 : 1) : n;
    if (n == 0) continue;
    const bool turns = n == 1 ? d.type == JointType::revolute : d.type == JointType::spherical;
    const bool both = slides < n || d.type == JointType::free || d.type == JointType::free2d;
    const char* const damping = both && slides == n ? "N s/m, N m s/rad" : turns ? "N m s/rad" : "N s/m";
    const char* const stiffness = both && slides == n ? "N/m, N m/rad" : turns ? "N m/rad" : "N/m";
    add("joint " + d.name + " damping", damping, of_dofs(Place::joint, i, 0, 0, slides));
    if (d.stiffness > 0) add("joint " + d.name + " stiffness", stiffness, of_dofs(Place::joint, i, 1, 0, slides));
    if (!d.turning) continue;
    add("joint " + d.name + " turning damping", "N m s/rad", of_dofs(Place::turning, i, 0, slides, n));
    if (d.turning->stiffness > 0)
      add("joint " + d.name + " turning stiffness", "N m/rad", of_dofs(Place::turning, i, 1, slides, n));
  }
  for (std::size_t k = 0; k < m.scene.motors.size(); ++k) {
    const MotorDescription& d = m.scene.motors[k];
    if (d.control != MotorControl::position) continue;
    std::size_t joint = 0;
    while (m.scene.links[joint].joint.name != d.joint) ++joint;
    const JointType type = m.scene.links[joint].joint.type;
    const bool turns = type == JointType::revolute || type == JointType::spherical;
    for (const int field : {2, 3}) {
      Entry entry = of_dofs(Place::motor, joint, field, 0, dof_count(type));
      entry.index = static_cast<int>(k);
      const char* const unit = field == 2 ? (turns ? "N m/rad" : "N/m") : (turns ? "N m s/rad" : "N s/m");
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
  const auto effect = [&](JointEffects& j) -> double& { return e.field == 0 ? j.damping : j.stiffness; };
  switch (e.place) {
    case Place::pair: return coefficient(scene.pair_contacts[at].coefficients);
    case Place::ground: return coefficient(scene.ground_contacts[at].coefficients);
    case Place::sensor: return coefficient(scene.sensors[at].coefficients);
    case Place::body: return scene.links[at].body.density;
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
        return r.target == RandomTarget::pair_contact && same_field && r.name == scene.pair_contacts[at].general_body &&
               r.second_name == scene.pair_contacts[at].primitive_body;
      case Place::ground:
        return r.target == RandomTarget::ground_contact && same_field && r.name == scene.ground_contacts[at].body;
      case Place::sensor: return r.target == RandomTarget::tactile && same_field && r.name == scene.sensors[at].name;
      case Place::body: return r.target == RandomTarget::density && r.name == scene.links[at].body.name;
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

void Parameters::gradient(const BlockCotangent& cotangent, int lane, std::span<double> out) const {
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    double sum = 0;
    for (const Term& t : entries_[k].terms)
      sum += t.coefficient * cotangent.parameters[std::size_t(t.row * kBlock + lane)];
    out[k] = sum;
  }
}

void Parameters::spread(std::span<const double> change, std::span<double> rows) const {
  std::fill(rows.begin(), rows.end(), 0.0);
  for (std::size_t k = 0; k < entries_.size(); ++k)
    for (const Term& t : entries_[k].terms) rows[std::size_t(t.row)] += t.coefficient * change[k];
}

}  // namespace tangere
