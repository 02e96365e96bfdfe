// SPDX-License-Identifier: Apache-2.0
// The general form of a shape under a pad: its plain distance at every point, in double. Where
// points are floats, a tile's centre in the shape's axes is split into a float and the remainder
// that the float leaves out. d then keeps the accuracy that brackets give the other shapes.
#pragma once

#include "kernels/contact/shapes/shape.hpp"
#include "kernels/numbers/lanes_f32.hpp"

namespace tangere::kernels {

/// Converts one half of sixteen floats to double, and back.
template <class A>
Lanes<A> widen(const LanesF<A>& x, int half) {
  alignas(64) float narrow[kLanesF];
  alignas(64) double wide[kGroup];
  store_lanes(x, narrow);
  for (int l = 0; l < kGroup; ++l) wide[l] = narrow[kGroup * half + l];
  return load_lanes<A>(wide);
}

/// Returns the distance at high + low + offset.
template <template <class> class Shape, class A>
Distance<Lanes<A>> wide_distance(const double* size, const Vec3<Lanes<A>>& high,
                                 const Vec3<Lanes<A>>&, const Vec3<Lanes<A>>& offset) {
  using N = Lanes<A>;
  return Shape<N>::of({N(size[0]), N(size[1]), N(size[2])}).evaluate(high + offset);
}
template <template <class> class Shape, class A>
Distance<LanesF<A>> wide_distance(const double* size, const Vec3<LanesF<A>>& high,
                                  const Vec3<LanesF<A>>& low, const Vec3<LanesF<A>>& offset) {
  const auto half_distance = [&](int half) {
    const auto wide = [half](const Vec3<LanesF<A>>& x) {
      return Vec3<Lanes<A>>{widen(x.x, half), widen(x.y, half), widen(x.z, half)};
    };
    return wide_distance<Shape>(size, wide(high) + wide(low), Vec3<Lanes<A>>{}, wide(offset));
  };
  const Distance<Lanes<A>> first = half_distance(0), second = half_distance(1);
  return {narrow(first.d, second.d),
          {narrow(first.n.x, second.n.x), narrow(first.n.y, second.n.y),
           narrow(first.n.z, second.n.z)}};
}
/// Two vectors side by side (kernels/tactile/vector_pair.hpp).
template <template <class> class Shape, template <class> class Pair, class M>
Distance<Pair<M>> wide_distance(const double* size, const Vec3<Pair<M>>& high,
                                const Vec3<Pair<M>>& low, const Vec3<Pair<M>>& offset) {
  const auto part = [&](M Pair<M>::*of) {
    const auto pick = [of](const Vec3<Pair<M>>& x) { return Vec3<M>{x.x.*of, x.y.*of, x.z.*of}; };
    return wide_distance<Shape>(size, pick(high), pick(low), pick(offset));
  };
  const Distance<M> a = part(&Pair<M>::a), b = part(&Pair<M>::b);
  return {{a.d, b.d}, {{a.n.x, b.n.x}, {a.n.y, b.n.y}, {a.n.z, b.n.z}}};
}

template <class P, template <class> class Form>
struct GeneralPad {
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr bool kTurns = true;
  static constexpr int kRows = 9;  // y as floats, their remainders, u

  Mat3<N> Q;
  double size[3];
  Vec3<N> high, low;
  Vec3<N> u;

  GeneralPad(const TouchShape& s, const Mat3<N>& pose)
      : Q(pose), size{s.size[0], s.size[1], s.size[2]} {}

  template <class D>
  static D bracket(const TouchShape& s, const Touch<D>& at, const Vec3<D>& t, const D& reach,
                   D* row) {
    const Vec3<D> y = transposed_times(at.Q, t - at.c);
    const D* wide = &y.x;
    for (int k = 0; k < 3; ++k) {
      const D up = D(0x1p29 + 1) * wide[k];  // Veltkamp: the leading 24 bits
      row[k] = P::kSingle ? up - (up - wide[k]) : wide[k];
      row[3 + k] = wide[k] - row[k];
    }
    return Form<D>::of({D(s.size[0]), D(s.size[1]), D(s.size[2])}).evaluate(y).d - reach;
  }

  void set(const N* row) {
    high = {row[0], row[1], row[2]};
    low = {row[3], row[4], row[5]};
  }

  auto distance(const Offset& s, N& d, Vec3<N>& n) const {
    const Vec3<N> e = {along(Q.m[0][0], Q.m[1][0], Q.m[2][0], s),
                       along(Q.m[0][1], Q.m[1][1], Q.m[2][1], s),
                       along(Q.m[0][2], Q.m[1][2], Q.m[2][2], s)};
    const Distance<N> at = wide_distance<Form>(size, high, low, e);
    d = at.d;
    n = Q * at.n;
    return d < N(0.0);
  }
};

}  // namespace tangere::kernels
