// SPDX-License-Identifier: Apache-2.0
// Forces are summed in pad axes at the pad's origin.
#include "engine/layer/layer_contact.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {

using kernels::Anchor;
using kernels::Mat3;
using kernels::Vec3;
using kernels::Vec6;
using D = kernels::Dual<double>;

namespace {

Vec3<D> dual(const Vec3<double>& x, const Vec3<double>& dot = {0, 0, 0}) {
  return {{x.x, dot.x}, {x.y, dot.y}, {x.z, dot.z}};
}
Vec3<double> change_of(const Vec3<D>& x) { return {x.x.epsilon, x.y.epsilon, x.z.epsilon}; }
Anchor<D> dual(const Anchor<double>& a) { return {dual(a.b), dual(a.a), a.gap}; }

/// A body that moves by displacement and change of twist, pad axes at the pad's origin.
LayerBody<D> moved(const LayerBody<double>& body, const Vec6<double>& displacement,
                   const Vec6<double>& twist) {
  const kernels::Touch<double>& t = body.touch;
  LayerBody<D> out;
  const Mat3<double> turned = kernels::skew(displacement.a) * t.Q;
  for (int i = 0; i < 9; ++i)
    out.touch.Q.m[i / 3][i % 3] = {t.Q.m[i / 3][i % 3], turned.m[i / 3][i % 3]};
  out.touch.c = dual(t.c, displacement.l + cross(displacement.a, t.c));
  out.touch.omega = dual(t.omega, twist.a);
  out.touch.v = dual(t.v, twist.l);
  out.touch.law = transformed(t.law, [](double x) { return D(x); });
  out.size = dual(body.size);
  return out;
}

/// Adds column `k` of a 6 × 6 matrix in blocks.
void add_column(Mat3<double> (&to)[2][2], int k, const Vec6<double>& x) {
  const double rows[6] = {x.a.x, x.a.y, x.a.z, x.l.x, x.l.y, x.l.z};
  for (int i = 0; i < 6; ++i) to[i / 3][k / 3].m[i % 3][k % 3] += rows[i];
}

}  // namespace

void LayerContact::begin(const LayerPad& pad) {
  pad_ = &pad;
  for (const Point& p : points_) slot_[static_cast<std::size_t>(p.index)] = -1;
  slot_.resize(pad.in_field.size(), -1);
  shapes_.clear(), bodies_.clear(), points_.clear();
}

void LayerContact::add_body(const LayerShape& shape, const LayerBody<double>& body) {
  shapes_.push_back(shape);
  bodies_.push_back(body);
}

template <class N>
LayerForce<N> LayerContact::force(const Point& p, const LayerBody<N>& body,
                                  const Anchor<N>& anchor) const {
  const LayerShape& of = shapes_[static_cast<std::size_t>(p.body)];
  LayerForce<N> out;
  kernels::with_distance<N>(
      of.shape, body.size,
      [&](const auto& shape) {
        out = layer_force(shape, of, body.touch, p.xi, *pad_->layer, p.known, anchor);
      },
      of.grid);
  return out;
}

void LayerContact::add_point(int candidate, int index, const Vec3<double>& place,
                             const Anchor<double>& anchor) {
  const LayerShape& of = shapes_.back();
  const LayerBody<double>& body = bodies_.back();
  const kernels::Frame<double>& frame = pad_->frame;
  Vec3<double> xi = transposed_times(frame.R, place - frame.p);
  xi.z = 0;  // but for rounding
  std::optional<KnownDepth> known;
  kernels::with_distance<double>(
      of.shape, body.size,
      [&](const auto& shape) { known = find_depth(shape, body.touch, xi, *pad_->layer); }, of.grid);
  if (!known) return;
  Point p{index, static_cast<int>(shapes_.size()) - 1, candidate, xi, *known, in_pad(anchor), {}};
  p.force = force(p, body, p.anchor);
  if (!(p.force.at.depth > -pad_->layer->bulge()) || !std::isfinite(p.force.at.depth)) return;
  int& slot = slot_[static_cast<std::size_t>(index)];
  if (slot < 0) {
    slot = static_cast<int>(points_.size());
    points_.push_back(p);
  } else if (Point& other = points_[static_cast<std::size_t>(slot)];
             p.force.at.depth > other.force.at.depth) {
    other = p;
  }
}

void LayerContact::solve() {
  depth_.assign(slot_.size(), least_depth(*pad_->layer));
  for (const Point& p : points_) depth_[static_cast<std::size_t>(p.index)] = p.force.at.depth;
  layer_.solve(*pad_->layer, depth_, pad_->layer->modulus / pad_->layer->stiffness);
}

double LayerContact::load(const Point& p) const {
  return bodies_[static_cast<std::size_t>(p.body)].touch.law.kn * pad_->layer->area *
         layer_.pressure()[static_cast<std::size_t>(p.index)];
}

