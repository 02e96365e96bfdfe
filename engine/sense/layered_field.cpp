// SPDX-License-Identifier: Apache-2.0
// Points are found by the shapes, tile by tile. Derivatives by motion and size go through dual
// numbers, one direction after the other.
#include "engine/sense/layered_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/sense/dense_tiles.hpp"
#include "engine/sense/pad_depth.hpp"

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

void add_force(std::span<double> field, int point, const Vec3<double>& f) {
  double* const to = &field[static_cast<std::size_t>(3 * point)];
  const double x[] = {f.x, f.y, f.z};
  for (int k = 0; k < 3; ++k) to[k] = to[k] == 0 ? x[k] : to[k] + x[k];  // keeps -0
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
Vec3<double> LayeredField::to_pad(const Vec3<double>& b) const {
  if (!pad_.skewed) return {b.x, b.y, -b.z};
  const double* const a = pad_.axes;
  return {a[0] * b.x + a[3] * b.y + a[6] * b.z, a[1] * b.x + a[4] * b.y + a[7] * b.z,
          a[2] * b.x + a[5] * b.y + a[8] * b.z};
}

/// Lists a point that a shape of a group presses, with the deepest of its shapes. `normal`: N of
/// the springs. `above`: how far above the surface a shape may be [m].
void LayeredField::add_point(int index, int group, const Vec3<double>& xi, double normal,
                             double above) {
  constexpr double kMostSlant = 10;  // 1/cos of 84°
  const CompiledLayer& layer = *sensor_->layer;
  Point best{index, group, -1, xi, {}, normal, {}};
  for (std::size_t k = 0; k < shapes_.size(); ++k) {
    const kernels::TouchShape& s = shapes_[k];
    if (sensor_->target_groups[k] != group) continue;
    if (s.grid != nullptr && !(normal > 0)) continue;
    kernels::with_distance<double>(
        s.shape, Vec3<double>{s.size[0], s.size[1], s.size[2]},
        [&](const auto& shape) {
          const auto known =
              find_depth(shape, touches_[k], xi, layer, s.grid == nullptr ? above : 0);
          if (!known) return;
          const LayerDepth<double> at =
              layer_depth(shape, touches_[k], xi, layer, *known, layer.grid.thickness);
          const bool presses = at.depth > -above && std::isfinite(at.depth) &&
                               dot(at.slant, at.slant) < kMostSlant * kMostSlant;
          if (presses && (best.target < 0 || at.depth > best.at.depth))
            best.target = static_cast<int>(k), best.known = *known, best.at = at;
        },
        s.grid);
  }
  if (best.target < 0) return;
  depth_[place(best)] = best.at.depth;
  points_.push_back(best);
}

/// Where the numbers of a point are in arrays of groups.
std::size_t LayeredField::place(const Point& p) const {
  return static_cast<std::size_t>(p.group * sensor_->points() + p.index);
}

double LayeredField::pressure(const Point& p) const {
  const auto at = static_cast<std::size_t>(p.index);
  return sensor_->layer->table ? table_.pressure()[at]
                               : layers_[static_cast<std::size_t>(p.group)].pressure()[at];
}

/// a k of a point on a layer [N/m].
double LayeredField::point_stiffness() const {
  const CompiledLayer& layer = *sensor_->layer;
  return layer.area * layer.modulus * kn_ / (layer.stiffness * layer.compliance.own);
}

/// The load that friction has: of a contact, that of engine/layer/layer_force.hpp.
double LayeredField::friction_load(const Point& p) const {
  const double load = sensor_->layer->area * pressure(p);
  if (!sensor_->layer->feedback) return load;
  return std::min(load, point_stiffness() * std::max(0.0, p.at.depth));
}

template <class F>
void LayeredField::for_each_law(const F& f) {
  const auto count = static_cast<std::size_t>(sensor_->points());
  if (sensor_->layer->table) return f(table_, std::size_t{0}, count);
  for (std::size_t g = 0; g < layers_.size(); ++g) f(layers_[g], g * count, count);
}

void LayeredField::find_points(const SpringFields& springs, double above) {
  points_.clear();
  depth_.assign(layers_.size() * static_cast<std::size_t>(sensor_->points()),
                least_depth(*sensor_->layer));
  if (!(kn_ > 0)) return;
  for (int tile = 0; tile < pad_.tiles(); ++tile) {
    bool reached = false;
    for (std::size_t k = 0; k < shapes_.size() && !reached; ++k)
      reached = reaches_tile(pad_, tile, shapes_[k], touches_[k], above);
    if (!reached) continue;
    const double* const offset = pad_.offsets + 2 * kernels::kTactileTile * pad_.kind[tile];
    for_points_of_tile(pad_, tile, [&](int slot, int index) {
      const Vec3<double> n = vector_at(springs.normal, index);
      for (int group = 0; group < static_cast<int>(layers_.size()); ++group)
        add_point(
            index, group,
            {pad_.x[tile] + offset[slot], pad_.y[tile] + offset[kernels::kTactileTile + slot], 0},
            std::sqrt(dot(n, n)), above);
    });
  }
}

LayeredField::Friction LayeredField::friction_at(const Point& p) const {
  Friction f;
  f.springs = vector_at(whole_, p.index) - vector_at(normal_, p.index);
  f.normal = (1 / std::sqrt(dot(p.at.slant, p.at.slant))) * in_field(p.at.slant);
  f.along = f.springs - dot(f.normal, f.springs) * f.normal;
  return f;
}

void LayeredField::read(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                        const SpringFields& springs, std::span<double> field,
                        const PadLoads& loads) {
  sensor_ = &sensor;
  friction_ = springs.friction;
  pad_ = sensor.tiles();
  const CompiledLayer& layer = *sensor.layer;
  kn_ = touch.n_touches > 0 ? touch.touches[0].law.kn : 0;
  shapes_.assign(touch.shapes, touch.shapes + touch.n_touches);
  touches_.assign(touch.touches, touch.touches + touch.n_touches);
  whole_.assign(springs.whole.begin(), springs.whole.end());
  normal_.assign(springs.normal.begin(), springs.normal.end());
  int groups = 1;
  for (const int g : sensor.target_groups) groups = std::max(groups, g + 1);
  layers_.resize(static_cast<std::size_t>(groups));
  const double modulus = layer.modulus * (kn_ / layer.stiffness);
  if (layer.load_control) {
    solve_loads(springs, loads, modulus);
  } else {
    find_points(springs, layer.bulge());
    for_each_law([&](auto& law, std::size_t first, std::size_t count) {
      law.solve(layer, std::span(depth_).subspan(first, count), modulus);
    });
  }
  std::fill(field.begin(), field.end(), 0.0);
  for (const Point& p : points_) {
    const double load = layer.area * pressure(p);
    Vec3<double> f = load * in_field(p.at.slant);
    if (p.normal > 0 && friction_) f += (friction_load(p) / p.normal) * friction_at(p).along;
    add_force(field, p.index, f);
  }
  // A state that is not finite is one in the springs' field.
  bool solved = !layer.load_control || control_.solved();
  for (const GelLayer& one : layers_) solved = solved && (layer.table || one.solved());
  for (std::size_t k = 0; k < field.size(); ++k)
    if (!solved || !std::isfinite(whole_[k])) field[k] = std::numeric_limits<double>::quiet_NaN();
}

/// Returns depth and slant where a shape moves as its dual numbers say, and the thickness changes.
LayerDepth<D> LayeredField::moved(const Point& p, const Touch<D>& touch, const Vec3<D>& size,
                                  double thickness_dot) const {
  const CompiledLayer& layer = *sensor_->layer;
  const kernels::TouchShape& s = shapes_[static_cast<std::size_t>(p.target)];
  LayerDepth<D> out;
  kernels::with_distance<D>(
      s.shape, size,
      [&](const auto& shape) {
        out =
            layer_depth(shape, touch, p.xi, layer, p.known, D(layer.grid.thickness, thickness_dot));
      },
      s.grid);
  return out;
}

void LayeredField::pull_back(std::span<const double> field_bar, bool numbers, Cotangents& out) {
  const CompiledLayer& layer = *sensor_->layer;
  for (std::span<double> x : {out.whole, out.normal}) std::fill(x.begin(), x.end(), 0.0);
  out.stiffness = 0;
  load_bar_.assign(depth_.size(), 0.0);
  depth_bar_.resize(depth_.size());
  slant_bar_.clear(), held_bar_.clear();
  if (layer.load_control) find_lambda(field_bar);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    held_bar_.push_back(0);
    const double load = layer.area * pressure(p);
    Vec3<double> bar = vector_at(field_bar, p.index), carried = {0, 0, 0};
    if (layer.load_control) {
      carried = control_.along(lambda_, loaded_[i]) * pressing_direction();
      bar = bar - carried;
    }
    double load_bar = dot(bar, in_field(p.at.slant));
    Vec3<double> slant_bar = load * to_pad(bar);
    if (p.normal > 0) {
      if (!friction_) bar = -carried;
      const Friction f = friction_at(p);
      const double held = friction_load(p), share = held / p.normal,
                   along = dot(bar, f.along) / p.normal, out_of_plane = dot(f.normal, bar),
                   sticks_out = dot(f.normal, f.springs);
      if (held < load) {
        if (held > 0) held_bar_.back() = along * point_stiffness();
        out.stiffness += along * held / kn_;
      } else {
        load_bar += along;
      }
      const Vec3<double> friction_bar = share * (bar - out_of_plane * f.normal);
      add_force(out.whole, p.index, friction_bar);
      add_force(out.normal, p.index,
                -friction_bar - (share * along / p.normal) * vector_at(normal_, p.index));
      const Vec3<double> m_bar = -share * (sticks_out * bar + out_of_plane * f.springs);
      const double size = std::sqrt(dot(p.at.slant, p.at.slant));
      slant_bar += (1 / size) * to_pad(m_bar) -
                   (dot(m_bar, in_field(p.at.slant)) / (size * size * size)) * p.at.slant;
    }
    load_bar_[place(p)] = layer.area * load_bar;
    slant_bar_.push_back(slant_bar);
    out.stiffness += load_bar * load / kn_;
  }
  for_each_law([&](auto& law, std::size_t first, std::size_t count) {
    law.pull_back(std::span(load_bar_).subspan(first, count),
                  std::span(depth_bar_).subspan(first, count));
  });
  for (std::size_t i = 0; i < points_.size(); ++i) depth_bar_[place(points_[i])] += held_bar_[i];
  for (kernels::TouchCotangent<double>& t : out.touches) t = {};
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (layer.load_control && !has_cotangent(points_[i])) continue;
    if (points_[i].known.by != DepthBy::end)
      pull_back_point(points_[i], slant_bar_[i], numbers, out);
  }
  out.material = {};
  out.loads = layer.load_control ? control_.loads_bar(lambda_) : PadLoads{};
  if (numbers && !layer.table && !layer.surface) pull_back_material(out);
}

