// SPDX-License-Identifier: Apache-2.0
// Recordings of presses as tables: columns by their names, units behind them ("depth_mm").
#pragma once

#include <string>

#include "apps/console.hpp"
#include "tasks/calibration/channel_fit.hpp"
#include "tasks/calibration/press.hpp"

namespace tangere::apps {

/// Reads `depth` and `force`, and if they are there `time`, `shear` and `shear_force`, in SI or in
/// ms, mm and mN. A note names columns that are not read, those in other units among them. Throws
/// InputError for a missing column and for a second one.
PressRecording read_press(const std::string& path, const Console& console);

/// Reads `depth` and the channels "channel_NAME", and if they are there `x` and `y` or `shear`, in
/// m or mm. Otherwise as read_press().
ChannelRecording read_channel_press(const std::string& path, const Console& console);

}  // namespace tangere::apps
