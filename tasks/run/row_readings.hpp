// SPDX-License-Identifier: Apache-2.0
// Readings of sensors in the rows of a task's environments, beside what the task observes: one at
// the row itself, or a window of those since the row before. They are the numbers of data sets.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/rows/episode_channels.hpp"
#include "engine/sense/readout.hpp"
#include "tasks/run/block_worker.hpp"

namespace tangere {

class RowReadings {
 public:
  /// What one thread needs to read.
  class Reader {
   public:
    Reader(const RowReadings& rows, const Model& model, Precision precision);

   private:
    friend class RowReadings;
    Readout readout_;
    std::vector<float> unused_numbers_;  // of environments whose episode is over
    std::vector<std::uint8_t> unused_bytes_;
  };

  /// `names`: of readings of sensors, none of which the task observes, with times in steps: none,
  /// or for a window a divisor of the steps of an action. Throws InputError for others.
  RowReadings(const Task& task, std::span<const TimedName> names, int environments);

  /// Shape, window and name of each reading, in the order of data sets.
  [[nodiscard]] const std::vector<EpisodeChannel>& channels() const { return channels_; }
  /// (E, numbers of a row) in SI units; empty for a picture in colours.
  [[nodiscard]] std::span<const float> numbers(std::size_t reading) const {
    return numbers_[reading];
  }
  /// The same of a picture in colours, 0 to 255; empty for others.
  [[nodiscard]] std::span<const std::uint8_t> bytes(std::size_t reading) const {
    return bytes_[reading];
  }

  /// Reads what is due after step `step`, 0 to K - 1, of an action of a block. Readings of
  /// environments whose episode was over before the action stay as they are.
  void read(Reader& reader, const Batch& batch, const EnvironmentData& data, int block, int step);

 private:
  template <class T>
  void read_channel(Reader& reader, const Batch& batch, const EnvironmentData& data, int block,
                    std::size_t channel, std::size_t place);

  int steps_per_row_;
  std::vector<EpisodeChannel> channels_;
  std::vector<std::vector<float>> numbers_;
  std::vector<std::vector<std::uint8_t>> bytes_;
};

}  // namespace tangere
