// SPDX-License-Identifier: Apache-2.0
// Channels, tables and attributes of engine/rows as objects of a file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/rows/channel.hpp"
#include "io/hdf5/h5.hpp"

namespace tangere::h5 {

[[nodiscard]] std::size_t bytes_of(NumberType type);

void write_attributes(const Id& object, const Attributes& attributes);

/// Opens the group at a path below `parent`, "tactile/pad", and creates what is missing of it.
Id group_at(const Id& parent, const std::string& path);

/// Writes the rows of a channel one after another.
class ChannelWriter {
 public:
  ChannelWriter(const Id& file, const Channel& channel);
  /// The next row, or consecutive parts of it that have whole environments, the first axis. Throws
  /// IoError when there are more numbers than the channel has, or numbers of another type.
  void write(const Numbers& numbers);
  /// Whole rows so far.
  [[nodiscard]] std::int64_t rows() const { return rows_; }

 private:
  template <class T>
  void append(std::span<const T> numbers);
  template <class T>
  void put(const T* data, std::size_t count);

  Id dataset_;
  std::vector<hsize_t> shape_;  // of a row
  std::int64_t most_, rows_ = 0;
  std::size_t width_, in_row_ = 0;  // numbers of a row; those of the row that is not whole yet
  /// A compressed chunk, kept until it is whole, because writing a part of one unpacks and packs it
  /// again. Numbers that it has, at most; 0: rows are written as they come.
  std::size_t chunk_ = 0;
  bool many_rows_ = false;                    // in a chunk
  std::size_t put_row_ = 0, put_in_row_ = 0;  // what is in the file
  std::vector<unsigned char> held_;
};

/// Creates a dataset and writes all of it.
void write_table(const Id& file, const Table& table);

/// Describes a dataset: type, shape, rows, names, units, frame and meaning. Throws IoError.
[[nodiscard]] Channel read_channel(const Id& dataset, const std::string& name);
/// Describes the datasets below a group, in the order of their names. `path`: stands before these.
[[nodiscard]] std::vector<Channel> list_channels(const Id& parent, const std::string& path = {});

}  // namespace tangere::h5
