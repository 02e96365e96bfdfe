// SPDX-License-Identifier: Apache-2.0
// Writes neighbouring bytes in one call.
#include "io/dataset/placed_file.hpp"

#include <array>

namespace tangere {
namespace {

constexpr std::size_t kMostQueued = 1024;

}  // namespace

void PlacedFile::add(std::uint64_t address, std::span<const unsigned char> bytes,
                     const BytesOf& what) {
  static constexpr std::array<unsigned char, 8> kZeros{};
  if (bytes.empty()) return;
  const bool follows = address >= queue_end_ && address - queue_end_ < kZeros.size();
  if (!queue_.empty() && (!follows || queue_.size() + 2 > kMostQueued)) flush();
  if (queue_.empty())
    queue_begin_ = address;
  else if (address > queue_end_)
    queue_.push_back({std::span(kZeros).first(address - queue_end_), {"unused"}});
  queue_.push_back({bytes, what});
  queue_end_ = address + bytes.size();
}

void PlacedFile::flush() {
  part_.write_at(queue_begin_, queue_);
  queue_.clear();
}

void PlacedFile::end_at(std::uint64_t end, std::uint64_t root) {
  std::array<unsigned char, h5::kSuperblockBytes> superblock{};
  part_.read_at(0, superblock);
  h5::set_end_of_file(superblock, end, root);
  add(0, superblock, {"head of the file"});
  flush();
}

}  // namespace tangere
