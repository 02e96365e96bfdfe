// SPDX-License-Identifier: Apache-2.0
// Reads trajectory files back for plots, one field at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/rows/sensor_layout.hpp"

namespace tangere {

/// Metadata of a trajectory file.
struct TrajectorySummary {
  std::vector<std::pair<std::string, std::string>> settings;  ///< by name
  std::vector<Channel> channels;
};
/// Returns none for a file of another kind. Throws IoError for one that is damaged.
std::optional<TrajectorySummary> summarise_trajectory(const std::string& path);

class TrajectoryReader {
 public:
  /// Throws IoError for a file that is missing, damaged or not a trajectory.
  explicit TrajectoryReader(const std::string& path);
  ~TrajectoryReader();
  TrajectoryReader(TrajectoryReader&&) noexcept;

  [[nodiscard]] const std::string& path() const;
  [[nodiscard]] const std::string& scene_name() const;
  [[nodiscard]] std::int64_t environments() const;
  [[nodiscard]] double timestep() const;  ///< [s]
  /// Steps before the file's own, of runs that it continues.
  [[nodiscard]] std::int64_t first_step() const;
  [[nodiscard]] const std::vector<SensorLayout>& sensors() const;
  /// Index of a sensor; "" is the first. Throws InputError that names the sensors of the file.
  [[nodiscard]] std::size_t find_sensor(const std::string& name) const;
  [[nodiscard]] std::int64_t frames(std::size_t sensor) const;
  /// Returns the steps of the run before a frame was read: the row of /q, where each is recorded.
  [[nodiscard]] std::int64_t step(std::size_t sensor, std::int64_t frame) const;
  /// Whether whole fields were recorded, and whether the numbers along the normal and those across
  /// it were.
  [[nodiscard]] bool has_field(std::size_t sensor) const;
  [[nodiscard]] bool has_pressure(std::size_t sensor) const;
  [[nodiscard]] bool has_shear(std::size_t sensor) const;
  /// Returns a field, (points, 3) [N]. What was not recorded is 0. Where pressure was recorded
  /// instead of the field, the third number is without friction.
  [[nodiscard]] std::vector<double> force(std::size_t sensor, std::int64_t frame,
                                          std::int64_t environment) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
