// SPDX-License-Identifier: Apache-2.0
// One system of the layer for all numbers.
#include "engine/derivative/layer_parameters.hpp"

#include "engine/step/layer_sums.hpp"
#include "engine/step/shear_lane.hpp"

namespace tangere {

using kernels::LinkPose;
using kernels::Row;
using kernels::Vec6;

namespace {

/// Subtracts the shares of the solved layer of one lane.
template <int L>
void subtract_shares(const CompiledModel& m, BasicWorkspace<L>& w, const Vec6<double>& slip,
                     int pad, int lane, LossRows<L>& loss) {
  std::vector<LayerContact::BodyNumbers> bodies(w.layer_members.size());
  const LayerMaterial material = w.layer_contact->pull_back(slip, bodies);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const int k = w.layer_members[b];
    for (int i = 0; i < kCoefficients; ++i)
      loss.parameters[m.view.rows.pair(k) + i][lane] -= bodies[b].law[std::size_t(i)];
    for (int i = 0; i < kernels::kSizeNumbers; ++i)
      loss.parameters[m.view.rows.solid(m.pairs[std::size_t(k)].body2) + i][lane] -=
          bodies[b].size[std::size_t(i)];
  }
  if (m.layer_pads[std::size_t(pad)].layer->surface) return;  // it has no numbers of its material
  const int row = m.layer_row(m.layer_pads[std::size_t(pad)].sensor);
  loss.parameters[row][lane] -= material.thickness;
  loss.parameters[row + 1][lane] -= material.poisson;
}

}  // namespace

template <int L>
void add_layer_parameters(const CompiledModel& m, const kernels::KernelTable& table,
                          BasicWorkspace<L>& w, LaneBits lanes, const Row<L>* q,
                          const Row<L>* lambda, LossRows<L>& loss) {
  if (m.layer_pads.empty() || loss.parameters == nullptr) return;
  AlignedVector<LinkPose<Row<L>>> poses(m.links.size());
  table.stage<L>().poses_at(m.view, w.stage, q, lambda, w.zero, poses.data());
  for_each_layer(m, w, [&](const kernels::LinkPair& links, int pad) {
    for (int l = 0; l < L; ++l) {
      if (!has(lanes, l)) continue;
      solve_layer(m, table, w, links, pad, l);
      if (w.layer_contact->empty()) continue;
      const LinkPose<double> one = pose_of<L>(poses, links.link1, l),
                             two = pose_of<L>(poses, links.link2, l);
      const Vec6<double> slip = motion_to_parent(relative(one.world, two.world), two.V) - one.V;
      subtract_shares(m, w, slip, pad, l, loss);
    }
  });
}

#define TANGERE_FOR_LANES(L)                                                                     \
  template void add_layer_parameters(const CompiledModel&, const kernels::KernelTable&,          \
                                     BasicWorkspace<L>&, LaneBits, const Row<L>*, const Row<L>*, \
                                     LossRows<L>&);
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES

}  // namespace tangere
