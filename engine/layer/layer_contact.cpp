// SPDX-License-Identifier: Apache-2.0
// Forces are summed in pad axes at the pad's origin. What runs for every point is inlined whole
// (flatten): compilers leave the small operations of vectors apart in units of this size, which
// takes a third of the time.
#include "engine/layer/layer_contact.hpp"

#include <algorithm>
#include <array>
#include <cmath>

// Sanitizers instrument every operation: inlined whole, these functions compile for a quarter of an
// hour.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TANGERE_INLINE_WHOLE
#else
#define TANGERE_INLINE_WHOLE [[gnu::flatten]]
#endif

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

Vec6<double> unit_motion(int k) {
  const auto one = [k](int i) { return i == k ? 1.0 : 0.0; };
  return {{one(0), one(1), one(2)}, {one(3), one(4), one(5)}};
}
double component(const Vec6<double>& x, int k) {
  const double all[] = {x.a.x, x.a.y, x.a.z, x.l.x, x.l.y, x.l.z};
  return all[k];
}

/// Adds factor · w dᵀ.
void add_outer(const Vec6<double>& w, double factor, const GelLayer::Directions& d,
               std::array<GelLayer::Directions, 6>& rows) {
  const double scaled[] = {factor * w.a.x, factor * w.a.y, factor * w.a.z,
                           factor * w.l.x, factor * w.l.y, factor * w.l.z};
  for (std::size_t r = 0; r < rows.size(); ++r)
    for (std::size_t k = 0; k < d.size(); ++k) rows[r][k] += scaled[r] * d[k];
}

/// Adds the wrench of a force at x that changes by M, along three directions from `first` on.
void add_force(const Mat3<double>& m, const Vec3<double>& x, std::size_t first,
               std::array<GelLayer::Directions, 6>& rows) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3<double> f = {m.m[0][k], m.m[1][k], m.m[2][k]}, moment = cross(x, f);
    rows[0][first + k] += moment.x, rows[1][first + k] += moment.y, rows[2][first + k] += moment.z;
    rows[3][first + k] += f.x, rows[4][first + k] += f.y, rows[5][first + k] += f.z;
  }
}

void set_column(Slopes& to, int k, const Vec3<double>& x) {
  Mat3<double>& of = k < 3 ? to.turn : to.shift;
  of.m[0][k % 3] = x.x, of.m[1][k % 3] = x.y, of.m[2][k % 3] = x.z;
}

}  // namespace

void LayerContact::begin(const LayerPad& pad, std::size_t slot) {
  pad_ = &pad;
  at_ = slot;
  if (layers_.size() <= slot) layers_.resize(slot + 1);
  for (const Point& p : points_) slot_[static_cast<std::size_t>(p.index)] = -1;
  slot_.resize(pad.in_field.size(), -1);
  shapes_.clear(), bodies_.clear(), points_.clear();
}

void LayerContact::add_body(const LayerShape& shape, const LayerBody<double>& body) {
  shapes_.push_back(shape);
  bodies_.push_back(body);
  down_ = down_in_shape(body.touch, pad_->layer->outward);
}

/// Calls f with the shape of a body at its size.
template <class N, class F>
void LayerContact::with_shape(int body, const Vec3<N>& size, const F& f) const {
  const LayerShape& of = shapes_[static_cast<std::size_t>(body)];
  kernels::with_distance<N>(of.shape, size, f, of.grid);
}

LayerForce<D> LayerContact::force(const Point& p, const LayerBody<D>& body,
                                  const Anchor<D>& anchor) const {
  LayerForce<D> out{};
  with_shape<D>(p.body, body.size, [&](const auto& shape) {
    out.at = layer_depth(shape, body.touch, p.xi, *pad_->layer, p.known);
    add_friction(shape, shapes_[static_cast<std::size_t>(p.body)], body.touch, p.xi, p.known,
                 anchor, out);
  });
  return out;
}

TANGERE_INLINE_WHOLE void LayerContact::add_point(int candidate, int index,
                                                  const Vec3<double>& place,
                                                  const Anchor<double>& anchor) {
  const LayerBody<double>& body = bodies_.back();
  const kernels::Frame<double>& frame = pad_->frame;
  Vec3<double> xi = transposed_times(frame.R, place - frame.p);
  xi.z = 0;  // but for rounding
  const int number = static_cast<int>(shapes_.size()) - 1;
  std::optional<DepthOfContact> found;
  with_shape<double>(number, body.size, [&](const auto& shape) {
    found = contact_depth(shape, body.touch, xi, *pad_->layer, down_);
  });
  if (!found || !(found->at.depth > -pad_->layer->bulge()) || !std::isfinite(found->at.depth))
    return;
  const Point p{
      index, number, candidate, xi, found->known, in_pad(anchor), {found->at, {0, 0, 0}, 0}};
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
  layer().solve(*pad_->layer, depth_, pad_->layer->modulus / pad_->layer->stiffness);
  for (Point& p : points_) {
    if (!(load(p) > 0)) continue;
    const auto number = static_cast<std::size_t>(p.body);
    with_shape<double>(p.body, bodies_[number].size, [&](const auto& shape) {
      add_friction(shape, shapes_[number], bodies_[number].touch, p.xi, p.known, p.anchor, p.force);
    });
  }
}

