// SPDX-License-Identifier: Apache-2.0
// Names and sizes of a scene's enumerations, and its poses.
#include "engine/model/scene.hpp"

#include <iterator>

#include "engine/model/frames.hpp"

namespace tangere {

Vector3 outer_point(const Pose& pose, const Vector3& point) {
  const kernels::Frame<double> at = to_frame(pose);
  const kernels::Vec3<double> p = at.R * vec3_of(point) + at.p;
  return {p.x, p.y, p.z};
}

Vector3 outer_direction(const Pose& pose, const Vector3& direction) {
  const kernels::Vec3<double> d = to_frame(pose).R * vec3_of(direction);
  return {d.x, d.y, d.z};
}

Pose pose_at_end(std::span<const Pose> way, const Pose& pose) {
  kernels::Frame<double> end = to_frame(way.front());
  for (const Pose& next : way.subspan(1)) end = compose(end, to_frame(next));
  const kernels::Frame<double> local = relative(end, to_frame(pose));
  const kernels::Quat<double> q = quaternion_of(local.R);
  return {{local.p.x, local.p.y, local.p.z}, {q.w, q.x, q.y, q.z}};
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
    case JointType::free: return "free";
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

const char* shape_name(const Shape& shape) {
  constexpr const char* kNames[] = {"sphere", "cuboid", "cylinder", "capsule",
                                    "plane",  "mesh",   "abstract"};
  static_assert(std::size(kNames) == std::variant_size_v<Shape>);
  return kNames[shape.index()];
}

bool has_distance(const Shape& shape) {
  return !std::holds_alternative<MeshShape>(shape) && !std::holds_alternative<AbstractShape>(shape);
}

bool has_contact_points(const Shape& shape) {
  if (const auto* mesh = std::get_if<MeshShape>(&shape)) return !mesh->vertices.empty();
  if (const auto* abstract = std::get_if<AbstractShape>(&shape))
    return !abstract->contact_points.empty();
  return !std::holds_alternative<SphereShape>(shape) && !std::holds_alternative<PlaneShape>(shape);
}

bool is_inertia(const std::array<double, 6>& inertia) {
  const auto& [xx, xy, xz, yy, yz, zz] = inertia;
  // ∫ρ x xᵀ = ½ tr(I) 1 - I must be positive definite: leading minors.
  const double half = 0.5 * (xx + yy + zz), a = half - xx, b = half - yy, c = half - zz;
  const double second = a * b - xy * xy;
  const double third = a * (b * c - yz * yz) - xy * (xy * c + yz * xz) - xz * (xy * yz + b * xz);
  return a > 0 && second > 0 && third > 0;
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

const char* to_string(JointField value) {
  switch (value) {
    case JointField::damping: return "damping";
    case JointField::armature: return "armature";
    case JointField::stiffness: return "stiffness";
    case JointField::lim_stiffness: return "lim_stiffness";
    case JointField::P: return "P";
    case JointField::D: return "D";
  }
  return "unknown";
}

double* size_number(Shape& shape, int which) {
  if (auto* cuboid = std::get_if<CuboidShape>(&shape))
    return which >= 2 && which <= 4 ? &cuboid->size[std::size_t(which - 2)] : nullptr;
  if (auto* sphere = std::get_if<SphereShape>(&shape))
    return which == 0 ? &sphere->radius : nullptr;
  const auto of_rod = [&](auto* rod) {
    return which == 0 ? &rod->radius : which == 1 ? &rod->length : nullptr;
  };
  if (auto* cylinder = std::get_if<CylinderShape>(&shape)) return of_rod(cylinder);
  if (auto* capsule = std::get_if<CapsuleShape>(&shape)) return of_rod(capsule);
  return nullptr;
}

const char* size_name(int which) {
  constexpr const char* kNames[kSizeNames] = {"radius", "length", "size[0]", "size[1]", "size[2]"};
  return which >= 0 && which < kSizeNames ? kNames[which] : "unknown";
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

}  // namespace tangere
