// SPDX-License-Identifier: Apache-2.0
// Pressure of a soft layer whose points are coupled (docs/layer.md). The layer is cut into cells i
// of m × m points s. With the depth δ_s of a shape below the pad's surface, along the pad's normal,
// a cell has the load
//   P_i = k Σ max(0, δ_s - w_i)/m²,  w = C' P,  C' = C - I/k,  k = 1/C(0)
// where C is the compliance of engine/model/layer_compliance.hpp. Let n_i points of cell i have
// δ_s > w_i. Then P solves M P = δ̄ on cells with n_i > 0, where δ̄_i is the mean of δ_s over these
// points and M = C' + diag(m²/(k n_i)), which is symmetric and positive definite. Newton's method
// changes n_i until they agree with P. The points of a cell share its load by the depths that the
// layer leaves, with w between cells by bilinear weights B:
//   p_s = m² P_i r_s/R_i,  r = max(0, δ - B w),  R_i = Σ r_s over the cell
// or p_s = k max(0, δ_s - w_i) where R_i is 0, and at all points where the layer is the contact:
// then p is the derivative of an energy by the depths, which is a ½ Σ p_s δ_s, a the area of a
// point.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/compiled_layer.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

/// The depth of a point that nothing can press. Points that only the bulge of the gel may press
/// have negative depths.
inline double least_depth(const CompiledLayer& layer) {
  return layer.feedback || layer.load_control ? -HUGE_VAL : 0;
}

/// Solves one sensor's layer at a time. Owns the scratch of one thread, which grows with the number
/// of cells in contact. A solution begins with the points that pressed in the last one, and uses
/// its factor again where they are the same; its bits depend on the depths alone.
class GelLayer {
 public:
  /// Solves the layer for depths δ, (points) [m], with E = `modulus` [Pa]. Points with
  /// δ ≤ least_depth() do not press. The functions below refer to this solution, which is exact but
  /// for rounding where solved().
  void solve(const CompiledLayer& layer, std::span<const double> depth, double modulus);

  /// p, (points) [Pa]; 0 where a point does not press.
  [[nodiscard]] std::span<const double> pressure() const { return pressure_; }
  /// P, (cells) [Pa].
  [[nodiscard]] std::vector<double> loads() const;
  /// Linear systems that solve() needed.
  [[nodiscard]] int systems() const { return systems_; }
  /// Whether the pressures were found. Two to four systems usually give them; where Newton's method
  /// cycles, relaxation does, up to a limit (CompiledLayer).
  [[nodiscard]] bool solved() const { return solved_; }

  /// Computes the cotangent of the depths, (points), from that of the pressures. Which points press
  /// stays fixed. p is proportional to E.
  void pull_back(std::span<const double> pressure_bar, std::span<double> depth_bar);
  /// Returns the cotangent of t and ν at these depths, after pull_back() of the same cotangent.
  [[nodiscard]] LayerMaterial pull_back_material(std::span<const double> pressure_bar) const;
  /// Computes how the pressures change with the depths, (points), and with t and ν, at a given E.
  void push_forward(std::span<const double> depth_dot, const LayerMaterial& material_dot,
                    std::span<double> pressure_dot);
  /// Sets the sums of pressing cells, (cells, kernels::kCellNumbers), to zero.
  void clear_cells(AlignedVector<double>& cells) const;
  /// Adds what the yield of a layer that is the contact changes in the slopes of a wrench, (6,
  /// kernels::kLayerDirections), from sums of kernels::LayerSlopeSums.
  void add_yield_slopes(const kernels::KernelTable& table, const AlignedVector<double>& cells,
                        std::span<double> rows);

 private:
  bool update_pressing();
  void find_touching(std::span<const double> depth);
  [[nodiscard]] bool solve_warm();
  void solve_cold();
  void solve_pressing();
  void set_up();
  void factor();
  void solve_system();
  void couple(const std::vector<int>& from, const std::vector<double>& x,
              const std::vector<int>& to, std::vector<double>& out) const;
  [[nodiscard]] bool relax();
  [[nodiscard]] bool is_clear() const;
  void put_solution(std::vector<double>& cells) const;
  void share_loads();
  [[nodiscard]] double relaxed(int cell);
  [[nodiscard]] double coupling(int i, int j) const;
  void change_coupling(const LayerMaterial& by, std::vector<double>& out) const;
  [[nodiscard]] double between_cells(int point) const;
  [[nodiscard]] std::size_t cell(int point) const;

  const CompiledLayer* layer_ = nullptr;
  std::uint64_t number_ = 0;                     ///< of the layer of the last solution
  double stiffness_ = 0;                         ///< k at E = 1 [1/m]
  double modulus_ = 0;                           ///< E [Pa]
  double rounding_ = 0;                          ///< differences of depths that are rounding [m]
  std::vector<int> touching_;                    ///< points with δ > least_depth()
  std::vector<double> depth_, left_, pressure_;  ///< (points) δ, r, p
  std::vector<char> presses_;                    ///< (points) δ_s > w_i
  std::vector<int> last_pressing_;               ///< points that pressed in the last solution
  std::vector<int> near_, pressing_;  ///< cells that touching points are in or near; with n_i > 0
  std::vector<int> idle_;             ///< near ones whose yield is a product
  std::vector<int> count_;            ///< (cells) n_i
  std::vector<double> mean_, load_, yield_, sum_;  ///< (cells) δ̄, P at E = 1, w, R
  std::vector<double> load_bar_, yield_bar_;       ///< (cells) cotangents, or tangents
  std::vector<double> factor_, rhs_;  ///< (pressing, pressing) U with M = Uᵀ U; (pressing)
  std::vector<int> factored_;         ///< cells of the factor, each before its n_i
  AlignedVector<double> work_;        ///< (pressing, kernels::kCellWrench)
  int systems_ = 0;
  bool solved_ = true;
};

}  // namespace tangere
