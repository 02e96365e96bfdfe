// SPDX-License-Identifier: Apache-2.0
// Field of a sensor with a coupled layer (docs/layer.md) or a table (docs/table.md). With the force
// N n and the friction T of the springs at a point, the pressure p of the layer or the table there,
// and the normal m = slant/|slant| of the surface that presses, the force on the sensor's body is
//   f = 𝒜 p (slant + T'/N),  T' = T - m (m·T)
// so that friction has the cone of that load. Where N is 0 there is no friction. Where the layer is
// the contact, each group of bodies of one link has a layer of its own. Under load control
// (engine/layer/load_control.hpp) the pressing forces are -o·f, with the outward normal o.
#pragma once

#include <span>
#include <vector>

#include "engine/layer/gel_layer.hpp"
#include "engine/layer/layer_depth.hpp"
#include "engine/layer/load_control.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/sense/table_pressure.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere {

/// Fields of springs at the same state, each (points, 3) [N]: with friction, and without it.
struct SpringFields {
  std::span<const double> whole, normal;
  bool friction = true;  ///< whether the field has friction; else `whole` counts for loads alone
};

/// Owns the scratch of one thread.
class LayeredField {
 public:
  /// Computes the field, (points, 3) [N]; of a layer whose pressures are not found no numbers.
  /// `touch`: the shapes in pad axes (PadReader::arguments()). `loads`: those that a layer under
  /// load control carries.
  void read(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
            const SpringFields& springs, std::span<double> field, const PadLoads& loads = {});
  /// Whether the layer of the last field, under load control, carries its loads.
  [[nodiscard]] bool carries() const { return control_.carries(); }

  /// Derivatives of the last field that was read.
  struct Cotangents {
    std::span<double> whole, normal;                       ///< (points, 3) of the springs' fields
    std::span<kernels::TouchCotangent<double>> touches{};  ///< pad axes and origin
    double stiffness = 0;                                  ///< of the coefficient kn
    LayerMaterial material{};                              ///< of a layer
    PadLoads loads{};                                      ///< under load control
  };
  /// Pulls the cotangent of the field back. Overwrites all of `out`. `numbers`: also by sizes of
  /// shapes and by the material of a layer without a surface.
  void pull_back(std::span<const double> field_bar, bool numbers, Cotangents& out);

  /// Computes how the last field changes when the springs' fields and the shapes do: (points, 3).
  /// `touches`, `sizes`: of the shapes, with dual numbers. `stiffness_dot`: of kn.
  /// `material_dot`: of a layer. `loads_dot`: under load control.
  void push_forward(const SpringFields& springs_dot,
                    std::span<const kernels::Touch<kernels::Dual<double>>> touches,
                    std::span<const kernels::Vec3<kernels::Dual<double>>> sizes,
                    double stiffness_dot, const LayerMaterial& material_dot,
                    std::span<double> field_dot, const PadLoads& loads_dot = {});

 private:
  struct Point {
    int index, group, target;
    kernels::Vec3<double> xi;  ///< pad axes [m]
    KnownDepth known;          ///< δ
    double normal;             ///< N [N]
    LayerDepth<double> at;
  };
  /// Friction of one point: T, T' and m, in components of the field.
  struct Friction {
    kernels::Vec3<double> springs, along, normal;
  };
  [[nodiscard]] double pressure(const Point& p) const;
  [[nodiscard]] std::size_t place(const Point& p) const;
  [[nodiscard]] double point_stiffness() const;
  [[nodiscard]] double friction_load(const Point& p) const;
  /// Calls f with the law of each group, and where its points begin.
  template <class F>
  void for_each_law(const F& f);
  void find_points(const SpringFields& springs, double above);
  void add_point(int index, int group, const kernels::Vec3<double>& xi, double normal,
                 double above);
  void solve_loads(const SpringFields& springs, const PadLoads& loads, double modulus);
  [[nodiscard]] double pressing_share(const Point& p) const;
  [[nodiscard]] kernels::Vec3<double> pressing_direction() const;
  [[nodiscard]] bool has_cotangent(const Point& p) const;
  [[nodiscard]] std::array<double, 3> approach_bar() const;
  void find_lambda(std::span<const double> field_bar);
  void add_approach(const PadLoads& loads_dot, const LayerMaterial& material_dot,
                    std::span<double> field_dot);
  void pull_back_point(const Point& p, const kernels::Vec3<double>& slant_bar, bool sizes,
                       Cotangents& out) const;
  void pull_back_material(Cotangents& out) const;
  [[nodiscard]] Friction friction_at(const Point& p) const;
  [[nodiscard]] LayerDepth<kernels::Dual<double>> moved(
      const Point& p, const kernels::Touch<kernels::Dual<double>>& touch,
      const kernels::Vec3<kernels::Dual<double>>& size, double thickness_dot) const;
  [[nodiscard]] kernels::Vec3<double> in_field(const kernels::Vec3<double>& force) const;
  [[nodiscard]] kernels::Vec3<double> to_pad(const kernels::Vec3<double>& field_bar) const;

  const CompiledSensor* sensor_ = nullptr;
  kernels::PadTiles pad_{};
  double kn_ = 0;
  std::vector<kernels::TouchShape> shapes_;
  std::vector<kernels::Touch<double>> touches_;
  std::vector<Point> points_;
  std::vector<double> whole_, normal_;            // (points, 3)
  std::vector<double> depth_;                     // (groups, points)
  std::vector<double> depth_bar_, load_bar_;      // (groups, points) cotangents
  std::vector<kernels::Vec3<double>> slant_bar_;  // parallel to points_
  std::vector<double> held_bar_;                  // of depths, by the loads of friction
  std::vector<GelLayer> layers_;  // of each group of targets (CompiledSensor::target_groups)
  TablePressure table_;
  bool friction_ = true;  // SpringFields::friction
  LoadControl control_;
  std::vector<LoadControl::Point> loaded_;  // parallel to points_
  std::array<double, 3> lambda_{};          // of LoadControl::pull_back()
};

}  // namespace tangere
