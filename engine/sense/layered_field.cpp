// SPDX-License-Identifier: Apache-2.0
#include "engine/sense/layered_field.hpp"

#include <cmath>

#include "engine/sense/dense_tiles.hpp"

namespace tangere {

using kernels::Mat3;
using kernels::Touch;
using kernels::Vec3;
using D = kernels::Dual<double>;

namespace {

Vec3<D> lifted(const Vec3<double>& x, const Vec3<double>& dot) {
  return {{x.x, dot.x}, {x.y, dot.y}, {x.z, dot.z}};
}

/// A shape that is displaced by θ and ρ in pad axes about the pad's origin.
Touch<D> displaced(const Touch<double>& t, const Vec3<double>& theta, const Vec3<double>& rho) {
  Touch<D> out{};
  const Mat3<double> turned = kernels::skew(theta) * t.Q;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out.Q.m[i][j] = {t.Q.m[i][j], turned.m[i][j]};
  out.c = lifted(t.c, rho + cross(theta, t.c));
  out.omega = lifted(t.omega, {0, 0, 0});
  out.v = lifted(t.v, {0, 0, 0});
  return out;
}

Vec3<double> unit(int axis) {
  return {axis == 0 ? 1.0 : 0, axis == 1 ? 1.0 : 0, axis == 2 ? 1.0 : 0};
}

/// Σ of cotangents times how depth and slant change.
double along(const LayerDepth<D>& at, double depth_bar, const Vec3<double>& slant_bar) {
  return depth_bar * at.depth.epsilon + slant_bar.x * at.slant.x.epsilon +
         slant_bar.y * at.slant.y.epsilon + slant_bar.z * at.slant.z.epsilon;
}

Vec3<double> vector_at(std::span<const double> field, int point) {
  const double* const f = &field[static_cast<std::size_t>(3 * point)];
  return {f[0], f[1], f[2]};
}

void put(std::span<double> field, int point, const Vec3<double>& f) {
  double* const to = &field[static_cast<std::size_t>(3 * point)];
  to[0] = f.x, to[1] = f.y, to[2] = f.z;
}

}  // namespace

/// A force in pad axes as components of the field: f·axis0, f·axis1, -f·(axis0 × axis1).
Vec3<double> LayeredField::in_field(const Vec3<double>& f) const {
  if (!pad_.skewed) return {f.x, f.y, -f.z};
  const double* const a = pad_.axes;
  return {a[0] * f.x + a[1] * f.y + a[2] * f.z, a[3] * f.x + a[4] * f.y + a[5] * f.z,
          a[6] * f.x + a[7] * f.y + a[8] * f.z};
}

/// The transpose.
Vec3<double> LayeredField::to_pad(const double* b) const {
  if (!pad_.skewed) return {b[0], b[1], -b[2]};
  const double* const a = pad_.axes;
  return {a[0] * b[0] + a[3] * b[1] + a[6] * b[2], a[1] * b[0] + a[4] * b[1] + a[7] * b[2],
          a[2] * b[0] + a[5] * b[1] + a[8] * b[2]};
}

/// Lists the points on which springs press, with the deepest shape at each.
void LayeredField::find_points(const kernels::TactileArgs<double>& touch,
                               const SpringFields& springs) {
  const CompiledLayer& layer = *sensor_->layer;
  points_.clear();
  depth_.assign(static_cast<std::size_t>(sensor_->points()), 0.0);
  for (int tile = 0; tile < pad_.tiles(); ++tile)
    for_points_of_tile(pad_, tile, [&](int slot, int index) {
      const Vec3<double> n = vector_at(springs.normal, index);
      const double normal = std::sqrt(dot(n, n));
      if (!(normal > 0)) return;
      const double* const offset =
          pad_.offsets + 2 * kernels::kTactileTile * pad_.kind[tile] + slot;
      const Vec3<double> xi = {pad_.x[tile] + offset[0],
                               pad_.y[tile] + offset[kernels::kTactileTile], 0};
      Point best{index, -1, xi, 0, normal, {}};
      for (int k = 0; k < touch.n_touches; ++k) {
        const kernels::TouchShape& s = touch.shapes[k];
        kernels::with_distance<double>(
            s.shape, Vec3<double>{s.size[0], s.size[1], s.size[2]},
            [&](const auto& shape) {
              const auto known = find_underside(shape, touch.touches[k], xi, layer.outward);
              if (!known) return;
              const LayerDepth<double> at =
                  layer_depth(shape, touch.touches[k], xi, layer.outward, *known, layer.relaxation);
              if (at.depth > 0 && (best.target < 0 || at.depth > best.at.depth))
                best.target = k, best.known = *known, best.at = at;
            },
            s.grid);
      }
      if (best.target < 0) return;
      depth_[static_cast<std::size_t>(index)] = best.at.depth;
      points_.push_back(best);
    });
}

void LayeredField::read(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                        const SpringFields& springs, std::span<double> field) {
  sensor_ = &sensor;
  pad_ = sensor.tiles();
  const CompiledLayer& layer = *sensor.layer;
  kn_ = touch.n_touches > 0 ? touch.touches[0].law.kn : layer.stiffness;
  shapes_.assign(touch.shapes, touch.shapes + touch.n_touches);
  touches_.assign(touch.touches, touch.touches + touch.n_touches);
  whole_.assign(springs.whole.begin(), springs.whole.end());
  normal_.assign(springs.normal.begin(), springs.normal.end());
  find_points(touch, springs);
  // Without stiffness springs find nothing that touches.
  layer_.solve(layer, depth_, kn_ > 0 ? layer.modulus * (kn_ / layer.stiffness) : 0);
  std::fill(field.begin(), field.end(), 0.0);
  for (const Point& p : points_) {
    const double load = layer.area * layer_.pressure()[static_cast<std::size_t>(p.index)];
    const Vec3<double> friction = vector_at(whole_, p.index) - vector_at(normal_, p.index);
    put(field, p.index, load * (in_field(p.at.slant) + (1 / p.normal) * friction));
  }
}

void LayeredField::pull_back(std::span<const double> field_bar, bool sizes, Cotangents& out) {
  const CompiledLayer& layer = *sensor_->layer;
  for (std::span<double> x : {out.whole, out.normal}) std::fill(x.begin(), x.end(), 0.0);
  out.stiffness = 0;
  load_bar_.assign(depth_.size(), 0.0);
  depth_bar_.resize(depth_.size());
  slant_bar_.clear();
  for (const Point& p : points_) {
    const auto at = static_cast<std::size_t>(p.index);
    const double load = layer.area * layer_.pressure()[at];
    const Vec3<double> bar = vector_at(field_bar, p.index), n = vector_at(normal_, p.index),
                       friction = vector_at(whole_, p.index) - n;
    const double along_friction = dot(bar, friction) / p.normal;
    const double load_bar = dot(bar, in_field(p.at.slant)) + along_friction;
    load_bar_[at] = layer.area * load_bar;
    slant_bar_.push_back(load * to_pad(&field_bar[3 * at]));
    const Vec3<double> friction_bar = (load / p.normal) * bar;
    put(out.whole, p.index, friction_bar);
    put(out.normal, p.index, -friction_bar - (load * along_friction / (p.normal * p.normal)) * n);
    out.stiffness += load_bar * load / kn_;
  }
  layer_.pull_back(load_bar_, depth_bar_);
  for (kernels::TouchCotangent<double>& t : out.touches) t = {};
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    const auto target = static_cast<std::size_t>(p.target);
    const double depth_bar = depth_bar_[static_cast<std::size_t>(p.index)];
    kernels::TouchCotangent<double>& to = out.touches[target];
    const kernels::TouchShape& s = shapes_[target];
    const Vec3<double> size = {s.size[0], s.size[1], s.size[2]};
    const auto change = [&](const Touch<D>& touch, const Vec3<D>& of_size) {
      double sum = 0;
      kernels::with_distance<D>(
          s.shape, of_size,
          [&](const auto& shape) {
            sum = along(layer_depth(shape, touch, p.xi, layer.outward, p.known, layer.relaxation),
                        depth_bar, slant_bar_[i]);
          },
          s.grid);
      return sum;
    };
    double turn[3], shift[3], grow[3] = {};
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3<D> same = lifted(size, {0, 0, 0});
      turn[axis] = change(displaced(touches_[target], unit(axis), {0, 0, 0}), same);
      shift[axis] = change(displaced(touches_[target], {0, 0, 0}, unit(axis)), same);
      if (sizes)
        grow[axis] =
            change(displaced(touches_[target], {0, 0, 0}, {0, 0, 0}), lifted(size, unit(axis)));
    }
    to.displacement +=
        kernels::Vec6<double>{{turn[0], turn[1], turn[2]}, {shift[0], shift[1], shift[2]}};
    to.size += Vec3<double>{grow[0], grow[1], grow[2]};
    const Vec3<double> rate = (depth_bar * layer.relaxation) * p.at.slant;
    to.twist += kernels::Vec6<double>{cross(p.at.place, rate), rate};
  }
}

