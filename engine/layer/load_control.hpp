// SPDX-License-Identifier: Apache-2.0
// A layer that carries given loads (docs/layer.md): its depths are shifted and tilted so that it
// does.
// With points s at (x_s, y_s) of the pad and b_s = (1, x_s/X, y_s/Y), where 2 X and 2 Y are the
// sides of the grid of cells, the layer is solved for the depths δ_s + a·b_s. A point has the
// pressing force c_s A p_s, with the share c_s that friction adds along the normal. Found are the
// shift a_0 and the tilts a_1 and a_2 with
//   r = Σ_s c_s A p_s b_s - T = 0,   T = (F, F x/X, F y/Y)
// Without friction, r is the slope of an energy that is convex by a. Newton's method takes steps
// along which r falls. |a_1| and |a_2| are at most half the thickness t, and a_0 is at most t.
// Where one of them is at its end and r would go on, that component of r stays.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "engine/layer/gel_layer.hpp"

namespace tangere {

/// Sums of pressing forces f at (x, y), pad axes and origin: Σ f [N], Σ f x and Σ f y [N m]. Or
/// their cotangents or changes.
using PadLoads = std::array<double, 3>;

/// Owns the scratch of one thread.
class LoadControl {
 public:
  /// A point below a body.
  struct Point {
    int index;     ///< in the field
    double depth;  ///< δ [m], negative above the surface
    double x, y;   ///< pad axes [m]
    double share;  ///< c
  };
  /// Lists all points of which a body is less than `reach` [m] above.
  using Points = std::function<std::span<const Point>(double reach)>;

  /// Solves `law` with E = `modulus` [Pa] for the depths at which it carries `loads`.
  void solve(const CompiledLayer& layer, double modulus, const PadLoads& loads,
             const Points& points, GelLayer& law);
  /// Whether the pressures were found, of the last shift and tilts.
  [[nodiscard]] bool solved() const { return solved_; }
  /// Whether the layer carries all loads. Else a shift or a tilt is at its end, nothing presses, or
  /// shift and tilts were not found in all steps of Newton's method.
  [[nodiscard]] bool carries() const { return carries_; }

  /// Returns x·b of a point.
  [[nodiscard]] double along(const std::array<double, 3>& x, const Point& p) const {
    return x[0] + x[1] * p.x / half_[0] + x[2] * p.y / half_[1];
  }
  /// Returns λ of the loads, by which a cotangent of the pressing forces falls as λ·b, from the
  /// cotangent of a at constant loads.
  [[nodiscard]] std::array<double, 3> pull_back(const std::array<double, 3>& approach_bar) const;
  /// Returns the cotangent of the loads, from λ.
  [[nodiscard]] PadLoads loads_bar(const std::array<double, 3>& lambda) const;
  /// Returns the cotangent of the thickness by a shift or tilts at their ends.
  [[nodiscard]] double thickness_bar(const std::array<double, 3>& approach_bar) const;
  /// Returns how a changes, from the changes of the loads, of the sums of the pressing forces where
  /// a stays, and of the thickness.
  [[nodiscard]] std::array<double, 3> push_forward(const PadLoads& loads_dot,
                                                   const PadLoads& carried_dot,
                                                   double thickness_dot) const;

 private:
  using Three = std::array<double, 3>;
  void evaluate(const Three& approach);
  void find_slopes();
  [[nodiscard]] bool presses() const;
  [[nodiscard]] bool begin_press();
  void release();
  [[nodiscard]] double largest_residual() const;
  void choose_ends();
  [[nodiscard]] Three direction();
  void step(const Three& direction);
  [[nodiscard]] Three solve_free(Three rhs, bool transposed) const;
  [[nodiscard]] double end(std::size_t k) const;
  [[nodiscard]] Three scaled(const PadLoads& loads) const;

  const CompiledLayer* layer_ = nullptr;
  const Points* list_ = nullptr;
  GelLayer* law_ = nullptr;
  double modulus_ = 0;
  std::array<double, 2> half_{1, 1};  ///< X, Y [m]
  double reach_ = 0;                  ///< of `points_` [m]
  double first_ = 0;                  ///< ten times the depth of the next first touch, by t
  std::span<const Point> points_;
  Three target_{}, approach_{}, residual_{};  ///< T [N], a [m], r [N]
  std::array<Three, 3> slopes_{};             ///< ∂r/∂a [N/m]
  std::array<int, 3> ends_{};                 ///< -1, 1: a is at that end; 0: it is free
  std::vector<double> depth_, change_, change_of_pressure_;  // (points of the pad)
  bool solved_ = true, carries_ = true;
};

}  // namespace tangere
