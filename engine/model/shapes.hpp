// SPDX-License-Identifier: Apache-2.0
// The table of shapes: everything that differs from shape to shape, except their distance
// (kernels/contact/shapes).
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/model/scene.hpp"

namespace tangere {

struct MassProperties;  // engine/model/compiled_model.hpp

/// A number of a shape's size: its index in size_number(), the index among the three numbers that
/// kernels keep (kernels::PairContact), and the factor between the two.
struct SizeNumber {
  int which, component;
  double scale;
  double* (*at)(Shape& shape);  ///< [m]; scale of a mesh: [1]
};

/// Integers that determine how many contact points a shape has.
struct PointCounts {
  const char* attribute;  ///< in scene files
  int least;
  std::vector<int* (*)(Shape& shape)> at;
};

struct ShapeRow {
  const char* name;
  Shape (*make)();  ///< with default counts and no size
  /// Its distance in kernels; without a value, nothing can touch it.
  std::optional<PrimitiveShape> distance = {};
  std::vector<SizeNumber> sizes = {};  ///< in the order in which scene files are read
  std::vector<PointCounts> counts = {};
  MassProperties (*mass)(const Shape& shape, double density) = nullptr;  ///< nullptr: massless
  /// Derivative by number `which` of the size; nullptr: it has no size.
  MassProperties (*mass_by_size)(const Shape& shape, double density, int which) = nullptr;
  /// Contact points, body frame, (n, 3); nullptr: it has none.
  std::vector<double> (*points)(const Shape& shape) = nullptr;
  /// Largest ratio of the longest to the shortest number of its size; 0: no limit.
  double slenderness = 0;

  /// Whether its contact points follow its size.
  [[nodiscard]] bool stretches() const { return points != nullptr && !sizes.empty(); }
  [[nodiscard]] const SizeNumber* size(int which) const;
};

/// Rows in the order of Shape's alternatives.
std::span<const ShapeRow> shape_rows();
const ShapeRow& row_of(const Shape& shape);
/// The row of a shape with a distance.
const ShapeRow& row_of(PrimitiveShape shape);

/// Numbers of a size as scene files name them [m]: radius, length, or the three edges of size.
struct NamedSize {
  const char* name;
  std::vector<double> values;
};
/// Returns the size of a shape by names, radius first. A mesh has none, its scale is no length.
std::vector<NamedSize> named_sizes(const Shape& shape);
/// Returns the volume of a solid [m³]; 0 for a plane.
double volume_of(const Shape& shape);

/// Returns the full widths of a shape with distance and size along its axes [m]; else zeros.
std::array<double, 3> widths(const Shape& shape);

/// Returns the distance of a place in the body's frame to the shape [m], negative inside. No value
/// for a shape without a distance in closed form: abstract bodies and meshes.
std::optional<double> distance_to(const Shape& shape, const Vector3& place);

/// Lists the shapes that satisfy `has`: "a sphere, cuboid or plane".
std::string shapes_with(const std::function<bool(const ShapeRow&)>& has);
/// Returns the name with its article: "a cuboid", "an abstract".
std::string with_article(const char* shape_name);

/// Returns what is wrong with a shape whose sizes range from `least` to `most` [m]; "" if nothing
/// is.
std::string slenderness_fault(const ShapeRow& row, double least, double most);
std::string slenderness_fault(const Shape& shape);

}  // namespace tangere
