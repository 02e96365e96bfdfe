// SPDX-License-Identifier: Apache-2.0
// The layer is solved with E = 1: its pressures are proportional to E. Sums run over cells in order,
// and the factorisation adds rows to rows, so that results depend on the depths alone.
#include "engine/sense/gel_layer.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

/// Newton iterations before relaxation takes over. Two to four are usual.
constexpr int kMostSystems = 30;
constexpr int kMostSweeps = 10000;
constexpr double kRelaxed = 1e-15;  ///< largest change of a sweep, relative

}  // namespace

/// Sets which points press at the present yield. Returns whether any changed.
bool GelLayer::update_pressing() {
  const std::vector<int>& cell = layer_->cell_of_point;
  bool changed = false;
  for (std::size_t s = 0; s < depth_.size(); ++s) {
    if (!(depth_[s] > 0)) continue;
    const auto i = static_cast<std::size_t>(cell[s]);
    const char now = depth_[s] > yield_[i] ? 1 : 0;
    count_[i] += now - presses_[s];
    changed |= now != presses_[s];
    presses_[s] = now;
  }
  return changed;
}

/// C' between two cells.
double GelLayer::coupling(int i, int j) const {
  const CompiledLayer& layer = *layer_;
  const auto n = static_cast<std::size_t>(layer.grid.cells());
  const double c = layer.compliance.table[static_cast<std::size_t>(i) * n + std::size_t(j)];
  return i == j ? c - layer.compliance.own : c;
}

/// Computes w = C' P of some cells. P is zero outside `pressing_`.
void GelLayer::yield_of(std::span<const int> cells) {
  for (const int i : cells) {
    double sum = 0;
    for (const int j : pressing_) sum += coupling(i, j) * load_[static_cast<std::size_t>(j)];
    yield_[static_cast<std::size_t>(i)] = sum;
  }
}

/// Lists the pressing cells, and sets their mean depths and the factor of M.
void GelLayer::set_up() {
  const std::vector<int>& cell = layer_->cell_of_point;
  pressing_.clear();
  for (const int i : near_)
    if (count_[static_cast<std::size_t>(i)] > 0) pressing_.push_back(i);
  std::fill(mean_.begin(), mean_.end(), 0.0);
  for (std::size_t s = 0; s < depth_.size(); ++s)
    if (presses_[s] != 0) mean_[static_cast<std::size_t>(cell[s])] += depth_[s];
  for (const int i : pressing_)
    mean_[static_cast<std::size_t>(i)] /= count_[static_cast<std::size_t>(i)];
  factor();
}

/// Factors M of the pressing cells, right-looking: rows are added to rows.
void GelLayer::factor() {
  const CompiledLayer& layer = *layer_;
  const std::size_t n = pressing_.size();
  factor_.resize(n * n);
  for (std::size_t a = 0; a < n; ++a) {
    double* const u = &factor_[a * n];
    for (std::size_t b = a; b < n; ++b) u[b] = coupling(pressing_[a], pressing_[b]);
    u[a] += layer.compliance.own * layer.side * layer.side /
            count_[static_cast<std::size_t>(pressing_[a])];
  }
  for (std::size_t a = 0; a < n; ++a) {
    double* const u = &factor_[a * n];
    const double inverse = 1 / std::sqrt(u[a]);
    for (std::size_t b = a; b < n; ++b) u[b] *= inverse;
    for (std::size_t b = a + 1; b < n; ++b) {
      double* const below = &factor_[b * n];
      const double f = u[b];
      for (std::size_t c = b; c < n; ++c) below[c] -= f * u[c];
    }
  }
}

/// Solves M x = rhs_ in place.
void GelLayer::solve_system() {
  const std::size_t n = pressing_.size();
  std::vector<double>& x = rhs_;
  for (std::size_t a = 0; a < n; ++a) {
    const double* const u = &factor_[a * n];
    x[a] /= u[a];
    for (std::size_t b = a + 1; b < n; ++b) x[b] -= u[b] * x[a];
  }
  for (std::size_t a = n; a-- > 0;) {
    const double* const u = &factor_[a * n];
    for (std::size_t b = a + 1; b < n; ++b) x[a] -= u[b] * x[b];
    x[a] /= u[a];
  }
}

/// Returns P of one cell where all others stay as they are: the root of
/// k Σ max(0, δ - others - C' P)/m² - P, which falls with P.
double GelLayer::relaxed(int cell) const {
  const CompiledLayer& layer = *layer_;
  const double own = coupling(cell, cell), others = yield_[static_cast<std::size_t>(cell)] -
                                                    own * load_[static_cast<std::size_t>(cell)];
  const auto excess = [&](double p) {
    double sum = 0;
    for (std::size_t s = 0; s < depth_.size(); ++s)
      if (layer.cell_of_point[s] == cell && depth_[s] > 0)
        sum += std::max(0.0, depth_[s] - others - own * p);
    return stiffness_ * sum / (layer.side * layer.side) - p;
  };
  double low = 0, high = std::max(excess(0), 0.0);
  while (high > low) {
    const double middle = low + 0.5 * (high - low);
    if (middle <= low || middle >= high) break;
    (excess(middle) > 0 ? low : high) = middle;
  }
  return low;
}

