// SPDX-License-Identifier: Apache-2.0
// Points of a body on a layer that is the contact: which ones it touches, their forces, and the
// slopes of the wrench w = Σ (x_s × f_s; f_s), all about the pad's origin. With the loads
//   P_s = c (δ_s - w_i),  c of LayerSlopeSums::stiffness,
// of the points s of cell i, b_s = c a_s + the slope of friction's own load, and
// a_s = (x × l; l), l = slant, plus T'/N where friction has the load P,
//   δw = Σ b_s δδ_s + Σ P δslant + F δ(T'/N) + … - Σ_i A_i δw_i,   A_i = Σ c a_s
// The last sum is that of kernels/layer/layer_system.hpp.
#pragma once

#include "kernels/layer/layer_slopes.hpp"
#include "kernels/numbers/transpose.hpp"

namespace tangere::kernels {

template <class N>
LayerBody<N> loaded(const LayerBody<double>& b) {
  const Touch<double>& t = b.touch;
  return {{broadcast<N>(t.Q), broadcast<N>(t.c), broadcast<N>(t.omega), broadcast<N>(t.v),
           transformed(t.law, [](double x) { return N(x); })},
          broadcast<N>(b.size)};
}

/// Calls f with the shape of a body. Meshes are no contacts of layers.
template <class N, class F>
void with_convex(const LayerShape& of, const Vec3<N>& size, const F& f) {
  with_distance<N>(
      of.shape, size,
      [&]<class Shape>(const Shape& shape) {
        if constexpr (Shape::kShape != PrimitiveShape::mesh) f(shape);
      },
      of.grid);
}

inline constexpr int kPointRows = sizeof(LayerEight) / sizeof(LaneRow);

/// Copies point l of eight to point k of others.
template <class A>
void copy_point(const double* from, int l, LayerEight& to, int k) {
  auto* const out = reinterpret_cast<double*>(&to);
  for (int i = 0; i < kPointRows; ++i) out[kGroup * i + k] = from[kGroup * i + l];
}

/// Finds the points that a body touches. Returns their number. The last eight are filled up.
template <class A>
int find_layer_points(const LayerSearch& s) {
  using N = Lanes<A>;
  const LayerBody<N> body = loaded<N>(*s.body);
  const Frame<N> pad = broadcast<N>(s.pad);
  int found = 0;
  with_convex<N>(*s.shape, body.size, [&](const auto& shape) {
    const Vec3<N> down = down_in_shape(body.touch, s.law.outward);
    const auto three = [&](const double* rows, int k) {
      return Vec3<N>{load_lanes_anywhere<A>(rows + k), load_lanes_anywhere<A>(rows + s.stride + k),
                     load_lanes_anywhere<A>(rows + 2 * s.stride + k)};
    };
    LayerPoint<N> p;
    static_assert(sizeof p == sizeof(LayerEight));
    const auto* const rows_of_p = reinterpret_cast<const double*>(&p);
    for (int k = 0; k < s.count; k += kGroup) {
      p.xi = transposed_times(pad.R, three(s.places, k) - pad.p);
      p.xi.z = N(0.0);  // but for rounding
      const ContactDepth<N> at = contact_depth(shape, body.touch, p.xi, s.law, down);
      unsigned touching = lane_bits((at.touches > N(0.0)) & (at.at.depth > N(-s.law.bulge)) &
                                    (at.at.depth < N(1e300)));
      if (s.count - k < kGroup) touching &= (1U << (s.count - k)) - 1;
      if (touching == 0) continue;
      p.known = at.known, p.by = at.by, p.at = at.at;
      p.anchor = {zero3<N>(), zero3<N>(), N(0.0)};
      if (s.anchors != nullptr) {
        const double* const from = s.anchors;
        p.anchor = {transposed_times(pad.R, three(from, k) - pad.p), three(from + 3 * s.stride, k),
                    load_lanes_anywhere<A>(from + 6 * s.stride + k)};
      }
      p.load = p.friction_load = p.normal = N(0.0);
      p.friction = zero3<N>();
      for (; touching != 0; touching &= touching - 1, ++found) {
        const int l = __builtin_ctz(touching);
        copy_point<A>(rows_of_p, l, s.points[found / kGroup], found % kGroup);
        s.candidate[found] = k + l;
      }
    }
  });
  for (int k = found; k % kGroup != 0; ++k) {
    LayerEight& last = s.points[k / kGroup];
    copy_point<A>(reinterpret_cast<const double*>(&last), 0, last, k % kGroup);
    s.candidate[k] = -1;
  }
  return found;
}

/// Adds the numbers of eight lanes, in order.
template <class A>
double sum_of_lanes(const Lanes<A>& x) {
  alignas(64) double lanes[kGroup];
  store_lanes(x, lanes);
  double sum = 0;
  for (const double a : lanes) sum += a;
  return sum;
}

/// Sets the friction of points with loads, and adds w, (6).
template <class A>
void add_layer_forces(const LayerPoints& of, double* w) {
  using N = Lanes<A>;
  const LayerBody<N> body = loaded<N>(*of.body);
  Vec6<N> sum = zero6<N>();
  with_convex<N>(*of.shape, body.size, [&](const auto& shape) {
    for (int i = 0; i < of.eights; ++i) {
      auto& p = reinterpret_cast<LayerPoint<N>&>(of.points[i]);
      if (!any(p.load > N(0.0))) continue;
      if (of.body->touch.law.mu > 0) {
        const LayerFriction<N> friction =
            layer_friction(shape, *of.shape, body.touch, p.xi, p.by, p.anchor, p.at.slant);
        const auto loaded_lanes = p.load > N(0.0);
        p.friction = select(loaded_lanes, friction.ratio, zero3<N>());
        p.normal = select(loaded_lanes, friction.normal, N(0.0));
      }
      const Vec3<N> f = mul_add(p.load, p.at.slant, p.friction_load * p.friction);
      sum += {cross(p.at.place, f), f};
    }
  });
  const N* const x = &sum.a.x;
  for (int i = 0; i < 6; ++i) w[i] += sum_of_lanes(x[i]);
}

/// Sums of the slopes of one body's points.
template <class N>
struct WrenchSlopes {
  N rows[6][kLayerDirections];

