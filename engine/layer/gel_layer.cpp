// SPDX-License-Identifier: Apache-2.0
// The layer is solved with E = 1: its pressures are proportional to E. Sums run over points and
// cells in order, so that results depend on the depths alone.
#include "engine/layer/gel_layer.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

constexpr double kRounding = 1e-13;  ///< relative, of depths and of a sweep's largest change
constexpr double kEnough = 1e-9;     ///< relative, of the last sweep's largest change
constexpr int kMostWarm = 3;         ///< systems from the last solution
constexpr double kClear = 1e-10;     ///< relative, of what presses or does not, beyond rounding

}  // namespace

std::size_t GelLayer::cell(int point) const {
  return static_cast<std::size_t>(layer_->cell_of_point[static_cast<std::size_t>(point)]);
}

/// C' between two cells.
double GelLayer::coupling(int i, int j) const {
  const auto n = static_cast<std::size_t>(layer_->grid.cells());
  const double c = layer_->compliance.table[static_cast<std::size_t>(i) * n + std::size_t(j)];
  return i == j ? c - layer_->compliance.own : c;
}

/// Computes C' x at the cells `to`, where x is zero outside `from`.
void GelLayer::couple(const std::vector<int>& from, const std::vector<double>& x,
                      const std::vector<int>& to, std::vector<double>& out) const {
  for (const int i : to) {
    double sum = 0;
    for (const int j : from) sum += coupling(i, j) * x[static_cast<std::size_t>(j)];
    out[static_cast<std::size_t>(i)] = sum;
  }
}

/// Returns B x of a point, where x is `yield_`.
double GelLayer::between_cells(int point) const {
  const CellWeights& w = layer_->weights[static_cast<std::size_t>(point)];
  double sum = 0;
  for (std::size_t k = 0; k < w.cell.size(); ++k)
    sum += w.weight[k] * yield_[static_cast<std::size_t>(w.cell[k])];
  return sum;
}

/// Sets which points press at the present yield. Returns whether any changed by more than rounding.
bool GelLayer::update_pressing() {
  bool changed = false;
  for (const int s : touching_) {
    const double excess = depth_[static_cast<std::size_t>(s)] - yield_[cell(s)];
    char& presses = presses_[static_cast<std::size_t>(s)];
    const char now = excess > 0 ? 1 : 0;
    if (now == presses || std::abs(excess) <= rounding_) continue;
    count_[cell(s)] += now - presses;
    presses = now;
    changed = true;
  }
  return changed;
}

/// Lists the pressing cells, and sets their mean depths and the factor of M.
void GelLayer::set_up() {
  pressing_.clear();
  for (const int i : near_) {
    mean_[static_cast<std::size_t>(i)] = 0;
    if (count_[static_cast<std::size_t>(i)] > 0) pressing_.push_back(i);
  }
  for (const int s : touching_)
    if (presses_[static_cast<std::size_t>(s)] != 0)
      mean_[cell(s)] += depth_[static_cast<std::size_t>(s)];
  for (const int i : pressing_)
    mean_[static_cast<std::size_t>(i)] /= count_[static_cast<std::size_t>(i)];
  bool same = factored_.size() == 2 * pressing_.size();
  for (std::size_t a = 0; a < pressing_.size() && same; ++a)
    same = factored_[2 * a] == pressing_[a] &&
           factored_[2 * a + 1] == count_[static_cast<std::size_t>(pressing_[a])];
  if (!same) factor();
}

/// Factors M of the pressing cells.
void GelLayer::factor() {
  const std::size_t n = pressing_.size();
  factored_.clear();
  for (const int i : pressing_)
    factored_.push_back(i), factored_.push_back(count_[static_cast<std::size_t>(i)]);
  factor_.resize(n * n);
  for (std::size_t a = 0; a < n; ++a) {
    double* const u = &factor_[a * n];
    for (std::size_t b = a; b < n; ++b) u[b] = coupling(pressing_[a], pressing_[b]);
    u[a] += layer_->compliance.own * layer_->side * layer_->side /
            count_[static_cast<std::size_t>(pressing_[a])];
  }
  kernels::active_kernels().factor_layer(factor_.data(), static_cast<int>(n));
}

