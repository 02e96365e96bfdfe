// SPDX-License-Identifier: Apache-2.0
// What a run stores: channels of numbers with names, units and frames. A rollout in tasks/ declares
// and fills them; files in io/ store any of them, and readers list them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace tangere {

/// Numbers of one type. NumberType has the order of the alternatives.
using Numbers =
    std::variant<std::span<const double>, std::span<const float>, std::span<const std::int64_t>,
                 std::span<const std::int32_t>, std::span<const std::int8_t>,
                 std::span<const std::uint8_t>, std::span<const std::int16_t>>;
enum class NumberType { float64, float32, int64, int32, int8, uint8, int16 };

/// A named fact about a run, a group of channels or a channel.
struct RunAttribute {
  std::string name;
  std::variant<std::string, std::vector<std::string>, std::int64_t, std::uint64_t, double,
               std::vector<double>, std::vector<std::int64_t>, std::vector<std::int8_t>>
      value;
};
using Attributes = std::vector<RunAttribute>;

/// Numbers that a run stores row by row.
struct Channel {
  enum class Storage {
    plain,           ///< uncompressed
    compressed,      ///< in chunks of many rows
    per_environment  ///< compressed, a chunk for each row and environment
  };
  std::string name;  ///< path in a file: "q", "bodies/pose", "tactile/pad/force"
  NumberType type = NumberType::float64;
  std::vector<std::uint64_t> shape;  ///< of a row: {E, nq}; none: one number
  std::int64_t rows = 0;
  /// Units along the last axis, each beside its name, or one of all numbers. Empty: unknown.
  std::vector<std::string> names = {}, units = {};
  std::string frame = {}, meaning = {};
  Attributes more = {};
  Storage storage = Storage::plain;

  [[nodiscard]] std::size_t width() const {  ///< numbers of a row
    std::size_t numbers = 1;
    for (const std::uint64_t n : shape) numbers *= n;
    return numbers;
  }
};

/// Numbers that are known as a whole: places of points, values of randomised parameters.
struct Table {
  Channel channel;
  std::variant<std::vector<double>, std::vector<std::int64_t>> numbers;  ///< (rows, shape)
};

/// Everything that a run stores.
struct Recording {
  Attributes facts;
  std::vector<std::pair<std::string, Attributes>> groups;  ///< by path: "bodies"
  std::vector<Channel> channels;
  std::vector<Table> tables;
};

/// Receives the rows of channels while a run goes on. A sink that cannot store throws IoError; the
/// run stops and passes it on.
class RowSink {
 public:
  virtual ~RowSink() = default;
  /// The next numbers of channel `channel` of the recording, which belong to the row after `step`
  /// steps of this run. A row comes whole, or in consecutive parts of whole environments.
  virtual void write(std::int64_t step, std::size_t channel, const Numbers& numbers) = 0;
};

}  // namespace tangere
