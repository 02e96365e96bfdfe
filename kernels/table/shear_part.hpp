// SPDX-License-Identifier: Apache-2.0
// The functions of an instruction set's table that update the shear state.
#pragma once

#include "kernels/numbers/one_lane.hpp"
#include "kernels/shear/advance_lists.hpp"
#include "kernels/shear/shear_pullback.hpp"
#include "kernels/shear/shear_rows.hpp"
#include "kernels/table/kernel_table.hpp"
#include "kernels/table/stage_view.hpp"

namespace tangere::kernels {

template <class Arch>
void add_shear_kernels(KernelTable& k) {
  k.recall = [](const ShearSpringTouch& touch, const ShearSpringPoints& points) {
    kernels::recall<Arch>(touch, points);
  };
  k.recall_entries = [](const ShearSpringTouch& touch, const ShearSpringPoints& points,
                        const int* index, ShearEntries entries) {
    return kernels::recall_entries<Arch>(touch, points, index, entries);
  };
  k.advance_entries = [](ShearUpdate& u) { kernels::advance_entries<Arch>(u); };
  k.advance_list = [](ShearListUpdate& u) { kernels::advance_list<Arch>(u); };
  k.advance = [](const ShearSpringTouch& end, const ShearSpringPoints& points, double* s,
                 double* force) { kernels::advance<Arch>(end, points, s, force); };
  k.pull_back_memory = [](const ShearPullback& m) { kernels::pull_back_memory<Arch>(m); };
}

template <class N, int L>
void add_shear_row_kernels(StageKernels<L>& k) {
  using View = StageView<N, L>;
  k.touches_at = [](const ModelView& m, const LinkPose<Row<L>>* links, int first, int end,
                    const unsigned* lanes, LinkPose<Row<L>>* out) {
    find_touches(m, reinterpret_cast<const LinkPose<N>*>(links), first, end, lanes,
                 reinterpret_cast<LinkPose<N>*>(out));
  };
  k.clear_far_contacts = [](const ModelView& m, const Stage<L>& stage,
                            const LinkPose<Row<L>>* links, unsigned* lanes) {
    kernels::clear_far_contacts(m, reinterpret_cast<const LinkPose<N>*>(links), stage.block,
                                stage.group, lanes);
  };
  k.recall_ground = [](const ModelView& m, const Stage<L>& stage, const LinkPose<Row<L>>* touches,
                       const Row<L>* s) {
    kernels::recall_ground(m, reinterpret_cast<const LinkPose<N>*>(touches), View::view(s),
                           View::view(stage.ground_anchors), stage.block, stage.group);
  };
  k.advance_ground = [](const ModelView& m, const Stage<L>& stage, const LinkPose<Row<L>>* touches,
                        const unsigned* lanes, Row<L>* kept) {
    kernels::advance_ground(m, reinterpret_cast<const LinkPose<N>*>(touches), lanes,
                            View::view(stage.ground_anchors), View::view(kept), stage.block,
                            stage.group);
  };
}

}  // namespace tangere::kernels
