// SPDX-License-Identifier: Apache-2.0
// Goes through every contact point by the plain distance of the shape that it may touch.
#include "engine/sense/contact_state.hpp"

#include <algorithm>

#include "kernels/contact/distance.hpp"

namespace tangere {

using kernels::Frame;
using kernels::kBlock;
using kernels::kGroup;
using kernels::Vec3;

namespace {

void add(PointDepths& depths, double depth) {
  if (!(depth > 0)) return;
  depths.deepest = std::max(depths.deepest, depth);
  ++depths.touching;
}

/// -1, 0 or 1 for each dof of a lane.
std::vector<int> beyond_limits(const CompiledModel& m, const double* column) {
  std::vector<int> beyond(static_cast<std::size_t>(m.nv));
  for (const kernels::Link& link : m.links) {
    if ((link.effects & kernels::kLimited) == 0 || link.kind == kernels::JointKind::spherical)
      continue;
    for (int k = 0; k < kernels::dofs(link.kind); ++k) {
      const kernels::DofEffects& e = m.dof_effects[static_cast<std::size_t>(link.v + k)];
      const double q = column[(m.layout.q + link.q + k) * kBlock];
      beyond[static_cast<std::size_t>(link.v + k)] = q < e.low ? -1 : q > e.high ? 1 : 0;
    }
  }
  return beyond;
}

}  // namespace

PointDepths pair_depths(const kernels::PairContact& pair, const PadReader& reader, int group,
                        int lane, const double* block) {
  const Frame<double> shape = compose(relative(reader.link(pair.link1, group, lane).world,
                                               reader.link(pair.link2, group, lane).world),
                                      pair.frame2);
  Vec3<double> size = pair.size;
  for (int c = 0; c < 3 && pair.size_row >= 0; ++c)
    (&size.x)[c] = kernels::row_of(block, pair.size_row + c, group)[lane];
  return kernels::with_distance<double>(
      pair.shape, size,
      [&](const auto& of) {
        PointDepths depths;
        for (int k = 0; k < pair.n_points; ++k) {
          const double* p = pair.points + 3 * k;
          const Vec3<double> at =
              transposed_times(shape.R, Vec3<double>{p[0], p[1], p[2]} - shape.p);
          add(depths, pair.ball_radius - distance_at(of, at).d);
        }
        return depths;
      },
      pair.grid);
}

PointDepths ground_depths(const kernels::GroundContact& ground, const kernels::ModelView& view,
                          const PadReader& reader, int group, int lane) {
  const Frame<double> body = reader.link(ground.link, group, lane).world;
  PointDepths depths;
  for (int k = 0; k < ground.n_points; ++k) {
    const double* p = ground.points + 3 * k;
    const Vec3<double> at = body.R * Vec3<double>{p[0], p[1], p[2]} + body.p;
    add(depths, ground.radius - dot(view.ground_normal, at - view.ground_point));
  }
  return depths;
}

std::vector<ContactState> ContactStateReader::read(const Batch& batch, int block) {
  const CompiledModel& m = compiled(model_);
  const int lanes = std::min(kBlock, batch.environments() - block * kBlock);
  std::vector<ContactState> states;
  for (int l = 0; l < lanes; ++l) {
    const int group = l / kGroup, lane = l % kGroup;
    if (lane == 0) reader_.move(batch, block, group);
    ContactState& state = states.emplace_back();
    for (const kernels::PairContact& pair : m.pairs)
      state.touching.push_back(
          pair_depths(pair, reader_, group, lane, batch.block(block)).touching);
    for (const kernels::GroundContact& ground : m.grounds)
      state.touching.push_back(ground_depths(ground, m.view, reader_, group, lane).touching);
    state.beyond = beyond_limits(m, batch.block(block) + l);
  }
  return states;
}

}  // namespace tangere
