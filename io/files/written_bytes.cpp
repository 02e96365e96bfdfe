// SPDX-License-Identifier: Apache-2.0
// The checksum of bytes at given places is
//
//   Σ over words w of eight bytes, aligned in the file: factor(place of w) · w, modulo 2⁶¹ − 1,
//
// where bytes that are not part of a piece count as zeros. It is linear, so that the sum of two
// pieces side by side is the sum of their sums, and a part that was read again can be taken away.
#include "io/files/written_bytes.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <vector>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

__extension__ using Wide = unsigned __int128;

constexpr std::uint64_t kPrime = (std::uint64_t{1} << 61) - 1;
constexpr std::size_t kWord = sizeof(std::uint64_t);
constexpr std::uint64_t kMostJoined = std::uint64_t{1} << 16;  // compared as a whole
constexpr std::size_t kMostRead = std::size_t{1} << 20;

std::uint64_t plus(std::uint64_t a, std::uint64_t b) { return (a + b) % kPrime; }
std::uint64_t minus(std::uint64_t a, std::uint64_t b) { return (a + kPrime - b) % kPrime; }

/// Looks random, below 2⁶¹.
std::uint64_t factor(std::uint64_t place) {
  std::uint64_t x = (place + 1) * 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 32)) * 0xBF58476D1CE4E5B9ULL;
  return x >> 3;
}

std::uint64_t word_at(const unsigned char* bytes) {
  std::uint64_t word = 0;
  std::memcpy(&word, bytes, kWord);
  return word;
}

/// The sum of bytes at `offset` of a file.
std::uint64_t sum_of(std::uint64_t offset, std::span<const unsigned char> bytes) {
  Wide sum = 0;
  std::uint64_t place = offset / kWord;
  const auto add_part = [&](std::size_t from, std::size_t count) {
    unsigned char word[kWord] = {};
    std::copy_n(bytes.begin(), count, word + from);
    sum += Wide{factor(place++)} * word_at(word);
    bytes = bytes.subspan(count);
  };
  if (const std::size_t from = offset % kWord; from != 0 && !bytes.empty())
    add_part(from, std::min(kWord - from, bytes.size()));
  constexpr std::size_t kTogether = 4;  // products of 125 bits that a sum of 128 bits has room for
  for (; bytes.size() >= kTogether * kWord; bytes = bytes.subspan(kTogether * kWord)) {
    sum = (sum & kPrime) + (sum >> 61);
    for (std::size_t k = 0; k < kTogether; ++k)
      sum += Wide{factor(place++)} * word_at(bytes.data() + k * kWord);
  }
  while (!bytes.empty()) {
    sum = (sum & kPrime) + (sum >> 61);
    add_part(0, std::min(kWord, bytes.size()));
  }
  return static_cast<std::uint64_t>(sum % kPrime);
}

/// Sums of what a file has, in reads of up to a megabyte if it is read from front to back.
class Reader {
 public:
  Reader(int descriptor, const std::string& path, std::size_t ahead)
      : descriptor_(descriptor), path_(path), ahead_(ahead) {}

  std::uint64_t sum(std::uint64_t begin, std::uint64_t end) {
    std::uint64_t total = 0;
    while (begin < end) {
      if (begin < first_ || begin >= first_ + buffer_.size())
        fill(begin, std::clamp<std::uint64_t>(end - begin, ahead_, kMostRead));
      const std::uint64_t skipped = begin - first_,
                          taken = std::min(end - begin, buffer_.size() - skipped);
      total = plus(total, sum_of(begin, std::span(buffer_).subspan(skipped, taken)));
      begin += taken;
    }
    return total;
  }

 private:
  /// What lies beyond the end of the file counts as zeros.
  void fill(std::uint64_t offset, std::size_t bytes) {
    buffer_.assign(bytes, 0);
    first_ = offset;
    for (std::size_t done = 0; done < bytes;) {
      const ssize_t got = pread(descriptor_, buffer_.data() + done, bytes - done,
                                static_cast<off_t>(offset + done));
      if (got == 0) return;
      if (got < 0 && errno != EINTR)
        throw IoError(fmt::format("cannot read '{}': {}", path_, std::strerror(errno)));
      if (got > 0) done += static_cast<std::size_t>(got);
    }
  }

