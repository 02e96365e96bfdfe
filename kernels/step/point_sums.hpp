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

/// Broadcasts numbers to all lanes. If they are vectors, lane `from` of each is taken.
template <class A, class To, class From>
To broadcast_lane(const From& numbers, int from) {
  constexpr int kStep = sizeof(From) == sizeof(To) ? kGroup : 1;
  To out;
  const double* x = reinterpret_cast<const double*>(&numbers);
  Lanes<A>* y = reinterpret_cast<Lanes<A>*>(&out);
  for (std::size_t i = 0; i < sizeof(To) / sizeof(Lanes<A>); ++i)
    y[i] = Lanes<A>(x[i * kStep + from]);
  return out;
}
/// The same for a motion.
template <class A, class Motion>
auto in_all_lanes(const Motion& motion, int from) {
  return broadcast_lane<A, typename Motion::template Of<Lanes<A>>>(motion, from);
}

/// How one lane's own candidates touch a shape whose points are summed one by one, in all lanes.
template <class A>
struct OwnCandidates {
  const PairContact& pair;
  Vec3<Lanes<A>> size, side;
  Frame<Lanes<A>> frame;
  Vec6<Lanes<A>> W;
  LawParameters<Lanes<A>> law;
};

/// Adds the own candidates of a lane. The law and its derivative are evaluated at eight of them at
/// a time, and added one by one in list order to the numbers of a PairSums, `stride` apart. This
/// gives the bits of add_candidates() for a fraction of the work.
template <bool Derivatives, class A, class List>
[[gnu::noinline]] void add_own_candidates(const OwnCandidates<A>& c, const List& list, double* sums,
                                          int stride) {
  using N = Lanes<A>;
  with_touched<N>(c.pair, c.size, c.side, [&]<class Shape>(const Shape& shape) {
    if constexpr (Shape::kSums == PointSumForm::points) {
      LawParameters<N> law = c.law;
      for (int first = 0; first < list.own_count; first += kGroup) {
        Vec3<N> xi;
        load_own_place<A>(list, first, xi);
        if (list.own_weights != nullptr)
          set_weighted(c.law, load_lanes<A>(list.own_weights + first), law);
        PairSums<N> own = PairSums<N>::zero();
        const unsigned touching =
            accumulate<Derivatives>(own, shape, law, c.frame.R, c.frame.p, c.W.a, c.W.l, xi);
        if (touching == 0) continue;
        const double* from = reinterpret_cast<const double*>(&own);
        constexpr std::size_t count = Derivatives ? sizeof(own) / sizeof(N) : 6;
        for (std::size_t i = 0; i < count; ++i) {
          double sum = sums[i * std::size_t(stride)];
          for (unsigned left = touching; left != 0; left &= left - 1)
            sum += from[i * kGroup + std::size_t(__builtin_ctz(left))];
          sums[i * std::size_t(stride)] = sum;
        }
      }
    }
  });
}

/// The same, from the numbers of a stage. Returns false where no lane is alone.
template <bool Derivatives, class N>
bool add_lone_candidates(const PairContact&, const Vec3<N>&, const Vec3<N>&, const Frame<N>&,
                         const Vec6<N>&, const LawParameters<N>&, const CandidateList<N>&, int,
                         PairSums<N>&) {
  return false;
}
template <bool Derivatives, class A, class N>
void add_lone(const PairContact& pair, const Vec3<N>& size, const Vec3<N>& side,
              const Frame<N>& frame, const Vec6<N>& W, const LawParameters<N>& law,
              const CandidateList<N>& list, int lane, PairSums<N>& sums) {
  using V = Lanes<A>;
  constexpr int kStride = sizeof(N) / sizeof(double);
  const auto all = [lane](const N& x) { return V(reinterpret_cast<const double*>(&x)[lane]); };
  const OwnCandidates<A> own = {
      pair,
      broadcast_lane<A, Vec3<V>>(size, lane),
      broadcast_lane<A, Vec3<V>>(side, lane),
      broadcast_lane<A, Frame<V>>(frame, lane),
      broadcast_lane<A, Vec6<V>>(W, lane),
      {transformed(law, all), law.law, law.ramp, all(law.friction_tangent)}};
  add_own_candidates<Derivatives>(own, list, reinterpret_cast<double*>(&sums) + lane, kStride);
}
template <bool Derivatives, class A>
bool add_lone_candidates(const PairContact& pair, const Vec3<OneLane<A>>& size,
                         const Vec3<OneLane<A>>& side, const Frame<OneLane<A>>& frame,
                         const Vec6<OneLane<A>>& W, const LawParameters<OneLane<A>>& law,
                         const CandidateList<OneLane<A>>& list, int, PairSums<OneLane<A>>& sums) {
  add_lone<Derivatives, A>(pair, size, side, frame, W, law, list, 0, sums);
  return true;
}
template <bool Derivatives, class A>
bool add_lone_candidates(const PairContact& pair, const Vec3<Lanes<A>>& size,
                         const Vec3<Lanes<A>>& side, const Frame<Lanes<A>>& frame,
                         const Vec6<Lanes<A>>& W, const LawParameters<Lanes<A>>& law,
                         const CandidateList<Lanes<A>>& list, int lone, PairSums<Lanes<A>>& sums) {
  if (lone < 0) return false;
  add_lone<Derivatives, A>(pair, size, side, frame, W, law, list, lone, sums);
  return true;
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
