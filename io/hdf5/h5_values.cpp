// SPDX-License-Identifier: Apache-2.0
// Numbers and texts of datasets and attributes. On disk they are little-endian.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "engine/base/error.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_driver.hpp"
#include "io/hdf5/h5_failure.hpp"
#include "io/hdf5/h5_lz4.hpp"
#include "io/hdf5/reading_note.hpp"

namespace tangere::h5 {
namespace {

/// Of a chunk when it is unpacked; 0 if the dataset has none.
std::uint64_t chunk_bytes(const Id& dataset) {
  if (H5Dget_offset(dataset.get()) != HADDR_UNDEF) return 0;
  const Id creation(H5Dget_create_plist(dataset.get()));
  if (H5Pget_layout(creation.get()) != H5D_CHUNKED) return 0;
  hsize_t sides[H5S_MAX_RANK];
  const int rank = H5Pget_chunk(creation.get(), H5S_MAX_RANK, sides);
  const Id type(H5Dget_type(dataset.get()));
  std::uint64_t bytes = H5Tget_size(type.get());
  for (int i = 0; i < rank; ++i) bytes *= sides[i];
  return bytes;
}

template <class T>
struct Types;
template <>
struct Types<double> {
  static hid_t memory() { return H5T_NATIVE_DOUBLE; }
  static hid_t disk() { return H5T_IEEE_F64LE; }
};
template <>
struct Types<float> {
  static hid_t memory() { return H5T_NATIVE_FLOAT; }
  static hid_t disk() { return H5T_IEEE_F32LE; }
};
template <>
struct Types<std::int8_t> {
  static hid_t memory() { return H5T_NATIVE_INT8; }
  static hid_t disk() { return H5T_STD_I8LE; }
};
template <>
struct Types<std::uint8_t> {
  static hid_t memory() { return H5T_NATIVE_UINT8; }
  static hid_t disk() { return H5T_STD_U8LE; }
};
template <>
struct Types<std::int16_t> {
  static hid_t memory() { return H5T_NATIVE_INT16; }
  static hid_t disk() { return H5T_STD_I16LE; }
};
template <>
struct Types<std::int32_t> {
  static hid_t memory() { return H5T_NATIVE_INT32; }
  static hid_t disk() { return H5T_STD_I32LE; }
};
template <>
struct Types<std::int64_t> {
  static hid_t memory() { return H5T_NATIVE_INT64; }
  static hid_t disk() { return H5T_STD_I64LE; }
};
template <>
struct Types<std::uint64_t> {
  static hid_t memory() { return H5T_NATIVE_UINT64; }
  static hid_t disk() { return H5T_STD_U64LE; }
};

Id text_type() {
  Id type(H5Tcopy(H5T_C_S1));
  H5Tset_size(type.get(), H5T_VARIABLE);
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  return type;
}

/// `data` may be null when the attribute has no elements.
void store(const Id& object, const std::string& name, hid_t disk, hid_t memory, const Id& space,
           const void* data) {
  const Id attribute(
      H5Acreate2(object.get(), name.c_str(), disk, space.get(), H5P_DEFAULT, H5P_DEFAULT));
  if (attribute.get() < 0) fail("create attribute", object, name);
  if (H5Sget_simple_extent_npoints(space.get()) == 0) return;
  if (H5Awrite(attribute.get(), memory, data) < 0) fail("write attribute", object, name);
  check_written(object);
}

Id list_space(std::size_t size) {
  const hsize_t extent = size;
  return Id(H5Screate_simple(1, &extent, nullptr));
}

/// Selects a box of the dataset's space and makes the matching dense space of memory.
struct Box {
  Id disk, memory;
  Box(const Id& dataset, const Dims& offset, const Dims& count)
      : disk(H5Dget_space(dataset.get())),
        memory(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr)) {
    const int rank = H5Sget_simple_extent_ndims(disk.get());
    if (rank != static_cast<int>(offset.size()) || rank != static_cast<int>(count.size()))
      fail("select a box of", dataset, {},
           fmt::format("it has rank {}, not {}", rank, count.size()));
    if (H5Sselect_hyperslab(disk.get(), H5S_SELECT_SET, offset.data(), nullptr, count.data(),
                            nullptr) < 0 ||
        H5Sselect_valid(disk.get()) <= 0)
      fail("select a box of", dataset, {}, "the box lies outside");
  }
};

struct OpenAttribute {
  Id attribute, space, type;
  std::size_t elements = 0;
  OpenAttribute(const Id& object, const std::string& name) {
    note_object(name);
    attribute = Id(H5Aopen(object.get(), name.c_str(), H5P_DEFAULT));
    if (attribute.get() < 0) fail("read attribute", object, name);
    space = Id(H5Aget_space(attribute.get()));
    type = Id(H5Aget_type(attribute.get()));
    const hssize_t count = H5Sget_simple_extent_npoints(space.get());
    // We write no larger ones, and a damaged count must not become an allocation.
    if (count < 0 || count > (hssize_t{1} << 26))
      fail("read attribute", object, name, fmt::format("it claims {} elements", count));
    elements = static_cast<std::size_t>(count);
  }
};

}  // namespace

