// SPDX-License-Identifier: Apache-2.0
// Builds the table of one instruction set. Included once by each generated kernels.<isa>.cpp,
// nowhere else.
#pragma once

#include <new>

#include "kernels/reverse/motion_pullback-inl.hpp"
#include "kernels/reverse/parameter_adjoint-inl.hpp"
#include "kernels/reverse/tactile_pullback-inl.hpp"
#include "kernels/reverse/tactile_tangent-inl.hpp"
#include "kernels/step/detection-inl.hpp"
#include "kernels/step/jacobian-inl.hpp"
#include "kernels/step/lu-inl.hpp"
#include "kernels/step/norms-inl.hpp"
#include "kernels/table/kernel_table.hpp"
#include "kernels/tactile/tactile_block-inl.hpp"

namespace tangere::kernels {

// A row of L doubles and the number type N of L lanes have the same layout; vector types may alias
// anything, and OneLane is a double.
template <class N, int L>
struct StageTable {
  static_assert(sizeof(N) == sizeof(Row<L>));
  using StageOf = Stage<L>;
  using RowOf = Row<L>;

  static N* view(RowOf* p) { return reinterpret_cast<N*>(p); }
  static const N* view(const RowOf* p) { return reinterpret_cast<const N*>(p); }

  static std::size_t scratch_bytes(const ModelView& m) {
    return sizeof(LinkScratch<N>) * m.n_links +
           sizeof(ContactScratch<N>) * (m.n_link_pairs + m.n_grounded) +
           sizeof(CandidateList<N>) * m.n_pairs + sizeof(JointColumns<N>) * 2 * m.n_links +
           sizeof(LinkAdjoint<N>) * m.n_links + 5 * alignof(N);
  }

  /// Hands out arrays from a stage's scratch, one after the other.
  struct Scratch {
    std::byte* at;
    template <class T>
    T* take(int count) {
      T* p = reinterpret_cast<T*>(at);
      at += (sizeof(T) * count + sizeof(N) - 1) / sizeof(N) * sizeof(N);
      return p;
    }
  };
  static StageArgs<N> arguments(const ModelView& m, const StageOf& s, int lone) {
    Scratch scratch{s.scratch};
    return arguments(m, s, lone, scratch);
  }

  static StageArgs<N> arguments(const ModelView& m, const StageOf& s, int lone, Scratch& scratch) {
    StageArgs<N> a;
    a.links = scratch.template take<LinkScratch<N>>(m.n_links);
    a.contacts = scratch.template take<ContactScratch<N>>(m.n_link_pairs + m.n_grounded);
    a.columns = scratch.template take<JointColumns<N>>(2 * m.n_links);
    auto* lists = scratch.template take<CandidateList<N>>(m.n_pairs);
    for (int k = 0; k < m.n_pairs; ++k) {
      const typename StageOf::List& l = s.lists[k];
      const int lane = lone < 0 ? 0 : lone;
      lists[k] = {
          view(l.points),    l.count, view(l.reference), l.margin, l.own + 3 * l.stride * lane,
          l.own_count[lane], l.stride};
    }
    a.candidates = lists;
    a.lone = lone;
    a.centre = view(s.centre);
    a.x = view(s.x);
    a.r = view(s.r);
    a.s = view(s.s);
    a.tau = view(s.tau);
    a.target = view(s.target);
    a.c0_over_h = *view(&s.c0_over_h);
    a.inverse_h = *view(&s.inverse_h);
    a.friction_tangent = *view(&s.friction_tangent);
    a.block = s.block;
    a.group = s.group;
    a.v = view(s.v);
    a.g = view(s.g);
    a.force_scale = view(s.force_scale);
    a.mass_diagonal = view(s.mass_diagonal);
    a.A = view(s.A);
    a.excess = view(s.excess);
    return a;
  }