  /// Adds w dᵀ.
  void add_outer(const Vec6<N>& w, const N (&d)[kLayerDirections]) {
    const N* const x = &w.a.x;
    for (int r = 0; r < 6; ++r)
      for (int k = 0; k < kLayerDirections; ++k) rows[r][k] = mul_add(x[r], d[k], rows[r][k]);
  }
  /// Adds the wrench of a force at x that changes by M, along three directions from `first` on.
  void add_force(const Mat3<N>& m, const Vec3<N>& x, int first) {
    add_moment(cross_columns(x, m), first);
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 3; ++k) rows[3 + r][first + k] += m.m[r][k];
  }
  void add_moment(const Mat3<N>& m, int first) {
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 3; ++k) rows[r][first + k] += m.m[r][k];
  }
};

/// Adds the numbers of eight points to their cells.
template <class A>
void add_to_cells(const Vec6<Lanes<A>>& wrench, const Lanes<A> (&depth)[kLayerDirections],
                  const int* cell, double* cells) {
  using N = Lanes<A>;
  N block[3][kGroup];
  for (auto& rows : block)
    for (N& row : rows) row = N(0.0);
  for (int i = 0; i < 6; ++i) block[0][i] = (&wrench.a.x)[i];
  for (int i = 0; i < kLayerDirections; ++i) block[1 + i / kGroup][i % kGroup] = depth[i];
  for (auto& rows : block) transpose(rows);
  for (int l = 0; l < kGroup; ++l) {
    if (cell[l] < 0) continue;
    double* const to = cells + kCellNumbers * cell[l];
    for (int b = 0; b < 3; ++b)
      store_lanes(load_lanes<A>(to + kGroup * b) + block[b][l], to + kGroup * b);
  }
}

/// Adds the slopes of the wrench of a body's points, and their sums over cells.
template <class A>
void add_layer_slopes(const LayerSlopeSums& s) {
  using N = Lanes<A>;
  const N zero(0.0), one(1.0), c(s.stiffness);
  const LayerBody<N> body = loaded<N>(*s.of.body);
  WrenchSlopes<N> sum;
  for (auto& row : sum.rows)
    for (N& x : row) x = zero;
  with_convex<N>(*s.of.shape, body.size, [&](const auto& shape) {
    for (int i = 0; i < s.of.eights; ++i) {
      const auto& p = reinterpret_cast<const LayerPoint<N>&>(s.of.points[i]);
      const auto pressing = p.load > zero;
      if (!any(pressing)) continue;
      LayerSlopes<N> by;
      depth_slopes(shape, body.touch, s.of.law, p, by);
      const auto frictional = p.normal > zero;
      const Vec3<N>& x = p.at.place;
      Slopes<N> turned = p.load * by.slant;
      if (any(frictional)) {
        friction_slopes(shape, *s.of.shape, body.touch, p, by);
        const N F = select(frictional, p.friction_load, zero);
        turned = turned + F * by.friction;
        sum.add_force(F * by.friction_by_twist.turn, x, 6);
        sum.add_force(F * by.friction_by_twist.shift, x, 9);
      }
      sum.add_force(turned.turn, x, 0);
      sum.add_force(turned.shift, x, 3);
      const Vec3<N> f = mul_add(p.load, p.at.slant, p.friction_load * p.friction);
      sum.add_moment(-cross_columns(f, by.place.turn), 0);
      sum.add_moment(-cross_columns(f, by.place.shift), 3);
      // Loads and friction change, while slants stay.
      const auto whole = p.friction_load >= p.load;  // friction has the load P
      const N gate = select(pressing, c, zero);
      const Vec3<N> loaded_force = gate * (p.at.slant + select(whole, one, zero) * p.friction),
                    own = (gate * select(whole, zero, select(p.friction_load > zero, one, zero))) *
                          p.friction;
      const Vec6<N> a = {cross(x, loaded_force), loaded_force}, b = {cross(x, own), own};
      const N* const depth = &by.depth.a.x;
      const N* const twist = &by.depth_by_twist.a.x;
      N d[kLayerDirections];
      for (int k = 0; k < 6; ++k)
        d[k] = select(pressing, depth[k], zero), d[6 + k] = select(pressing, twist[k], zero);
      sum.add_outer(a + b, d);
      add_to_cells<A>(a, d, s.cell + kGroup * i, s.cells);
    }
  });
  for (int r = 0; r < 6; ++r)
    for (int k = 0; k < kLayerDirections; ++k)
      s.rows[kLayerDirections * r + k] += sum_of_lanes(sum.rows[r][k]);
}

}  // namespace tangere::kernels
