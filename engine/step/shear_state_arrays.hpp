// SPDX-License-Identifier: Apache-2.0
// The shear state as dense arrays for files and Python: all points of all contacts with shear
// springs, contact after contact, points of a sensor in the order of its field, then the dofs with
// dry friction.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/base/vector3.hpp"
#include "engine/model/model.hpp"
#include "engine/step/shear_state.hpp"

namespace tangere {

/// The points of one contact with shear springs, or the dofs of one joint with dry friction.
struct ShearSpringPlaces {
  /// "contact pad box", "ground box", of a sensor "tactile pad box"; of one with memory="read"
  /// "tactile pad box b" and "tactile pad box a", its anchors; of a joint "joint elbow".
  std::string name;
  /// Of its points, axes of the moving frame that carries them [m]; of a joint's dofs zeros.
  std::vector<Vector3> places;
};

/// The points of a model that have shear springs, then the dofs with dry friction. Row r of an
/// array (points, 3) is the elastic displacement of point r [m], in the axes of the moving frame
/// that carries it; for a sensor with memory="read" its anchor b in these axes, or a in those of
/// the touched shape. Zeros: no displacement, or no contact. Of a dof with dry friction it has the
/// elastic displacement [m or rad] and two zeros.
struct ShearStateArrays {
  std::vector<ShearSpringPlaces> contacts;
  std::vector<int> row_of;  ///< (points) row of ShearEntry::point

  [[nodiscard]] std::size_t count() const { return row_of.size(); }
  /// Writes an array, (points, 3).
  void write(std::span<const ShearEntry> memory, std::span<double> array) const;
  /// Returns the shear state of an array, (points, 3). Rows of zeros get no entry.
  [[nodiscard]] ShearState read(std::span<const double> array) const;
  /// The same with entries for all rows.
  [[nodiscard]] ShearState read_all(std::span<const double> array) const;
  /// Where an entry's first number is in an array.
  [[nodiscard]] std::size_t first_of(const ShearEntry& entry) const {
    return 3 * std::size_t(row_of[std::size_t(entry.point)]);
  }
};

/// Returns those of a model; without contacts if it has no shear springs.
ShearStateArrays shear_state_arrays(const Model& model);

}  // namespace tangere
