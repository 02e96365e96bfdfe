// SPDX-License-Identifier: Apache-2.0
// Builds the table of one instruction set. Included once by each generated kernels.<isa>.cpp, nowhere else.
#pragma once

#include <new>

#include "kernels/detection-inl.hpp"
#include "kernels/jacobian-inl.hpp"
#include "kernels/kernel_table.hpp"
#include "kernels/link_poses-inl.hpp"
#include "kernels/lu-inl.hpp"
#include "kernels/norms-inl.hpp"
#include "kernels/tactile_block-inl.hpp"

namespace tangere::kernels {

// A row of L doubles and the number type N of L lanes have the same layout; vector types may alias anything, and OneLane
// is a double.
template <class N, int L>
struct StageTable {
  static_assert(sizeof(N) == sizeof(Row<L>));
  using StageOf = Stage<L>;
  using RowOf = Row<L>;

  static N* view(RowOf* p) { return reinterpret_cast<N*>(p); }
  static const N* view(const RowOf* p) { return reinterpret_cast<const N*>(p); }

  static std::size_t scratch_bytes(const ModelView& m) {
    return sizeof(LinkScratch<N>) * m.n_links + sizeof(ContactScratch<N>) * (m.n_link_pairs + m.n_grounded) +
           sizeof(CandidateList<N>) * m.n_pairs + sizeof(JointColumns<N>) * 2 * m.n_links + 4 * alignof(N);
  }

  static StageArgs<N> arguments(const ModelView& m, const StageOf& s, int lone) {
    std::byte* at = s.scratch;
    const auto take = [&at]<class T>(T*, int count) {
      T* p = reinterpret_cast<T*>(at);
      at += (sizeof(T) * count + sizeof(N) - 1) / sizeof(N) * sizeof(N);
      return p;
    };
    StageArgs<N> a;
    a.links = take(static_cast<LinkScratch<N>*>(nullptr), m.n_links);
    a.contacts = take(static_cast<ContactScratch<N>*>(nullptr), m.n_link_pairs + m.n_grounded);
    a.columns = take(static_cast<JointColumns<N>*>(nullptr), 2 * m.n_links);
    auto* lists = take(static_cast<CandidateList<N>*>(nullptr), m.n_pairs);
    for (int k = 0; k < m.n_pairs; ++k) {
      const typename StageOf::List& l = s.lists[k];
      const int lane = lone < 0 ? 0 : lone;
      lists[k] = {view(l.points),        l.count, view(l.reference), l.margin, l.own + 3 * l.stride * lane,
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

  static void kinematics_lanes(const ModelView& m, const StageOf& s) { kinematics(m, arguments(m, s, -1)); }
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
  static void set_floor_lanes(const ModelView& m, StageOf& s, const double* unknown_scale, const RowOf& accept) {
    const N floor = rounding_floor(m.pattern, view(s.A), view(s.inverse_weight), unknown_scale);
    *view(&s.floor) = select(*view(&accept) > N(0.0), floor, *view(&s.floor));
  }
  static void scaled_residual_lanes(const ModelView& m, const StageOf& s, double gravity, RowOf& out) {
    const ResidualScale<N> scale = {view(s.v), view(s.force_scale), view(s.weight), view(s.inverse_weight),
                                    *view(&s.c0_over_h), N(gravity), *view(&s.floor)};
    *view(&out) = scaled_residual(m.nv, view(s.g), scale);
  }
  static void weighted_norm_lanes(const ModelView& m, const StageOf& s, const RowOf* a, RowOf& out) {
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
    solve_watched(m.pattern, view(s.A), view(s.LU), view(b), view(out), view(sound), view(s.work));
  }
  static constexpr StageKernels<L> make() {
    return {scratch_bytes,     kinematics_lanes, near_pairs_lanes,      residual_lanes,      evaluate_lanes, set_weights_lanes,
            set_floor_lanes, scaled_residual_lanes, weighted_norm_lanes, factor_lanes, solve_lanes,    solve_watched_lanes};
  }
};

template <class Arch>
struct TableOf {
  using N = Lanes<Arch>;
  static N* view(LaneRow* p) { return reinterpret_cast<N*>(p); }
  static const N* view(const LaneRow* p) { return reinterpret_cast<const N*>(p); }
  static void poses_of_links(const ModelView& m, const GroupState& s, LinkPose<LaneRow>* out) {
    StageArgs<N> a{};
    a.centre = view(s.q);
    a.x = a.s = view(s.zero);
    a.r = view(s.v);
    a.c0_over_h = N(0.0);
    a.inverse_h = N(1.0);
    a.v = view(s.rates);
    link_poses(m, a, reinterpret_cast<LinkPose<N>*>(out));
  }
  static void touch_of_pad(const LinkPose<LaneRow>* sensor, const Frame<double>& pad, const LinkPose<LaneRow>* body,
                           const Frame<double>& shape, Touch<LaneRow>* out) {
    pad_touch(reinterpret_cast<const LinkPose<N>*>(sensor), pad, reinterpret_cast<const LinkPose<N>*>(body), shape,
              reinterpret_cast<Touch<N>&>(*out));
  }
  static int tactile(const TactileArgs<double>& a) { return any_field<InDouble<Arch>>(a); }
  static int tactile_mixed(const TactileArgs<float>& a) { return any_field<InMixed<Arch>>(a); }
  static void tactile_group(const TactileBlockArgs<double>& a) { tactile_block<InDouble<Arch>>(a); }
  static void tactile_group_mixed(const TactileBlockArgs<float>& a) { tactile_block<InMixed<Arch>>(a); }
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
            tactile_group_mixed};
  }
};

}  // namespace tangere::kernels
