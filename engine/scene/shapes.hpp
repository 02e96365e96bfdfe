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

#include "engine/scene/scene.hpp"

namespace tangere {

struct MassProperties;  // engine/scene/mass_properties.hpp

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

/// Half the width of a convex shape along a unit vector e is Σ straight_i |e_i| + √Σ (round_i e_i)²
/// [m].
struct HalfWidths {
  Vector3 straight, round;
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
  /// Widths for the three numbers that kernels keep; nullptr: it is not convex, or has no end.
  HalfWidths (*half_widths)(const Vector3& size) = nullptr;
  bool bounded = true;  ///< some ball holds it
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
/// Returns the three numbers that kernels keep of a size [m].
Vector3 size_in_kernels(const Shape& shape);
/// Returns the points that meet other bodies, (n, 3) in the body frame [m]; may be empty.
std::vector<double> contact_points(const Shape& shape);

MassProperties mass_properties(const Shape& shape, double density);
/// Derivative of the mass properties by a number of the shape's size (size_number). The shape must
/// have that number.
MassProperties mass_properties_by_size(const Shape& shape, double density, int which);
/// Returns the volume of a solid [m³]; 0 for a plane.
double volume_of(const Shape& shape);

/// Returns the inertia of a body of this mass [kg] about its centre: xx xy xz yy yz zz, body axes
/// [kg m²]. An abstract body keeps its own.
std::array<double, 6> solid_inertia(const Shape& shape, double mass);

/// Returns the full widths of a shape with distance and size along its axes [m]; else zeros.
std::array<double, 3> widths(const Shape& shape);

/// The distance of a point from a surface, negative inside [m], and the unit normal.
struct SurfaceDistance {
  double distance;
  Vector3 normal;
};
/// Returns the distance of a point in the body frame from a shape. No value for shapes whose
/// distance is no formula: abstract bodies and meshes.
std::optional<SurfaceDistance> distance_from(const Shape& shape, const Vector3& point);

/// Lists the shapes that satisfy `has`: "a sphere, cuboid or plane".
std::string shapes_with(const std::function<bool(const ShapeRow&)>& has);
/// Returns the name with its article: "a cuboid", "an abstract".
std::string with_article(const char* shape_name);

/// Returns an error text for a shape whose sizes range from `least` to `most` [m]; "" if they are
/// valid.
std::string slenderness_fault(const ShapeRow& row, double least, double most);
std::string slenderness_fault(const Shape& shape);

}  // namespace tangere
