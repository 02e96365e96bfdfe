// SPDX-License-Identifier: Apache-2.0
// Links of a group come from the reader; a body or an end effector is fixed to one of them.
#include "engine/sense/motion_reading.hpp"

#include <algorithm>

#include "engine/scene/frames.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;

namespace {

void write3(const kernels::Vec3<double>& a, double* to) { to[0] = a.x, to[1] = a.y, to[2] = a.z; }

/// Returns an end effector's position, by the model's origin, in the group moved last.
kernels::Vec3<double> position_of(const PadReader& reader, const CompiledEndEffector& v, int group,
                                  int lane) {
  const kernels::Frame<double> at = reader.link(v.link, group, lane).world;
  return at.R * v.point + at.p;
}

void write_positions(const CompiledModel& m, const PadReader& reader, int group, int lane,
                     std::span<double> position) {
  double* to = position.data();
  for (const CompiledEndEffector& v : m.end_effectors)
    write3(m.in_world(position_of(reader, v, group, lane)), to), to += 3;
}

}  // namespace

void read_bodies(const CompiledModel& m, PadReader& reader, const Batch& batch, int environment,
                 std::span<double> pose, std::span<double> twist, std::span<const int> chosen) {
  for (const int body : chosen) checked_index("body", body, std::ssize(m.bodies));
  const std::size_t count = chosen.empty() ? m.bodies.size() : chosen.size();
  check_size("poses of bodies", pose.size(), 7 * count);
  check_size("twists of bodies", twist.size(), 6 * count);
  const int group = environment % kBlock / kGroup, lane = environment % kGroup;
  reader.move(batch, environment / kBlock, group);
  for (std::size_t b = 0; b < count; ++b) {
    const CompiledBody& body = m.bodies[chosen.empty() ? b : std::size_t(chosen[b])];
    const kernels::LinkPose<double> link = reader.link(body.link, group, lane);
    const kernels::Frame<double> at = compose(link.world, body.frame);
    const kernels::Quat<double> o = quaternion_of(at.R);
    const kernels::Vec3<double> p = m.in_world(at.p);
    const double values[7] = {p.x, p.y, p.z, o.w, o.x, o.y, o.z};
    std::copy(values, values + 7, &pose[7 * b]);
    const kernels::Vec3<double> omega = link.world.R * link.V.a;
    const kernels::Vec3<double> v = link.world.R * (link.V.l + cross(link.V.a, body.frame.p));
    const double rates[6] = {omega.x, omega.y, omega.z, v.x, v.y, v.z};
    std::copy(rates, rates + 6, &twist[6 * b]);
  }
}

void read_end_effectors(const CompiledModel& m, PadReader& reader, const Batch& batch,
                        int environment, std::span<double> position, std::span<double> velocity) {
  check_size("positions of end effectors", position.size(), 3 * m.end_effectors.size());
  if (!velocity.empty())
    check_size("velocities of end effectors", velocity.size(), 3 * m.end_effectors.size());
  const int group = environment % kBlock / kGroup, lane = environment % kGroup;
  reader.move(batch, environment / kBlock, group);
  write_positions(m, reader, group, lane, position);
  const std::vector<CompiledEndEffector>& all = m.end_effectors;
  for (std::size_t k = 0; k < all.size() && !velocity.empty(); ++k) {
    const kernels::LinkPose<double> link = reader.link(all[k].link, group, lane);
    write3(link.world.R * (link.V.l + cross(link.V.a, all[k].point)), &velocity[3 * k]);
  }
}

void read_end_effectors(const CompiledModel& m, PadReader& reader, const Batch& batch, int block,
                        std::span<const std::span<double>> positions) {
  const int environments = std::min(kBlock, batch.environments() - block * kBlock);
  for (int e = 0; e < environments; ++e) {
    if (e % kGroup == 0) reader.move(batch, block, e / kGroup);
    write_positions(m, reader, e / kGroup, e % kGroup, positions[std::size_t(e)]);
  }
}

void read_end_effector_jacobian(const CompiledModel& m, PadReader& reader, const Batch& batch,
                                int environment, std::span<double> jacobian) {
  check_size("Jacobian of end effectors", jacobian.size(),
             3 * m.end_effectors.size() * std::size_t(m.nv));
  const int group = environment % kBlock / kGroup, lane = environment % kGroup;
  reader.move(batch, environment / kBlock, group);
  const auto nv = std::size_t(m.nv);
  std::fill(jacobian.begin(), jacobian.end(), 0.0);
  for (std::size_t k = 0; k < m.end_effectors.size(); ++k) {
    const auto column = [&](int dof, const kernels::Vec3<double>& c) {
      double* const at = &jacobian[3 * k * nv + std::size_t(dof)];
      at[0] = c.x, at[nv] = c.y, at[2 * nv] = c.z;
    };
    const CompiledEndEffector& end_effector = m.end_effectors[k];
    const kernels::Vec3<double> x = position_of(reader, end_effector, group, lane);
    for (int i = end_effector.link; i >= 0; i = m.links[std::size_t(i)].parent) {
      const kernels::Link& link = m.links[std::size_t(i)];
      const kernels::Frame<double> at = reader.link(i, group, lane).world;
      const auto along = [&](const kernels::Vec3<double>& axis) {
        const kernels::Vec3<double> a = at.R * axis;
        return kernels::slides(link.kind) ? a : cross(a, x - at.p);
      };
      if (kernels::dofs(link.kind) == 1) {
        column(link.v, along(link.axis));
      } else {
        column(link.v, along({1, 0, 0}));
        column(link.v + 1, along({0, 1, 0}));
        column(link.v + 2, along({0, 0, 1}));
      }
    }
  }
}

}  // namespace tangere