/// min(P, a k depth), where k is that of a point on the layer.
double LayerContact::friction_load(const Point& p) const {
  return std::min(load(p), point_stiffness(p) * std::max(0.0, p.force.at.depth));
}

/// a k [N/m].
double LayerContact::point_stiffness(const Point& p) const {
  const CompiledLayer& layer = *pad_->layer;
  return bodies_[static_cast<std::size_t>(p.body)].touch.law.kn * layer.area * layer.modulus /
         (layer.stiffness * layer.compliance.own);
}

Vec6<double> LayerContact::wrench() const {
  Vec6<double> sum = kernels::zero6<double>();
  for (const Point& p : points_) {
    const Vec3<double> f = load(p) * p.force.at.slant + friction_load(p) * p.force.friction;
    sum += {cross(p.force.at.place, f), f};
  }
  return wrench_to_parent(pad_->frame, sum);
}

double LayerContact::energy() const {
  double sum = 0;
  for (const Point& p : points_) sum += 0.5 * load(p) * p.known.depth;
  return sum;
}

Vec6<double> LayerContact::change_in_pad(std::span<const LayerBody<D>> bodies,
                                         std::span<const Anchor<D>> anchors) {
  depth_dot_.resize(depth_.size());
  load_dot_.resize(depth_.size());
  changes_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    depth_dot_[static_cast<std::size_t>(p.index)] = 0;
    if (!(load(p) > 0)) continue;
    changes_[i] = force(p, bodies[static_cast<std::size_t>(p.body)],
                        anchors.empty() ? dual(p.anchor) : anchors[i]);
    depth_dot_[static_cast<std::size_t>(p.index)] = changes_[i].at.depth.epsilon;
  }
  layer_.push_forward(depth_dot_, load_dot_);
  Vec6<double> sum = kernels::zero6<double>();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    if (!(load(p) > 0)) continue;
    const D& kn = bodies[static_cast<std::size_t>(p.body)].touch.law.kn;
    const auto at = static_cast<std::size_t>(p.index);
    const double relative = kn.epsilon / kn.value, P = load(p), F = friction_load(p),
                 P_dot = kn.value * pad_->layer->area * load_dot_[at] + relative * P,
                 slope = F > 0 ? point_stiffness(p) : 0,
                 F_dot = F < P ? slope * depth_dot_[at] + relative * F : P_dot;
    const LayerForce<double>& force = p.force;
    const LayerForce<D>& change = changes_[i];
    const Vec3<double> f = P * force.at.slant + F * force.friction,
                       f_dot = P_dot * force.at.slant + P * change_of(change.at.slant) +
                               F_dot * force.friction + F * change_of(change.friction);
    sum += {cross(change_of(change.at.place), f) + cross(force.at.place, f_dot), f_dot};
  }
  return sum;
}

Vec6<double> LayerContact::change(std::span<const LayerBody<D>> bodies,
                                  std::span<const Anchor<D>> anchors) {
  return wrench_to_parent(pad_->frame, change_in_pad(bodies, anchors));
}

void LayerContact::add_to(kernels::PairSums<double>& sums, bool derivatives) {
  sums.wrench += wrench();
  if (!derivatives || points_.empty()) return;
  const Vec6<double> none = kernels::zero6<double>();
  for (int k = 0; k < 12; ++k) {
    Vec6<double> unit = none;
    (k % 6 < 3 ? &unit.a.x : &unit.l.x)[k % 3] = 1;
    // ε and δW of the link in pad axes.
    const Vec6<double> in_pad = motion_to_child(pad_->frame, unit);
    moved_.clear();
    for (const LayerBody<double>& body : bodies_)
      moved_.push_back(k < 6 ? moved(body, in_pad, none) : moved(body, none, in_pad));
    add_column(k < 6 ? sums.k : sums.d, k % 6, change(moved_));
  }
}

Vec3<double> LayerContact::friction_bar(const Point& p, const Vec6<double>& wrench_bar) const {
  if (!(p.force.normal > 0)) return {0, 0, 0};
  const Vec6<double> bar = motion_to_child(pad_->frame, wrench_bar);
  const Vec3<double>&slant = p.force.at.slant, f = bar.l + cross(bar.a, p.force.at.place);
  return (friction_load(p) / p.force.normal) *
         (pad_->frame.R * (f - (dot(slant, f) / dot(slant, slant)) * slant));
}

std::vector<LayerBody<D>> LayerContact::still_bodies() const {
  const Vec6<double> none = kernels::zero6<double>();
  std::vector<LayerBody<D>> out;
  for (const LayerBody<double>& body : bodies_) out.push_back(moved(body, none, none));
  return out;
}

}  // namespace tangere
