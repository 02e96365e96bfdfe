// SPDX-License-Identifier: Apache-2.0
// Where a loop gives no place in body 2, it is that of body 1 where the scene starts.
#include "engine/model/compile_loops.hpp"

#include <algorithm>

#include "engine/scene/frames.hpp"
#include "engine/scene/scene_number.hpp"

namespace tangere {

using kernels::Frame;
using kernels::JointKind;
using kernels::Vec3;

namespace {

/// Returns the pose of a link in its parent at the initial state.
Frame<double> local_frame(const CompiledModel& m, const kernels::Link& link) {
  const double* const q = &m.initial_q[std::size_t(link.q)];
  Frame<double> moved = kIdentityFrame;
  switch (link.kind) {
    case JointKind::prismatic: moved.p = q[0] * link.axis; break;
    case JointKind::translational: moved.p = {q[0], q[1], q[2]}; break;
    case JointKind::revolute: {
      const Vec3<double> x = kernels::reduce_angle(q[0]) * link.axis;
      moved.R = kernels::rotation_exp(x, kernels::rotation_series(x));
      break;
    }
    case JointKind::spherical:
      moved.R = kernels::to_matrix(
          kernels::rotate_by(kernels::Quat<double>{q[0], q[1], q[2], q[3]}, {0, 0, 0}));
      break;
  }
  return compose(link.frame, moved);
}

/// Returns the poses of all links in the world at the initial state.
std::vector<Frame<double>> initial_frames(const CompiledModel& m) {
  std::vector<Frame<double>> world;
  for (const kernels::Link& link : m.links) {
    const Frame<double> local = local_frame(m, link);
    world.push_back(link.parent < 0 ? local : compose(world[std::size_t(link.parent)], local));
  }
  return world;
}

}  // namespace

void compile_loops(CompiledModel& m, const NameIndex& bodies) {
  if (m.scene.loops.empty()) return;
  const std::vector<Frame<double>> world = initial_frames(m);
  const auto frame_at = [&](int link) {
    return link < 0 ? kIdentityFrame : world[std::size_t(link)];
  };
  NameIndex names;
  for (LoopDescription& d : m.scene.loops) {
    names.add("loop", d.name, 0, d.source);
    const CompiledBody& one = m.bodies[std::size_t(bodies.find("body", d.body1, d.source))];
    CompiledBody two;
    two.frame = kIdentityFrame;
    if (m.moved) two.frame.p = -m.origin;
    if (!d.body2.empty()) two = m.bodies[std::size_t(bodies.find("body", d.body2, d.source))];
    if (one.link == two.link)
      throw InputError(d.source.prefix() + "loop '" + d.name + "': bodies '" + d.body1 + "' and '" +
                       (d.body2.empty() ? "the world" : d.body2) +
                       "' cannot move against each other");
    kernels::Loop loop{};
    loop.link1 = one.link;
    loop.link2 = two.link;
    loop.frame1 = {one.frame.R, one.frame.R * vec3_of(d.position1) + one.frame.p};
    loop.frame2 = relative(frame_at(two.link), compose(frame_at(one.link), loop.frame1));
    if (d.position2) loop.frame2.p = two.frame.R * vec3_of(*d.position2) + two.frame.p;
    if (d.orientation2) loop.frame2.R = two.frame.R * to_frame({{0, 0, 0}, *d.orientation2}).R;
    // The place that is found is kept: a scene with another number has the same one.
    const Vec3<double> place = transpose(two.frame.R) * (loop.frame2.p - two.frame.p);
    if (!d.position2) d.position2 = Vector3{place.x, place.y, place.z};
    const kernels::Quat<double> turn = quaternion_of(transpose(two.frame.R) * loop.frame2.R);
    if (d.weld && !d.orientation2) d.orientation2 = Quaternion{turn.w, turn.x, turn.y, turn.z};
    loop.weld = d.weld;
    for (std::size_t k = 0; k < kernels::kLoopNumbers; ++k)
      loop.*kernels::kLoopParameters[k] = {d.*kLoopNumbers[k], -1};
    m.loops.push_back(loop);
  }
}

void vary_loop(CompiledModel& m, const RandomizationDescription& d, int row) {
  const auto at = std::ranges::find(m.scene.loops, d.number.name, &LoopDescription::name);
  if (at == m.scene.loops.end())
    throw InputError(d.source.prefix() + "no loop is named '" + d.number.name + "'");
  kernels::Loop& loop = m.loops[std::size_t(at - m.scene.loops.begin())];
  (loop.*kernels::kLoopParameters[loop_index(d.number.field)]).row = row;
}

}  // namespace tangere
