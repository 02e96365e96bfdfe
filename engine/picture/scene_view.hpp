// SPDX-License-Identifier: Apache-2.0
// A picture of solids as a camera sees them: for every pixel the depth along the camera's axis, the
// number of the solid, and a colour. Of a ray (u, v, 1) t the parameter t is the depth; the nearest
// one stays. Numbers are in the camera's axes: right, down, forward.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/vector3.hpp"

namespace tangere {

/// Depths below it are in front of the pinhole, and not seen [m].
inline constexpr double kNearest = 1e-3;
inline constexpr int kLargestExponent = 128;  ///< of a highlight
/// The number of a pixel in which there is nothing.
inline constexpr std::int32_t kNoSolid = -1;

struct ViewGrid {
  int rows = 0, cols = 0;
  double fov = 45;                     ///< from the upper edge to the lower one [degrees]
  double far = 10;                     ///< [m]
  [[nodiscard]] double focal() const;  ///< [pixels]
  [[nodiscard]] std::size_t pixels() const { return std::size_t(rows) * std::size_t(cols); }
};

enum class SolidKind : std::uint8_t { ball, ellipsoid, cuboid, cylinder, capsule, half_space };

/// A solid in its own axes at a place in the camera's. A solid around the pinhole is not seen: its
/// surface has one side.
struct ViewSolid {
  SolidKind kind = SolidKind::ball;
  std::int32_t number = 0;  ///< of the pixels that show it
  /// Its axes in those of the camera, unit, and its origin [m].
  std::array<Vector3, 3> axes{};
  Vector3 origin{};
  /// Semi-axes of a ball, ellipsoid or cuboid; radius and half of the straight length of a cylinder
  /// or capsule, which lie along z [m]. A half-space z < 0 has none.
  Vector3 size{};
  std::array<double, 3> colour{};  ///< R, G, B, 0 to 1
  double specular = 0;             ///< strength of its highlight, 0 to 1
  int exponent = 64;               ///< of the highlight, 1 to kLargestExponent
  double emission = 0;             ///< share of its colour that it emits, 0 to 1
  /// Of a half-space: sides of squares in two tones [m]; 0: it has one tone.
  double square = 0;
};

/// Triangles, anticlockwise from outside.
struct ViewMesh {
  std::span<const double> vertices;  ///< (n, 3), own axes, before `scale` [m]
  std::span<const std::array<int, 3>> triangles;
  double scale = 1;
};

class SceneView {
 public:
  explicit SceneView(const ViewGrid& grid);

  /// Empties the picture. `light`: unit, to the lamp, or zero for none; `ambient`: share of light
  /// from everywhere; `brightness`: factor of all light. A surface with normal n at a unit ray d
  /// has its colour times brightness (ambient + (1 - ambient) max(0, n·light)) + emission, and
  /// white times brightness (1 - ambient) specular max(0, n·h)^exponent where n·light > 0, with h
  /// halfway between light and -d; at most white.
  void begin(const Vector3& light, double ambient, double brightness = 1);
  void add(const ViewSolid& solid);
  /// The size of `place` has no effect.
  void add(const ViewMesh& mesh, const ViewSolid& place);

  [[nodiscard]] const ViewGrid& grid() const { return grid_; }
  [[nodiscard]] std::span<const float> depth() const { return depth_; }  ///< [m]
  [[nodiscard]] std::span<const std::int32_t> numbers() const { return numbers_; }
  /// R + 256 G + 65536 B.
  [[nodiscard]] std::span<const std::uint32_t> colours() const { return colours_; }

 private:
  /// A corner of a mesh in the picture: right and down in parts of a pixel.
  struct Place {
    std::int64_t x = 0, y = 0;
  };
  /// Pixels [first, end) of rows and columns.
  struct Pixels {
    int first_row = 0, end_row = 0, first_col = 0, end_col = 0;
  };
  /// The pixels in which one of some balls may be seen, and what lies between them.
  [[nodiscard]] Pixels pixels_of(std::span<const Vector3> centres, double radius) const;
  [[nodiscard]] Pixels pixels_of(const ViewSolid& solid) const;
  void add_triangle(const std::array<Vector3, 3>& corners, const std::array<Place, 3>& places,
                    const ViewSolid& of);
  void add_cut_triangle(const std::array<Vector3, 3>& corners, const ViewSolid& of);
  [[nodiscard]] Place place_of(const Vector3& corner) const;
  /// v of the rays of a row.
  [[nodiscard]] double ray_row(int row) const;

  ViewGrid grid_;
  double focal_;  // [pixels]
  Vector3 light_{0, 0, -1};
  double ambient_ = 1, direct_ = 0;  // times the brightness
  std::vector<float> u_;             // (cols) of the rays
  std::vector<float> depth_;
  std::vector<std::int32_t> numbers_;
  std::vector<std::uint32_t> colours_;
  std::vector<Vector3> corners_;  // of a mesh
  std::vector<Place> places_;
};

/// Turns colours into bytes R, G, B.
void unpack_colours(std::span<const std::uint32_t> colours, std::span<std::uint8_t> bytes);

}  // namespace tangere