/// Solves M x = rhs_ in place.
void GelLayer::solve_system() {
  kernels::active_kernels().solve_layer(factor_.data(), static_cast<int>(pressing_.size()),
                                        rhs_.data());
}

/// Returns P of one cell where all others stay as they are: the root of
/// k Σ max(0, δ - others - C' P)/m² - P, which falls with P.
double GelLayer::relaxed(int i) {
  const auto at = static_cast<std::size_t>(i);
  const double own = coupling(i, i), others = yield_[at] - own * load_[at];
  std::vector<double>& free = rhs_;  // depths that the others leave
  free.clear();
  for (const int s : touching_)
    if (cell(s) == at) free.push_back(depth_[static_cast<std::size_t>(s)] - others);
  const auto excess = [&](double p) {
    double sum = 0;
    for (const double d : free) sum += std::max(0.0, d - own * p);
    return stiffness_ * sum / (layer_->side * layer_->side) - p;
  };
  // It falls by 1 + k C' n/m² ≥ min(1, k C(i, i)) with P, where k C' may be negative at free sides.
  const double fall = std::min(1.0, 1 + stiffness_ * own);
  double low = 0, high = std::max(excess(0), 0.0) / fall;
  while (high > low) {
    const double middle = low + 0.5 * (high - low);
    if (middle <= low || middle >= high) break;
    (excess(middle) > 0 ? low : high) = middle;
  }
  return low;
}

/// Writes the solution in rhs_ to its cells, and 0 to the other near ones.
void GelLayer::put_solution(std::vector<double>& cells) const {
  for (const int i : near_) cells[static_cast<std::size_t>(i)] = 0;
  for (std::size_t a = 0; a < rhs_.size(); ++a)
    cells[static_cast<std::size_t>(pressing_[a])] = rhs_[a];
}

/// Changes one cell after the other until nothing changes. The energy is convex, so this ends where
/// Newton's method may cycle. Returns whether the last change was small enough.
bool GelLayer::relax() {
  std::fill(load_.begin(), load_.end(), 0.0);
  double change = HUGE_VAL, most = 0;
  for (int sweep = 0; sweep < layer_->most_sweeps; ++sweep) {
    change = most = 0;
    for (const int i : near_) {
      couple(near_, load_, {i}, yield_);
      const double now = relaxed(i);
      change = std::max(change, std::abs(now - load_[static_cast<std::size_t>(i)]));
      most = std::max(most, now);
      load_[static_cast<std::size_t>(i)] = now;
    }
    if (change <= kRounding * most) break;
  }
  couple(near_, load_, near_, yield_);
  return change <= kEnough * most;
}

/// Sets r, R and p from P and w.
void GelLayer::share_loads() {
  const int whole = layer_->side * layer_->side;
  for (const int i : near_) sum_[static_cast<std::size_t>(i)] = 0;
  for (const int s : touching_) {
    if (layer_->feedback) break;
    const auto at = static_cast<std::size_t>(s);
    left_[at] = std::max(0.0, depth_[at] - between_cells(s));
    sum_[cell(s)] += left_[at];
  }
  for (const int s : touching_) {
    const auto at = static_cast<std::size_t>(s);
    const std::size_t i = cell(s);
    const double own = sum_[i] > 0         ? whole * load_[i] * left_[at] / sum_[i]
                       : presses_[at] != 0 ? stiffness_ * std::max(0.0, depth_[at] - yield_[i])
                                           : 0;
    pressure_[at] = modulus_ * own;
  }
}

std::vector<double> GelLayer::loads() const {
  std::vector<double> out;
  for (const double p : load_) out.push_back(modulus_ * p);
  return out;
}

