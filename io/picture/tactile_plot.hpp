// SPDX-License-Identifier: Apache-2.0
// Draws tactile fields as SVG: pressure as a map with a colour bar, shear as arrows. It opens no
// window.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/trajectory/trajectory_reader.hpp"

namespace tangere {

struct PlotOptions {
  std::string sensor;  ///< "": the first sensor that can be drawn
  std::int64_t environment = 0;
  std::optional<std::int64_t> frame;  ///< one frame instead of a strip
  int strip = 6;                      ///< most frames in a strip, spread over those with contact
};

/// Names of the sensors that can be drawn (rectangular arrays, and lists with an image), in
/// alphabetical order, as files list them.
std::vector<std::string> drawable_sensors(const TrajectoryReader& file);

/// In an array, axis1 (columns) points right and axis0 (rows) down; otherwise the columns and rows
/// of the image do. All frames share one colour scale and one arrow scale. Throws InputError for a
/// sensor, environment or frame that does not exist or cannot be drawn.
std::string render_tactile_svg(const TrajectoryReader& file, const PlotOptions& options);

}  // namespace tangere
