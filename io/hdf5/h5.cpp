// SPDX-License-Identifier: Apache-2.0
// Files, groups and datasets. Links lead only to files of the same folder.
#include "io/hdf5/h5.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <utility>

#include "engine/base/error.hpp"
#include "io/files/input_files.hpp"
#include "io/files/text_file.hpp"
#include "io/hdf5/h5_driver.hpp"
#include "io/hdf5/h5_failure.hpp"
#include "io/hdf5/h5_lz4.hpp"
#include "io/hdf5/reading_note.hpp"

namespace tangere::h5 {
namespace {

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
                  void*) noexcept try {
  if (!may_lead_to(from, to)) return -1;
  add_input(std::filesystem::path(from).replace_filename(to));
  return 0;
} catch (const std::exception&) {  // no memory
  return -1;
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
  const std::string own = object_name(dataset.get());
  for (std::size_t k = 0; k < views; ++k) {
    const auto text = [&](auto get) {
      const ssize_t size = get(creation.get(), k, nullptr, std::size_t{0});
      std::string value(static_cast<std::size_t>(std::max<ssize_t>(size, 0)) + 1, '\0');
      get(creation.get(), k, value.data(), value.size());
      value.pop_back();
      return value;
    };
    const std::string file = text(H5Pget_virtual_filename);
    if (!may_lead_to(file_name(dataset.get()), file))
      fail("open dataset", parent, name, fmt::format("it shows '{}', in another folder", file));
    add_input(std::filesystem::path(file_name(dataset.get())).replace_filename(file));
    if (file == "." && text(H5Pget_virtual_dsetname) == own)
      fail("open dataset", parent, name, "it shows itself");
  }
}

std::string open_reason() {
  return last_open_error() != 0 ? std::strerror(last_open_error()) : last_reason();
}

}  // namespace

Id without_times(hid_t kind) {
  Id properties(H5Pcreate(kind));
  H5Pset_obj_track_times(properties.get(), false);  // same numbers, same bytes
  return properties;
}

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
  return fmt::format("'{}' in '{}'", object_name(object.get()), file_name(object.get()));
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

Id open_file(const std::string& path, bool evict) {
  const Quiet quiet;
  note_file(path);
  require_regular_file(path, "an HDF5 file");
  allow_lz4();
  const Id access(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
  H5Pset_file_locking(access.get(), false, true);  // read-only folders and network mounts
  H5Pset_evict_on_close(access.get(), evict);
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
  const LongCall writes_numbers;
  const auto failure = write_failure(file.get());
  std::string reason;
  if (H5Fflush(file.get(), H5F_SCOPE_GLOBAL) < 0) reason = last_reason();
  if (H5Fclose(file.get()) < 0 && reason.empty()) reason = last_reason();
  file.release();  // also where closing failed: a second try would find a file half closed
  if (failure != nullptr && failure->any()) failure->raise(fmt::format("cannot write '{}'", path));
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

}  // namespace tangere::h5
