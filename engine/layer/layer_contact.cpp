// SPDX-License-Identifier: Apache-2.0
// Forces are summed in pad axes at the pad's origin.
#include "engine/layer/layer_contact.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/layer/layer_force.hpp"

namespace tangere {

using kernels::Anchor;
using kernels::kGroup;
using kernels::kLayerDirections;
using kernels::LayerBody;
using kernels::LayerShape;
using kernels::Mat3;
using kernels::Vec3;
using kernels::Vec6;
using D = kernels::Dual<double>;

namespace {

Vec3<D> dual(const Vec3<double>& x) { return {x.x, x.y, x.z}; }
Vec3<double> change_of(const Vec3<D>& x) { return {x.x.epsilon, x.y.epsilon, x.z.epsilon}; }
Anchor<D> dual(const Anchor<double>& a) { return {dual(a.b), dual(a.a), a.gap}; }

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

/// A body whose dual numbers do not change.
LayerBody<D> still(const LayerBody<double>& of) {
  LayerBody<D> body;
  body.touch.Q = kernels::broadcast<D>(of.touch.Q);
  body.touch.c = dual(of.touch.c);
  body.touch.omega = dual(of.touch.omega), body.touch.v = dual(of.touch.v);
  body.touch.law = transformed(of.touch.law, [](double x) { return D(x); });
  body.size = dual(of.size);
  return body;
}

Vec3<double> lane_of(const Vec3<kernels::LaneRow>& x, int l) { return {x.x[l], x.y[l], x.z[l]}; }

}  // namespace

void LayerContact::begin(const kernels::KernelTable& table, const LayerPad& pad, std::size_t slot) {
  for (int k = 0; k < kGroup * eights_; ++k)
    if (index_[std::size_t(k)] >= 0) slot_[std::size_t(index_[std::size_t(k)])] = -1;
  table_ = &table;
  pad_ = &pad;
  at_ = slot;
  if (layers_.size() <= slot) layers_.resize(slot + 1);
  slot_.resize(pad.in_field.size(), -1);
  bodies_.clear();
  eights_ = 0;
  wrench_ = kernels::zero6<double>();
}

/// Leaves the deeper one of two bodies at a point.
void LayerContact::keep_deepest(int k) {
  const auto depth = [this](int i) {
    return points_[std::size_t(i / kGroup)].at.depth[i % kGroup];
  };
  int& number = index_[std::size_t(k)];
  int& slot = slot_[std::size_t(number)];
  if (slot >= 0 && !(depth(k) > depth(slot))) {
    number = -1;
    return;
  }
  if (slot >= 0) index_[std::size_t(slot)] = -1;
  slot = k;
}

void LayerContact::add_body(const LayerShape& shape, const LayerBody<double>& body,
                            const LayerCandidates& candidates) {
  const std::size_t most = std::size_t(eights_ + candidates.count / kGroup + 2);
  if (points_.size() < most) {
    points_.resize(most);
    for (auto* numbers : {&index_, &candidate_, &cell_}) numbers->resize(kGroup * most);
  }
  const int first = eights_,
            found = table_->find_layer_points(
                {&shape, &body, contact_law(*pad_->layer), pad_->frame, candidates.places,
                 candidates.anchors, candidates.stride, candidates.count,
                 &points_[std::size_t(first)], &candidate_[std::size_t(kGroup * first)]}),
            count = (found + kGroup - 1) / kGroup;
  bodies_.push_back({shape, body, first, count});
  eights_ += count;
  for (int k = kGroup * first; k < kGroup * eights_; ++k) {
    const int candidate = candidate_[std::size_t(k)];
    index_[std::size_t(k)] = -1;
    if (candidate < 0) continue;
    const int number = candidates.index == nullptr ? candidate : candidates.index[candidate];
    index_[std::size_t(k)] = pad_->in_field[std::size_t(number)];
    keep_deepest(k);
  }
}

kernels::LayerPoints LayerContact::points_of(const Body& body) {
  return {&body.shape, &body.motion, contact_law(*pad_->layer), points_.data() + body.first,
          body.count};
}

/// a k [N/m].
double LayerContact::point_stiffness(const Body& body) const {
  const CompiledLayer& layer = *pad_->layer;
  return body.motion.touch.law.kn * layer.area * layer.modulus /
         (layer.stiffness * layer.compliance.own);
}

/// Sets P and min(P, a k depth).
void LayerContact::set_loads(const Body& body) {
  const double stiffness = point_stiffness(body),
               area = body.motion.touch.law.kn * pad_->layer->area;
  for (int k = kGroup * body.first; k < kGroup * (body.first + body.count); ++k) {
    kernels::LayerEight& eight = points_[std::size_t(k / kGroup)];
    const int l = k % kGroup, index = index_[std::size_t(k)];
    const double load =
        index < 0 ? 0 : area * layers_[at_].pressure()[static_cast<std::size_t>(index)];
    eight.load[l] = load;
    eight.friction_load[l] = std::min(load, stiffness * std::max(0.0, eight.at.depth[l]));
    cell_[std::size_t(k)] =
        load > 0 ? pad_->layer->cell_of_point[static_cast<std::size_t>(index)] : -1;
  }
}

void LayerContact::solve() {
  depth_.assign(slot_.size(), least_depth(*pad_->layer));
  for (int k = 0; k < kGroup * eights_; ++k)
    if (const int index = index_[std::size_t(k)]; index >= 0)
      depth_[static_cast<std::size_t>(index)] =
          points_[std::size_t(k / kGroup)].at.depth[k % kGroup];
  layers_[at_].solve(*pad_->layer, depth_, pad_->layer->modulus / pad_->layer->stiffness);
  for (const Body& body : bodies_) {
    set_loads(body);
    table_->add_layer_forces(points_of(body), &wrench_.a.x);
  }
}

LayerContact::Point LayerContact::point(int k) const {
  const kernels::LayerEight& e = points_[std::size_t(k / kGroup)];
  const int l = k % kGroup;
  int body = 0;
  while (k >= kGroup * (bodies_[std::size_t(body)].first + bodies_[std::size_t(body)].count))
    ++body;
  return {index_[std::size_t(k)],
          body,
          candidate_[std::size_t(k)],
          lane_of(e.xi, l),
          {e.known[l], static_cast<DepthBy>(e.by[l])},
          {lane_of(e.anchor.b, l), lane_of(e.anchor.a, l), e.anchor.gap[l]},
          {e.at.depth[l], lane_of(e.at.slant, l), lane_of(e.at.place, l)},
          e.load[l],
          e.friction_load[l],
          lane_of(e.friction, l),
          e.normal[l]};
}

Vec6<double> LayerContact::wrench() const { return wrench_to_parent(pad_->frame, wrench_); }

double LayerContact::energy() const {
  double sum = 0;
  for_each_point([&](const Point& p) { sum += 0.5 * p.load * p.known.depth; });
  return sum;
}

LayerContact::PointChange LayerContact::changed(const Point& p, const LayerBody<D>& body,
                                                const Anchor<D>& anchor,
                                                double thickness_dot) const {
  const LayerShape& of = bodies_[static_cast<std::size_t>(p.body)].shape;
  PointChange out{};
  kernels::with_distance<D>(
      of.shape, body.size,
      [&](const auto& shape) {
        out.at = layer_depth(shape, body.touch, p.xi, *pad_->layer, p.known,
                             D(pad_->layer->grid.thickness, thickness_dot));
        out.friction = layer_friction(shape, of, body.touch, dual(p.xi), D(double(p.known.by)),
                                      anchor, out.at.slant)
                           .ratio;
      },
      of.grid);
  return out;
}

Vec6<double> LayerContact::change_in_pad(std::span<const LayerBody<D>> bodies,
                                         std::span<const Anchor<D>> anchors,
                                         const LayerMaterial& material_dot) {
  depth_dot_.resize(depth_.size());
  load_dot_.resize(depth_.size());
  changes_.clear();
  for_each_point([&](const Point& p) {
    double& depth_dot = depth_dot_[static_cast<std::size_t>(p.index)] = 0;
    changes_.emplace_back();
    if (!(p.load > 0)) return;
    changes_.back() = changed(p, bodies[static_cast<std::size_t>(p.body)],
                              anchors.empty() ? dual(p.anchor) : anchors[changes_.size() - 1],
                              material_dot.thickness);
    depth_dot = changes_.back().at.depth.epsilon;
  });
  layers_[at_].push_forward(depth_dot_, material_dot, load_dot_);
  const double softer = pad_->layer->own_change(material_dot) / pad_->layer->compliance.own;
  Vec6<double> sum = kernels::zero6<double>();
  std::size_t next = 0;
  for_each_point([&](const Point& p) {
    const PointChange& change = changes_[next++];
    if (!(p.load > 0)) return;
    const auto body = static_cast<std::size_t>(p.body), at = static_cast<std::size_t>(p.index);
    const D& kn = bodies[body].touch.law.kn;
    const double relative = kn.epsilon / kn.value, P = p.load, F = p.friction_load,
                 P_dot = kn.value * pad_->layer->area * load_dot_[at] + relative * P,
                 slope = F > 0 ? point_stiffness(bodies_[body]) : 0,
                 F_dot = F < P ? slope * depth_dot_[at] + (relative - softer) * F : P_dot;
    const Vec3<double> f = P * p.at.slant + F * p.friction,
                       f_dot = P_dot * p.at.slant + P * change_of(change.at.slant) +
                               F_dot * p.friction + F * change_of(change.friction);
    sum += {cross(change_of(change.at.place), f) + cross(p.at.place, f_dot), f_dot};
  });
  return sum;
}

Vec6<double> LayerContact::change(std::span<const LayerBody<D>> bodies,
                                  std::span<const Anchor<D>> anchors,
                                  const LayerMaterial& material_dot) {
  return wrench_to_parent(pad_->frame, change_in_pad(bodies, anchors, material_dot));
}

/// T'/N of a point where its place and its surface stay.
Vec3<D> LayerContact::changed_friction(const Point& p, const LayerBody<D>& body) const {
  const LayerShape& of = bodies_[static_cast<std::size_t>(p.body)].shape;
  return kernels::with_distance<D>(
      of.shape, body.size,
      [&](const auto& shape) {
        return layer_friction(shape, of, body.touch, dual(p.xi), D(double(p.known.by)),
                              dual(p.anchor), dual(p.at.slant))
            .ratio;
      },
      of.grid);
}

/// Adds what one point's force changes with its own numbers, where its load P stays, but for those
/// of kn, and with the depth by depth_bar_.
void LayerContact::pull_back_point(const Point& p, const Vec6<double>& bar, BodyNumbers& of,
                                   double& thickness) const {
  const double P = p.load, F = p.friction_load;
  const Vec3<double> g = bar.l + cross(bar.a, p.at.place), f = P * p.at.slant + F * p.friction;
  LayerBody<D> body = still(bodies_[static_cast<std::size_t>(p.body)].motion);
  const double normal = dot(g, f);
  of.law[0] += normal / body.touch.law.kn.value;
  if (p.normal > 0)
    for (std::size_t i = 0; i < kCoefficients; ++i) {
      body.touch.law[i].epsilon = 1;
      of.law[i] += F * dot(g, change_of(changed_friction(p, body)));
      body.touch.law[i].epsilon = 0;
    }
  const double depth_bar = depth_bar_[static_cast<std::size_t>(p.index)];
  const auto share = [&](double thickness_dot) {
    const PointChange change = changed(p, body, dual(p.anchor), thickness_dot);
    return depth_bar * change.at.depth.epsilon +
           dot(g, P * change_of(change.at.slant) + F * change_of(change.friction)) +
           dot(bar.a, cross(change_of(change.at.place), f));
  };
  for (std::size_t i = 0; i < kernels::kSizeNumbers; ++i) {
    D& size = (&body.size.x)[i];
    size.epsilon = 1;
    of.size[i] += share(0);
    size.epsilon = 0;
  }
  if (pad_->layer->relaxation > 0) thickness += share(1);
}

LayerMaterial LayerContact::pull_back(const Vec6<double>& wrench_bar,
                                      std::span<BodyNumbers> bodies) {
  const Vec6<double> bar = motion_to_child(pad_->frame, wrench_bar);
  load_bar_.assign(depth_.size(), 0.0);
  depth_bar_.resize(depth_.size());
  double softer = 0;  // Σ g·φ F of the points whose friction has the load of their depth
  for_each_point([&](const Point& p) {
    if (!(p.load > 0)) return;
    const Vec3<double> g = bar.l + cross(bar.a, p.at.place);
    const double area = bodies_[std::size_t(p.body)].motion.touch.law.kn * pad_->layer->area;
    const bool whole = !(p.friction_load < p.load);
    load_bar_[std::size_t(p.index)] =
        area * (dot(g, p.at.slant) + (whole ? dot(g, p.friction) : 0.0));
    if (!whole) softer += p.friction_load * dot(g, p.friction);
  });
  layers_[at_].pull_back(load_bar_, depth_bar_);
  const bool has_slopes = !pad_->layer->surface;  // by the material
  LayerMaterial material;
  if (has_slopes) material = layers_[at_].pull_back_material(load_bar_);
  for_each_point([&](const Point& p) {
    if (!(p.load > 0)) return;
    const auto body = std::size_t(p.body);
    if (p.friction_load < p.load && p.friction_load > 0)
      depth_bar_[std::size_t(p.index)] +=
          point_stiffness(bodies_[body]) * dot(bar.l + cross(bar.a, p.at.place), p.friction);
    pull_back_point(p, bar, bodies[body], material.thickness);
  });
  if (!has_slopes) return {};
  const double own = pad_->layer->compliance.own;
  material.thickness -= softer * pad_->layer->own_change({1, 0}) / own;
  material.poisson -= softer * pad_->layer->own_change({0, 1}) / own;
  return material;
}

void LayerContact::add_to(kernels::PairSums<double>& sums, bool derivatives) {
  sums.wrench += wrench();
  if (!derivatives || empty()) return;
  double rows[6 * kLayerDirections] = {};
  layers_[at_].clear_cells(cells_);
  for (const Body& body : bodies_)
    table_->add_layer_slopes({points_of(body), point_stiffness(body),
                              &cell_[std::size_t(kGroup * body.first)], cells_.data(), rows});
  layers_[at_].add_yield_slopes(*table_, cells_, rows);
  for (int k = 0; k < kLayerDirections; ++k) {
    // ε and δW of the link in pad axes.
    const Vec6<double> in_pad = motion_to_child(pad_->frame, unit_motion(k % 6));
    Vec6<double> sum = kernels::zero6<double>();
    for (int i = 0; i < 6; ++i) {
      const double* const of = rows + i + (k < 6 ? 0 : 6);
      const auto row = [of](int r) { return of[kLayerDirections * r]; };
      sum +=
          component(in_pad, i) * Vec6<double>{{row(0), row(1), row(2)}, {row(3), row(4), row(5)}};
    }
    add_column(k < 6 ? sums.k : sums.d, k % 6, wrench_to_parent(pad_->frame, sum));
  }
}

Vec3<double> LayerContact::friction_bar(const Point& p, const Vec6<double>& wrench_bar) const {
  if (!(p.normal > 0)) return {0, 0, 0};
  const Vec6<double> bar = motion_to_child(pad_->frame, wrench_bar);
  const Vec3<double>&slant = p.at.slant, f = bar.l + cross(bar.a, p.at.place);
  return (p.friction_load / p.normal) *
         (pad_->frame.R * (f - (dot(slant, f) / dot(slant, slant)) * slant));
}

}  // namespace tangere
