// SPDX-License-Identifier: Apache-2.0
// Chunks have about a megabyte. What is mostly zeros, or hardly changes from row to row, is
// compressed.
#include "io/hdf5/h5_channels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "engine/base/error.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere::h5 {
namespace {

constexpr hsize_t kChunkBytes = 1U << 20;
constexpr std::ptrdiff_t kDeepestGroup = 8;  // more is damage, or a circle of links

Dims dims_of(const Channel& channel) {
  Dims dims{static_cast<hsize_t>(channel.rows)};
  dims.insert(dims.end(), channel.shape.begin(), channel.shape.end());
  return dims;
}

/// Chunks of whole rows, or of whole environments where a row is larger than a chunk.
Storage storage_of(const Channel& channel) {
  Dims dims = dims_of(channel);
  const hsize_t element = bytes_of(channel.type), row = channel.width() * element;
  if (row == 0 || dims[0] == 0) return {};
  if (channel.storage == Channel::Storage::per_environment) {
    dims[0] = dims[1] = 1;
    return {dims, true};
  }
  const bool compress = channel.storage == Channel::Storage::compressed;
  if (!compress && dims[0] * row <= kChunkBytes) return {};  // small: one contiguous piece
  const hsize_t environment = dims.size() > 1 ? row / dims[1] : row;
  if (dims.size() > 1) dims[1] = std::clamp<hsize_t>(kChunkBytes / environment, 1, dims[1]);
  if (dims.size() > 2 && compress)
    dims[2] = std::clamp<hsize_t>(kChunkBytes / (environment / dims[2]), 1, dims[2]);
  const hsize_t part = dims.size() > 1 ? environment * dims[1] : row;
  dims[0] = std::clamp<hsize_t>(kChunkBytes / part, 1, dims[0]);
  return {dims, compress};
}

/// Calls body(T{}) with a number of the type.
template <class Body>
auto with_type(NumberType type, const Body& body) {
  switch (type) {
    case NumberType::float32: return body(float{});
    case NumberType::int64: return body(std::int64_t{});
    case NumberType::int32: return body(std::int32_t{});
    case NumberType::int8: return body(std::int8_t{});
    case NumberType::uint8: return body(std::uint8_t{});
    case NumberType::int16: return body(std::int16_t{});
    case NumberType::float64: break;
  }
  return body(double{});
}

Id create(const Id& file, const Channel& channel) {
  const std::size_t slash = channel.name.rfind('/');
  const bool below = slash != std::string::npos;
  const Id group = below ? group_at(file, channel.name.substr(0, slash)) : Id();
  const std::string name = below ? channel.name.substr(slash + 1) : channel.name;
  Id dataset = with_type(channel.type, [&](auto zero) {
    return create_dataset<decltype(zero)>(below ? group : file, name, dims_of(channel),
                                          storage_of(channel));
  });
  if (!channel.names.empty())
    write_attribute(dataset, "names", std::span<const std::string>(channel.names));
  const bool one_each = channel.units.size() == channel.names.size() && !channel.shape.empty() &&
                        channel.shape.back() == channel.units.size();
  if (one_each && !channel.units.empty())
    write_attribute(dataset, "units", std::span<const std::string>(channel.units));
  else if (!channel.units.empty())
    write_attribute(dataset, "units", channel.units[0]);
  if (!channel.frame.empty()) write_attribute(dataset, "frame", channel.frame);
  if (!channel.meaning.empty()) write_attribute(dataset, "meaning", channel.meaning);
  write_attributes(dataset, channel.more);
  return dataset;
}

void write_value(const Id& object, const std::string& name, const std::string& text) {
  write_attribute(object, name, text);
}
void write_value(const Id& object, const std::string& name, const std::vector<std::string>& list) {
  write_attribute(object, name, std::span<const std::string>(list));
}
template <class T>
void write_value(const Id& object, const std::string& name, T number) {
  write_scalar<T>(object, name, number);
}
template <class T>
void write_value(const Id& object, const std::string& name, const std::vector<T>& list) {
  write_list<T>(object, name, list);
}

}  // namespace

std::size_t bytes_of(NumberType type) {
  return with_type(type, [](auto zero) { return sizeof(zero); });
}

void write_attributes(const Id& object, const Attributes& attributes) {
  for (const RunAttribute& attribute : attributes)
    std::visit([&](const auto& value) { write_value(object, attribute.name, value); },
               attribute.value);
}

Id group_at(const Id& parent, const std::string& path) {
  const std::size_t slash = path.find('/');
  const std::string name = path.substr(0, slash);
  Id group = has_link(parent, name) ? open_group(parent, name) : create_group(parent, name);
  return slash == std::string::npos ? std::move(group) : group_at(group, path.substr(slash + 1));
}

ChannelWriter::ChannelWriter(const Id& file, const Channel& channel)
    : dataset_(create(file, channel)),
      shape_(channel.shape.begin(), channel.shape.end()),
      most_(channel.rows),
      width_(channel.width()) {
  if (channel.storage != Channel::Storage::compressed) return;
  const Storage storage = storage_of(channel);
  if (storage.chunk.empty()) return;
  many_rows_ = storage.chunk[0] > 1;
  chunk_ = many_rows_ || shape_.empty() ? storage.chunk[0] * width_
                                        : storage.chunk[1] * (width_ / shape_[0]);
  held_.reserve(chunk_ * bytes_of(channel.type));
}

