// SPDX-License-Identifier: Apache-2.0
// Forces of a skin under an indenter that follows a given path: what a press bench records.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Units of the columns of a table, as they stand behind their names; empty where none does.
struct PressUnits {
  std::string time, depth, force;
};

/// A recorded press, one number for each row. Vectors of columns that were not recorded are empty.
struct PressRecording {
  std::vector<double> time;         ///< [s], ascending
  std::vector<double> depth;        ///< of the indenter below the first touch [m]
  std::vector<double> force;        ///< along the skin's normal, positive in compression [N]
  std::vector<double> shear;        ///< displacement of the indenter along the skin's x [m]
  std::vector<double> shear_force;  ///< of the indenter on the skin along x [N]
  std::vector<double> x, y;         ///< place of the indenter from the middle of a field [m]
  /// Points of a recorded field, in the order of the sensor's; 0: forces.
  std::size_t points = 0;
  std::vector<double> field;  ///< (rows, points), positive in compression, in place of force [N]
  std::vector<double> shear_field;  ///< (rows, points, 2), along axis0 and axis1 [N]
  PressUnits units;
  std::vector<int> lines;  ///< of the rows in their file; empty: not of a file

  [[nodiscard]] std::size_t rows() const { return depth.size(); }
  /// What the normal fit compares: the field, (rows, points), or the force.
  [[nodiscard]] const std::vector<double>& normal() const { return points > 0 ? field : force; }
  /// What the fit of a shear compares: (rows, points, 2), or the shear force.
  [[nodiscard]] const std::vector<double>& tangential() const {
    return points > 0 ? shear_field : shear_force;
  }
  /// Returns the rate of the depth [m/s] by differences between neighbours; zeros without times.
  [[nodiscard]] std::vector<double> rates() const;
  /// Returns the rows at which the rate of the depth or of the shear jumps by more than a fifth of
  /// its largest size, so that it is not known there, or by more than half where the former are
  /// more than a fifth of the rows; none where these are, too, and none without times. Jumps within
  /// four deviations of the scatter of third differences are none. Ascending.
  [[nodiscard]] std::vector<int> turns() const;
  /// Returns the standard deviation of the errors of evenly spaced depths [m], by third differences
  /// between turns, which a smooth motion has hardly. 0 for times that are not even, and for few
  /// rows.
  [[nodiscard]] double depth_scatter() const;
};

/// Where the indenter is at each row. Columns that are empty are 0.
struct PressPath {
  std::span<const double> depth;  ///< [m]
  std::span<const double> rate;   ///< of the depth [m/s]
  std::span<const double> time;   ///< [s]
  std::span<const double> x, y;   ///< from the middle of the skin [m]
  bool fields = false;            ///< whether forces are those of each point
};

/// Returns the scene with its indenter above the middle of the skin, at the depth 0. `scene`: link
/// 0 is fixed and carries the one sensor, whose skin faces z; link 1 has a joint of type
/// translational and a body whose lowest point is the joint's origin.
Scene placed_indenter(const Scene& scene);

/// Computes the force along the normal at each row, without friction [N]: (rows), or of fields
/// (rows, points). `scene`: of placed_indenter().
std::vector<double> press_forces(const Scene& scene, const PressPath& path);

/// Forces at the rows of a path, with friction [N].
struct PathForces {
  std::vector<double> normal;      ///< as press_forces()
  std::vector<double> tangential;  ///< along x, (rows), or of fields (rows, points, 2)
};

/// Computes the forces at each row of a path that begins outside the skin above its first row. With
/// times, rates are means since the row before, and the first row is reached slowly; without,
/// forces by rates are left out. `scene`: of placed_indenter(), with a position motor at the joint.
/// Throws InputError for a step that fails, with its row.
PathForces path_forces(const Scene& scene, const PressPath& path);

/// Computes the force along x at each row of a path [N], (rows), or of fields those along axis0 and
/// axis1, (rows, points, 2): path_forces().tangential.
std::vector<double> shear_forces(const Scene& scene, const PressPath& path);

/// Computes how much the friction of the sensor adds to the normal forces at each row of a path
/// [N], as press_forces(). Times and errors are those of path_forces().
std::vector<double> friction_shares(const Scene& scene, const PressPath& path);

/// Computes the rates of the depth that path_forces() has [m/s]: zeros without times.
std::vector<double> path_rates(const PressPath& path);

/// Returns the scene with its sensor's forces by rates left out.
Scene without_rates(const Scene& scene);

/// Calls f with the ideal field, (points, 3) [N], at each row, after `zero` [m] is added to its
/// depth. `x`, `y`: of the indenter from the middle of the skin, or empty: there. `shear`: not
/// empty: the rows are a path as in shear_forces(). `model`: of such a scene.
void for_fields(const Model& model, double zero, std::span<const double> depth,
                std::span<const double> x, std::span<const double> y, std::span<const double> shear,
                const std::function<void(std::span<const double>)>& f);

}  // namespace tangere
