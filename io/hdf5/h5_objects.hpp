// SPDX-License-Identifier: Apache-2.0
// Makes objects of HDF5 files as bytes, without the library and on any thread. The library takes 17
// µs per object on one thread. That is 0.2 ms for an episode that takes 0.86 ms of one core to
// simulate (docs/datasets.md). Formats: HDF5 File Format Specification, version 3. Tests and
// `tangere validate` read everything made here back through the library.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tangere::h5 {

/// The address that stands for "none".
inline constexpr std::uint64_t kNowhere = ~std::uint64_t{0};

/// Rounds up to a multiple of eight bytes, where objects and rows begin.
constexpr std::uint64_t aligned(std::uint64_t bytes) { return (bytes + 7) / 8 * 8; }

/// Little-endian bytes of a file to be written.
class Bytes {
 public:
  template <class T>
  void number(T value) {
    for (std::size_t k = 0; k < sizeof(T); ++k)
      bytes_.push_back(static_cast<unsigned char>(static_cast<std::uint64_t>(value) >> (8 * k)));
  }
  void add(std::span<const unsigned char> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  void text(std::string_view text) { bytes_.insert(bytes_.end(), text.begin(), text.end()); }
  void zeros(std::size_t count) { bytes_.resize(bytes_.size() + count, 0); }
  /// Adds zeros up to a multiple of eight bytes.
  void align() { bytes_.resize(aligned(bytes_.size()), 0); }
  void clear() { bytes_.clear(); }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::span<const unsigned char> from(std::size_t first) const {
    return std::span(bytes_).subspan(first);
  }
  [[nodiscard]] std::span<const unsigned char> all() const { return bytes_; }

 private:
  std::vector<unsigned char> bytes_;
};

/// The library's checksum of object descriptions: Jenkins' lookup3.
std::uint32_t object_checksum(std::span<const unsigned char> bytes);

/// LZ4's number among registered filters. Readers need its plug-in or allow_lz4()
/// (io/hdf5/h5_lz4.hpp).
inline constexpr std::uint16_t kLz4Filter = 32004;

/// Size of the head of a file that the library made for readers of HDF5 1.8.
inline constexpr std::size_t kSuperblockBytes = 48;
/// Writes where the file ends after it grew and, unless `root` is kNowhere, the address of its
/// group "/".
void set_end_of_file(std::span<unsigned char, kSuperblockBytes> superblock, std::uint64_t end,
                     std::uint64_t root = kNowhere);

/// Types of the format. `text`: bytes, filled with zeros up to one length.
enum class NumberType { float32, float64, int8, uint8, int16, int64, uint64, boolean, text };
/// Bytes of a number. A text has those of its dataset: the result is 1.
std::size_t bytes_of(NumberType type);

struct FileFilter {
  std::uint16_t id = 0;
  std::string_view name = {};  ///< for filter numbers from 256 on
  std::vector<std::uint32_t> values = {};
};

/// Names the text that says which rows a virtual dataset shows, in a list that add_texts made.
struct FileView {
  std::uint64_t texts = 0;   ///< address of the list
  std::uint32_t number = 0;  ///< index in the list
};

/// A text in a list that add_texts made. Objects of read-only files can share it. A change through
/// one object would take the text from the others.
struct FileText {
  std::string_view name;     ///< of the attribute
  std::uint64_t texts = 0;   ///< address of the list
  std::uint32_t number = 0;  ///< index in the list
  std::uint32_t bytes = 0;
};

/// A dataset. Elements that its chunks leave out are zero. Elements that a view cannot find are
/// NaN.
struct FileDataset {
  NumberType type = NumberType::float32;
  std::vector<std::uint64_t> dims;
  std::vector<std::uint64_t> chunk = {};  ///< empty: contiguous
  std::uint64_t address = kNowhere;       ///< of the numbers, or of the index of the chunks
  std::span<const FileFilter> filters = {};
  std::span<const FileText> texts = {};  ///< attributes
  std::optional<FileView> view =
      {};  ///< shows floating-point numbers of other datasets; none of its own
  std::uint32_t text_bytes = 1;  ///< of each text
};

struct FileLink {
  std::string_view name;
  std::uint64_t address = kNowhere;  ///< of the object, if it is in this file
  std::string_view file = {};  ///< of the object, if in another file; relative to this one's folder
  std::string_view path = {};  ///< in that file
};

/// A number, or a list of them.
struct FileAttribute {
  std::string_view name;
  NumberType type;
  bool list;
  std::span<const unsigned char> values;  ///< little-endian
};

/// Appends texts, or other bytes, that attributes and views refer to. Appends nothing for an empty
/// list.
void add_texts(Bytes& out, std::span<const std::string_view> texts);
/// Appends the description of a dataset.
void add_dataset(Bytes& out, const FileDataset& dataset);
/// Appends a group that stores its links in its own header. This suits groups of few links.
void add_group(Bytes& out, std::span<const FileLink> links,
               std::span<const FileAttribute> attributes = {});

}  // namespace tangere::h5
