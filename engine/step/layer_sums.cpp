// SPDX-License-Identifier: Apache-2.0
// Copies one lane's numbers to the contact of a layer, and its sums back to rows.
#include "engine/step/layer_sums.hpp"

#include <limits>

#include "engine/step/shear_lane.hpp"

namespace tangere {

using kernels::Row;

namespace {

/// Returns the coefficients of a pair in one lane, softened as those of other contacts.
template <int L>
Coefficients<double> softened_law(const kernels::PairContact& pair, const kernels::Stage<L>& stage,
                                  int lane) {
  Coefficients<double> law = transformed(
      pair.parameters, [&](const kernels::Parameter& p) { return number_of<L>(p, stage, lane); });
  law.kn *= stage.normal_share[lane];
  law.damping *= stage.normal_share[lane];
  law.kt *= stage.friction_share[lane];
  law.ks *= stage.friction_share[lane];
  return law;
}

template <int L>
kernels::Vec3<double> size_in_lane(const kernels::PairContact& pair, const kernels::Stage<L>& stage,
                                   int lane) {
  if (pair.size_row < 0) return pair.size;
  const auto number = [&](int i) { return number_of<L>({0, pair.size_row + i}, stage, lane); };
  return {number(0), number(1), number(2)};
}

/// Presents the candidates of a pair.
template <int L>
LayerCandidates candidates_of(const typename kernels::Stage<L>::List& list, int lane) {
  return {list.own + 3 * list.stride * lane,
          list.own_anchors == nullptr
              ? nullptr
              : list.own_anchors + kernels::kAnchorNumbers * list.stride * lane,
          list.own_index + list.stride * lane, list.stride, list.own_count[lane]};
}

}  // namespace

template <int L>
void solve_layer(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                 const kernels::LinkPair& links, int pad, int lane) {
  const Row<L>* const row = w.pair_motions + kernels::kPairMotionNumbers * links.layer;
  kernels::Frame<double> link2_in_1;
  for (int i = 0; i < 9; ++i) link2_in_1.R.m[i / 3][i % 3] = row[i][lane];
  link2_in_1.p = {row[9][lane], row[10][lane], row[11][lane]};
  const kernels::Vec6<double> twist = {{row[12][lane], row[13][lane], row[14][lane]},
                                       {row[15][lane], row[16][lane], row[17][lane]}};
  const LayerPad& of = m.layer_pads[std::size_t(pad)];
  w.layer_members.clear();
  const std::size_t slot = m.layer_pads.size() * std::size_t(links.layer) + std::size_t(pad);
  w.layer_contact->begin(table, of, L * slot + std::size_t(lane));
  for (int i = links.first; i < links.first + links.count; ++i) {
    const int k = m.pair_order[std::size_t(i)];
    const kernels::PairContact& pair = m.pairs[std::size_t(k)];
    const auto& list = w.candidates->lists[std::size_t(k)];
    if (pair.layer_pad != pad || list.own_count[lane] == 0) continue;
    w.layer_members.push_back(k);
    const Coefficients<double> law = softened_law<L>(pair, w.stage, lane);
    w.layer_contact->add_body({pair.shape, pair.grid, pair.law, pair.ramp, pair.memory >= 0,
                               w.stage.friction_tangent[lane] == 0},
                              layer_body<double>(of, pair.frame2, link2_in_1, twist, law,
                                                 size_in_lane<L>(pair, w.stage, lane)),
                              candidates_of<L>(list, lane));
  }
  w.layer_contact->solve();
}

template <int L>
LaneBits set_layer_sums(const CompiledModel& m, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes, bool derivatives) {
  LaneBits unsolved = 0;
  if (m.layer_pads.empty()) return unsolved;
  table.stage<L>().pair_motions(m.view, w.stage, w.pair_motions);
  Row<L>* const rows = w.stage.layer_sums;
  for (int i = 0; i < kernels::kPairSumNumbers * m.layer_link_pairs; ++i)
    for (int l = 0; l < L; ++l)
      if (has(lanes, l)) rows[i][l] = 0;
  for_each_layer(m, w, [&](const kernels::LinkPair& links, int pad) {
    for (int l = 0; l < L; ++l) {
      if (!has(lanes, l)) continue;
      solve_layer(m, table, w, links, pad, l);
      if (w.layer_contact->empty()) continue;
      auto sums = kernels::PairSums<double>::zero();
      w.layer_contact->add_to(sums, derivatives);
      const bool solved = w.layer_contact->solved();
      if (!solved) unsolved |= 1U << l;
      const double* const from = &sums.wrench.a.x;
      Row<L>* const to = rows + kernels::kPairSumNumbers * links.layer;
      for (int i = 0; i < kernels::kPairSumNumbers; ++i)
        to[i][l] += solved ? from[i] : std::numeric_limits<double>::quiet_NaN();
    }
  });
  return unsolved;
}

#define TANGERE_FOR_LANES(L)                                                                       \
  template void solve_layer(const CompiledModel&, const kernels::KernelTable&, BasicWorkspace<L>&, \
                            const kernels::LinkPair&, int, int);                                   \
  template LaneBits set_layer_sums(const CompiledModel&, const kernels::KernelTable&,              \
                                   BasicWorkspace<L>&, LaneBits, bool);
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES

}  // namespace tangere