/// Adds the cotangents of the layer's material, from the pressures and from depths that follow from
/// the thickness.
void LayeredField::pull_back_material(Cotangents& out) const {
  const auto count = static_cast<std::size_t>(sensor_->points());
  for (std::size_t g = 0; g < layers_.size(); ++g) {
    const LayerMaterial of =
        layers_[g].pull_back_material(std::span(load_bar_).subspan(g * count, count));
    out.material.thickness += of.thickness;
    out.material.poisson += of.poisson;
  }
  const LayerSlopes& slopes = sensor_->layer->slopes.at(sensor_->layer->grid);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    const auto target = static_cast<std::size_t>(p.target);
    const double* const size = shapes_[target].size;
    out.material.thickness += along(moved(p, displaced(touches_[target], {0, 0, 0}, {0, 0, 0}),
                                          lifted({size[0], size[1], size[2]}, {0, 0, 0}), 1),
                                    depth_bar_[place(p)], slant_bar_[i]);
    // Friction whose load is a k δ has the k of the material.
    const double own_bar = -held_bar_[i] * p.at.depth / sensor_->layer->compliance.own;
    out.material.thickness += own_bar * slopes.thickness.own;
    out.material.poisson += own_bar * slopes.poisson.own;
  }
  if (sensor_->layer->load_control)
    out.material.thickness += control_.thickness_bar(approach_bar());
}

