// SPDX-License-Identifier: Apache-2.0
// Names and sizes of a scene's enumerations. Those of shapes are in shapes.cpp.
#include "engine/scene/scene.hpp"

#include <algorithm>
#include <iterator>

#include "engine/scene/frames.hpp"

namespace tangere {

bool is_transmission(const Scene& scene, const JointDescription& joint) {
  return std::ranges::find(scene.transmissions, joint.name, &TransmissionDescription::joint) !=
         scene.transmissions.end();
}

std::vector<TactilePoint> tactile_points(const TactileDescription& sensor) {
  if (!sensor.points.empty()) return sensor.points;
  const RectArray& a = sensor.array;
  using kernels::Vec3;
  const Vec3<double> p0 = vec3_of(a.corner0), axis0 = vec3_of(a.axis0), axis1 = vec3_of(a.axis1),
                     diagonal = vec3_of(a.corner1) - p0;
  const Vec3<double> normal = cross(axis0, axis1);
  const double step0 = a.rows > 1 ? dot(diagonal, axis0) / (a.rows - 1) : 0;
  const double step1 = a.cols > 1 ? dot(diagonal, axis1) / (a.cols - 1) : 0;
  std::vector<TactilePoint> points;
  for (int i = 0; i < a.rows; ++i)
    for (int j = 0; j < a.cols; ++j) {
      const Vec3<double> at = p0 + (i * step0) * axis0 + (j * step1) * axis1;
      TactilePoint point;
      point.position = {at.x, at.y, at.z};
      point.normal = {normal.x, normal.y, normal.z};
      point.axis0 = a.axis0, point.axis1 = a.axis1;
      point.pixel = {i, j};
      points.push_back(point);
    }
  return points;
}

const char* to_string(JointType value) {
  switch (value) {
    case JointType::fixed: return "fixed";
    case JointType::revolute: return "revolute";
    case JointType::prismatic: return "prismatic";
    case JointType::planar: return "planar";
    case JointType::translational: return "translational";
    case JointType::free2d: return "free2d";
    case JointType::spherical: return "spherical";
    case JointType::free: return "free3d";
  }
  return "unknown";
}

const char* to_string(ContactLaw value) {
  switch (value) {
    case ContactLaw::clamped: return "clamped";
    case ContactLaw::paper: return "paper";
    case ContactLaw::linear: return "linear";
  }
  return "unknown";
}

const char* to_string(Distribution::Kind value) {
  switch (value) {
    case Distribution::Kind::uniform: return "uniform";
    case Distribution::Kind::log_uniform: return "log_uniform";
    case Distribution::Kind::normal: return "normal";
    case Distribution::Kind::list: return "list";
  }
  return "unknown";
}

const char* law_name(ContactLaw law, std::optional<double> ramp) {
  return law == ContactLaw::linear && ramp == 0 ? "published" : to_string(law);
}

/// Whether a symmetric matrix is positive definite: its leading minors are positive.
static bool is_positive(const std::array<double, 6>& matrix) {
  const auto& [a, ab, ac, b, bc, c] = matrix;
  const double third = a * (b * c - bc * bc) - ab * (ab * c - bc * ac) + ac * (ab * bc - b * ac);
  return a > 0 && a * b - ab * ab > 0 && third > 0;
}

bool is_inertia(const std::array<double, 6>& inertia) { return is_positive(inertia); }

bool is_solid_inertia(const std::array<double, 6>& inertia) {
  const auto& [xx, xy, xz, yy, yz, zz] = inertia;
  const double half = 0.5 * (xx + yy + zz);  // ∫ρ x xᵀ = ½ tr(I) 1 - I
  return is_positive({half - xx, -xy, -xz, half - yy, -yz, half - zz});
}

int position_count(JointType type) {
  switch (type) {
    case JointType::fixed: return 0;
    case JointType::revolute:
    case JointType::prismatic: return 1;
    case JointType::planar: return 2;
    case JointType::translational:
    case JointType::free2d: return 3;
    case JointType::spherical: return 4;
    case JointType::free: return 7;
  }
  return 0;
}

int dof_count(JointType type) {
  switch (type) {
    case JointType::spherical: return 3;
    case JointType::free: return 6;
    default: return position_count(type);
  }
}

int dofs_driven(const Scene& scene, const MotorDescription& motor) {
  for (const LinkDescription& link : scene.links)
    if (link.joint.name == motor.joint) return dof_count(link.joint.type);
  return 0;
}

bool dof_turns(JointType type, int k) {
  switch (type) {
    case JointType::revolute:
    case JointType::spherical: return true;
    case JointType::free2d: return k == 2;
    case JointType::free: return k >= 3;
    default: return false;
  }
}

const char* coordinate_unit(JointType type, int k) {
  if (type == JointType::spherical || (type == JointType::free && k > 2)) return "1";
  return dof_turns(type, k) ? "rad" : "m";
}

}  // namespace tangere
