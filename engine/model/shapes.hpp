// SPDX-License-Identifier: Apache-2.0
// The table of shapes: everything but their distance (kernels/contact/shapes) that differs from
// shape to shape.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/model/scene.hpp"

namespace tangere {

struct MassProperties;  // engine/model/compiled_model.hpp

/// A number of a shape's size: which of size_number(), which of three numbers kernels keep for it
/// (kernels::PairContact), and by what factor.
struct SizeNumber {
  int which, component;
  double scale;
  double* (*at)(Shape& shape);  ///< [m]
};

/// Whole numbers that say how many contact points a shape has.
struct PointCounts {
  const char* attribute;  ///< in scene files
  int least;
  std::vector<int* (*)(Shape& shape)> at;
};

struct ShapeRow {
  const char* name;
  Shape (*make)();  ///< with default counts and no size
  /// Its distance in kernels; none: nothing can touch it.
  std::optional<PrimitiveShape> distance = {};
  std::vector<SizeNumber> sizes = {};  ///< in the order in which scene files are read
  std::vector<PointCounts> counts = {};
  MassProperties (*mass)(const Shape& shape, double density) = nullptr;  ///< nullptr: massless
  /// By number `which` of the size; the centre of mass stays. nullptr: it has no size.
  MassProperties (*mass_by_size)(const Shape& shape, double density, int which) = nullptr;
  /// Contact points, body frame, (n, 3); nullptr: it has none.
  std::vector<double> (*points)(const Shape& shape) = nullptr;
  /// What the longest number of its size may be over the shortest; 0: anything.
  double slenderness = 0;

  /// Its contact points follow its size.
  [[nodiscard]] bool stretches() const { return points != nullptr && !sizes.empty(); }
  [[nodiscard]] const SizeNumber* size(int which) const;
};

/// In the order of Shape's alternatives.
std::span<const ShapeRow> shape_rows();
const ShapeRow& row_of(const Shape& shape);
/// The row of a shape with a distance.
const ShapeRow& row_of(PrimitiveShape shape);

/// "a sphere, cuboid or plane": those that have it.
std::string shapes_with(const std::function<bool(const ShapeRow&)>& has);
/// "a cuboid", "an abstract".
std::string with_article(const char* shape_name);

/// What is wrong with sizes from the least to the most that a shape may have [m]: "" if nothing.
std::string slenderness_fault(const ShapeRow& row, double least, double most);
std::string slenderness_fault(const Shape& shape);

}  // namespace tangere