/// Adds the cotangents of the motion and of the size of the shape at a point.
void LayeredField::pull_back_point(const Point& p, const Vec3<double>& slant_bar, bool sizes,
                                   Cotangents& out) const {
  const auto target = static_cast<std::size_t>(p.target);
  const double depth_bar = depth_bar_[place(p)];
  kernels::TouchCotangent<double>& to = out.touches[target];
  const double* const own = shapes_[target].size;
  const Vec3<double> size = {own[0], own[1], own[2]}, none = {0, 0, 0};
  const auto change = [&](const Vec3<double>& turn, const Vec3<double>& shift,
                          const Vec3<double>& grow) {
    return along(moved(p, displaced(touches_[target], turn, shift), lifted(size, grow), 0),
                 depth_bar, slant_bar);
  };
  const auto along_axes = [](const auto& f) {
    return Vec3<double>{f(unit(0)), f(unit(1)), f(unit(2))};
  };
  to.displacement += kernels::Vec6<double>{
      along_axes([&](const Vec3<double>& e) { return change(e, none, none); }),
      along_axes([&](const Vec3<double>& e) { return change(none, e, none); })};
  if (sizes) to.size += along_axes([&](const Vec3<double>& e) { return change(none, none, e); });
  const Vec3<double> rate =
      (depth_bar * relaxation_at(*sensor_->layer, p.known.depth, sensor_->layer->grid.thickness)) *
      p.at.slant;
  to.twist += kernels::Vec6<double>{cross(p.at.place, rate), rate};
}

