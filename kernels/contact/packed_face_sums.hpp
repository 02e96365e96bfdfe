// SPDX-License-Identifier: Apache-2.0
// The face sums of a lone lane, packed eight to a vector: a product of two wrenches takes six
// vectors instead of 36 numbers. Numbers are added in the same order and with the same roundings as
// in FaceSums, so the bits are the same.
#pragma once

#include "kernels/contact/elastic_face_contact.hpp"
#include "kernels/contact/elastic_sphere_contact.hpp"
#include "kernels/numbers/one_lane.hpp"

namespace tangere::kernels {

/// In the sum of products of two wrenches, row i is component i of the left wrench (force, then
/// torque) times the right wrench, which fills lanes 0 … 5. In the sum of products of a wrench with
/// a vector, column k is component k of the vector times the wrench. Other lanes hold leftovers.
template <class A>
struct PackedFaceSums {
  using N = Lanes<A>;
  N wrench;  ///< f, x × f
  N nn[6], pn[6];
  N ne[3], sxx[3], n_turn[3];
  N linear, spins, rest;  ///< s x, m n; d s ñ; from lane 4: d s (n·ω) x, s
  N tt[6], tn[6], te[3];
};
/// With the sums of a spring.
template <class A>
struct PackedElasticFaceSums : PackedFaceSums<A> {
  using N = Lanes<A>;
  N spring;           ///< k A, k x, k
  N anchor_place[3];  ///< row i: k A_i x
  N spring_tt[6];     ///< as tt: k t̃ t̃ᵀ
};

template <bool Derivatives, class A>
void clear(PackedFaceSums<A>& s) {
  Lanes<A>* all = reinterpret_cast<Lanes<A>*>(&s);
  const std::size_t count = Derivatives ? sizeof(s) / sizeof(Lanes<A>) : 1;
  for (std::size_t i = 0; i < count; ++i) all[i] = Lanes<A>(0.0);
}

template <bool Derivatives, class A>
void clear(PackedElasticFaceSums<A>& s) {
  using N = Lanes<A>;
  clear<Derivatives>(static_cast<PackedFaceSums<A>&>(s));
  if constexpr (Derivatives) {
    s.spring = N(0.0);
    for (N& x : s.anchor_place) x = N(0.0);
    for (N& x : s.spring_tt) x = N(0.0);
  }
}

/// Loads eight numbers of a point, starting at a vector.
template <class A>
Lanes<A> eight_from(const Vec3<OneLane<A>>& first) {
  return load_lanes_anywhere<A>(&first.x.x);
}
/// sum[i] += left_i right for `Count` numbers, starting at a vector.
template <int Count, class A>
[[gnu::always_inline]] inline void add_products(Lanes<A> (&sum)[Count],
                                                const Vec3<OneLane<A>>& left,
                                                const Lanes<A>& right) {
  const double* x = &left.x.x;
  for (int i = 0; i < Count; ++i) sum[i] = mul_add(Lanes<A>(x[i]), right, sum[i]);
}

template <bool Derivatives, class A, class Point>
void add_chunk(PackedFaceSums<A>& sums, const PointChunk<Point>& chunk) {
  using N = Lanes<A>;
  PackedFaceSums<A> s = sums;
  for (int c = 0; c < chunk.count; ++c) {
    const auto& p = chunk.point[chunk.touching[c]];
    s.wrench += eight_from<A>(p.f);
    if constexpr (Derivatives) {
      const N n = eight_from<A>(p.n), an = eight_from<A>(p.an);
      add_products(s.nn, p.an, n);
      add_products(s.pn, p.p, n);
      if constexpr (Point::kBends) add_products(s.pn, p.r, eight_from<A>(p.a));
      add_products(s.ne, p.e, Point::kElastic ? n : an);
      add_products(s.sxx, p.sx, eight_from<A>(p.x));
      add_products(s.n_turn, p.n, eight_from<A>(p.turn));
      s.linear += eight_from<A>(p.sx);
      s.spins += eight_from<A>(p.dn);
      s.rest += load_lanes_anywhere<A>(&p.dn.z.x);
    }
  }
  if constexpr (Derivatives) {
    for (int c = 0; c < chunk.slips; ++c) {
      const auto& p = chunk.point[chunk.slipping[c]];
      const N t = eight_from<A>(p.t);
      add_products(s.tt, p.st, t);
      add_products(s.tn, p.gt, eight_from<A>(p.n));
      add_products(s.te, p.e_slip, t);
    }
  }
  sums = s;
}

/// Adds the points of a chunk in order.
template <bool Derivatives, class A, class Point>
void add_chunk(PackedElasticFaceSums<A>& sums, const PointChunk<Point>& chunk) {
  add_chunk<Derivatives>(static_cast<PackedFaceSums<A>&>(sums), chunk);
  if constexpr (Derivatives) {
    PackedElasticFaceSums<A> s = sums;
    for (int c = 0; c < chunk.count; ++c) {
      const auto& p = chunk.point[chunk.touching[c]];
      s.spring += eight_from<A>(p.k_anchor);
      add_products(s.anchor_place, p.k_anchor, eight_from<A>(p.x));
    }
    for (int c = 0; c < chunk.slips; ++c) {
      const auto& p = chunk.point[chunk.slipping[c]];
      add_products(s.spring_tt, p.k_t, eight_from<A>(p.t));
    }
    sums = s;
  }
}

// Numbers, vectors and blocks of packed sums. Torques come first in blocks, forces in vectors.
template <class A>
OneLane<A> packed_number(const Lanes<A>& row, int i) {
  return OneLane<A>(reinterpret_cast<const double*>(&row)[i]);
}
template <class A>
Vec3<OneLane<A>> packed_vector(const Lanes<A>& row, int first) {
  return {packed_number<A>(row, first), packed_number<A>(row, first + 1),
          packed_number<A>(row, first + 2)};
}
/// The 3×3 block that starts at (row, column).
template <class A>
Mat3<OneLane<A>> packed_block(const Lanes<A>* rows, int row, int column) {
  Mat3<OneLane<A>> m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m.m[i][j] = packed_number<A>(rows[row + i], column + j);
  return m;
}
template <class A>
UpperTriangle<OneLane<A>> packed_upper(const Lanes<A>* rows, int row, int column) {
  const Mat3<OneLane<A>> m = packed_block<A>(rows, row, column);
  return {{m.m[0][0], m.m[0][1], m.m[0][2], m.m[1][1], m.m[1][2], m.m[2][2]}};
}
template <class A>
SymmetricSums<OneLane<A>> packed_symmetric(const Lanes<A>* rows) {
  return {packed_upper<A>(rows, 3, 3), packed_upper<A>(rows, 0, 0), packed_block<A>(rows, 3, 0)};
}
template <class A>
ProductSums<OneLane<A>> packed_product(const Lanes<A>* rows) {
  return {{{packed_block<A>(rows, 3, 3), packed_block<A>(rows, 3, 0)},
           {packed_block<A>(rows, 0, 3), packed_block<A>(rows, 0, 0)}}};
}

/// Writes the same sums number by number.
template <bool Derivatives, class A>
void unpack(const PackedFaceSums<A>& s, FaceSums<OneLane<A>>& out) {
  out.f = packed_vector<A>(s.wrench, 0);
  out.xf = packed_vector<A>(s.wrench, 3);
  if constexpr (Derivatives) {
    out.nn = packed_symmetric<A>(s.nn);
    out.tt = packed_symmetric<A>(s.tt);
    out.pn = packed_product<A>(s.pn);
    out.tn = packed_product<A>(s.tn);
    for (int part = 0; part < 2; ++part) {
      out.ne[part] = transpose(packed_block<A>(s.ne, 0, 3 - 3 * part));
      out.te[part] = transpose(packed_block<A>(s.te, 0, 3 - 3 * part));
    }
    out.moments = {packed_number<A>(s.rest, 7), packed_vector<A>(s.linear, 0),
                   packed_vector<A>(s.linear, 3), packed_upper<A>(s.sxx, 0, 0)};
    out.turns = {packed_block<A>(s.n_turn, 0, 0), packed_vector<A>(s.spins, 0),
                 packed_vector<A>(s.spins, 3), packed_vector<A>(s.rest, 4)};
  }
}

/// Returns the same sums number by number.
template <bool Derivatives, class A>
FaceSums<OneLane<A>> unpacked(const PackedFaceSums<A>& s) {
  FaceSums<OneLane<A>> out;
  unpack<Derivatives>(s, out);
  return out;
}
template <bool Derivatives, class A>
ElasticFaceSums<OneLane<A>> unpacked(const PackedElasticFaceSums<A>& s) {
  ElasticFaceSums<OneLane<A>> out;
  unpack<Derivatives>(s, out);
  if constexpr (Derivatives) {
    out.spring = {packed_vector<A>(s.spring, 0), packed_vector<A>(s.spring, 3),
                  packed_number<A>(s.spring, 6), packed_block<A>(s.anchor_place, 0, 0),
                  packed_symmetric<A>(s.spring_tt)};
  }
  return out;
}
/// Spheres do not pack their sums.
template <bool Derivatives, class A>
const SphereSums<OneLane<A>>& unpacked(const SphereSums<OneLane<A>>& s) {
  return s;
}
template <bool Derivatives, class A>
const ElasticSphereSums<OneLane<A>>& unpacked(const ElasticSphereSums<OneLane<A>>& s) {
  return s;
}
/// The type in which a lone lane keeps the sums of a family of shapes.
template <template <class> class Sums, class A>
struct OwnSums {
  using Type = Sums<OneLane<A>>;
};
template <class A>
struct OwnSums<FaceSums, A> {
  using Type = PackedFaceSums<A>;
};
template <class A>
struct OwnSums<ElasticFaceSums, A> {
  using Type = PackedElasticFaceSums<A>;
};

}  // namespace tangere::kernels
