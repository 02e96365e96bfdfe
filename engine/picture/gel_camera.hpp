// SPDX-License-Identifier: Apache-2.0
// The camera behind a gel: from the depth of a body at the points of a pad to the gel's surface,
// and from there to pictures (docs/pictures.md).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "engine/picture/camera_noise.hpp"
#include "engine/picture/gel_colour.hpp"
#include "engine/picture/membrane.hpp"
#include "engine/picture/printed_markers.hpp"
#include "engine/picture/surface_image.hpp"

namespace tangere {

/// T: float or double. Owns the scratch of one thread. Only the constructor and pull_back()
/// allocate. Arrays of points are (rows, cols) of the grid; pictures are (height, width, channels),
/// row 0 on top.
template <class T>
class GelCamera {
 public:
  /// `reach`: ℓ [m] where the gel has none. `outside`: the surface outside of the grid.
  GelCamera(const PictureGrid& grid, const PictureDescription& picture, double reach,
            Outside outside = Outside::zero);

  [[nodiscard]] const PictureGrid& grid() const { return grid_; }

  /// Takes the depth δ of the body at the points [m].
  void set_depth(std::span<const T> depth);
  /// Takes the surface at the points, positive towards the camera [m].
  void set_surface(std::span<const T> surface);
  /// Moves the printed markers (PrintedMarkers::move()), which the picture must have.
  void move_markers(std::span<const T> displacement) { markers_->move(displacement); }
  /// Chooses the draws of the pictures that follow; without them there is no noise.
  void set_draws(const CameraKey& key);

  /// Computes the surface, (height, width) [m], without the gel's blur.
  void read_height(std::span<T> height);
  /// Computes colours, (height, width, 3), from 0 to 255. `markers`: with printed markers.
  void read(bool markers, std::span<T> colours);
  /// The same, rounded to whole levels; 0 for what is not a number.
  void read(bool markers, std::span<std::uint8_t> colours) requires std::is_same_v<T, float>;

  /// Computes the cotangent of the surface from those of the height, (height, width), and of the
  /// colours, (height, width, 3); one of them may be empty. With markers also that of their
  /// displacements, (points, 2); empty: it is not computed. Clamped numbers have no derivative.
  void pull_back(bool markers, std::span<const T> height_bar, std::span<const T> colour_bar,
                 std::span<T> surface_bar, std::span<T> displacement_bar = {});
  /// The same for the depth that was given last.
  void pull_back_depth(std::span<const T> surface_bar, std::span<T> depth_bar);

 private:
  /// Fills planes_ with a row of the picture, not clamped yet.
  void paint(int row, bool markers);
  /// Fills p_, q_, up_ and planes_ with slopes, normals and colours of a row of the gel.
  void shade(int row);
  /// Multiplies planes_ by the gains and adds noise.
  void add_draws(int row);
  void pull_back_colours(bool markers, std::span<const T> colour_bar, bool move);

  PictureGrid grid_;
  double noise_, gain_;
  Membrane<T> membrane_;
  SurfaceImage<T> image_, height_;  // as light and as heights have the surface
  GelColour<T> colour_;
  std::optional<PrintedMarkers<T>> markers_;
  std::optional<CameraKey> key_;
  std::array<T, kColours> gains_{1, 1, 1};
  std::vector<T> depth_, surface_;                      // (points)
  std::vector<T> p_, q_, up_, planes_, p_bar_, q_bar_;  // of a row
  std::vector<std::uint8_t> bytes_;                     // (3, width)
};

/// Returns the part of a picture's description that its grid has. `rows`, `cols`: points; pitches
/// are positive [m].
PictureGrid picture_grid(const PictureDescription& picture, int rows, int cols, double pitch_x,
                         double pitch_y);

}  // namespace tangere
