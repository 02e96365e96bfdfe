// SPDX-License-Identifier: Apache-2.0
// The library's return codes become IoError here and nowhere else.
#include "io/hdf5/h5.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <utility>

#include "engine/base/error.hpp"
#include "io/files/text_file.hpp"
#include "io/hdf5/h5_driver.hpp"
#include "io/hdf5/h5_lz4.hpp"
#include "io/hdf5/reading_note.hpp"

namespace tangere::h5 {
namespace {

/// What the library's error stack says, innermost cause first; the operating system's words if any.
std::string last_reason() {
  std::string text;
  const auto keep_innermost = [](unsigned, const H5E_error2_t* entry, void* into) -> herr_t {
    auto& reason = *static_cast<std::string*>(into);
    if (reason.empty() && entry->desc != nullptr) reason = entry->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_innermost, &text);
  constexpr std::string_view kMark = "error message = '";
  if (const auto start = text.find(kMark); start != std::string::npos) {
    const auto begin = start + kMark.size();
    return text.substr(begin, text.find('\'', begin) - begin);
  }
  return text.empty() ? "HDF5 gives no reason" : text;
}

std::string name_of(hid_t object) {
  const ssize_t size = H5Iget_name(object, nullptr, 0);
  if (size <= 0) return {};
  std::string name(static_cast<std::size_t>(size) + 1, '\0');
  H5Iget_name(object, name.data(), name.size());
  name.resize(static_cast<std::size_t>(size));
  return name;
}

std::string file_of(hid_t object) {
  const ssize_t size = H5Fget_name(object, nullptr, 0);
  if (size <= 0) return {};
  std::string name(static_cast<std::size_t>(size) + 1, '\0');
  H5Fget_name(object, name.data(), name.size());
  name.resize(static_cast<std::size_t>(size));
  return name;
}

/// `reason` is our own text for failures that the library does not explain.
[[noreturn]] void fail(std::string_view operation, const Id& object, std::string_view child = {},
                       std::string reason = {}) {
  if (reason.empty()) reason = last_reason();  // before any other call of the library clears it
  std::shared_ptr<const WriteFailure> failure;
  if (any_write_failure()) {  // then what the library says is only a consequence
    const Id file(H5Iget_file_id(object.get()));
    failure = write_failure(file.get());
  }
  std::string where = name_of(object.get());
  if (!child.empty()) {
    if (!where.ends_with('/')) where += '/';
    where += child;
  }
  const std::string doing =
      fmt::format("cannot {} '{}' in '{}'", operation, where, file_of(object.get()));
  if (failure != nullptr && failure->any()) failure->tell(doing);
  throw IoError(fmt::format("{}: {}", doing, reason));
}

/// Throws if the disk refused an earlier write: the library buffers bytes, and its driver hides
/// failures from it.
void check_written(const Id& object) {
  if (!any_write_failure()) return;
  const Id file(H5Iget_file_id(object.get()));
  if (const auto failure = write_failure(file.get()); failure != nullptr && failure->any())
    fail("write", object, {}, "the disk refused it");
}

/// The way from Minari's view, DATASET/minari/tangere/[TASK/]NAME/data/main_data.hdf5, to DATASET;
/// empty for other files.
std::filesystem::path way_up(const std::filesystem::path& from) {
  if (from.filename() != "main_data.hdf5") return {};
  std::filesystem::path up = "../../..", place = from.parent_path().parent_path().parent_path();
  for (const bool with_task : {false, true}) {
    up /= "..";
    if (place.filename() == "tangere" && place.parent_path().filename() == "minari") return up;
    if (!with_task) place = place.parent_path();
  }
  return {};
}

/// Whether a file may lead to another: to one beside it ("shard-00001.h5"), and Minari's view to
/// one of the data set ("../../../../shard-00001.h5").
bool may_lead_to(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (to.empty() || to.is_absolute() || to.filename() == "..") return false;
  const std::filesystem::path up = way_up(from);
  return to.parent_path().empty() || (!up.empty() && to.parent_path() == up);
}

/// What the library asks before it follows a link to another file; a negative answer refuses.
herr_t allow_link(const char* from, const char*, const char* to, const char*, unsigned*, hid_t,
                  void*) {
  return may_lead_to(from, to) ? 0 : -1;
}

/// Whether a description has a message of type 7: a list of external files. Much faster than to ask
/// for the properties, which copies all of them.
bool has_external_list(const Id& dataset) {
#if H5_VERSION_GE(1, 12, 0)
  H5O_native_info_t info;
  if (H5Oget_native_info(dataset.get(), &info, H5O_NATIVE_INFO_HDR) < 0) return true;
#else
  H5O_info_t info;
  if (H5Oget_info2(dataset.get(), &info, H5O_INFO_HDR) < 0) return true;
#endif
  constexpr unsigned kExternalFiles = 7;
  return (info.hdr.mesg.present >> kExternalFiles & 1U) != 0;
}

/// Refuses numbers that lie outside HDF5 files, views of other folders and views of themselves.
void check_source(const Id& dataset, const Id& parent, const std::string& name) {
  if (H5Dget_offset(dataset.get()) != HADDR_UNDEF && !has_external_list(dataset)) return;
  const Id creation(H5Dget_create_plist(dataset.get()));
  if (H5Pget_external_count(creation.get()) > 0)
    fail("open dataset", parent, name, "its numbers lie in another file, which is not HDF5");
  if (H5Pget_layout(creation.get()) != H5D_VIRTUAL) return;
  std::size_t views = 0;
  H5Pget_virtual_count(creation.get(), &views);
  const std::string own = name_of(dataset.get());
  for (std::size_t k = 0; k < views; ++k) {
    const auto text = [&](auto get) {
      const ssize_t size = get(creation.get(), k, nullptr, std::size_t{0});
      std::string value(static_cast<std::size_t>(std::max<ssize_t>(size, 0)) + 1, '\0');
      get(creation.get(), k, value.data(), value.size());
      value.pop_back();
      return value;
    };
    const std::string file = text(H5Pget_virtual_filename);
    if (!may_lead_to(file_of(dataset.get()), file))
      fail("open dataset", parent, name, fmt::format("it shows '{}', in another folder", file));
    if (file == "." && text(H5Pget_virtual_dsetname) == own)
      fail("open dataset", parent, name, "it shows itself");
  }
}

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

std::string open_reason() {
  return last_open_error() != 0 ? std::strerror(last_open_error()) : last_reason();
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

Id without_times(hid_t kind) {
  Id properties(H5Pcreate(kind));
  H5Pset_obj_track_times(properties.get(), false);  // same numbers, same bytes
  return properties;
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

hid_t link_access(hid_t kind) {
  const auto made = [](hid_t of) {
    const hid_t access = H5Pcreate(of);
    H5Pset_elink_cb(access, allow_link, nullptr);
    return std::pair(of, access);
  };
  // Made once and kept: making one takes longer than opening an object with it.
  static const std::array all{made(H5P_GROUP_ACCESS), made(H5P_DATASET_ACCESS),
                              made(H5P_LINK_ACCESS)};
  return std::find_if(all.begin(), all.end(), [&](const auto& a) { return a.first == kind; })
      ->second;
}

std::string place_of(const Id& object) {
  return fmt::format("'{}' in '{}'", name_of(object.get()), file_of(object.get()));
}

Quiet::Quiet() {
  note_call_begins();
  // Otherwise the library would try again, and complain, at the end of the program about a file
  // that a full disk kept it from closing. The call is refused without harm when the library is
  // already in use.
  static const herr_t no_exit_handler = H5dont_atexit();
  static_cast<void>(no_exit_handler);
  H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

Quiet::~Quiet() {
  note_call_ends();
  H5Eset_auto2(H5E_DEFAULT, function_, data_);
}

void Id::reset() noexcept {
  if (id_ < 0) return;
  const Quiet quiet;
  H5Idec_ref(id_);
  id_ = -1;
}

Id create_file(const std::string& path, WrittenBytes* written, hsize_t description_block,
               bool views) {
  const Quiet quiet;
  const Id access(H5Pcreate(H5P_FILE_ACCESS));
  // 1.8 objects: attributes above 64 KiB (long scenes), and a plain open works after a crash.
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, views ? H5F_LIBVER_V110 : H5F_LIBVER_V18);
  H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
  H5Pset_meta_block_size(access.get(), description_block);
  H5Pset_file_locking(access.get(), false, true);  // io/files/part_file.hpp holds the lock
  const Id creation = without_times(H5P_FILE_CREATE);
  use_checked_driver(access.get(), written);
  Id file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation.get(), access.get()));
  if (file.get() < 0) throw IoError(fmt::format("cannot create '{}': {}", path, open_reason()));
  return file;
}

Id create_memory_file() {
  const Quiet quiet;
  const Id access(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_V18);
  H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
  constexpr std::size_t kGrowth = std::size_t{1} << 16;
  H5Pset_fapl_core(access.get(), kGrowth, false);
  Id file(H5Fcreate("memory", H5F_ACC_TRUNC, H5P_DEFAULT, access.get()));
  if (file.get() < 0)
    throw IoError(fmt::format("cannot create a file in memory: {}", last_reason()));
  return file;
}

Id open_file(const std::string& path, bool forget) {
  const Quiet quiet;
  note_file(path);
  require_regular_file(path, "an HDF5 file");
  allow_lz4();
  const Id access(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
  H5Pset_file_locking(access.get(), false, true);  // read-only folders and network mounts
  H5Pset_evict_on_close(access.get(), forget);
  Id file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.get()));
  if (file.get() < 0) throw IoError(fmt::format("cannot read '{}': {}", path, last_reason()));
  return file;
}

Id change_file(const std::string& path, WrittenBytes* written) {
  const Quiet quiet;
  const Id access(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_V18);
  H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
  H5Pset_file_locking(access.get(), false, true);
  use_checked_driver(access.get(), written);
  Id file(H5Fopen(path.c_str(), H5F_ACC_RDWR, access.get()));
  if (file.get() >= 0) return file;
  if (written != nullptr) written->compare_all();  // says more if that is why
  throw IoError(fmt::format("cannot write into '{}': {}", path, open_reason()));
}

void link_object(const Id& parent, const std::string& name, std::uint64_t address) {
  const Quiet quiet;
  const Id object(H5Oopen_by_addr(parent.get(), address));
  if (object.get() < 0 ||
      H5Olink(object.get(), parent.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT) < 0)
    fail("link", parent, name);
}

void close_file(Id& file, const std::string& path) {
  const Quiet quiet;
  const auto failure = write_failure(file.get());
  std::string reason;
  if (H5Fflush(file.get(), H5F_SCOPE_GLOBAL) < 0) reason = last_reason();
  if (H5Fclose(file.get()) < 0 && reason.empty()) reason = last_reason();
  file.release();  // also where closing failed: a second try would find a file half closed
  if (failure != nullptr && failure->any()) failure->tell(fmt::format("cannot write '{}'", path));
  if (failure == nullptr) reason = "HDF5 does not say whether its writes succeeded";
  if (!reason.empty()) throw IoError(fmt::format("cannot write '{}': {}", path, reason));
}

Id create_group(const Id& parent, const std::string& name) {
  const Quiet quiet;
  const Id creation = without_times(H5P_GROUP_CREATE);
  Id group(H5Gcreate2(parent.get(), name.c_str(), H5P_DEFAULT, creation.get(), H5P_DEFAULT));
  if (group.get() < 0) fail("create group", parent, name);
  return group;
}

Id open_group(const Id& parent, const std::string& name) {
  const Quiet quiet;
  note_object(name);
  Id group(H5Gopen2(parent.get(), name.c_str(), link_access(H5P_GROUP_ACCESS)));
  if (group.get() < 0) fail("open group", parent, name);
  return group;
}

bool has_link(const Id& parent, const std::string& name) {
  const Quiet quiet;
  return H5Lexists(parent.get(), name.c_str(), link_access(H5P_LINK_ACCESS)) > 0;
}

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
    // Only whole chunks are written, so a cache would only delay errors until the file is closed.
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

Id open_dataset(const Id& parent, const std::string& name) {
  const Quiet quiet;
  note_object(name);
  Id dataset(H5Dopen2(parent.get(), name.c_str(), link_access(H5P_DATASET_ACCESS)));
  if (dataset.get() < 0) fail("open dataset", parent, name);
  check_source(dataset, parent, name);
  return dataset;
}

Dims dimensions(const Id& dataset) {
  const Quiet quiet;
  const Id space(H5Dget_space(dataset.get()));
  const int rank = H5Sget_simple_extent_ndims(space.get());
  if (rank < 0) fail("read the shape of", dataset);
  Dims dims(static_cast<std::size_t>(rank));
  if (rank > 0) H5Sget_simple_extent_dims(space.get(), dims.data(), nullptr);
  // Who multiplies these may rely on the product.
  constexpr hsize_t kMost = hsize_t{1} << 48;
  hsize_t numbers = 1;
  for (const hsize_t size : dims) {
    if (size != 0 && numbers > kMost / size)
      fail("read the shape of", dataset, {}, "it claims more numbers than any file holds");
    if (size != 0) numbers *= size;  // a list of nothing may still claim wide rows
  }
  return dims;
}

template <class T>
void write_box(const Id& dataset, const Dims& offset, const Dims& count, const T* data) {
  const Quiet quiet;
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
  if (H5Dread(dataset.get(), Types<T>::memory(), box.memory.get(), box.disk.get(), H5P_DEFAULT,
              data) < 0)
    fail("read", dataset);
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
TANGERE_H5_TYPE(std::int32_t)
TANGERE_H5_TYPE(std::int64_t)
TANGERE_H5_TYPE(std::uint64_t)
#undef TANGERE_H5_TYPE

}  // namespace tangere::h5