/// Lists the points that may press, and cells that they are in; of a reading also near.
void GelLayer::find_touching(std::span<const double> depth) {
  const auto cells = static_cast<std::size_t>(layer_->grid.cells());
  depth_.assign(depth.begin(), depth.end());
  presses_.assign(depth.size(), 0);
  count_.assign(cells, 0);
  for (auto* x : {&left_, &pressure_}) x->assign(depth.size(), 0.0);
  for (auto* x : {&mean_, &load_, &yield_, &sum_, &load_bar_, &yield_bar_}) x->assign(cells, 0.0);
  touching_.clear(), near_.clear(), pressing_.clear();
  std::vector<double>& marks = sum_;
  double most = 0;
  for (std::size_t s = 0; s < depth.size(); ++s) {
    if (!(depth[s] > least_depth(*layer_))) continue;
    touching_.push_back(static_cast<int>(s));
    most = std::max(most, depth[s]);
    marks[cell(static_cast<int>(s))] = 1;
    if (layer_->feedback) continue;
    for (const int i : layer_->weights[s].cell) marks[static_cast<std::size_t>(i)] = 1;
  }
  for (std::size_t i = 0; i < cells; ++i)
    if (marks[i] > 0) near_.push_back(static_cast<int>(i));
  rounding_ = kRounding * most;
}

/// Computes P and w where the present points press.
void GelLayer::solve_pressing() {
  ++systems_;
  set_up();
  rhs_.clear();
  for (const int i : pressing_) rhs_.push_back(mean_[static_cast<std::size_t>(i)]);
  solve_system();
  put_solution(load_);
  // Of a contact, w = δ̄ - P m²/(k n) on pressing cells, which costs no product.
  const double whole = layer_->side * layer_->side * layer_->compliance.own;
  idle_.clear();
  for (const int i : near_)
    if (count_[static_cast<std::size_t>(i)] == 0 || !layer_->feedback) idle_.push_back(i);
  kernels::active_kernels().couple_cells({layer_->compliance.table.data(), layer_->grid.cells(),
                                          pressing_.data(), rhs_.data(),
                                          static_cast<int>(pressing_.size()), idle_.data(),
                                          static_cast<int>(idle_.size()), yield_.data()});
  for (const int i : pressing_) {
    const auto at = static_cast<std::size_t>(i);
    yield_[at] = layer_->feedback ? mean_[at] - whole / count_[at] * load_[at]
                                  : yield_[at] - layer_->compliance.own * load_[at];
  }
}

/// Whether every point presses, or does not, by more than rounding. Then no other set of points
/// solves the layer.
bool GelLayer::is_clear() const {
  return std::ranges::none_of(touching_, [&](int s) {
    const double excess = depth_[static_cast<std::size_t>(s)] - yield_[cell(s)];
    return std::abs(excess) <= kClear / kRounding * rounding_;
  });
}

/// Begins with the points of the last solution. Returns false where the result is not the only one.
bool GelLayer::solve_warm() {
  bool any = false;
  for (const int s : last_pressing_) {
    if (!(depth_[static_cast<std::size_t>(s)] > least_depth(*layer_))) continue;
    presses_[static_cast<std::size_t>(s)] = 1;
    ++count_[cell(s)];
    any = true;
  }
  bool changed = any;
  for (int k = 0; changed && k < kMostWarm; ++k) {
    solve_pressing();
    changed = update_pressing();
  }
  if (any && !changed && is_clear()) return true;
  std::fill(presses_.begin(), presses_.end(), 0);
  for (const int i : near_) {
    const auto at = static_cast<std::size_t>(i);
    count_[at] = 0, load_[at] = yield_[at] = 0;
  }
  pressing_.clear();
  return false;
}

void GelLayer::solve_cold() {
  bool changed = update_pressing();
  for (int k = 0; changed && k < layer_->most_systems; ++k) {
    solve_pressing();
    changed = update_pressing();
  }
  if (!changed) return;
  solved_ = relax();
  static_cast<void>(update_pressing());
  if (!solved_) return set_up();
  // The bits of a solution do not depend on the way to it, if it is clear what presses.
  solve_pressing();
  if (!update_pressing()) return;
  solved_ = relax();
  static_cast<void>(update_pressing());
  set_up();
}

void GelLayer::solve(const CompiledLayer& layer, std::span<const double> depth, double modulus) {
  if (layer.number == 0 || number_ != layer.number) last_pressing_.clear(), factored_.clear();
  layer_ = &layer;
  number_ = layer.number;
  modulus_ = modulus;
  stiffness_ = 1 / layer.compliance.own;
  solved_ = true;
  systems_ = 0;
  find_touching(depth);
  if (layer.most_systems == 0 || last_pressing_.empty() || !solve_warm()) solve_cold();
  last_pressing_.clear();
  for (const int s : touching_)
    if (presses_[static_cast<std::size_t>(s)] != 0) last_pressing_.push_back(s);
  share_loads();
}