template <class T>
Id create_dataset(const Id& parent, const std::string& name, const Dims& dims,
                  const Storage& storage) {
  const Quiet quiet;
  const Id space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr));
  if (space.get() < 0) fail("lay out dataset", parent, name);
  const Id creation = without_times(H5P_DATASET_CREATE);
  const Id access(H5Pcreate(H5P_DATASET_ACCESS));
  if (!storage.chunk.empty()) {
    if (H5Pset_chunk(creation.get(), static_cast<int>(storage.chunk.size()), storage.chunk.data()) <
        0)
      fail("lay out the chunks of", parent, name);
    // Compressed chunks are written whole, so a cache would only delay errors until the file is
    // closed. A chunk that is written in parts would be inflated and deflated for each of them.
    H5Pset_chunk_cache(access.get(), 0, 0, 1);
    if (storage.compress &&
        (H5Pset_shuffle(creation.get()) < 0 || H5Pset_deflate(creation.get(), 1) < 0))
      fail("compress", parent, name);
  }
  Id dataset(H5Dcreate2(parent.get(), name.c_str(), Types<T>::disk(), space.get(), H5P_DEFAULT,
                        creation.get(), access.get()));
  if (dataset.get() < 0) fail("create dataset", parent, name);
  return dataset;
}

void create_flags(const Id& parent, const std::string& name, std::span<const std::int8_t> flags) {
  const Quiet quiet;
  const Id type(H5Tenum_create(H5T_NATIVE_INT8));
  const std::int8_t no = 0, yes = 1;
  H5Tenum_insert(type.get(), "FALSE", &no);
  H5Tenum_insert(type.get(), "TRUE", &yes);
  const Id creation = without_times(H5P_DATASET_CREATE);
  const Id space = list_space(flags.size());
  const Id dataset(H5Dcreate2(parent.get(), name.c_str(), type.get(), space.get(), H5P_DEFAULT,
                              creation.get(), H5P_DEFAULT));
  if (dataset.get() < 0) fail("create dataset", parent, name);
  const NumbersOf numbers(dataset.get());
  if (H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, flags.data()) < 0)
    fail("write", dataset);
  check_written(dataset);
}

template <class T>
void write_box(const Id& dataset, const Dims& offset, const Dims& count, const T* data) {
  const Quiet quiet;
  const LongCall writes_numbers;
  const Box box(dataset, offset, count);
  const NumbersOf numbers(dataset.get());
  if (H5Dwrite(dataset.get(), Types<T>::memory(), box.memory.get(), box.disk.get(), H5P_DEFAULT,
               data) < 0)
    fail("write", dataset);
  check_written(dataset);
}

template <class T>
void read_box(const Id& dataset, const Dims& offset, const Dims& count, T* data) {
  const Quiet quiet;
  const Box box(dataset, offset, count);
  const ExpectedChunk chunk(chunk_bytes(dataset));
  const LongCall reads_numbers;
  if (H5Dread(dataset.get(), Types<T>::memory(), box.memory.get(), box.disk.get(), H5P_DEFAULT,
              data) < 0)
    fail("read", dataset);
}

bool has_files(const Id& dataset) {
  const Quiet quiet;
  const Id type(H5Dget_type(dataset.get()));
  return H5Tget_class(type.get()) == H5T_STRING && H5Tis_variable_str(type.get()) == 0;
}

std::vector<std::string> read_files(const Id& dataset, hsize_t first, hsize_t count) {
  constexpr std::size_t kMostBytes = std::size_t{1} << 30;
  const Quiet quiet;
  const Id type(H5Dget_type(dataset.get()));
  const std::size_t width = H5Tget_size(type.get());
  if (!has_files(dataset) || width == 0 || count > kMostBytes / width)
    throw IoError(fmt::format("{} has {} texts of {} bytes; expected files, less than {} bytes",
                              place_of(dataset), count, width, kMostBytes));
  std::vector<char> bytes(width * count);
  const Box box(dataset, {first}, {count});
  const LongCall reads_numbers;
  if (H5Dread(dataset.get(), type.get(), box.memory.get(), box.disk.get(), H5P_DEFAULT,
              bytes.data()) < 0)
    fail("read", dataset);
  std::vector<std::string> files;
  for (hsize_t k = 0; k < count; ++k) {
    std::string_view file(bytes.data() + k * width, width);
    file = file.substr(0, file.find_last_not_of('\0') + 1);
    files.emplace_back(file);
  }
  return files;
}

