// SPDX-License-Identifier: Apache-2.0
// What friction remembers as arrays that files and Python show: all points of all contacts that
// remember, contact after contact, and those of a sensor in the order of its field.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/base/vector3.hpp"
#include "engine/model/model.hpp"
#include "engine/step/shear_state.hpp"

namespace tangere {

/// The points of a contact that remembers.
struct ShearSpringPlaces {
  /// "contact pad box", "ground box", of a sensor "tactile pad box"; of one with memory="read"
  /// "tactile pad box b" and "tactile pad box a", its anchors.
  std::string name;
  std::vector<Vector3> places;  ///< of its points, axes of the moving frame that carries them [m]
};

/// The points of a model that remember. Row r of an array (points, 3) is the elastic displacement
/// of point r [m], in the axes of the moving frame that carries it; of a sensor with memory="read"
/// its anchor b in these axes, or a in those of the touched shape. Zeros: it has not moved, or does
/// not touch.
struct ShearStateArrays {
  std::vector<ShearSpringPlaces> contacts;
  std::vector<int> row_of;  ///< (points) row of ShearEntry::point

  [[nodiscard]] std::size_t count() const { return row_of.size(); }
  /// Writes an array, (points, 3).
  void write(std::span<const ShearEntry> memory, std::span<double> array) const;
  /// Returns the memory of an array, (points, 3). Points of zeros are left out.
  [[nodiscard]] ShearState read(std::span<const double> array) const;
};

/// Returns those of a model, without contacts where its friction does not remember.
ShearStateArrays shear_state_arrays(const Model& model);

}  // namespace tangere
