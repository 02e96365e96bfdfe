// SPDX-License-Identifier: Apache-2.0
// Builds the table of one instruction set. Included once by each generated kernels.<isa>.cpp, nowhere else.
#pragma once

#include <new>

#include "kernels/jacobian-inl.hpp"
#include "kernels/kernel_table.hpp"
#include "kernels/link_poses-inl.hpp"
#include "kernels/lu-inl.hpp"
#include "kernels/tactile_block-inl.hpp"

namespace tangere::kernels {

// A LaneRow and Lanes<Arch> are both eight consecutive doubles at 64-byte alignment; vector types may alias anything.
template <class Arch>
struct TableOf {
  using N = Lanes<Arch>;
  static_assert(sizeof(N) == sizeof(LaneRow));

  static N* view(LaneRow* p) { return reinterpret_cast<N*>(p); }
  static const N* view(const LaneRow* p) { return reinterpret_cast<const N*>(p); }

  static std::size_t scratch_bytes(const ModelView& m) {
    return sizeof(LinkScratch<N>) * m.n_links + sizeof(ContactScratch<N>) * (m.n_pairs + m.n_grounds) +
           sizeof(CandidateList<N>) * (m.n_pairs + 2) + sizeof(Vec6<N>) * 4 * m.nv;
  }

  static StageArgs<N> arguments(const ModelView& m, const GroupStage& s) {
    std::byte* at = s.scratch;
    const auto take = [&at]<class T>(T*, int count) {
      T* p = reinterpret_cast<T*>(at);
      at += sizeof(T) * count;
      return p;
    };
    StageArgs<N> a;
    a.links = take(static_cast<LinkScratch<N>*>(nullptr), m.n_links);
    a.contacts = take(static_cast<ContactScratch<N>*>(nullptr), m.n_pairs + m.n_grounds);
    a.columns = take(static_cast<Vec6<N>*>(nullptr), 4 * m.nv);
    auto* lists = take(static_cast<CandidateList<N>*>(nullptr), m.n_pairs);
    for (int k = 0; k < m.n_pairs; ++k)
      lists[k] = {view(s.lists[k].points), s.lists[k].count, view(s.lists[k].reference), s.lists[k].margin};
    a.candidates = lists;
    a.centre = view(s.centre);
    a.x = view(s.x);
    a.r = view(s.r);
    a.s = view(s.s);
    a.tau = view(s.tau);
    a.c0_over_h = load_lanes<Arch>(s.c0_over_h.lane);
    a.inverse_h = load_lanes<Arch>(s.inverse_h.lane);
    a.block = s.block;
    a.group = s.group;
    a.v = view(s.v);
    a.g = view(s.g);
    a.force_scale = view(s.force_scale);
    a.mass_diagonal = view(s.mass_diagonal);
    a.G_q = view(s.G_q);
    a.C = view(s.C);
    a.A = view(s.A);
    a.excess = view(s.excess);
    return a;
  }

  static void pair_poses(const ModelView& m, const GroupStage& s, LaneRow* out) {
    const StageArgs<N> a = arguments(m, s);
    outward_sweep(m, a);
    for (int k = 0; k < m.n_pairs; ++k) {
      pair_motion(m, m.pairs[k], a, a.contacts[k]);
      const Frame<N>& x = a.contacts[k].shape_in_1;
      N* row = view(out + 12 * k);
      for (int i = 0; i < 9; ++i) row[i] = x.R.m[i / 3][i % 3];
      row[9] = x.p.x, row[10] = x.p.y, row[11] = x.p.z;
    }
  }
  static void evaluate(const ModelView& m, const GroupStage& s) {
    const StageArgs<N> a = arguments(m, s);
    residual<true>(m, a);
    jacobian(m, a, s.dofs);
  }
  static void factor_lanes(const ModelView& m, const GroupStage& s, const LaneRow& accept) {
    factor(m.pattern, view(s.A), load_lanes<Arch>(accept.lane), view(s.LU), view(s.work));
  }
  static void solve_lanes(const ModelView& m, const GroupStage& s, const LaneRow* b, LaneRow* out) {
    solve(m.pattern, view(s.LU), view(b), view(out), view(s.work));
  }
  static void solve_watched_lanes(const ModelView& m, const GroupStage& s, const LaneRow* b, LaneRow* out,
                                  LaneRow* sound) {
    solve_watched(m.pattern, view(s.A), view(s.LU), view(b), view(out), view(sound), view(s.work));
  }
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
  static int tactile(const TactileArgs<double>& a) { return tactile_field<InDouble<Arch>>(a); }
  static int tactile_mixed(const TactileArgs<float>& a) { return tactile_field<InMixed<Arch>>(a); }
  static void tactile_group(const TactileBlockArgs<double>& a) { tactile_block<InDouble<Arch>>(a); }
  static void tactile_group_mixed(const TactileBlockArgs<float>& a) { tactile_block<InMixed<Arch>>(a); }

  static constexpr KernelTable make(const char* name) {
    return {name,           scratch_bytes, pair_poses,    evaluate,      factor_lanes,       solve_lanes, solve_watched_lanes,
            poses_of_links, touch_of_pad,  tactile,       tactile_mixed, tactile_group, tactile_group_mixed};
  }
};

}  // namespace tangere::kernels