  static void kinematics_lanes(const ModelView& m, const StageOf& s) {
    kinematics(m, arguments(m, s, -1));
  }
  static void near_pairs_lanes(const ModelView& m, const StageOf& s, NearPairs<L>& out) {
    near_pairs(m, arguments(m, s, -1), out);
  }
  static void residual_lanes(const ModelView& m, const StageOf& s, int lone) {
    residual<false>(m, arguments(m, s, lone));
  }
  static void evaluate_lanes(const ModelView& m, const StageOf& s, int lone) {
    const StageArgs<N> a = arguments(m, s, lone);
    residual<true>(m, a);
    jacobian(m, a);
  }
  static void set_weights_lanes(const ModelView& m, StageOf& s) {
    set_weights(m.nv, view(s.mass_diagonal), view(s.weight), view(s.inverse_weight));
  }
  static void set_floor_lanes(const ModelView& m, StageOf& s, const double* unknown_scale,
                              const RowOf& accept) {
    const N floor = rounding_floor(m.pattern, view(s.A), view(s.inverse_weight), unknown_scale);
    *view(&s.floor) = select(*view(&accept) > N(0.0), floor, *view(&s.floor));
  }
  static void scaled_residual_lanes(const ModelView& m, const StageOf& s, double gravity,
                                    RowOf& out) {
    const ResidualScale<N> scale = {
        view(s.v),           view(s.force_scale), view(s.weight), view(s.inverse_weight),
        *view(&s.c0_over_h), N(gravity),          *view(&s.floor)};
    *view(&out) = scaled_residual(m.nv, view(s.g), scale);
  }
  static void weighted_norm_lanes(const ModelView& m, const StageOf& s, const RowOf* a,
                                  RowOf& out) {
    *view(&out) = weighted_norm(m.nv, view(s.weight), view(a));
  }
  static void factor_lanes(const ModelView& m, const StageOf& s, const RowOf* accept) {
    factor(m.pattern, view(s.A), view(accept), view(s.LU), view(s.work));
  }
  static void solve_lanes(const ModelView& m, const StageOf& s, const RowOf* b, RowOf* out) {
    solve(m.pattern, view(s.LU), view(b), view(out), view(s.work));
  }
  static void solve_watched_lanes(const ModelView& m, const StageOf& s, const RowOf* b, RowOf* out,
                                  RowOf* sound) {
    solve_watched<false>(m.pattern, view(s.A), view(s.LU), view(b), view(out), view(sound),
                         view(s.work));
  }
  static void solve_transposed_lanes(const ModelView& m, const StageOf& s, const RowOf* b,
                                     RowOf* out, RowOf* sound) {
    solve_watched<true>(m.pattern, view(s.A), view(s.LU), view(b), view(out), view(sound),
                        view(s.work));
  }
  static AdjointArgs<N> adjoint_arguments(const StageAdjoint<L>& d, LinkAdjoint<N>* links) {
    return {view(d.q_bar),    view(d.v_bar),
            view(d.rhs),      view(d.lambda),
            view(d.nu),       view(d.mass_lambda),
            view(d.target),   view(d.other),
            view(d.q_centre), view(d.v_centre),
            view(d.q_other),  view(d.v_other),
            d.history,        links};
  }
  static void adjoint_rhs_lanes(const ModelView& m, const StageOf& s, const StageAdjoint<L>& d) {
    adjoint_rhs(m, arguments(m, s, -1), adjoint_arguments(d, nullptr));
  }
  static void adjoint_products_lanes(const ModelView& m, const StageOf& s,
                                     const StageAdjoint<L>& d) {
    Scratch scratch{s.scratch};
    const StageArgs<N> a = arguments(m, s, -1, scratch);
    adjoint_products(m, a, adjoint_arguments(d, scratch.template take<LinkAdjoint<N>>(m.n_links)));
  }
  static void parameter_products_lanes(const ModelView& m, const StageOf& s,
                                       const StageAdjoint<L>& d, int lone, RowOf* out) {
    Scratch scratch{s.scratch};
    const StageArgs<N> a = arguments(m, s, lone, scratch);
    parameter_products(m, a, adjoint_arguments(d, scratch.template take<LinkAdjoint<N>>(m.n_links)),
                       view(out));
  }
  static constexpr StageKernels<L> make() {
    return {scratch_bytes,
            kinematics_lanes,
            near_pairs_lanes,
            residual_lanes,
            evaluate_lanes,
            set_weights_lanes,
            set_floor_lanes,
            scaled_residual_lanes,
            weighted_norm_lanes,
            factor_lanes,
            solve_lanes,
            solve_watched_lanes,
            solve_transposed_lanes,
            adjoint_rhs_lanes,
            adjoint_products_lanes,
            parameter_products_lanes};
  }
};

template <class Arch>
struct TableOf {
  using N = Lanes<Arch>;
  static N* view(LaneRow* p) { return reinterpret_cast<N*>(p); }
  static const N* view(const LaneRow* p) { return reinterpret_cast<const N*>(p); }
  static StageArgs<N> at_state(const GroupState& s) {
    StageArgs<N> a{};
    a.centre = view(s.q);
    a.x = a.s = view(s.zero);
    a.r = view(s.v);
    a.c0_over_h = N(0.0);
    a.inverse_h = N(1.0);
    a.v = view(s.rates);
    a.block = s.block;
    a.group = s.group;
    return a;
  }
  static void poses_of_links(const ModelView& m, const GroupState& s, LinkPose<LaneRow>* out) {
    link_poses(m, at_state(s), reinterpret_cast<LinkPose<N>*>(out));
  }
  static void motion_of_links(const ModelView& m, const GroupState& s, std::byte* scratch,
                              MotionCotangent<LaneRow>* links, LaneRow* q_bar, LaneRow* v_bar) {
    pull_back_links(m, at_state(s), reinterpret_cast<LinkMotion<N>*>(scratch),
                    reinterpret_cast<MotionCotangent<N>*>(links), view(q_bar), view(v_bar));
  }
  static std::size_t pullback_bytes(const ModelView& m) {
    return sizeof(LinkMotion<N>) * std::size_t(m.n_links);
  }
  static void touch_of_pad(const LinkPose<LaneRow>* sensor, const Frame<double>& pad,
                           const LinkPose<LaneRow>* body, const Frame<double>& shape,
                           Touch<LaneRow>* out) {
    pad_touch(reinterpret_cast<const LinkPose<N>*>(sensor), pad,
              reinterpret_cast<const LinkPose<N>*>(body), shape, reinterpret_cast<Touch<N>&>(*out));
  }
  static int tactile(const TactileArgs<double>& a) { return any_field<InDouble<Arch>>(a); }
  static int tactile_mixed(const TactileArgs<float>& a) { return any_field<InMixed<Arch>>(a); }
  static void tactile_group(const TactileBlockArgs<double>& a) { tactile_block<InDouble<Arch>>(a); }
  static void tactile_group_mixed(const TactileBlockArgs<float>& a) {
    tactile_block<InMixed<Arch>>(a);
  }
  static constexpr KernelTable make(const char* name) {
    return {name,
            StageTable<Lanes<Arch>, kGroup>::make(),
            StageTable<OneLane<Arch>, 1>::make(),
            search_candidates<Arch>,
            transpose_rows<Arch>,
            poses_of_links,
            touch_of_pad,
            tactile,
            tactile_mixed,
            tactile_group,
            tactile_group_mixed,
            motion_of_links,
            pullback_bytes,
            pull_back_field<Arch>,
            field_tangent<Arch>};
  }
};

}  // namespace tangere::kernels
