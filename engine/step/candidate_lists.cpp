// SPDX-License-Identifier: Apache-2.0
// Each list has one allocation, as large as its candidates need.
#include "engine/step/candidate_lists.hpp"

#include <algorithm>
#include <utility>

#include "kernels/contact/elastic_contact.hpp"

namespace tangere {

using kernels::kAnchorNumbers;
using kernels::kGroup;
using kernels::Row;

namespace {

/// Whether lists of a pair have the numbers of their points.
bool has_index(const kernels::PairContact& pair) { return pair.memory >= 0 || pair.layer_pad >= 0; }

/// Hands out the parts of a list of `list.stride` points from `base`; null: counts alone. Returns
/// how many doubles they are. A lane alone needs no rows.
template <int L, class List>
std::size_t lay_out(const kernels::PairContact& pair, double* base, List& list) {
  std::size_t used = 0;
  const auto part = [&]<class T>(T*& to, bool requested, int numbers) {
    to = base == nullptr || !requested ? nullptr : reinterpret_cast<T*>(base + used);
    if (requested) used += std::size_t(L * numbers) * std::size_t(list.stride);
  };
  const bool elastic = pair.memory >= 0, weighted = pair.weights != nullptr;
  part(list.own, true, 3);
  part(list.own_weights, weighted, 1);
  part(list.own_anchors, elastic, kAnchorNumbers);
  part(list.points, L > 1, 3);
  part(list.weights, L > 1 && weighted, 1);
  part(list.anchors, L > 1 && elastic, kAnchorNumbers);
  return used;
}

/// Copies what the lanes list from one list to a longer one.
template <int L, class List>
void copy_own(const List& from, List& to) {
  for (int l = 0; l < L; ++l) {
    const int count = (from.own_count[l] + kGroup - 1) / kGroup * kGroup;
    const auto copy = [&](const auto* a, auto* b, int rows) {
      if (b == nullptr) return;
      for (int i = 0; i < rows; ++i)
        std::copy_n(a + (l * rows + i) * from.stride, count, b + (l * rows + i) * to.stride);
    };
    copy(from.own, to.own, 3);
    copy(from.own_weights, to.own_weights, 1);
    copy(from.own_anchors, to.own_anchors, kAnchorNumbers);
    copy(from.own_index, to.own_index, 1);
  }
}

}  // namespace

template <int L>
CandidateLists<L>::CandidateLists(const CompiledModel& m)
    : lists(m.pairs.size()),
      references(12 * m.link_pairs.size()),
      apart(m.link_pairs.size(), 1),
      apart_before(apart),
      in_rows(m.pairs.size(), 0),
      anchored(in_rows),
      anchors_in_rows(in_rows),
      storage_(m.pairs.size()) {
  if (m.view.faced) faces.resize(3 * m.pairs.size());
  if (std::ranges::any_of(m.pairs, [](const auto& pair) { return pair.size_row >= 0; }))
    sizes.resize(3 * m.pairs.size());
  for (std::size_t g = 0; g < m.link_pairs.size(); ++g) {
    const kernels::LinkPair& links = m.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i) {
      List& list = lists[std::size_t(m.pair_order[std::size_t(i)])];
      list.margin = links.margin;
      list.reference = references.data() + 12 * g;
    }
  }
}

template <int L>
void CandidateLists<L>::reserve(const CompiledModel& m, std::size_t pair, int points) {
  const List old = lists[pair];
  const int needed = stride_of(points);
  if (needed <= old.stride) return;
  List& list = lists[pair];
  Storage storage;
  // A quarter more, because a list that has grown may grow again.
  list.stride = std::min(needed * 5 / 4 / kGroup * kGroup, search_stride(m.pairs[pair]));
  storage.numbers.resize(lay_out<L>(m.pairs[pair], nullptr, list));
  lay_out<L>(m.pairs[pair], storage.numbers.data(), list);
  if (has_index(m.pairs[pair])) {
    storage.index.resize(std::size_t(L * list.stride));
    list.own_index = storage.index.data();
  }
  copy_own<L>(old, list);
  std::swap(storage_[pair], storage);
  list.count = 0;
  in_rows[pair] = anchors_in_rows[pair] = all_in_rows = 0;
}

template <int L>
void CandidateLists<L>::clear(LaneBits lanes) {
  if ((searched & lanes) == 0) return;
  searched &= ~lanes;
  all_in_rows &= ~lanes;
  for (std::size_t k = 0; k < lists.size(); ++k) {
    in_rows[k] &= ~lanes;
    for (int l = 0; l < L; ++l)
      if (has(lanes, l)) lists[k].own_count[l] = 0;
  }
}

template <int L>
void CandidateLists<L>::drop_anchors() {
  all_anchored = 0;
  std::ranges::fill(anchored, kNoLane);
}

template <int L>
std::size_t CandidateLists<L>::bytes(const CompiledModel& m, int most) {
  const CandidateLists empty(m);
  std::size_t bytes =
      sizeof(CandidateLists) + empty.lists.size() * (sizeof(List) + sizeof(Storage)) +
      (empty.references.size() + empty.faces.size() + empty.sizes.size()) * sizeof(Row<L>);
  for (const kernels::LinkPair& links : m.link_pairs) {
    int left = most;
    for (int i = links.first; i < links.first + links.count && left > 0; ++i) {
      const kernels::PairContact& pair = m.pairs[std::size_t(m.pair_order[std::size_t(i)])];
      List list{};
      list.stride = stride_of(std::min(pair.n_points, left));
      left -= pair.n_points;
      bytes += lay_out<L>(pair, nullptr, list) * sizeof(double);
      if (has_index(pair)) bytes += std::size_t(L * list.stride) * sizeof(int);
    }
  }
  return bytes;
}

template class CandidateLists<kGroup>;
template class CandidateLists<1>;

}  // namespace tangere
