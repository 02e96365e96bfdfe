// SPDX-License-Identifier: Apache-2.0
// Contact sums over candidates, one shape after the other. Many lanes go through the list row by
// row. A lone lane evaluates the law at eight of its points at a time and adds them one by one in
// list order. This gives the same bits for a third of the work.
#pragma once

#include "kernels/contact/packed_face_sums.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

// Places of a list: rows, and vectors of one lane's own points.
template <class N>
void load_place(const CandidateList<N>& list, int k, Vec3<N>& to) {
  to = {list.points[3 * k], list.points[3 * k + 1], list.points[3 * k + 2]};
}
template <class N>
void load_place(const CandidateList<N>& list, int k, ElasticPlace<N>& to) {
  load_place(list, k, to.xi);
  to.numbers = list.anchors + kAnchorNumbers * k;
  to.stride = 1;
}
template <class A, class List>
void load_own_place(const List& list, int first, Vec3<Lanes<A>>& to) {
  const double* at = list.own + first;
  to = {load_lanes<A>(at), load_lanes<A>(at + list.stride), load_lanes<A>(at + 2 * list.stride)};
}
template <class A, class List>
void load_own_place(const List& list, int first, ElasticPlace<Lanes<A>>& to) {
  load_own_place<A>(list, first, to.xi);
  to.numbers = reinterpret_cast<const Lanes<A>*>(list.own_anchors + first);
  to.stride = list.stride / kGroup;
}

/// Adds the list row by row.
template <bool Derivatives, class Motion, class N>
void add_rows(const Motion& motion, const LawParameters<N>& law, const CandidateList<N>& list,
              typename Motion::Sums& sums) {
  using Chunk = PointChunk<typename Motion::Point>;
  Chunk chunk;
  for (int k = 0; k < list.count; k += Chunk::kPoints) {
    const int count = list.count - k < Chunk::kPoints ? list.count - k : Chunk::kPoints;
    typename Motion::Place place[Chunk::kPoints];
    for (int i = 0; i < count; ++i) load_place(list, k + i, place[i]);
    const N* const areas = list.weights == nullptr ? nullptr : list.weights + k;
    fill_chunk<Derivatives>(motion, law, place, areas, count, chunk);
    add_chunk<Derivatives>(sums, chunk);
  }
}

/// Adds the touching points of row i of a chunk of vectors, in order.
template <bool Derivatives, class Rows, class Point, class Sums>
void add_row(const Rows& rows, int i, Sums& sums, PointChunk<Point>& chunk) {
  static_assert(sizeof(Point) == Point::kNumbers * sizeof(double));
  const unsigned slip = lane_bits(rows.slip[i]);
  const double* fields = reinterpret_cast<const double*>(&rows.point[i]);
  chunk.count = chunk.slips = 0;
  for (unsigned left = lane_bits(rows.touch[i]); left != 0; left &= left - 1) {
    const int l = __builtin_ctz(left), to = chunk.count;
    const bool slips = ((slip >> l) & 1U) != 0;
    const auto copy = [&, point = reinterpret_cast<double*>(&chunk.point[to])](int begin, int end) {
      for (int f = begin; f < end; ++f) point[f] = fields[f * kGroup + l];
    };
    copy(0, Point::kValues);
    if (Derivatives) copy(Point::kValues, Point::kDerivatives);
    if (Derivatives && slips) copy(Point::kDerivatives, Point::kSlipping);
    if (Derivatives) copy(Point::kSlipping, Point::kBent);
    if constexpr (Derivatives && Point::kElastic)
      copy(Point::kSpring, slips ? Point::kNumbers : Point::kSpringSlipping);
    chunk.touching[chunk.count++] = to;
    if (slips) chunk.slipping[chunk.slips++] = to;
  }
  add_chunk<Derivatives>(sums, chunk);
}

