// SPDX-License-Identifier: Apache-2.0
// Every solution begins without shift and tilts, so that its bits depend on depths and loads alone.
#include "engine/layer/load_control.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/vector3.hpp"

namespace tangere {
namespace {

constexpr double kMostShift = 1, kMostTilt = 0.5;  // by the thickness
constexpr double kBulge = 0.1;       // by the thickness: what the bulge beside a press may touch
constexpr double kFirst = 0.1;       // by the thickness: ten times the depth of a first touch
constexpr double kStep = 0.02;       // by the thickness: a step changes depths by at least as much
constexpr double kMoreReach = 1.25;  // of a reach that grows
constexpr double kExact = 2e-14, kResidual = 5e-13;  // residuals by the loads
constexpr double kSingular = 1e-9, kLift = 1e-6;     // pivots by the trace, and what is added then
constexpr double kAtEnd = 1e-12;                     // relative, of an end
constexpr double kRoundedShare = 2e-15;              // of slopes times approach
constexpr int kMostSteps = 400, kMostTrials = 30;

double size_of(const std::array<double, 3>& a) {
  return std::abs(a[0]) + std::abs(a[1]) + std::abs(a[2]);
}

}  // namespace

/// The largest value of a component of a.
double LoadControl::end(std::size_t k) const {
  return (k == 0 ? kMostShift : kMostTilt) * layer_->grid.thickness;
}

LoadControl::Three LoadControl::scaled(const PadLoads& loads) const {
  return {loads[0], loads[1] / half_[0], loads[2] / half_[1]};
}

/// Solves the layer at an approach, and sets r. Points above the bulge cannot press.
void LoadControl::evaluate(const Three& approach) {
  const double t = layer_->grid.thickness, needed = size_of(approach) + kBulge * t;
  if (!(reach_ >= needed)) {
    reach_ = kMoreReach * needed;
    points_ = (*list_)(reach_);
  }
  approach_ = approach;
  depth_.assign(layer_->cell_of_point.size(), -HUGE_VAL);
  for (const Point& p : points_) {
    const double depth = p.depth + along(approach, p);
    if (depth > -kBulge * t) depth_[static_cast<std::size_t>(p.index)] = depth;
  }
  law_->solve(*layer_, depth_, modulus_);
  for (std::size_t k = 0; k < 3; ++k) residual_[k] = -target_[k];
  for (const Point& p : points_) {
    const double force =
        p.share * layer_->area * law_->pressure()[static_cast<std::size_t>(p.index)];
    residual_[0] += force;
    residual_[1] += force * p.x / half_[0];
    residual_[2] += force * p.y / half_[1];
  }
}

bool LoadControl::presses() const {
  return std::ranges::any_of(law_->pressure(), [](double p) { return p > 0; });
}

/// Lets nothing press.
void LoadControl::release() {
  depth_.assign(layer_->cell_of_point.size(), -HUGE_VAL);
  law_->solve(*layer_, depth_, modulus_);
  for (std::size_t k = 0; k < 3; ++k) residual_[k] = -target_[k], ends_[k] = 1;
}

/// Shifts the depths until a point presses. Returns whether there is one within the largest shift.
bool LoadControl::begin_press() {
  const double t = layer_->grid.thickness;
  first_ *= 0.1;
  if (points_.empty()) {
    reach_ = kMoreReach * (kMostShift + 2 * kMostTilt + kBulge) * t;
    points_ = (*list_)(reach_);
  }
  double highest = -HUGE_VAL;
  for (const Point& p : points_) highest = std::max(highest, p.depth + along(approach_, p));
  Three next = approach_;
  next[0] = std::min(end(0), next[0] - highest + first_ * t);
  if (points_.empty() || next[0] <= approach_[0]) return false;
  evaluate(next);
  return presses();
}

void LoadControl::find_slopes() {
  change_.assign(depth_.size(), 0.0);
  change_of_pressure_.resize(depth_.size());
  for (std::size_t k = 0; k < 3; ++k) {
    Three unit{};
    unit[k] = 1;
    for (const Point& p : points_) change_[static_cast<std::size_t>(p.index)] = along(unit, p);
    law_->push_forward(change_, {}, change_of_pressure_);
    for (Three& row : slopes_) row[k] = 0;
    for (const Point& p : points_) {
      const double force =
          p.share * layer_->area * change_of_pressure_[static_cast<std::size_t>(p.index)];
      slopes_[0][k] += force;
      slopes_[1][k] += force * p.x / half_[0];
      slopes_[2][k] += force * p.y / half_[1];
    }
  }
}

/// Chooses the components of a that stay at an end.
void LoadControl::choose_ends() {
  for (std::size_t k = 0; k < 3; ++k) {
    ends_[k] = 0;
    if (approach_[k] >= end(k) && residual_[k] < 0) ends_[k] = 1;
    if (k > 0 && approach_[k] <= -end(k) && residual_[k] > 0) ends_[k] = -1;
  }
}

double LoadControl::largest_residual() const {
  double most = 0;
  for (std::size_t k = 0; k < 3; ++k)
    if (ends_[k] == 0) most = std::max(most, std::abs(residual_[k]));
  return most;
}

/// Solves ∂r/∂a x = rhs, or its transpose, for the free components; the others are zero. Where it
/// is singular, because what presses lies on a line, something is added to its diagonal.
LoadControl::Three LoadControl::solve_free(Three rhs, bool transposed) const {
  double trace = 0;
  for (std::size_t k = 0; k < 3; ++k) trace += slopes_[k][k];
  for (const double lift : {0.0, kLift * trace}) {
    std::array<Three, 3> m{};
    Three x = rhs;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j)
        if (ends_[i] == 0 && ends_[j] == 0) m[i][j] = transposed ? slopes_[j][i] : slopes_[i][j];
      m[i][i] += ends_[i] == 0 ? lift : trace;
      if (ends_[i] != 0) x[i] = 0;
    }
    bool regular = true;
    for (std::size_t k = 0; k < 3; ++k) {
      std::size_t best = k;
      for (std::size_t i = k + 1; i < 3; ++i)
        if (std::abs(m[i][k]) > std::abs(m[best][k])) best = i;
      std::swap(m[k], m[best]), std::swap(x[k], x[best]);
      regular = regular && std::abs(m[k][k]) > kSingular * trace;
      for (std::size_t i = k + 1; i < 3; ++i) {
        const double factor = m[i][k] / m[k][k];
        for (std::size_t j = k; j < 3; ++j) m[i][j] -= factor * m[k][j];
        x[i] -= factor * x[k];
      }
    }
    if (!regular && lift == 0) continue;
    for (std::size_t k = 3; k-- > 0;) {
      for (std::size_t j = k + 1; j < 3; ++j) x[k] -= m[k][j] * x[j];
      x[k] /= m[k][k];
    }
    return x;
  }
  return {};
}

