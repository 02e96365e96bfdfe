// SPDX-License-Identifier: Apache-2.0
// Fits a camera gel to photographs of a ball that presses it (docs/pictures.md#calibration). With
// the depth d = ratio · r of a press whose imprint has the radius r, the ball of radius R is
//   δ(ρ) = max(0, √(R² - ρ²) - R + d)
// deep. The colours are linear in the lamps' 72 numbers, so these follow from normal equations over
// the pixels within 1.6 r. ratio, reach and blur are searched; places and radii of the imprints are
// refined by Gauss and Newton with the lamps held; both three times.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/scene/gel.hpp"

namespace tangere {

/// The circle of an imprint [pixels]; the first pixel's centre is at (½, ½), y counts down.
struct Imprint {
  double x = 0, y = 0, radius = 0;
};

/// A photograph of a ball that presses a gel.
struct BallPress {
  Imprint label;
  std::vector<float> levels;  ///< (rows, cols, 3) R, G, B, 0 to 255, without the camera's gains
};

/// How well a press is predicted by the lamps that were fitted to the others, within 1.5 labelled
/// radii: drawn where the label says, moved by what the labels of the others are off in common, and
/// where its own circle was refined.
struct PressScore {
  double psnr = 0, ssim = 0;  ///< [dB], -1 to 1
  double aligned_psnr = 0, aligned_ssim = 0;
  Imprint refined;
};

struct GelFit {
  Gel gel;                 ///< with the background that was given
  double depth_ratio = 0;  ///< depth of a press by the radius of its imprint
  std::vector<PressScore> scores;
  [[nodiscard]] PressScore mean() const;  ///< over the presses; no circle
};

inline constexpr std::size_t kFewestPresses = 3;

/// Fits a gel to presses of a ball of radius `ball` [m]; `pixel`: side of a pixel [m]. Throws
/// InputError for fewer than kFewestPresses, for photographs of another size than the background,
/// for circles of no size or outside of the picture, and for a ball larger than the picture.
GelFit fit_gel(const GelBackground& background, std::span<const BallPress> presses, double ball,
               double pixel);

/// Peak signal-to-noise ratio [dB] and mean structural similarity (Gaussian windows of 11 × 11
/// pixels) of two pictures, (rows, cols, 3), over the pixels within `radius` of a place.
struct Likeness {
  double psnr = 0, ssim = 0;
};
Likeness likeness(std::span<const float> a, std::span<const float> b, int rows, int cols,
                  const Imprint& disc);

}  // namespace tangere
