// SPDX-License-Identifier: Apache-2.0
// Shear state after an accepted step in all lanes of a group: eight environments at a time, row by
// row of a pair's list. An environment has the same bits as on its own (update_shear_state.hpp).
#pragma once

#include <cstdint>

#include "kernels/numbers/transpose.hpp"
#include "kernels/shear/update_shear_state.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Elastic displacements of eight rows of a list at the end of a step.
template <class A>
struct AdvancedRows {
  Lanes<A> s[3][kGroup];
  std::uint64_t touching;  ///< byte i: lanes in which row i touches
};

/// Computes the rows from `first` on.
template <class A, class Shape>
void advance_rows(const Shape& shape, const LoadedTouch<Lanes<A>>& t, const GroupStage::List& list,
                  int first, AdvancedRows<A>& out) {
  using N = Lanes<A>;
  out.touching = 0;
  for (int i = 0; i < kGroup && first + i < list.count; ++i) {
    const auto row = [&](const LaneRow* rows, int number) {
      return load_lanes<A>(rows[number].lane);
    };
    const LaneRow* const place = list.points + 3 * (first + i);
    ElasticPoint<N> p;
    find_place(shape, t, {row(place, 0), row(place, 1), row(place, 2)}, p);
    const unsigned touching = lane_bits(p.d < N(0.0));
    if (touching == 0) continue;
    LawParameters<N> own;
    if (list.weights != nullptr) {
      own = t.law;
      set_weighted(t.law, row(list.weights, first + i), own);
    }
    const LawParameters<N>& law = list.weights == nullptr ? t.law : own;
    const LaneRow* const anchors = list.anchors + kAnchorNumbers * (first + i);
    find_motion(law, t.omega, t.v, p);
    add_spring(law, t.Q, t.c, load_anchor<N>([&](int c) { return row(anchors, c); }), p);
    const Vec3<N> s = p.hold * p.s;
    out.s[0][i] = s.x, out.s[1][i] = s.y, out.s[2][i] = s.z;
    out.touching |= std::uint64_t{touching} << (kGroup * i);
  }
}

/// Transposes eight bytes of eight bits: bit l of byte i becomes bit i of byte l. Each instruction
/// set has its own.
template <class A>
std::uint64_t transposed_bits(std::uint64_t x) {
  const auto swap = [&x](int shift, std::uint64_t mask) {
    const std::uint64_t differ = (x ^ (x >> shift)) & mask;
    x ^= differ ^ (differ << shift);
  };
  swap(7, 0x00aa00aa00aa00aa);
  swap(14, 0x0000cccc0000cccc);
  swap(28, 0x00000000f0f0f0f0);
  return x;
}

/// Computes the entries of a pair's points at the end of a step.
template <class A>
void advance_list(ShearListUpdate& u) {
  using N = Lanes<A>;
  const PairContact& pair = u.of->contact;
  const GroupStage& stage = *u.stage;
  const GroupStage::List& list = stage.lists[u.of->pair];
  const auto& at = *reinterpret_cast<const LinkPose<N>*>(u.end);
  const LoadedTouch<N> t = {
      at.world.R,
      at.world.p,
      at.V.a,
      at.V.l,
      load_law<N>(pair.parameters, pair.law, pair.ramp, stage.block, stage.group),
      N(0.0),
      false};
  Vec3<N> faces = zero3<N>();
  if (pair.faced) {
    const auto* const side = reinterpret_cast<const N*>(stage.faces + 3 * u.of->pair);
    faces = {side[0], side[1], side[2]};
  }
  const Vec3<N> size = load_vector<N>(pair.size, pair.size_row, stage.block, stage.group);
  with_touched<N>(pair, size, faces, [&](const auto& shape) {
    AdvancedRows<A> rows{};
    for (int first = 0; first < list.count; first += kGroup) {
      advance_rows(shape, t, list, first, rows);
      if (rows.touching == 0) continue;
      for (auto& s : rows.s) transpose(s);
      const std::uint64_t touching = transposed_bits<A>(rows.touching);
      for (unsigned left = u.lanes; left != 0; left &= left - 1) {
        const int l = __builtin_ctz(left);
        const auto which = static_cast<unsigned>(touching >> (kGroup * l)) & 0xffU;
        if (which != 0)
          u.after[l] =
              write_entries<A>({u.of->first, list.own_index + l * list.stride + first},
                               {rows.s[0][l], rows.s[1][l], rows.s[2][l]}, which, u.after[l]);
      }
    }
  });
}

}  // namespace tangere::kernels
