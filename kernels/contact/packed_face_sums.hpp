// SPDX-License-Identifier: Apache-2.0
// The face sums of a lone lane, packed eight to a vector: a product of two wrenches takes six
// vectors instead of 36 numbers. Numbers are added in the same order and with the same roundings as
// in FaceSums, so the bits are the same.
#pragma once

#include "kernels/contact/face_contact.hpp"
#include "kernels/contact/sphere_contact.hpp"
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

template <bool Derivatives, class A>
void clear(PackedFaceSums<A>& s) {
  Lanes<A>* all = reinterpret_cast<Lanes<A>*>(&s);
  const std::size_t count = Derivatives ? sizeof(s) / sizeof(Lanes<A>) : 1;
  for (std::size_t i = 0; i < count; ++i) all[i] = Lanes<A>(0.0);
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

template <bool Derivatives, class A, bool Bent>
void add_chunk(PackedFaceSums<A>& sums, const PointChunk<FacePoint<OneLane<A>, Bent>>& chunk) {
  using N = Lanes<A>;
  PackedFaceSums<A> s = sums;
  for (int c = 0; c < chunk.count; ++c) {
    const auto& p = chunk.point[chunk.touching[c]];
    s.wrench += eight_from<A>(p.f);
    if constexpr (Derivatives) {
      const N n = eight_from<A>(p.n), an = eight_from<A>(p.an);
      add_products(s.nn, p.an, n);
      add_products(s.pn, p.p, n);
      if constexpr (Bent) add_products(s.pn, p.r, eight_from<A>(p.a));
      add_products(s.ne, p.e, an);
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

/// Returns the same sums number by number.
template <bool Derivatives, class A>
FaceSums<OneLane<A>> unpacked(const PackedFaceSums<A>& s) {
  const auto at = [](const Lanes<A>& row, int i) {
    return OneLane<A>(reinterpret_cast<const double*>(&row)[i]);
  };
  const auto vector = [&](const Lanes<A>& row, int first) {
    return Vec3<OneLane<A>>{at(row, first), at(row, first + 1), at(row, first + 2)};
  };
  // The 3×3 block that starts at (row, column).
  const auto block = [&](const Lanes<A>* rows, int row, int column) {
    Mat3<OneLane<A>> m;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) m.m[i][j] = at(rows[row + i], column + j);
    return m;
  };
  const auto upper = [](const Mat3<OneLane<A>>& m) {
    return UpperTriangle<OneLane<A>>{
        {m.m[0][0], m.m[0][1], m.m[0][2], m.m[1][1], m.m[1][2], m.m[2][2]}};
  };
  const auto symmetric = [&](const Lanes<A>* rows) {
    return SymmetricSums<OneLane<A>>{upper(block(rows, 3, 3)), upper(block(rows, 0, 0)),
                                     block(rows, 3, 0)};
  };
  const auto product =
      [&](const Lanes<A>* rows) {  // torques come first in blocks, forces in vectors
        return ProductSums<OneLane<A>>{
            {{block(rows, 3, 3), block(rows, 3, 0)}, {block(rows, 0, 3), block(rows, 0, 0)}}};
      };
  FaceSums<OneLane<A>> out;
  out.f = vector(s.wrench, 0);
  out.xf = vector(s.wrench, 3);
  if constexpr (Derivatives) {
    out.nn = symmetric(s.nn);
    out.tt = symmetric(s.tt);
    out.pn = product(s.pn);
    out.tn = product(s.tn);
    for (int part = 0; part < 2; ++part) {
      out.ne[part] = transpose(block(s.ne, 0, 3 - 3 * part));
      out.te[part] = transpose(block(s.te, 0, 3 - 3 * part));
    }
    out.moments = {at(s.rest, 7), vector(s.linear, 0), vector(s.linear, 3),
                   upper(block(s.sxx, 0, 0))};
    out.turns = {block(s.n_turn, 0, 0), vector(s.spins, 0), vector(s.spins, 3), vector(s.rest, 4)};
  }
  return out;
}

/// Spheres do not pack their sums.
template <bool Derivatives, class A>
const SphereSums<OneLane<A>>& unpacked(const SphereSums<OneLane<A>>& s) {
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

}  // namespace tangere::kernels