/// Changes one cell after the other until nothing changes. The energy is convex, so this ends where
/// Newton's method might go in circles.
void GelLayer::relax() {
  std::fill(load_.begin(), load_.end(), 0.0);
  pressing_ = near_;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    double change = 0, most = 0;
    for (const int i : near_) {
      yield_of({&i, 1});
      const double now = relaxed(i);
      change = std::max(change, std::abs(now - load_[static_cast<std::size_t>(i)]));
      most = std::max(most, now);
      load_[static_cast<std::size_t>(i)] = now;
    }
    if (change <= kRelaxed * most) break;
  }
  yield_of(near_);
}

void GelLayer::solve(const CompiledLayer& layer, std::span<const double> depth, double modulus) {
  layer_ = &layer;
  modulus_ = modulus;
  stiffness_ = 1 / layer.compliance.own;
  const auto cells = static_cast<std::size_t>(layer.grid.cells());
  depth_.assign(depth.begin(), depth.end());
  presses_.assign(depth.size(), 0);
  count_.assign(cells, 0);
  for (auto* x : {&mean_, &load_, &yield_}) x->assign(cells, 0.0);
  bool changed = update_pressing();
  near_.clear();
  for (int i = 0; i < layer.grid.cells(); ++i)
    if (count_[static_cast<std::size_t>(i)] > 0) near_.push_back(i);
  pressing_.clear();
  for (systems_ = 0; changed && systems_ < kMostSystems; ++systems_) {
    set_up();
    rhs_.clear();
    for (const int i : pressing_) rhs_.push_back(mean_[static_cast<std::size_t>(i)]);
    solve_system();
    std::fill(load_.begin(), load_.end(), 0.0);
    for (std::size_t a = 0; a < rhs_.size(); ++a)
      load_[static_cast<std::size_t>(pressing_[a])] = rhs_[a];
    yield_of(near_);
    changed = update_pressing();
  }
  if (changed) {
    relax();
    static_cast<void>(update_pressing());
    set_up();
  }
  pressure_.assign(depth_.size(), 0.0);
  for (std::size_t s = 0; s < depth_.size(); ++s)
    if (presses_[s] != 0)
      pressure_[s] = modulus * stiffness_ *
                     (depth_[s] - yield_[static_cast<std::size_t>(layer.cell_of_point[s])]);
}

// p = E k (δ - w), w = C' P, M dP = dδ̄: δ̄_s = E k p̄_s - λ_i/n_i, M λ = C' a, a_i = E k Σ p̄_s.
void GelLayer::pull_back(std::span<const double> pressure_bar, std::span<double> depth_bar) {
  const std::vector<int>& cell = layer_->cell_of_point;
  const double slope = modulus_ * stiffness_;
  std::fill(load_.begin(), load_.end(), 0.0);  // a
  for (std::size_t s = 0; s < depth_.size(); ++s)
    if (presses_[s] != 0) load_[static_cast<std::size_t>(cell[s])] += slope * pressure_bar[s];
  yield_of(pressing_);
  rhs_.clear();
  for (const int i : pressing_) rhs_.push_back(yield_[static_cast<std::size_t>(i)]);
  solve_system();
  for (std::size_t a = 0; a < rhs_.size(); ++a)
    load_[static_cast<std::size_t>(pressing_[a])] = rhs_[a];  // λ
  for (std::size_t s = 0; s < depth_.size(); ++s) {
    const auto i = static_cast<std::size_t>(cell[s]);
    depth_bar[s] = presses_[s] == 0 ? 0 : slope * pressure_bar[s] - load_[i] / count_[i];
  }
}

void GelLayer::push_forward(std::span<const double> depth_dot, std::span<double> pressure_dot) {
  const std::vector<int>& cell = layer_->cell_of_point;
  std::fill(load_.begin(), load_.end(), 0.0);
  for (std::size_t s = 0; s < depth_.size(); ++s) {
    const auto i = static_cast<std::size_t>(cell[s]);
    if (presses_[s] != 0) load_[i] += depth_dot[s] / count_[i];
  }
  rhs_.clear();
  for (const int i : pressing_) rhs_.push_back(load_[static_cast<std::size_t>(i)]);
  solve_system();
  for (std::size_t a = 0; a < rhs_.size(); ++a)
    load_[static_cast<std::size_t>(pressing_[a])] = rhs_[a];
  yield_of(pressing_);
  for (std::size_t s = 0; s < depth_.size(); ++s)
    pressure_dot[s] =
        presses_[s] == 0
            ? 0
            : modulus_ * stiffness_ * (depth_dot[s] - yield_[static_cast<std::size_t>(cell[s])]);
}

}  // namespace tangere