  int descriptor_;
  const std::string& path_;
  std::size_t ahead_;
  std::vector<unsigned char> buffer_;
  std::uint64_t first_ = 0;
};

}  // namespace

void WrittenBytes::add(std::uint64_t offset, std::span<const unsigned char> bytes,
                       const BytesOf& what) {
  if (bytes.empty()) return;
  compared_ = false;
  const std::uint64_t end = offset + bytes.size(), sum = sum_of(offset, bytes);
  clear_sums(offset, end);
  size_ = std::max(size_, end);
  auto name = names_.find(what.name);
  if (name == names_.end()) name = names_.emplace(what.name).first;
  const auto next = pieces_.lower_bound(offset);
  if (next != pieces_.begin()) {
    const auto before = std::prev(next);
    Piece& piece = before->second;
    if (piece.end == offset && piece.name == &*name && piece.number == what.number &&
        end - before->first <= kMostJoined) {
      piece.end = end;
      piece.sum = plus(piece.sum, sum);
      return;
    }
  }
  pieces_.emplace_hint(next, offset, Piece{end, sum, &*name, what.number});
}

/// Of a piece that is partly in [begin, end), takes the sum of what the file has there away: if
/// that is not what was written, the rest no longer fits either.
void WrittenBytes::clear_sums(std::uint64_t begin, std::uint64_t end) {
  Reader reader(descriptor_, path_, 0);
  auto next = pieces_.upper_bound(begin);
  if (next != pieces_.begin() && std::prev(next)->second.end > begin) --next;
  while (next != pieces_.end() && next->first < end) {
    const auto [first, piece] = *next;
    next = pieces_.erase(next);
    if (first >= begin && piece.end <= end) continue;
    std::uint64_t rest =
        minus(piece.sum, reader.sum(std::max(first, begin), std::min(piece.end, end)));
    if (piece.end > end) {
      const std::uint64_t behind = first < begin ? reader.sum(end, piece.end) : rest;
      rest = minus(rest, behind);
      pieces_[end] = {piece.end, behind, piece.name, piece.number};
    }
    if (first < begin) pieces_[first] = {begin, rest, piece.name, piece.number};
  }
}

void WrittenBytes::end_at(std::uint64_t size) {
  compared_ = false;
  if (size < size_) clear_sums(size, size_);
  size_ = size;
}

bool WrittenBytes::is_of(std::uint64_t device, std::uint64_t number) const {
  struct stat info {};
  return fstat(descriptor_, &info) == 0 && info.st_dev == device && info.st_ino == number;
}

void WrittenBytes::throw_difference(std::uint64_t begin, std::uint64_t end, const std::string& name,
                                    std::int64_t number) const {
  throw IoError(fmt::format(
      "'{}' is damaged: bytes {} to {} ({}) are not what was written when they are read back",
      path_, begin, end - 1, number < 0 ? name : fmt::format("{}{}", name, number)));
}

void WrittenBytes::compare(std::uint64_t offset, std::uint64_t bytes) const {
  Reader reader(descriptor_, path_, 0);
  auto next = pieces_.upper_bound(offset);
  if (next != pieces_.begin() && std::prev(next)->second.end > offset) --next;
  for (; next != pieces_.end() && next->first < offset + bytes; ++next) {
    const auto& [first, piece] = *next;
    if (reader.sum(first, piece.end) != piece.sum)
      throw_difference(first, piece.end, *piece.name, piece.number);
  }
}

void WrittenBytes::compare_all() {
  if (compared_) return;
  Reader reader(descriptor_, path_, kMostRead);
  std::uint64_t at = 0;
  const auto compare_unused = [&](std::uint64_t end) {
    if (at < end && reader.sum(at, end) != 0) throw_difference(at, end, "unused", -1);
  };
  for (const auto& [first, piece] : pieces_) {
    compare_unused(first);
    if (reader.sum(first, piece.end) != piece.sum)
      throw_difference(first, piece.end, *piece.name, piece.number);
    at = piece.end;
  }
  compare_unused(size_);
  struct stat info {};
  if (fstat(descriptor_, &info) != 0)
    throw IoError(fmt::format("cannot read '{}': {}", path_, std::strerror(errno)));
  if (static_cast<std::uint64_t>(info.st_size) != size_)
    throw IoError(
        fmt::format("'{}' is damaged: it has {} bytes; expected {}", path_, info.st_size, size_));
  compared_ = true;
}

}  // namespace tangere