void LayeredField::push_forward(const SpringFields& springs_dot, std::span<const Touch<D>> touches,
                                std::span<const Vec3<D>> sizes, double stiffness_dot,
                                const LayerMaterial& material_dot, std::span<double> field_dot,
                                const PadLoads& loads_dot) {
  const CompiledLayer& layer = *sensor_->layer;
  std::vector<Vec3<double>> slants_dot;
  std::vector<double> depth_dot(depth_.size()), pressure_dot(depth_.size());
  for (const Point& p : points_) {
    const auto target = static_cast<std::size_t>(p.target);
    const LayerDepth<D> at = moved(p, touches[target], sizes[target], material_dot.thickness);
    depth_dot[place(p)] = at.depth.epsilon;
    slants_dot.push_back({at.slant.x.epsilon, at.slant.y.epsilon, at.slant.z.epsilon});
  }
  double own_dot = 0;
  for_each_law([&](auto& law, std::size_t first, std::size_t count) {
    const auto dot = std::span(depth_dot).subspan(first, count),
               to = std::span(pressure_dot).subspan(first, count);
    if constexpr (requires { law.push_forward(dot, to); })
      law.push_forward(dot, to);
    else
      law.push_forward(dot, material_dot, to);
  });
  if (layer.feedback) own_dot = layer.own_change(material_dot);
  std::fill(field_dot.begin(), field_dot.end(), 0.0);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    const Vec3<double>& slant_dot = slants_dot[i];
    const double load = layer.area * pressure(p),
                 load_dot = layer.area * pressure_dot[place(p)] + load * stiffness_dot / kn_;
    Vec3<double> f = load_dot * in_field(p.at.slant) + load * in_field(slant_dot);
    if (p.normal > 0) {
      const Friction now = friction_at(p);
      const Vec3<double> n = vector_at(normal_, p.index),
                         n_dot = vector_at(springs_dot.normal, p.index),
                         springs = vector_at(springs_dot.whole, p.index) - n_dot;
      const double size = std::sqrt(dot(p.at.slant, p.at.slant));
      const Vec3<double> m_dot =
          (1 / size) * in_field(slant_dot) -
          (dot(p.at.slant, slant_dot) / (size * size * size)) * in_field(p.at.slant);
      const Vec3<double> along_dot =
          springs - dot(now.normal, now.springs) * m_dot -
          (dot(m_dot, now.springs) + dot(now.normal, springs)) * now.normal;
      const double held = friction_load(p), slope = held > 0 ? point_stiffness() : 0,
                   held_dot =
                       held < load
                           ? slope * depth_dot[place(p)] +
                                 held * (stiffness_dot / kn_ - own_dot / layer.compliance.own)
                           : load_dot,
                   inverse = 1 / p.normal,
                   inverse_dot = -dot(n, n_dot) * inverse * inverse * inverse;
      f += (held_dot * inverse + held * inverse_dot) * now.along + (held * inverse) * along_dot;
    }
    add_force(field_dot, p.index, f);
  }
  if (layer.load_control) add_approach(loads_dot, material_dot, field_dot);
}

