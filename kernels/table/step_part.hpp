// SPDX-License-Identifier: Apache-2.0
// The forward functions of an instruction set's table. They view a stage as numbers and call its
// kernels.
#pragma once

#include "kernels/step/detection.hpp"
#include "kernels/step/jacobian.hpp"
#include "kernels/step/link_poses.hpp"
#include "kernels/step/lu.hpp"
#include "kernels/step/norms.hpp"
#include "kernels/table/kernel_table.hpp"
#include "kernels/table/stage_view.hpp"

namespace tangere::kernels {

/// Returns the part of the pattern that the last Jacobian filled.
template <int L>
const PatternPart& part_of(const ModelView& m, const Stage<L>& s) {
  return *s.coupled != 0 ? m.pattern.whole : m.pattern.apart;
}

template <class N, int L>
void add_step_kernels(StageKernels<L>& k) {
  using View = StageView<N, L>;
  k.kinematics = [](const ModelView& m, const Stage<L>& s) {
    kernels::kinematics(m, View::arguments(m, s, -1));
  };
  k.choose_faces = [](const ModelView& m, const Stage<L>& s, Row<L>* out) {
    kernels::choose_faces(m, View::arguments(m, s, -1), View::view(out));
  };
  k.choose_faces_at = [](const ModelView& m, const Stage<L>& s, const Row<L>* q, const Row<L>* zero,
                         Row<L>* out) {
    kernels::choose_faces_at(m, View::at_rest(m, s, q, zero), View::view(out));
  };
  k.place_balls = [](const ModelView& m, const Stage<L>& s, const Row<L>* q, const Row<L>* zero,
                     Row<L>* out) {
    kernels::place_balls(m, View::at_rest(m, s, q, zero), View::view(out));
  };
  k.poses_at = [](const ModelView& m, const Stage<L>& s, const Row<L>* q, const Row<L>* v,
                  const Row<L>* zero, LinkPose<Row<L>>* out) {
    kernels::link_poses(m, View::state_of(s, q, v, zero), reinterpret_cast<LinkPose<N>*>(out));
  };
  k.near_pairs = [](const ModelView& m, const Stage<L>& s, NearPairs<L>& out) {
    kernels::near_pairs(m, View::arguments(m, s, -1), out);
  };
  k.pair_motions = [](const ModelView& m, const Stage<L>& s, Row<L>* out) {
    kernels::pair_motions(m, View::arguments(m, s, -1), View::view(out));
  };
  k.residual = [](const ModelView& m, const Stage<L>& s, int lone) {
    kernels::residual<false>(m, View::arguments(m, s, lone));
  };
  k.evaluate = [](const ModelView& m, const Stage<L>& s, int lone) {
    const StageArgs<N> a = View::arguments(m, s, lone);
    kernels::residual<true>(m, a);
    kernels::jacobian(m, a);
  };
  k.contact_wrenches = [](const ModelView& m, const Stage<L>& s, Row<L>* out) {
    kernels::contact_wrenches(m, View::arguments(m, s, -1), View::view(out));
  };
  k.set_weights = [](const ModelView& m, Stage<L>& s) {
    kernels::set_weights(m.nv, View::view(s.mass_diagonal), View::view(s.weight),
                         View::view(s.inverse_weight));
  };
  k.set_floor = [](const ModelView& m, Stage<L>& s, const double* unknown_scale,
                   const Row<L>& accept) {
    const N floor =
        rounding_floor(m.pattern, View::view(s.A), View::view(s.weight),
                       View::view(s.inverse_weight), *View::view(&s.c0_over_h), unknown_scale);
    *View::view(&s.floor) = select(*View::view(&accept) > N(0.0), floor, *View::view(&s.floor));
  };
  k.scaled_residual = [](const ModelView& m, const Stage<L>& s, double gravity, Row<L>& out) {
    const ResidualScale<N> scale = {View::view(s.v),           View::view(s.force_scale),
                                    View::view(s.weight),      View::view(s.inverse_weight),
                                    *View::view(&s.c0_over_h), N(gravity),
                                    *View::view(&s.floor)};
    *View::view(&out) = kernels::scaled_residual(m.nv, View::view(s.g), scale);
  };
  k.weighted_norm = [](const ModelView& m, const Stage<L>& s, const Row<L>* a, Row<L>& out) {
    *View::view(&out) = kernels::weighted_norm(m.nv, View::view(s.weight), View::view(a));
  };
  k.factor = [](const ModelView& m, const Stage<L>& s, const Row<L>* accept) {
    kernels::factor(m.pattern, part_of(m, s), View::view(s.A), View::view(accept), View::view(s.LU),
                    View::view(s.work));
  };
  k.solve = [](const ModelView& m, const Stage<L>& s, const Row<L>* b, Row<L>* out) {
    kernels::solve(m.pattern, m.pattern.whole, View::view(s.LU), View::view(b), View::view(out),
                   View::view(s.work));
  };
  k.solve_watched = [](const ModelView& m, const Stage<L>& s, const Row<L>* b, Row<L>* out,
                       Row<L>* sound) {
    kernels::solve_watched<false>(m.pattern, part_of(m, s), View::view(s.A), View::view(s.LU),
                                  View::view(b), View::view(out), View::view(sound),
                                  View::view(s.work));
  };
  k.solve_transposed = [](const ModelView& m, const Stage<L>& s, const Row<L>* b, Row<L>* out,
                          Row<L>* sound) {
    kernels::solve_watched<true>(m.pattern, part_of(m, s), View::view(s.A), View::view(s.LU),
                                 View::view(b), View::view(out), View::view(sound),
                                 View::view(s.work));
  };
}

template <class Arch>
void add_group_kernels(KernelTable& k) {
  k.find_candidates = [](const CandidateSearch& search) -> int {
    return search_candidates<Arch>(search);
  };
  k.transpose_list = [](GroupStage::List& list, unsigned lanes) {
    transpose_rows<Arch>(list, lanes);
  };
  k.transpose_anchors = [](const GroupStage::List& list) { transpose_anchors<Arch>(list); };
  k.link_poses = [](const ModelView& m, const GroupState& s, LinkPose<LaneRow>* out) {
    using N = Lanes<Arch>;
    kernels::link_poses(m, at_state<N>(s), reinterpret_cast<LinkPose<N>*>(out));
  };
  k.pad_touch = [](const LinkPose<LaneRow>* sensor, const Frame<double>& pad,
                   const LinkPose<LaneRow>* body, const Frame<double>& shape, Touch<LaneRow>* out) {
    using N = Lanes<Arch>;
    kernels::pad_touch(reinterpret_cast<const LinkPose<N>*>(sensor), pad,
                       reinterpret_cast<const LinkPose<N>*>(body), shape,
                       reinterpret_cast<Touch<N>&>(*out));
  };
}

}  // namespace tangere::kernels
