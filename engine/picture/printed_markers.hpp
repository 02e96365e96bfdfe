// SPDX-License-Identifier: Apache-2.0
// Dark discs printed on a gel, which move along with its surface. At a distance d from the centre
// of a disc of radius r [pixels] a picture is multiplied by
//   1 - a s(r + ½ - d),  s(t) = t² (3 - 2t) of t clamped to 0 … 1,  a = 0.7
#pragma once

#include <span>
#include <vector>

#include "engine/picture/picture_grid.hpp"

namespace tangere {

/// T: float or double. Owns the scratch of one thread. Only the constructor allocates.
template <class T>
class PrintedMarkers {
 public:
  struct Disc {
    double x = 0, y = 0;  ///< of the centre [pixels]; the first pixel's centre is at (½, ½)
  };

  /// `cols`, `rows`: of discs. `pitch`: between them [m]; 0: spread over the picture. `radius` [m];
  /// 0: a tenth of the smaller distance between them.
  PrintedMarkers(const PictureGrid& grid, int cols, int rows, double pitch, double radius);

  /// Moves the discs by displacements of the points along columns and rows of the picture,
  /// (points, 2: x, y) [m], which cubic B-splines interpolate.
  void move(std::span<const T> displacement);
  [[nodiscard]] std::span<const Disc> discs() const { return moved_; }
  /// Multiplies the colours of a row, (3, width).
  void darken(int row, std::span<T> planes) const;

  /// Sets the cotangents of the discs' places to zero.
  void begin_pull_back();
  /// Adds those of a row. `levels_bar`: (width) Σ over colours of a level, darkened by all discs,
  /// times its cotangent.
  void add_row(int row, std::span<const T> levels_bar);
  /// Computes the cotangent of the displacements, (points, 2).
  void take(std::span<T> displacement_bar) const;

 private:
  /// Calls f(pixel of the row, its distance along x and along y from the disc's centre) for those
  /// that a disc may darken [pixels]. y is in units in which a disc is round.
  template <class F>
  void for_pixels(const Disc& disc, int row, const F& f) const;

  PictureGrid grid_;
  double radius_x_, radius_y_;  // [pixels]
  std::vector<Disc> rest_, moved_, bar_;
  std::vector<SplineWeights<double>> columns_, lines_;  // of each disc
};

}  // namespace tangere
