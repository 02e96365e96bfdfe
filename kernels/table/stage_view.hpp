// SPDX-License-Identifier: Apache-2.0
// Views the engine's rows of doubles as a kernel's numbers.
#pragma once

#include "kernels/contact/elastic_contact.hpp"
#include "kernels/step/arguments.hpp"
#include "kernels/step/low_points.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

// A row of L doubles and the number type N of L lanes have the same layout. Vector types may alias
// anything, and OneLane is a double.
template <class N, int L>
struct StageView {
  static_assert(sizeof(N) == sizeof(Row<L>));
  using StageOf = Stage<L>;
  using RowOf = Row<L>;

  static N* view(RowOf* p) { return reinterpret_cast<N*>(p); }
  static const N* view(const RowOf* p) { return reinterpret_cast<const N*>(p); }

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
  /// Presents (q, v) as a stage at x = 0 whose rates are v. Rates go to `work`.
  static StageArgs<N> state_of(const StageOf& s, const RowOf* q, const RowOf* v,
                               const RowOf* zero) {
    StageArgs<N> a{};
    a.centre = view(q);
    a.x = a.s = view(zero);
    a.r = view(v);
    a.c0_over_h = N(0.0);
    a.inverse_h = N(1.0);
    a.v = view(s.work);
    a.block = s.block;
    a.group = s.group;
    return a;
  }

  /// Presents the lists of links that are not apart: copying all would take longer than what is
  /// left to do where nothing touches.
  static const CandidateList<N>* lists_of(const ModelView& m, const StageOf& s, int lone,
                                          Scratch& scratch) {
    auto* lists = scratch.template take<CandidateList<N>>(m.n_pairs);
    const int lane = lone < 0 ? 0 : lone;
    const bool all = s.considered == nullptr;
    for (int at = 0, end = all ? m.n_link_pairs : s.n_considered; at < end; ++at) {
      const int g = all ? at : s.considered[at];
      const int first = m.pair_order[m.link_pairs[g].first];
      lists[first].margin = s.lists[first].margin;
      if (s.apart[g] != 0) continue;
      for (int i = 0; i < m.link_pairs[g].count; ++i) {
        const int k = m.pair_order[m.link_pairs[g].first + i];
        const typename StageOf::List& l = s.lists[k];
        lists[k] = {
            view(l.points),
            l.count,
            view(l.reference),
            l.margin,
            l.own + 3 * l.stride * lane,
            l.own_count[lane],
            l.stride,
            view(l.anchors),
            l.own_anchors == nullptr ? nullptr : l.own_anchors + kAnchorNumbers * l.stride * lane,
            view(l.weights),
            l.own_weights == nullptr ? nullptr : l.own_weights + l.stride * lane};
      }
    }
    return lists;
  }

  static StageArgs<N> arguments(const ModelView& m, const StageOf& s, int lone) {
    Scratch scratch{s.scratch};
    return arguments(m, s, lone, scratch);
  }

  /// Presents the stage's model at q, without rates.
  static StageArgs<N> at_rest(const ModelView& m, const StageOf& s, const RowOf* q,
                              const RowOf* zero) {
    StageArgs<N> a = arguments(m, s, -1);
    a.centre = view(q);
    a.x = a.r = a.s = view(zero);
    a.c0_over_h = N(0.0);
    a.inverse_h = N(1.0);
    return a;
  }

  static StageArgs<N> arguments(const ModelView& m, const StageOf& s, int lone, Scratch& scratch) {
    StageArgs<N> a;
    a.links = scratch.template take<LinkScratch<N>>(m.n_links);
    a.contacts =
        scratch.template take<ContactScratch<N>>(m.n_link_pairs + m.n_grounded + m.n_loops);
    a.columns = scratch.template take<JointColumns<N>>(2 * m.n_links);
    a.transmission_columns = scratch.template take<TransmissionColumn<N>>(m.n_transmission_dofs);
    a.transmission_force = scratch.template take<N>(m.n_transmissions);
    a.transmission_second =
        scratch.template take<N>(m.most_transmission_dofs * m.most_transmission_dofs);
    a.polynomials = scratch.template take<PolynomialScratch<N>>(m.n_polynomials);
    a.own_x = view(s.x);
    a.own_r = view(s.r);
    a.low_points = scratch.template take<std::uint64_t>(low_words(m.most_ground_points));
    a.candidates = lists_of(m, s, lone, scratch);
    a.apart = s.apart;
    a.coupled = s.coupled;
    a.ground_anchors = view(s.ground_anchors);
    static_assert(sizeof(PairSums<N>) == kPairSumNumbers * sizeof(N));
    a.layer_sums = reinterpret_cast<const PairSums<N>*>(s.layer_sums);
    a.faces = view(s.faces);
    a.lone = lone;
    a.centre = view(s.centre);
    a.x = view(s.x);
    a.r = view(s.r);
    a.s = view(s.s);
    a.tau = view(s.tau);
    a.target = view(s.target);
    a.dry_anchor = view(s.dry_anchor);
    a.c0_over_h = *view(&s.c0_over_h);
    a.inverse_h = *view(&s.inverse_h);
    a.friction_tangent = *view(&s.friction_tangent);
    a.normal_share = *view(&s.normal_share);
    a.friction_share = *view(&s.friction_share);
    a.block = s.block;
    a.group = s.group;
    a.v = view(s.v);
    a.g = view(s.g);
    a.force_scale = view(s.force_scale);
    a.mass_diagonal = view(s.mass_diagonal);
    a.A = view(s.A);
    a.block_first = s.block_first;
    a.block_entries = s.block_entries;
    a.considered = s.considered;
    a.n_considered = s.n_considered;
    a.ball_starts = view(s.ball_starts);
    a.ball_slack = view(s.ball_slack);
    a.ball_moves = view(s.ball_moves);
    a.excess = view(s.excess);
    a.between = view(s.between);
    return a;
  }
};

/// Presents a state as a stage at x = 0 whose rates are v.
template <class N>
StageArgs<N> at_state(const GroupState& s) {
  using View = StageView<N, kGroup>;
  StageArgs<N> a{};
  a.centre = View::view(s.q);
  a.x = a.s = View::view(s.zero);
  a.r = View::view(s.v);
  a.c0_over_h = N(0.0);
  a.inverse_h = N(1.0);
  a.v = View::view(s.rates);
  a.block = s.block;
  a.group = s.group;
  return a;
}

}  // namespace tangere::kernels