void ChannelWriter::write(const Numbers& numbers) {
  std::visit([&](const auto& values) { append(values); }, numbers);
}

template <class T>
void ChannelWriter::append(std::span<const T> numbers) {
  const std::size_t environment = shape_.empty() || shape_[0] == 0 ? width_ : width_ / shape_[0];
  const bool whole = environment == 0 ? numbers.empty() : numbers.size() % environment == 0;
  if (rows_ >= most_ || !whole || in_row_ + numbers.size() > width_ ||
      (numbers.empty() && width_ > 0))
    throw IoError(fmt::format("{}: row {} of {} has {} numbers; expected {}", place_of(dataset_),
                              rows_, most_, in_row_ + numbers.size(), width_));
  in_row_ += numbers.size();
  const bool row_ends = in_row_ == width_;
  if (row_ends) ++rows_, in_row_ = 0;
  if (width_ == 0) return;
  if (chunk_ == 0) {
    put(numbers.data(), numbers.size());
    return;
  }
  while (!numbers.empty()) {
    const std::size_t held = held_.size() / sizeof(T),
                      count = std::min(chunk_ - held, numbers.size());
    const auto bytes = std::as_bytes(numbers.first(count));
    const auto* const from = reinterpret_cast<const unsigned char*>(bytes.data());
    held_.insert(held_.end(), from, from + bytes.size());
    numbers = numbers.subspan(count);
    const bool last = numbers.empty() && row_ends && (!many_rows_ || rows_ == most_);
    if (held + count < chunk_ && !last) continue;
    put(reinterpret_cast<const T*>(held_.data()), held + count);
    held_.clear();
  }
}

/// Writes whole rows, or environments of one row, behind what is in the file.
template <class T>
void ChannelWriter::put(const T* data, std::size_t count) {
  Dims offset(shape_.size() + 1, 0), box = shape_;
  offset[0] = put_row_;
  box.insert(box.begin(), std::max<hsize_t>(1, count / width_));
  if (count % width_ != 0) {
    const std::size_t environment = width_ / shape_[0];
    offset[1] = put_in_row_ / environment;
    box[1] = count / environment;
  }
  write_box<T>(dataset_, offset, box, data);
  put_in_row_ += count;
  put_row_ += put_in_row_ / width_;
  put_in_row_ %= width_;
}

void write_table(const Id& file, const Table& table) {
  std::visit(
      [&](const auto& numbers) {
        using T = typename std::decay_t<decltype(numbers)>::value_type;
        const Id dataset = create(file, table.channel);
        const Dims dims = dims_of(table.channel);
        if (!numbers.empty()) write_box<T>(dataset, Dims(dims.size(), 0), dims, numbers.data());
      },
      table.numbers);
}

Channel read_channel(const Id& dataset, const std::string& name) {
  const Dims dims = dimensions(dataset);
  Channel channel;
  channel.name = name;
  {
    const Quiet quiet;
    const Id type(H5Dget_type(dataset.get()));
    const bool real = H5Tget_class(type.get()) == H5T_FLOAT;
    const std::size_t bytes = H5Tget_size(type.get());
    channel.type = real         ? bytes == 4 ? NumberType::float32 : NumberType::float64
                   : bytes == 8 ? NumberType::int64
                   : bytes == 4 ? NumberType::int32
                   : bytes == 2 ? NumberType::int16
                   : H5Tget_sign(type.get()) == H5T_SGN_NONE ? NumberType::uint8
                                                             : NumberType::int8;
  }
  if (!dims.empty()) {
    channel.rows = static_cast<std::int64_t>(dims[0]);
    channel.shape.assign(dims.begin() + 1, dims.end());
  }
  const auto text = [&](const char* attribute) {
    return H5Aexists(dataset.get(), attribute) > 0 ? attribute_text(dataset, attribute)
                                                   : std::string();
  };
  const auto texts = [&](const char* attribute) {
    return H5Aexists(dataset.get(), attribute) > 0 ? read_texts(dataset, attribute)
                                                   : std::vector<std::string>();
  };
  channel.names = texts("names");
  channel.units = texts("units");
  channel.frame = text("frame");
  channel.meaning = text("meaning");
  return channel;
}

std::vector<Channel> list_channels(const Id& parent, const std::string& path) {
  std::vector<Channel> channels;
  for (const std::string& name : link_names(parent)) {
    const std::string inner = path + name;
    if (is_dataset(parent, name)) {
      channels.push_back(read_channel(open_dataset(parent, name), inner));
    } else if (std::count(inner.begin(), inner.end(), '/') < kDeepestGroup) {
      for (Channel& channel : list_channels(open_group(parent, name), inner + "/"))
        channels.push_back(std::move(channel));
    }
  }
  return channels;
}

}  // namespace tangere::h5
