// SPDX-License-Identifier: Apache-2.0
// tangere calibrate --channels: fits the map from a sensor's field to what its hardware returns.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "apps/press_scene.hpp"

namespace tangere::apps {

struct ChannelCalibration {
  std::string recording, sensor, check;  ///< tables and a layout; "": no check
  Indenter indenter;
  std::string map, output;    ///< files to write; "": none
  std::vector<double> nodes;  ///< rows and columns; empty: usual ones
  std::string loads, unit;    ///< "pressure" or "force", "": by the recording; of channels
  double zero = 0;            ///< added to depths [m]
  std::optional<double> hold_out;
  bool overwrite = false;
};

/// Fits, prints R², and writes the map and a layout that names it. Throws InputError (file:line)
/// and IoError.
int run_calibrate_channels(const ChannelCalibration& arguments, const Console& console);

}  // namespace tangere::apps