// --- load control ---

/// The component of a field that is its pressing force.
Vec3<double> LayeredField::pressing_direction() const {
  const double third = pad_.skewed ? pad_.axes[8] : -1;
  return {0, 0, -sensor_->layer->outward / third};
}

/// The pressing force of a point by its load.
double LayeredField::pressing_share(const Point& p) const {
  if (!(p.normal > 0)) return 1;
  return 1 + dot(pressing_direction(), friction_at(p).along) / p.normal;
}

/// Whether the cotangents of depth and slant of a point may be other numbers than zero.
bool LayeredField::has_cotangent(const Point& p) const {
  return pressure(p) > 0 || depth_bar_[place(p)] != 0;
}

void LayeredField::solve_loads(const SpringFields& springs, const PadLoads& loads, double modulus) {
  control_.solve(
      *sensor_->layer, modulus, loads,
      [&](double above) -> std::span<const LoadControl::Point> {
        find_points(springs, above);
        loaded_.clear();
        for (const Point& p : points_)
          loaded_.push_back({p.index, p.at.depth, p.xi.x, p.xi.y, pressing_share(p)});
        return loaded_;
      },
      layers_[0]);
}

/// Returns the cotangent of shift and tilts from that of the depths.
std::array<double, 3> LayeredField::approach_bar() const {
  std::array<double, 3> sum{};
  for (std::size_t i = 0; i < points_.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<double, 3> unit{};
      unit[k] = 1;
      sum[k] += depth_bar_[place(points_[i])] * control_.along(unit, loaded_[i]);
    }
  return sum;
}

/// Sets λ from the cotangent of the field at constant loads.
void LayeredField::find_lambda(std::span<const double> field_bar) {
  const CompiledLayer& layer = *sensor_->layer;
  for (const Point& p : points_) {
    const Vec3<double> bar = vector_at(field_bar, p.index);
    double load_bar = dot(bar, in_field(p.at.slant));
    if (p.normal > 0 && friction_) load_bar += dot(bar, friction_at(p).along) / p.normal;
    load_bar_[place(p)] = layer.area * load_bar;
  }
  layers_[0].pull_back(load_bar_, depth_bar_);
  lambda_ = control_.pull_back(approach_bar());
}

/// Adds what the change of shift and tilts changes.
void LayeredField::add_approach(const PadLoads& loads_dot, const LayerMaterial& material_dot,
                                std::span<double> field_dot) {
  PadLoads carried{};
  for (const Point& p : points_) {
    const double force = dot(pressing_direction(), vector_at(field_dot, p.index));
    carried[0] += force, carried[1] += force * p.xi.x, carried[2] += force * p.xi.y;
  }
  const std::array<double, 3> change =
      control_.push_forward(loads_dot, carried, material_dot.thickness);
  std::vector<double> depth_dot(depth_.size()), pressure_dot(depth_.size());
  for (std::size_t i = 0; i < points_.size(); ++i)
    depth_dot[place(points_[i])] = control_.along(change, loaded_[i]);
  layers_[0].push_forward(depth_dot, {}, pressure_dot);
  for (const Point& p : points_) {
    Vec3<double> f = in_field(p.at.slant);
    if (p.normal > 0) f += (1 / p.normal) * friction_at(p).along;
    add_force(field_dot, p.index, (sensor_->layer->area * pressure_dot[place(p)]) * f);
  }
}

}  // namespace tangere
