// SPDX-License-Identifier: Apache-2.0
// 3-vectors, 3×3 matrices and spatial (6-D) vectors over any number type: double, Lanes, Dual.
// Spatial vectors are (angular; linear) in body axes, the linear part at the body frame's origin
// (docs/dynamics.md §1).
#pragma once

#include "kernels/numbers/lanes.hpp"

namespace tangere::kernels {

template <class N>
struct Vec3 {
  N x, y, z;
};
template <class N>
struct Mat3 {  // row-major
  N m[3][3];
};
/// Twist (ω; v) or wrench (τ; f).
template <class N>
struct Vec6 {
  Vec3<N> a, l;
};
/// Child frame in its parent: point_parent = R point_child + p.
template <class N>
struct Frame {
  Mat3<N> R;
  Vec3<N> p;
};

template <class N>
Vec3<N> operator+(const Vec3<N>& a, const Vec3<N>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class N>
Vec3<N> operator-(const Vec3<N>& a, const Vec3<N>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class N>
Vec3<N> operator-(const Vec3<N>& a) {
  return {-a.x, -a.y, -a.z};
}
template <class N>
Vec3<N> operator*(const N& s, const Vec3<N>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class N>
Vec3<N>& operator+=(Vec3<N>& a, const Vec3<N>& b) {
  return a = a + b;
}
template <class N>
Vec3<N>& operator-=(Vec3<N>& a, const Vec3<N>& b) {
  return a = a - b;
}
/// Returns s a + b.
template <class N>
Vec3<N> mul_add(const N& s, const Vec3<N>& a, const Vec3<N>& b) {
  return {mul_add(s, a.x, b.x), mul_add(s, a.y, b.y), mul_add(s, a.z, b.z)};
}
template <class N>
N dot(const Vec3<N>& a, const Vec3<N>& b) {
  return mul_add(a.x, b.x, mul_add(a.y, b.y, a.z * b.z));
}
template <class N>
Vec3<N> cross(const Vec3<N>& a, const Vec3<N>& b) {
  return {mul_sub_from(a.z, b.y, a.y * b.z), mul_sub_from(a.x, b.z, a.z * b.x),
          mul_sub_from(a.y, b.x, a.x * b.y)};
}
template <class M, class N>
Vec3<N> select(const M& m, const Vec3<N>& a, const Vec3<N>& b) {
  return {select(m, a.x, b.x), select(m, a.y, b.y), select(m, a.z, b.z)};
}
template <class N>
Vec3<N> zero3() {
  return {N(0.0), N(0.0), N(0.0)};
}

template <class N>
Mat3<N> zero33() {
  Mat3<N> c;
  for (auto& row : c.m)
    for (N& e : row) e = N(0.0);
  return c;
}
template <class N>
Mat3<N> diagonal(const N& d) {
  Mat3<N> c = zero33<N>();
  for (int i = 0; i < 3; ++i) c.m[i][i] = d;
  return c;
}
template <class N>
Mat3<N> operator+(const Mat3<N>& a, const Mat3<N>& b) {
  Mat3<N> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c.m[i][j] = a.m[i][j] + b.m[i][j];
  return c;
}
template <class N>
Mat3<N> operator-(const Mat3<N>& a, const Mat3<N>& b) {
  Mat3<N> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c.m[i][j] = a.m[i][j] - b.m[i][j];
  return c;
}
template <class N>
Mat3<N> operator-(const Mat3<N>& a) {
  Mat3<N> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c.m[i][j] = -a.m[i][j];
  return c;
}
template <class N>
Mat3<N>& operator+=(Mat3<N>& a, const Mat3<N>& b) {
  return a = a + b;
}
template <class N>
Mat3<N> operator*(const N& s, const Mat3<N>& a) {
  Mat3<N> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c.m[i][j] = s * a.m[i][j];
  return c;
}
template <class N>
Vec3<N> operator*(const Mat3<N>& a, const Vec3<N>& b) {
  N c[3];
  for (int i = 0; i < 3; ++i)
    c[i] = mul_add(a.m[i][0], b.x, mul_add(a.m[i][1], b.y, a.m[i][2] * b.z));
  return {c[0], c[1], c[2]};
}
/// Returns aᵀ b.
template <class N>
Vec3<N> transposed_times(const Mat3<N>& a, const Vec3<N>& b) {
  N c[3];
  for (int i = 0; i < 3; ++i)
    c[i] = mul_add(a.m[0][i], b.x, mul_add(a.m[1][i], b.y, a.m[2][i] * b.z));
  return {c[0], c[1], c[2]};
}
template <class N>
Mat3<N> operator*(const Mat3<N>& a, const Mat3<N>& b) {
  Mat3<N> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      c.m[i][j] =
          mul_add(a.m[i][0], b.m[0][j], mul_add(a.m[i][1], b.m[1][j], a.m[i][2] * b.m[2][j]));
  return c;
}
template <class N>
Mat3<N> transpose(const Mat3<N>& a) {
  Mat3<N> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c.m[i][j] = a.m[j][i];
  return c;
}
template <class N>
Mat3<N> outer(const Vec3<N>& a, const Vec3<N>& b) {
  return {{{a.x * b.x, a.x * b.y, a.x * b.z},
           {a.y * b.x, a.y * b.y, a.y * b.z},
           {a.z * b.x, a.z * b.y, a.z * b.z}}};
}
/// Returns [a], the matrix of a ×.
template <class N>
Mat3<N> skew(const Vec3<N>& a) {
  return {{{N(0.0), -a.z, a.y}, {a.z, N(0.0), -a.x}, {-a.y, a.x, N(0.0)}}};
}
/// Returns [a] B, column by column, without forming [a].
template <class N>
Mat3<N> cross_columns(const Vec3<N>& a, const Mat3<N>& b) {
  Mat3<N> c;
  for (int j = 0; j < 3; ++j) {
    const Vec3<N> col = cross(a, Vec3<N>{b.m[0][j], b.m[1][j], b.m[2][j]});
    c.m[0][j] = col.x;
    c.m[1][j] = col.y;
    c.m[2][j] = col.z;
  }
  return c;
}
/// Returns B [a]. (B [a])ᵀ = -[a] Bᵀ, so each row r of B becomes r × a.
template <class N>
Mat3<N> times_skew(const Mat3<N>& b, const Vec3<N>& a) {
  Mat3<N> c;
  for (int i = 0; i < 3; ++i) {
    const Vec3<N> row = cross(Vec3<N>{b.m[i][0], b.m[i][1], b.m[i][2]}, a);
    c.m[i][0] = row.x;
    c.m[i][1] = row.y;
    c.m[i][2] = row.z;
  }
  return c;
}

template <class N>
Vec6<N> zero6() {
  return {zero3<N>(), zero3<N>()};
}
template <class N>
Vec6<N> operator+(const Vec6<N>& a, const Vec6<N>& b) {
  return {a.a + b.a, a.l + b.l};
}
template <class N>
Vec6<N> operator-(const Vec6<N>& a, const Vec6<N>& b) {
  return {a.a - b.a, a.l - b.l};
}
template <class N>
Vec6<N> operator-(const Vec6<N>& a) {
  return {-a.a, -a.l};
}
template <class N>
Vec6<N>& operator+=(Vec6<N>& a, const Vec6<N>& b) {
  return a = a + b;
}
template <class N>
Vec6<N>& operator-=(Vec6<N>& a, const Vec6<N>& b) {
  return a = a - b;
}
/// Returns s a + b.
template <class N>
Vec6<N> mul_add(const N& s, const Vec6<N>& a, const Vec6<N>& b) {
  return {mul_add(s, a.a, b.a), mul_add(s, a.l, b.l)};
}
template <class N>
Vec6<N> operator*(const N& s, const Vec6<N>& a) {
  return {s * a.a, s * a.l};
}
/// Power of a wrench on a twist, or any other pairing of the two.
template <class N>
N dot(const Vec6<N>& a, const Vec6<N>& b) {
  return dot(a.a, b.a) + dot(a.l, b.l);
}
/// V × W: motion cross motion.
template <class N>
Vec6<N> cross_motion(const Vec6<N>& v, const Vec6<N>& w) {
  return {cross(v.a, w.a), cross(v.l, w.a) + cross(v.a, w.l)};
}
/// V ×* F: motion cross wrench, the rate of a wrench that is constant in axes moving with V.
template <class N>
Vec6<N> cross_wrench(const Vec6<N>& v, const Vec6<N>& f) {
  return {cross(v.a, f.a) + cross(v.l, f.l), cross(v.a, f.l)};
}
/// Motion vector from the parent's frame to the child's: ω' = Rᵀω, v' = Rᵀ(v + ω × p).
template <class N>
Vec6<N> motion_to_child(const Frame<N>& x, const Vec6<N>& v) {
  return {transposed_times(x.R, v.a), transposed_times(x.R, v.l + cross(v.a, x.p))};
}
/// Motion vector from the child's frame to the parent's: ω' = Rω, v' = Rv + p × Rω.
template <class N>
Vec6<N> motion_to_parent(const Frame<N>& x, const Vec6<N>& v) {
  const Vec3<N> w = x.R * v.a;
  return {w, x.R * v.l + cross(x.p, w)};
}
/// Wrench from the child's frame to the parent's: f' = Rf, τ' = Rτ + p × Rf.
template <class N>
Vec6<N> wrench_to_parent(const Frame<N>& x, const Vec6<N>& f) {
  const Vec3<N> force = x.R * f.l;
  return {x.R * f.a + cross(x.p, force), force};
}
/// Wrench from the parent's frame to the child's: f' = Rᵀf, τ' = Rᵀ(τ - p × f).
template <class N>
Vec6<N> wrench_to_child(const Frame<N>& x, const Vec6<N>& f) {
  return {transposed_times(x.R, f.a - cross(x.p, f.l)), transposed_times(x.R, f.l)};
}
/// Returns frame c in a, from b in a and c in b.
template <class N>
Frame<N> compose(const Frame<N>& ab, const Frame<N>& bc) {
  return {ab.R * bc.R, ab.R * bc.p + ab.p};
}
/// Returns frame 2 in frame 1, from both in the world. Only the difference of the two origins is
/// rounded.
template <class N>
Frame<N> relative(const Frame<N>& w1, const Frame<N>& w2) {
  return {transpose(w1.R) * w2.R, transposed_times(w1.R, w2.p - w1.p)};
}

/// Constants of the scene, the same in every lane.
template <class N>
Vec3<N> broadcast(const Vec3<double>& a) {
  return {N(a.x), N(a.y), N(a.z)};
}
template <class N>
Mat3<N> broadcast(const Mat3<double>& a) {
  Mat3<N> c;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c.m[i][j] = N(a.m[i][j]);
  return c;
}
template <class N>
Frame<N> broadcast(const Frame<double>& x) {
  return {broadcast<N>(x.R), broadcast<N>(x.p)};
}

}  // namespace tangere::kernels