double LayerContact::load(const Point& p) const {
  return bodies_[static_cast<std::size_t>(p.body)].touch.law.kn * pad_->layer->area *
         layer().pressure()[static_cast<std::size_t>(p.index)];
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
  layer().push_forward(depth_dot_, load_dot_);
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

/// Slopes at a point, outside of the shape by dual numbers.
TANGERE_INLINE_WHOLE LayerSlopes LayerContact::slopes(const Point& p) const {
  const auto number = static_cast<std::size_t>(p.body);
  const LayerShape& of = shapes_[number];
  const LayerBody<double>& body = bodies_[number];
  LayerSlopes out{};
  if (p.known.by != DepthBy::gap) {
    with_shape<double>(p.body, body.size, [&](const auto& shape) {
      out = layer_slopes(shape, of, body.touch, p.xi, *pad_->layer, p.known, p.anchor, p.force);
    });
    return out;
  }
  double depth[6];
  for (int k = 0; k < 6; ++k) {
    const LayerForce<D> f =
        force(p, moved(body, unit_motion(k), kernels::zero6<double>()), dual(p.anchor));
    depth[k] = f.at.depth.epsilon;
    set_column(out.slant, k, change_of(f.at.slant));
  }
  out.depth = {{depth[0], depth[1], depth[2]}, {depth[3], depth[4], depth[5]}};
  return out;
}

/// Computes the derivatives of w by displacement and twist, (12) in pad axes.
TANGERE_INLINE_WHOLE std::array<Vec6<double>, 12> LayerContact::columns_in_pad() {
  depth_slopes_.resize(depth_.size());
  load_slopes_.resize(depth_.size());
  slopes_.resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) {
    GelLayer::Directions& depth = depth_slopes_[static_cast<std::size_t>(points_[i].index)];
    depth = {};
    if (!(load(points_[i]) > 0)) continue;
    slopes_[i] = slopes(points_[i]);
    for (int k = 0; k < 6; ++k) {
      depth[std::size_t(k)] = component(slopes_[i].depth, k);
      depth[std::size_t(k + 6)] = component(slopes_[i].depth_by_twist, k);
    }
  }
  layer().push_forward(depth_slopes_, load_slopes_);
  // Rows of w, each along the 12 directions.
  std::array<GelLayer::Directions, 6> rows{};
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    const double P = load(p), F = friction_load(p), slope = F > 0 ? point_stiffness(p) : 0,
                 per_load =
                     bodies_[static_cast<std::size_t>(p.body)].touch.law.kn * pad_->layer->area;
    if (!(P > 0)) continue;
    const auto at = static_cast<std::size_t>(p.index);
    const LayerForce<double>& force = p.force;
    const Vec3<double>&x = force.at.place, f = P * force.at.slant + F * force.friction,
          loaded = force.at.slant + (F < P ? 0.0 : 1.0) * force.friction;
    // Loads and friction change, while slants stay.
    add_outer({cross(x, loaded), loaded}, per_load, load_slopes_[at], rows);
    if (F < P)
      add_outer({cross(x, force.friction), force.friction}, slope, depth_slopes_[at], rows);
    const LayerSlopes& by = slopes_[i];
    const Slopes turned = P * by.slant + F * by.friction;
    add_force(turned.turn, x, 0, rows), add_force(turned.shift, x, 3, rows);
    add_force(F * by.friction_by_twist.turn, x, 6, rows);
    add_force(F * by.friction_by_twist.shift, x, 9, rows);
    if (p.known.by == DepthBy::underside)
      for (int k = 0; k < 6; ++k) {
        const Vec3<double> moment = cross(column(by.place, k), f);
        rows[0][std::size_t(k)] += moment.x, rows[1][std::size_t(k)] += moment.y,
            rows[2][std::size_t(k)] += moment.z;
      }
  }
  std::array<Vec6<double>, 12> out;
  for (std::size_t k = 0; k < out.size(); ++k)
    out[k] = {{rows[0][k], rows[1][k], rows[2][k]}, {rows[3][k], rows[4][k], rows[5][k]}};
  return out;
}

void LayerContact::add_to(kernels::PairSums<double>& sums, bool derivatives) {
  sums.wrench += wrench();
  if (!derivatives || points_.empty()) return;
  const std::array<Vec6<double>, 12> columns = columns_in_pad();
  for (int k = 0; k < 12; ++k) {
    // ε and δW of the link in pad axes.
    const Vec6<double> in_pad = motion_to_child(pad_->frame, unit_motion(k % 6));
    Vec6<double> sum = kernels::zero6<double>();
    for (int i = 0; i < 6; ++i)
      sum += component(in_pad, i) * columns[std::size_t(i + (k < 6 ? 0 : 6))];
    add_column(k < 6 ? sums.k : sums.d, k % 6, wrench_to_parent(pad_->frame, sum));
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
