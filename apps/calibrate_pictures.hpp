// SPDX-License-Identifier: Apache-2.0
// tangere calibrate --pictures: fits a camera gel to photographs of a ball that presses it.
#pragma once

#include <optional>
#include <string>

#include "apps/console.hpp"

namespace tangere::apps {

struct PictureCalibration {
  std::string folder;           ///< with background.png, presses.csv and the photographs
  std::optional<double> ball;   ///< radius [m]
  std::optional<double> pixel;  ///< side of a pixel [m]
  std::string output;           ///< gel file; "": none
  bool overwrite = false;
};

/// Fits, prints the scores and writes the gel file, with its background beside it. Throws
/// InputError (file:line) and IoError.
int run_calibrate_pictures(const PictureCalibration& arguments, const Console& console);

}  // namespace tangere::apps
