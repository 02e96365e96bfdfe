// SPDX-License-Identifier: Apache-2.0
// A reading with a window is due every K / window steps, one without at the end of the row.
#include "tasks/run/row_readings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <type_traits>

#include "engine/base/as_size.hpp"
#include "engine/base/error.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/run/block_reader.hpp"

namespace tangere {

RowReadings::Reader::Reader(const RowReadings& rows, const Model& model, Precision precision)
    : readout_(model, precision) {
  for (const EpisodeChannel& channel : rows.channels_) {
    if (channel.own_bytes() == 1)
      unused_bytes_.resize(std::max(unused_bytes_.size(), channel.reading_width()));
    else
      unused_numbers_.resize(std::max(unused_numbers_.size(), channel.reading_width()));
  }
}

RowReadings::RowReadings(const Task& task, std::span<const TimedName> names, int environments)
    : steps_per_row_(task.spec().steps_per_action) {
  const Model& model = task.model();
  for (const EpisodeChannel& channel :
       episode_channels(model, &task.spec(), names, steps_per_row_)) {
    if (channel.kind != EpisodeChannel::Kind::reading) continue;
    if (const std::string reason = reason_against(model.scene(), channel.reading); !reason.empty())
      throw InputError(fmt::format("reading '{}', but {}", channel.name, reason));
    channels_.push_back(channel);
    const std::size_t count = as_size(environments) * channel.width();
    numbers_.emplace_back(channel.own_bytes() == 1 ? 0 : count);
    bytes_.emplace_back(channel.own_bytes() == 1 ? count : 0);
  }
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto named = [&](const auto& other) { return other.name == names[k].name; };
    if (std::none_of(channels_.begin(), channels_.end(), named))
      throw InputError(fmt::format(
          "reading '{}' of task '{}'; expected one of a sensor of its scene that the task does not "
          "observe",
          names[k].name, task.spec().name));
    if (std::any_of(names.begin(), names.begin() + std::ptrdiff_t(k), named))
      throw InputError(
          fmt::format("reading '{}' is listed twice; expected it once", names[k].name));
  }
}

void RowReadings::read(Reader& reader, const Batch& batch, const EnvironmentData& data, int block,
                       int step) {
  for (std::size_t k = 0; k < channels_.size(); ++k) {
    const std::optional<std::size_t> place = channels_[k].window_place(step, steps_per_row_);
    if (!place) continue;
    if (channels_[k].own_bytes() == 1)
      read_channel<std::uint8_t>(reader, batch, data, block, k, *place);
    else
      read_channel<float>(reader, batch, data, block, k, *place);
  }
}

template <class T>
void RowReadings::read_channel(Reader& reader, const Batch& batch, const EnvironmentData& data,
                               int block, std::size_t channel, std::size_t place) {
  constexpr bool kIsPicture = std::is_same_v<T, std::uint8_t>;
  const std::size_t width = channels_[channel].width(), each = channels_[channel].reading_width();
  read_field<T>(reader.readout_, batch, block, channels_[channel].reading, [&](int e) {
    const bool over = data.state[as_size(e)] == EnvironmentState::over;
    if constexpr (kIsPicture)
      return over ? std::span(reader.unused_bytes_).first(each)
                  : std::span(bytes_[channel]).subspan(as_size(e) * width + place * each, each);
    else
      return over ? std::span(reader.unused_numbers_).first(each)
                  : std::span(numbers_[channel]).subspan(as_size(e) * width + place * each, each);
  });
}

}  // namespace tangere