void LayeredField::push_forward(const SpringFields& springs_dot, std::span<const Touch<D>> touches,
                                std::span<const Vec3<D>> sizes, double stiffness_dot,
                                std::span<double> field_dot) {
  const CompiledLayer& layer = *sensor_->layer;
  std::vector<LayerDepth<D>> moved;
  depth_bar_.assign(depth_.size(), 0.0);  // how depths change
  load_bar_.resize(depth_.size());        // how pressures change
  for (const Point& p : points_) {
    const auto target = static_cast<std::size_t>(p.target);
    const kernels::TouchShape& s = shapes_[target];
    kernels::with_distance<D>(
        s.shape, sizes[target],
        [&](const auto& shape) {
          moved.push_back(
              layer_depth(shape, touches[target], p.xi, layer.outward, p.known, layer.relaxation));
        },
        s.grid);
    depth_bar_[static_cast<std::size_t>(p.index)] = moved.back().depth.epsilon;
  }
  layer_.push_forward(depth_bar_, load_bar_);
  std::fill(field_dot.begin(), field_dot.end(), 0.0);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    const auto at = static_cast<std::size_t>(p.index);
    const double load = layer.area * layer_.pressure()[at],
                 load_dot = layer.area * load_bar_[at] + load * stiffness_dot / kn_;
    const Vec3<double> n = vector_at(normal_, p.index), friction = vector_at(whole_, p.index) - n,
                       n_dot = vector_at(springs_dot.normal, p.index),
                       friction_dot = vector_at(springs_dot.whole, p.index) - n_dot;
    const Vec3<D>& slant = moved[i].slant;
    const double inverse = 1 / p.normal, inverse_dot = -dot(n, n_dot) * inverse * inverse * inverse;
    put(field_dot, p.index,
        load_dot * (in_field(p.at.slant) + inverse * friction) +
            load * (in_field({slant.x.epsilon, slant.y.epsilon, slant.z.epsilon}) +
                    inverse * friction_dot + inverse_dot * friction));
  }
}

}  // namespace tangere
