// SPDX-License-Identifier: Apache-2.0
// Channels of the rows of episodes: one list for the simulation and for the files.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/rows/camera_layout.hpp"
#include "engine/rows/run_facts.hpp"
#include "engine/rows/sensor_layout.hpp"
#include "engine/scene/field_form.hpp"

namespace tangere {

/// Numbers of a body in a row: its pose x y z qw qx qy qz, then its angular and linear velocity.
inline constexpr std::size_t kMotion = 13;

/// An observation of episodes.
struct EpisodeChannel {
  enum class Kind { q, v, end_effectors, bodies, reading, task };
  Kind kind = Kind::task;
  std::string name;                  ///< "q", "variables", "bodies.box", "pad.sum", a task's own
  std::vector<std::uint64_t> shape;  ///< of a row
  std::string unit, meaning;         ///< of a task's episodes
  std::vector<int> bodies = {};      ///< of Kind::bodies
  FieldOutput reading = {};          ///< of Kind::reading
  bool requested = true;
  OutputTimes times = {};  ///< in rows; none: at every row
  /// Readings of a row, K / `window` steps apart, the last one at the row. Above 1, `shape` begins
  /// with it.
  int window = 1;
  /// Touch: all its numbers are 0 without contact. Of a sensor with imperfections only the ideal
  /// field and the markers are, and a task with such a sensor has none.
  bool touch = false;
  std::size_t task_bytes = 0;  ///< TensorSpec::own_bytes

  [[nodiscard]] std::size_t width() const;  ///< numbers of a row
  /// Numbers of one of the readings of a row.
  [[nodiscard]] std::size_t reading_width() const {
    return width() / static_cast<std::size_t>(window);
  }
  /// Place in the window of the reading that is due after step `step`, 0 to K - 1, of a row of
  /// `steps_per_row` = K steps; none where none is due.
  [[nodiscard]] std::optional<std::size_t> window_place(int step, int steps_per_row) const {
    const int between = steps_per_row / window, after = step + 1;
    if (after % between != 0) return std::nullopt;
    return static_cast<std::size_t>(after / between - 1);
  }
  /// Bytes of a number whose type does not follow the precision of the run; else 0.
  [[nodiscard]] std::size_t own_bytes() const {
    return kind == Kind::reading ? tangere::own_bytes(reading.form) : task_bytes;
  }
};

/// Returns the observations that episodes may have, those that are not recorded among them: q and
/// v, then all that a task observes and what `record` names of the sensors of its scene; or the end
/// effectors (if any), and what `record` names of bodies, sensors and cameras of a scene. `facts`:
/// names of coordinates and end effectors, and the task; `bodies`: names; `record`: names, with
/// times in steps; none: everything except bodies, cameras and sensors beside a task.
/// `every`: K, steps of a row. A reading of a sensor that is taken every n < K steps is a window of
/// K / n readings. Throws InputError for times that are no multiple of K, nor, for such a reading,
/// a divisor of it; and of a task for all times but those of windows.
std::vector<EpisodeChannel> episode_channels(const RunFacts& facts,
                                             std::span<const SensorLayout> sensors,
                                             std::span<const CameraLayout> cameras,
                                             std::span<const std::string> bodies,
                                             std::span<const TimedName> record, int every);
/// The same of a model; `task`: null for a scene.
std::vector<EpisodeChannel> episode_channels(const Model& model, const TaskSpec* task,
                                             std::span<const TimedName> record, int every);

}  // namespace tangere