// With q = E p̄ and cells where R > 0: r̄_s = m² P_i/R_i (q_s - Σ q r/R_i), P̄_i = m² Σ q r/R_i,
// w̄ = -Bᵀ r̄; elsewhere δ̄_s = k q_s, w̄_i = -k Σ q. Then P̄ += C' w̄, M λ = P̄, δ̄_s += λ_i/n_i.
void GelLayer::pull_back(std::span<const double> pressure_bar, std::span<double> depth_bar) {
  const int whole = layer_->side * layer_->side;
  std::fill(depth_bar.begin(), depth_bar.end(), 0.0);
  for (const int i : near_)
    load_bar_[static_cast<std::size_t>(i)] = yield_bar_[static_cast<std::size_t>(i)] = 0;
  for (const int s : touching_) {
    const std::size_t i = cell(s), at = static_cast<std::size_t>(s);
    if (sum_[i] > 0) load_bar_[i] += modulus_ * pressure_bar[at] * left_[at] / sum_[i];
  }
  for (const int s : touching_) {
    const std::size_t i = cell(s), at = static_cast<std::size_t>(s);
    const double q = modulus_ * pressure_bar[at];
    if (sum_[i] > 0) {
      if (!(left_[at] > 0)) continue;
      depth_bar[at] = whole * load_[i] / sum_[i] * (q - load_bar_[i]);
      const CellWeights& w = layer_->weights[at];
      for (std::size_t k = 0; k < w.cell.size(); ++k)
        yield_bar_[static_cast<std::size_t>(w.cell[k])] -= w.weight[k] * depth_bar[at];
    } else if (presses_[at] != 0) {
      depth_bar[at] = stiffness_ * q;
      yield_bar_[i] -= stiffness_ * q;
    }
  }
  rhs_.clear();
  for (const int i : pressing_) {
    double sum = whole * load_bar_[static_cast<std::size_t>(i)];
    for (const int j : near_) sum += coupling(i, j) * yield_bar_[static_cast<std::size_t>(j)];
    rhs_.push_back(sum);
  }
  solve_system();
  put_solution(load_bar_);  // λ
  for (const int s : touching_) {
    const std::size_t i = cell(s), at = static_cast<std::size_t>(s);
    if (presses_[at] != 0) depth_bar[at] += load_bar_[i] / count_[i];
  }
}

/// Computes how C' P of the near cells changes with t and ν where P stays.
void GelLayer::change_coupling(const LayerMaterial& by, std::vector<double>& out) const {
  const LayerSlopes& of = layer_->slopes.at(layer_->grid);
  const auto n = static_cast<std::size_t>(layer_->grid.cells());
  const double own = layer_->own_change(by);
  for (const int i : near_) {
    const auto at = static_cast<std::size_t>(i);
    double sum = -own * load_[at];
    for (const int j : pressing_) {
      const std::size_t cells = at * n + std::size_t(j);
      sum += (by.thickness * of.thickness.table[cells] + by.poisson * of.poisson.table[cells]) *
             load_[static_cast<std::size_t>(j)];
    }
    out[at] = sum;
  }
}

// With λ and w̄ of pull_back(): dL = w̄·dC' P - λ·dM P, dM = dC' + diag(m²/n_i) dC(0), and where
// R is 0, p = k max(0, δ - w) with dk = -k² dC(0).
LayerMaterial GelLayer::pull_back_material(std::span<const double> pressure_bar) const {
  const double whole = layer_->side * layer_->side;
  std::vector<double> change(load_.size());
  const auto along = [&](const LayerMaterial& by) {
    const double own = layer_->own_change(by);
    change_coupling(by, change);
    double sum = 0;
    for (const int i : near_) {
      const auto at = static_cast<std::size_t>(i);
      const double slip = count_[at] > 0 ? load_bar_[at] : 0;
      sum += (yield_bar_[at] - slip) * change[at];
      if (count_[at] > 0) sum -= slip * whole / count_[at] * own * load_[at];
    }
    for (const int s : touching_) {
      const std::size_t i = cell(s), at = static_cast<std::size_t>(s);
      if (sum_[i] > 0 || presses_[at] == 0) continue;
      sum -= modulus_ * pressure_bar[at] * stiffness_ * stiffness_ * own *
             std::max(0.0, depth_[at] - yield_[i]);
    }
    return sum;
  };
  return {along({1, 0}), along({0, 1})};
}

