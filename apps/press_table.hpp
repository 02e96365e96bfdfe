// SPDX-License-Identifier: Apache-2.0
// Recordings of presses as tables: columns by their names, units behind them ("depth_mm").
#pragma once

#include <span>
#include <string>

#include "apps/console.hpp"
#include "tasks/calibration/channel_fit.hpp"
#include "tasks/calibration/press.hpp"

namespace tangere::apps {

/// What the table is of.
struct PressTableSensor {
  std::string name;        ///< of the layout
  std::size_t points = 0;  ///< of the layout
  /// Columns that have other names, "NAME=[FACTOR*]COLUMN": depth, time, force, shear, shear_force,
  /// x, y, and of a field the text before the '/' of its columns.
  std::span<const std::string> columns;
};

/// Reads `depth` and `force`, or in place of the force a field: `force/0`, `force/1` … with three
/// numbers for each point of the sensor, or `pressure/0` … with one; its name may stand in their
/// place, as in tables of data sets. If they are there it reads `time`, `shear` and `shear_force`,
/// and beside a field `x` and `y`. Numbers are in SI or in ms, mm and mN. A note names columns that
/// are not read, those in other units among them. Throws InputError for a missing column, for a
/// second one, and for a field of another number of columns.
PressRecording read_press(const std::string& path, const PressTableSensor& sensor,
                          const Console& console);

/// Reads `depth` and the channels "channel_NAME", and if they are there `x` and `y` or `shear`, in
/// m or mm. Otherwise as read_press().
ChannelRecording read_channel_press(const std::string& path, const Console& console);

}  // namespace tangere::apps