void write_attribute(const Id& object, const std::string& name, std::string_view text) {
  const Quiet quiet;
  const std::string copy(text);
  if (copy.find('\0') != std::string::npos)
    throw IoError(fmt::format("attribute '{}': the text contains a NUL character", name));
  const char* pointer = copy.c_str();
  const Id type = text_type();
  store(object, name, type.get(), type.get(), Id(H5Screate(H5S_SCALAR)), &pointer);
}

void write_attribute(const Id& object, const std::string& name,
                     std::span<const std::string> texts) {
  const Quiet quiet;
  std::vector<const char*> pointers;
  pointers.reserve(texts.size());
  for (const std::string& text : texts) {
    if (text.find('\0') != std::string::npos)
      throw IoError(fmt::format("attribute '{}': the text contains a NUL character", name));
    pointers.push_back(text.c_str());
  }
  const Id type = text_type();
  store(object, name, type.get(), type.get(), list_space(texts.size()), pointers.data());
}

template <class T>
void write_scalar(const Id& object, const std::string& name, T value) {
  const Quiet quiet;
  store(object, name, Types<T>::disk(), Types<T>::memory(), Id(H5Screate(H5S_SCALAR)), &value);
}

template <class T>
void write_list(const Id& object, const std::string& name, std::span<const T> values) {
  const Quiet quiet;
  store(object, name, Types<T>::disk(), Types<T>::memory(), list_space(values.size()),
        values.data());
}

std::vector<std::string> read_texts(const Id& object, const std::string& name) {
  const Quiet quiet;
  const OpenAttribute open(object, name);
  if (H5Tget_class(open.type.get()) != H5T_STRING || H5Tis_variable_str(open.type.get()) <= 0)
    fail("read attribute", object, name, "it is not text of variable length");
  std::vector<std::string> texts(open.elements);
  if (texts.empty()) return texts;
  std::vector<char*> pointers(texts.size(), nullptr);
  const Id type = text_type();
  if (H5Tset_cset(type.get(), H5Tget_cset(open.type.get())) < 0 ||
      H5Aread(open.attribute.get(), type.get(), pointers.data()) < 0)
    fail("read attribute", object, name);
  for (std::size_t i = 0; i < texts.size(); ++i)
    if (pointers[i] != nullptr) texts[i] = pointers[i];
  H5Dvlen_reclaim(type.get(), open.space.get(), H5P_DEFAULT, pointers.data());
  return texts;
}

std::string read_text(const Id& object, const std::string& name) {
  std::vector<std::string> texts = read_texts(object, name);
  if (texts.size() != 1) {
    const Quiet quiet;
    fail("read attribute", object, name, fmt::format("expected one text; found {}", texts.size()));
  }
  return std::move(texts.front());
}

template <class T>
std::vector<T> read_numbers(const Id& object, const std::string& name) {
  const Quiet quiet;
  const OpenAttribute open(object, name);
  std::vector<T> values(open.elements);
  if (!values.empty() && H5Aread(open.attribute.get(), Types<T>::memory(), values.data()) < 0)
    fail("read attribute", object, name);
  return values;
}

template <class T>
T read_number(const Id& object, const std::string& name) {
  const std::vector<T> values = read_numbers<T>(object, name);
  if (values.size() != 1) {
    const Quiet quiet;
    fail("read attribute", object, name,
         fmt::format("expected one number; found {}", values.size()));
  }
  return values[0];
}

#define TANGERE_H5_TYPE(T)                                                                   \
  template Id create_dataset<T>(const Id&, const std::string&, const Dims&, const Storage&); \
  template void write_box<T>(const Id&, const Dims&, const Dims&, const T*);                 \
  template void read_box<T>(const Id&, const Dims&, const Dims&, T*);                        \
  template void write_scalar<T>(const Id&, const std::string&, T);                           \
  template void write_list<T>(const Id&, const std::string&, std::span<const T>);            \
  template std::vector<T> read_numbers<T>(const Id&, const std::string&);                    \
  template T read_number<T>(const Id&, const std::string&);
TANGERE_H5_TYPE(double)
TANGERE_H5_TYPE(float)
TANGERE_H5_TYPE(std::int8_t)
TANGERE_H5_TYPE(std::uint8_t)
TANGERE_H5_TYPE(std::int16_t)
TANGERE_H5_TYPE(std::int32_t)
TANGERE_H5_TYPE(std::int64_t)
TANGERE_H5_TYPE(std::uint64_t)
#undef TANGERE_H5_TYPE

}  // namespace tangere::h5