void GelLayer::push_forward(std::span<const double> depth_dot, const LayerMaterial& material_dot,
                            std::span<double> pressure_dot) {
  const int whole = layer_->side * layer_->side;
  const bool changes = material_dot.thickness != 0 || material_dot.poisson != 0;
  const double own_dot = layer_->own_change(material_dot);
  std::vector<double> coupling_dot(changes ? load_.size() : 0);
  if (changes) change_coupling(material_dot, coupling_dot);
  std::vector<double>&load_dot = load_bar_, &yield_dot = yield_bar_;
  for (const int i : near_) load_dot[static_cast<std::size_t>(i)] = 0;
  for (const int s : touching_) {
    const std::size_t i = cell(s), at = static_cast<std::size_t>(s);
    if (presses_[at] != 0) load_dot[i] += depth_dot[at] / count_[i];
  }
  rhs_.clear();
  for (const int i : pressing_) {
    const auto at = static_cast<std::size_t>(i);
    rhs_.push_back(load_dot[at]);
    if (changes) rhs_.back() -= coupling_dot[at] + whole * own_dot / count_[at] * load_[at];
  }
  solve_system();
  put_solution(load_dot);
  couple(pressing_, load_dot, near_, yield_dot);
  for (const int i : near_)
    if (changes)
      yield_dot[static_cast<std::size_t>(i)] += coupling_dot[static_cast<std::size_t>(i)];
  std::vector<double> left_dot(layer_->feedback ? 0 : depth_.size()),
      sum_dot(layer_->feedback ? 0 : sum_.size());
  for (const int s : touching_) {
    if (layer_->feedback) break;
    const auto at = static_cast<std::size_t>(s);
    if (!(left_[at] > 0)) continue;
    const CellWeights& w = layer_->weights[at];
    left_dot[at] = depth_dot[at];
    for (std::size_t k = 0; k < w.cell.size(); ++k)
      left_dot[at] -= w.weight[k] * yield_dot[static_cast<std::size_t>(w.cell[k])];
    sum_dot[cell(s)] += left_dot[at];
  }
  std::fill(pressure_dot.begin(), pressure_dot.end(), 0.0);
  for (const int s : touching_) {
    const std::size_t i = cell(s), at = static_cast<std::size_t>(s);
    double own = 0;
    if (sum_[i] > 0)
      own =
          whole / sum_[i] *
          (load_dot[i] * left_[at] + load_[i] * (left_dot[at] - left_[at] * sum_dot[i] / sum_[i]));
    else if (presses_[at] != 0)
      own = stiffness_ * (depth_dot[at] - yield_dot[i] -
                          stiffness_ * own_dot * std::max(0.0, depth_[at] - yield_[i]));
    pressure_dot[at] = modulus_ * own;
  }
}

void GelLayer::clear_cells(AlignedVector<double>& cells) const {
  cells.resize(kernels::kCellNumbers * count_.size());
  for (const int i : pressing_)
    std::fill_n(&cells[kernels::kCellNumbers * std::size_t(i)], kernels::kCellNumbers, 0.0);
}

void GelLayer::add_yield_slopes(const kernels::KernelTable& table,
                                const AlignedVector<double>& cells, std::span<double> rows) {
  work_.resize(kernels::kCellWrench * pressing_.size());
  const double whole = layer_->side * layer_->side * layer_->compliance.own;
  table.add_yield_slopes({factor_.data(), static_cast<int>(pressing_.size()), factored_.data(),
                          factored_.data() + 1, 2, whole, cells.data(), work_.data(), rows.data()});
}

}  // namespace tangere
