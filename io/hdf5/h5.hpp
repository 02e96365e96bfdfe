// SPDX-License-Identifier: Apache-2.0
// The part of HDF5 that our files need, with identifiers that close themselves and errors that are
// exceptions carrying the library's own reason instead of text printed on stderr.
//
// Every function throws IoError: "cannot <operation> '<object>' in '<file>': <reason>".
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/files/written_bytes.hpp"
#include "io/hdf5/h5_id.hpp"

namespace tangere::h5 {

/// "'/scene' in 'balls/shard-00000.h5'", for messages.
[[nodiscard]] std::string place_of(const Id& object);

/// Properties of H5P_GROUP_ACCESS, H5P_DATASET_ACCESS or H5P_LINK_ACCESS with which links are
/// followed only to files of the same folder. The caller does not close them.
hid_t link_access(hid_t kind);

/// Properties of H5P_FILE_CREATE, H5P_GROUP_CREATE or H5P_DATASET_CREATE with which objects carry
/// no times, so that the same numbers give the same bytes.
Id without_times(hid_t kind);

using Dims = std::vector<hsize_t>;

/// Creates a file, replacing what is at `path`. Readable by HDF5 1.8 and later; two runs that write
/// the same numbers write the same bytes. Descriptions of objects are put together in blocks of
/// `description_block` bytes: large ones suit files of many objects. With `views` the file may have
/// virtual datasets, and reading it needs HDF5 1.10. `written`: records checksums of all writes;
/// may be null.
Id create_file(const std::string& path, WrittenBytes* written = nullptr,
               hsize_t description_block = 2048, bool views = false);
/// A file that is never on disk.
Id create_memory_file();
/// Opens a file for reading. Devices, pipes and folders are refused. Links and views may name files
/// of the same folder only, and datasets with external raw storage cannot be opened. With `evict`
/// the library does not cache descriptions of closed objects, because searching tens of thousands
/// of them is slow.
Id open_file(const std::string& path, bool evict = false);
/// Opens a file for reading and writing, as create_file left it.
Id change_file(const std::string& path, WrittenBytes* written = nullptr);
/// Gives a name to the object at an address of the file.
void link_object(const Id& parent, const std::string& name, std::uint64_t address);
/// Flushes and closes a file, and throws if any byte since it was opened could not be written. The
/// file is closed in any case.
void close_file(Id& file, const std::string& path);

Id create_group(const Id& parent, const std::string& name);
Id open_group(const Id& parent, const std::string& name);
[[nodiscard]] bool has_link(const Id& parent, const std::string& name);

/// How a dataset lies on disk.
struct Storage {
  Dims chunk;             ///< empty: contiguous
  bool compress = false;  ///< shuffle, then deflate level 1; needs a chunk shape
};

/// T: double, float, std::int8_t, std::uint8_t, std::int16_t, std::int32_t, std::int64_t,
/// std::uint64_t. On disk: little endian.
template <class T>
Id create_dataset(const Id& parent, const std::string& name, const Dims& dims,
                  const Storage& storage = {});
/// A list of h5py's booleans: an enumeration FALSE = 0, TRUE = 1 of one byte.
void create_flags(const Id& parent, const std::string& name, std::span<const std::int8_t> flags);
Id open_dataset(const Id& parent, const std::string& name);
[[nodiscard]] Dims dimensions(const Id& dataset);

/// Writes the box [offset, offset + count) from `data`, dense and row-major.
template <class T>
void write_box(const Id& dataset, const Dims& offset, const Dims& count, const T* data);
/// Reads the box [offset, offset + count) into `data`. Numbers are converted to T.
template <class T>
void read_box(const Id& dataset, const Dims& offset, const Dims& count, T* data);

/// Whether elements of a dataset are files: texts of one length, filled with zeros.
[[nodiscard]] bool has_files(const Id& dataset);
/// Reads files `first` to first + count - 1 of a list of them, without the zeros at their ends.
std::vector<std::string> read_files(const Id& dataset, hsize_t first, hsize_t count);

/// Text attributes are variable-length UTF-8, which h5py shows as str. Text must not contain NUL.
void write_attribute(const Id& object, const std::string& name, std::string_view text);
void write_attribute(const Id& object, const std::string& name, std::span<const std::string> texts);
/// One number, or a list of them. T as for create_dataset.
template <class T>
void write_scalar(const Id& object, const std::string& name, T value);
template <class T>
void write_list(const Id& object, const std::string& name, std::span<const T> values);

[[nodiscard]] std::string read_text(const Id& object, const std::string& name);
[[nodiscard]] std::vector<std::string> read_texts(const Id& object, const std::string& name);
/// The elements of a numeric attribute, whatever its rank (a scalar gives one).
template <class T>
[[nodiscard]] std::vector<T> read_numbers(const Id& object, const std::string& name);
/// A numeric attribute of one element.
template <class T>
[[nodiscard]] T read_number(const Id& object, const std::string& name);

}  // namespace tangere::h5
