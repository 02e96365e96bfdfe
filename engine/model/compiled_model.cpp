// SPDX-License-Identifier: Apache-2.0
// Sets the ModelView of the kernels from the arrays.
#include "engine/model/compiled_model.hpp"

#include <algorithm>

#include "engine/model/compiled_layer.hpp"

namespace tangere {

kernels::PadTiles CompiledSensor::tiles() const {
  kernels::PadTiles p{};
  p.rows = rows, p.cols = cols;
  p.tile_rows = tile_rows, p.tile_cols = tile_cols;
  p.x = tile_x.data(), p.y = tile_y.data(), p.z = tile_z.data(), p.radius = tile_radius.data();
  p.eight_x = eight_x.data(), p.eight_y = eight_y.data(), p.eight_z = eight_z.data();
  p.eight_radius = eight_radius.data();
  p.kind = tile_kind.data();
  p.offsets = offsets.data(), p.offsets_f = offsets_f.data();
  if (!index.empty()) {
    p.index = index.data();
    p.frames = frames.data(), p.frames_f = frames_f.data();
  }
  if (!factors.empty()) p.factors = factors.data(), p.factors_f = factors_f.data();
  p.parts = parts.data();
  std::copy(middle, middle + 3, p.middle);
  p.reach = reach;
  p.skewed = skewed;
  std::copy(axes, axes + 9, p.axes);
  return p;
}

void point_transmissions(const CompiledModel& m, kernels::ModelView& v) {
  v.n_transmissions = static_cast<int>(m.transmissions.size());
  v.transmissions = m.transmissions.data();
  v.pieces = m.transmission_pieces.data();
  v.n_transmission_dofs = static_cast<int>(m.transmission_dofs.size());
  v.transmission_dofs = m.transmission_dofs.data();
  v.most_transmission_dofs = 0;
  for (const kernels::Transmission& t : m.transmissions)
    v.most_transmission_dofs = std::max(v.most_transmission_dofs, t.dofs);
}

void point_view(CompiledModel& m) {
  kernels::ModelView& v = m.view;
  v.n_links = static_cast<int>(m.links.size());
  v.nq = m.nq;
  v.nv = m.nv;
  v.links = m.links.data();
  v.effects = m.dof_effects.data();
  v.n_pairs = static_cast<int>(m.pairs.size());
  v.n_grounds = static_cast<int>(m.grounds.size());
  v.most_ground_points = 0;
  for (const kernels::GroundContact& g : m.grounds)
    v.most_ground_points = std::max(v.most_ground_points, g.n_points);
  v.pairs = m.pairs.data();
  v.faced = std::any_of(m.pairs.begin(), m.pairs.end(), [](const auto& p) { return p.faced; });
  v.grounds = m.grounds.data();
  v.n_link_pairs = static_cast<int>(m.link_pairs.size());
  v.n_grounded = static_cast<int>(m.grounded.size());
  v.link_pairs = m.link_pairs.data();
  v.grounded = m.grounded.data();
  v.link_balls = m.link_balls.empty() ? nullptr : m.link_balls.data();
  v.pair_order = m.pair_order.data();
  v.ground_order = m.ground_order.data();
  v.n_solids = static_cast<int>(m.solids.size());
  v.solids = m.solids.data();
  v.n_shear_springs = static_cast<int>(m.shear_springs.size());
  v.memories = m.shear_springs.data();
  kernels::ParameterRows& rows = v.rows;
  rows.grounds = rows.pair(v.n_pairs);
  rows.links = rows.ground(v.n_grounds);
  rows.dofs = rows.link(v.n_links);
  rows.solids = rows.dof(v.nv, 0);
  rows.places = rows.solid(v.n_solids);
  rows.loops = rows.place(v.n_links);
  rows.sensors = rows.loop(static_cast<int>(m.loops.size()));
  m.layer_rows = rows.sensor(static_cast<int>(m.sensors.size()));
  const bool layers = std::ranges::any_of(
      m.sensors, [](const CompiledSensor& s) { return s.layer && !s.layer->table; });
  rows.count = layers ? m.layer_row(static_cast<int>(m.sensors.size())) : m.layer_rows;
  v.pattern = m.pattern.view();
  v.n_followers = static_cast<int>(m.followers.size());
  v.followers = m.followers.data();
  v.n_ties = static_cast<int>(m.ties.size());
  v.ties = m.ties.data();
  v.n_folded = static_cast<int>(m.pattern.folded.size());
  v.folded = m.pattern.folded.data();
  v.n_polynomials = static_cast<int>(m.polynomials.size());
  v.polynomials = m.polynomials.data();
  v.n_sloped = static_cast<int>(m.pattern.sloped.size());
  v.sloped = m.pattern.sloped.data();
  v.n_loops = static_cast<int>(m.loops.size());
  v.loops = m.loops.data();
  point_transmissions(m, v);
}

}  // namespace tangere