/// Returns Newton's step, no longer than the layer is deep, and within the ends. A component that
/// would leave its end stays there.
LoadControl::Three LoadControl::direction() {
  Three d;
  for (bool inside = false; !inside;) {
    d = solve_free({-residual_[0], -residual_[1], -residual_[2]}, false);
    inside = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const int side = approach_[k] >= end(k) ? 1 : k > 0 && approach_[k] <= -end(k) ? -1 : 0;
      if (side * d[k] > 0) ends_[k] = side, inside = false;
    }
  }
  double deepest = kStep * layer_->grid.thickness;
  for (const Point& p : points_) deepest = std::max(deepest, p.depth + along(approach_, p));
  double share = std::min(1.0, deepest / size_of(d));
  for (std::size_t k = 0; k < 3; ++k) {
    const double next = approach_[k] + share * d[k];
    if (next > end(k)) share = (end(k) - approach_[k]) / d[k];
    if (k > 0 && next < -end(k)) share = (-end(k) - approach_[k]) / d[k];
  }
  for (double& x : d) x *= share;
  return d;
}

/// Goes along a direction until r no longer falls along it: the whole way, or to a place between.
void LoadControl::step(const Three& direction) {
  const Three from = approach_;
  const double start = dot(residual_, direction);
  const bool last = largest_residual() <= kResidual * size_of(target_);  // but for rounding
  double low = 0, high = 1, fall = start, rise = 0, share = 1;
  for (int trial = 0; trial < kMostTrials; ++trial) {
    Three next = from;
    for (std::size_t k = 0; k < 3; ++k) {
      next[k] += share * direction[k];
      if (std::abs(std::abs(next[k]) - end(k)) <= kAtEnd * end(k))
        next[k] = std::copysign(end(k), next[k]);
    }
    evaluate(next);
    const double here = dot(residual_, direction);
    if (last) return;
    if (here <= -0.5 * start && (share == 1 || here >= 0.5 * start)) return;
    if (here > 0)
      high = share, rise = here;
    else
      low = share, fall = here;
    const double secant = std::clamp(fall / (fall - rise), 0.1, 0.9);
    share = low + (high - low) * (trial % 2 == 0 ? secant : 0.5);
  }
}

