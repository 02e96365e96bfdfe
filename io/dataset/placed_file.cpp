// SPDX-License-Identifier: Apache-2.0
// Writes neighbouring bytes in one call, and reads them back in one.
#include "io/dataset/placed_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

constexpr std::size_t kMostRead = std::size_t{1} << 20;
constexpr std::size_t kMostQueued = 1024;
constexpr std::size_t kRawName = ~std::size_t{0};  // no dataset has this number

std::size_t bytes_of(const PlacedRows& rows) {
  return static_cast<std::size_t>(rows.rows) * rows.row_bytes;
}

}  // namespace

void PlacedFile::add(std::uint64_t address, const PlacedRows& rows, const void* data) {
  if (bytes_of(rows) > 0) queue({address, rows}, data);
}

void PlacedFile::add(std::uint64_t address, std::span<const unsigned char> bytes) {
  if (bytes.empty()) return;
  const PlacedRows raw{static_cast<std::int64_t>(address), kRawName, 0, 1, bytes.size()};
  expected_.add(raw.episode, raw.name, raw.first_row, raw.rows, raw.row_bytes, bytes.data());
  queue({address, raw}, bytes.data());
}

void PlacedFile::queue(const Place& place, const void* data) {
  static std::array<unsigned char, 8> zeros{};
  const bool follows = place.address >= queue_end_ && place.address - queue_end_ < zeros.size();
  if (!queue_.empty() && (!follows || queue_.size() + 2 > kMostQueued)) flush();
  if (queue_.empty())
    queue_begin_ = place.address;
  else if (place.address > queue_end_)
    queue_.push_back({zeros.data(), place.address - queue_end_});
  queue_.push_back({const_cast<void*>(data), bytes_of(place.rows)});
  queue_end_ = place.address + bytes_of(place.rows);
  places_.push_back(place);
}

void PlacedFile::flush() {
  part_.write_at(queue_begin_, queue_);
  queue_.clear();
}

void PlacedFile::write_unchecked(std::uint64_t address, std::span<const unsigned char> bytes) {
  std::array<iovec, 1> pieces{{{const_cast<unsigned char*>(bytes.data()), bytes.size()}}};
  part_.write_at(address, pieces);
}

void PlacedFile::end_at(std::uint64_t end, std::uint64_t root) {
  std::array<unsigned char, h5::kSuperblockBytes> superblock{};
  part_.read_at(0, superblock);
  h5::set_end_of_file(superblock, end, root);
  write_unchecked(0, superblock);
}

void PlacedFile::verify() const {
  std::vector<Place> places = places_;
  std::sort(places.begin(), places.end(),
            [](const Place& a, const Place& b) { return a.address < b.address; });
  ContentSum sum;
  std::vector<unsigned char> buffer;
  for (std::size_t first = 0; first < places.size();) {
    const std::uint64_t begin = places[first].address;
    std::size_t end = first;
    std::uint64_t bytes = 0;
    for (; end < places.size(); ++end) {
      const std::uint64_t with_it = places[end].address + bytes_of(places[end].rows) - begin;
      if (end > first && with_it > kMostRead) break;
      bytes = with_it;
    }
    buffer.resize(std::max<std::size_t>(buffer.size(), bytes));
    part_.read_at(begin, std::span(buffer).first(bytes));
    for (; first < end; ++first) {
      const PlacedRows& r = places[first].rows;
      sum.add(r.episode, r.name, r.first_row, r.rows, r.row_bytes,
              buffer.data() + (places[first].address - begin));
    }
  }
  if (sum.value() != expected_.value())
    throw IoError(
        fmt::format("'{}' is damaged: the checksum of what was written is {:016x} when read back; "
                    "expected {:016x}",
                    part_.path(), sum.value(), expected_.value()));
}

}  // namespace tangere