/// Adds one lane's own candidates. Motion and law are the same in every lane of the vectors.
template <bool Derivatives, class Motion, class A, class List, class Sums>
void add_own_points(const Motion& motion, const LawParameters<Lanes<A>>& law, const List& list,
                    Sums& sums) {
  using Chunk = PointChunk<typename Motion::Point>;
  constexpr int kRows = Chunk::kPoints;
  Chunk rows;
  PointChunk<typename Motion::template Of<OneLane<A>>::Point> chunk;
  for (int first = 0; first < list.own_count; first += kRows * kGroup) {
    const int rest = (list.own_count - first + kGroup - 1) / kGroup,
              count = rest < kRows ? rest : kRows;
    typename Motion::Place place[kRows];
    for (int i = 0; i < count; ++i) load_own_place<A>(list, first + i * kGroup, place[i]);
    const auto* const areas = list.own_weights == nullptr
                                  ? nullptr
                                  : reinterpret_cast<const Lanes<A>*>(list.own_weights + first);
    fill_chunk<Derivatives>(motion, law, place, areas, count, rows);
    for (int c = 0; c < rows.count; ++c) add_row<Derivatives>(rows, rows.touching[c], sums, chunk);
  }
}

/// Broadcasts a motion to all lanes. If it is made of vectors, lane `from` of each is taken.
template <class A, class Motion>
auto in_all_lanes(const Motion& motion, int from) {
  using To = typename Motion::template Of<Lanes<A>>;
  constexpr int kStep = sizeof(Motion) == sizeof(To) ? kGroup : 1;
  To out;
  const double* x = reinterpret_cast<const double*>(&motion);
  Lanes<A>* y = reinterpret_cast<Lanes<A>*>(&out);
  for (std::size_t i = 0; i < sizeof(To) / sizeof(Lanes<A>); ++i)
    y[i] = Lanes<A>(x[i * kStep + from]);
  return out;
}

/// How the points of a pair of links are summed: row by row of their lists.
template <bool Derivatives, template <class> class Sums, class N>
struct PointSums {
  Sums<N> sums;

  void start(int) { clear<Derivatives>(sums); }
  template <class Motion>
  void add(const Motion& motion, const LawParameters<N>& law, const CandidateList<N>& list, int) {
    add_rows<Derivatives>(motion, law, list, sums);
  }
  const Sums<N>& result(int) { return sums; }
};

/// For a lone environment: across its points.
template <bool Derivatives, template <class> class Sums, class A>
struct PointSums<Derivatives, Sums, OneLane<A>> {
  typename OwnSums<Sums, A>::Type own;

  void start(int) { clear<Derivatives>(own); }
  template <class Motion>
  void add(const Motion& motion, const LawParameters<OneLane<A>>& law,
           const CandidateList<OneLane<A>>& list, int) {
    using N = Lanes<A>;
    const auto spread = [](const OneLane<A>& a) { return N(a.x); };
    const LawParameters<N> all = {transformed(law, spread), law.law, law.ramp,
                                  spread(law.friction_tangent)};
    add_own_points<Derivatives>(in_all_lanes<A>(motion, 0), all, list, own);
  }
  Sums<OneLane<A>> result(int) { return unpacked<Derivatives>(own); }
};

/// For a group: by rows, or across the points of the lane that is evaluated alone.
template <bool Derivatives, template <class> class Sums, class A>
struct PointSums<Derivatives, Sums, Lanes<A>> {
  using N = Lanes<A>;
  Sums<N> sums;
  alignas(64) typename OwnSums<Sums, A>::Type own;

  void start(int lone) {
    if (lone < 0) {
      clear<Derivatives>(sums);
    } else {
      clear<Derivatives>(own);
    }
  }
  template <class Motion>
  void add(const Motion& motion, const LawParameters<N>& law, const CandidateList<N>& list,
           int lone) {
    if (lone < 0) {
      add_rows<Derivatives>(motion, law, list, sums);
      return;
    }
    const auto spread = [lone](const N& a) { return N(reinterpret_cast<const double*>(&a)[lone]); };
    const LawParameters<N> all = {transformed(law, spread), law.law, law.ramp,
                                  spread(law.friction_tangent)};
    add_own_points<Derivatives>(in_all_lanes<A>(motion, lone), all, list, own);
  }
  const Sums<N>& result(int lone) {
    if (lone < 0) return sums;
    alignas(64) const Sums<OneLane<A>> one = unpacked<Derivatives>(own);
    const double* from = reinterpret_cast<const double*>(&one);
    N* to = reinterpret_cast<N*>(&sums);
    constexpr std::size_t count =
        Derivatives ? sizeof(one) / sizeof(double) : 6;  // force and moment come first
    for (std::size_t i = 0; i < count; ++i) to[i] = N(from[i]);
    return sums;
  }
};

}  // namespace tangere::kernels