void LoadControl::solve(const CompiledLayer& layer, double modulus, const PadLoads& loads,
                        const Points& points, GelLayer& law) {
  layer_ = &layer, list_ = &points, law_ = &law;
  modulus_ = modulus;
  half_ = {0.5 * layer.grid.height * layer.grid.rows, 0.5 * layer.grid.width * layer.grid.cols};
  target_ = scaled(loads);
  approach_ = {}, ends_ = {}, slopes_ = {};
  reach_ = 0, points_ = {};
  first_ = kFirst;
  const double load = size_of(target_);
  solved_ = std::isfinite(load), carries_ = load == 0;
  evaluate(approach_);  // lists points as well where there is no load
  if (!solved_ || !(target_[0] > 0)) return release();
  double last = HUGE_VAL;
  for (int k = 0; k < kMostSteps; ++k) {
    if (!presses() && !begin_press()) return release();
    choose_ends();
    const double now = largest_residual();
    find_slopes();
    // Depths of the size of the approach are rounded, and forces change by slopes times that.
    const double rounding =
        kRoundedShare * (slopes_[0][0] + slopes_[1][1] + slopes_[2][2]) * size_of(approach_);
    if (now <= kExact * load) break;
    if (now <= std::max(kResidual * load, rounding) && now > 0.5 * last) break;
    solved_ = law.solved();
    if (!solved_ || k + 1 == kMostSteps) return;
    last = now;
    step(direction());
  }
  carries_ = ends_ == std::array<int, 3>{};
}

std::array<double, 3> LoadControl::pull_back(const std::array<double, 3>& approach_bar) const {
  return slopes_[0][0] > 0 ? solve_free(approach_bar, true) : Three{};
}

PadLoads LoadControl::loads_bar(const std::array<double, 3>& lambda) const {
  return scaled(lambda);
}

double LoadControl::thickness_bar(const std::array<double, 3>& approach_bar) const {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k)
    sum += ends_[k] * end(k) / layer_->grid.thickness * approach_bar[k];
  return sum;
}

std::array<double, 3> LoadControl::push_forward(const PadLoads& loads_dot,
                                                const PadLoads& carried_dot,
                                                double thickness_dot) const {
  if (!(slopes_[0][0] > 0)) return {};
  const Three loads = scaled(loads_dot), carried = scaled(carried_dot);
  Three at_ends{}, rhs{};
  for (std::size_t k = 0; k < 3; ++k)
    at_ends[k] = ends_[k] * end(k) / layer_->grid.thickness * thickness_dot;
  for (std::size_t k = 0; k < 3; ++k) rhs[k] = loads[k] - carried[k] - dot(slopes_[k], at_ends);
  Three out = solve_free(rhs, false);
  for (std::size_t k = 0; k < 3; ++k) out[k] += at_ends[k];
  return out;
}

}  // namespace tangere
