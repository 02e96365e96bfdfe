// SPDX-License-Identifier: Apache-2.0
// Callbacks of a file driver: C functions on a struct that begins with the library's own. Features
// are those of the library's POSIX driver, so that files have the same bytes. The sieve buffer is
// off: it delays writes, so errors could not be attributed.
#include "io/hdf5/h5_driver.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <exception>
#include <limits>
#include <map>
#include <new>
#include <string_view>

#include "engine/base/error.hpp"

#if H5_VERSION_GE(1, 13, 0)
#include <H5FDdevelop.h>
#endif

namespace tangere::h5 {
namespace {

std::atomic<bool> any_failure{false};
thread_local int open_error = 0;
thread_local hid_t numbers_of = -1;
thread_local const char* numbers_of_child = nullptr;

/// What the library copies for each file.
struct DriverInfo {
  WrittenBytes* written;
};

struct CheckedFile {
  H5FD_t library{};  // first: the library casts
  int descriptor = -1;
  haddr_t end_allocated = 0, end = 0;
  dev_t device = 0;
  ino_t inode = 0;
  std::shared_ptr<WriteFailure> failure;
  WrittenBytes* written = nullptr;
  std::map<hid_t, std::string> names;  // of datasets; the library does not use a number twice

  void fail(int error) noexcept {
    if (failure->error == 0) failure->error = error;
    any_failure = true;
  }

  /// Calls `use` with `written`, if there is one. The library knows no exceptions.
  template <class Use>
  void keep_track(const Use& use) noexcept {
    if (written == nullptr || failure->any()) return;
    try {
      use(*written);
    } catch (const std::bad_alloc&) {
      fail(ENOMEM);
    } catch (const std::exception& difference) {
      fail(EIO);
      try {
        failure->damage = difference.what();
      } catch (const std::bad_alloc&) {  // then EIO says it
      }
    }
  }

  /// What is being written.
  std::string_view name(H5FD_mem_t kind) {
    if (kind != H5FD_MEM_DRAW) return "descriptions of objects";
    if (numbers_of < 0) return "texts of attributes";
    std::string& name = names[numbers_of];
    if (name.empty() || numbers_of_child != nullptr) {
      std::array<char, 256> text{};
      H5Iget_name(numbers_of, text.data(), text.size());
      name = text.data();
      if (numbers_of_child != nullptr) name += std::string("/") + numbers_of_child;
    }
    return name;
  }
};

CheckedFile* ours(H5FD_t* file) { return reinterpret_cast<CheckedFile*>(file); }
const CheckedFile* ours(const H5FD_t* file) { return reinterpret_cast<const CheckedFile*>(file); }

H5FD_t* open_file(const char* name, unsigned flags, hid_t access, haddr_t) {
  int mode = (flags & H5F_ACC_RDWR) != 0 ? O_RDWR : O_RDONLY;
  if ((flags & H5F_ACC_TRUNC) != 0) mode |= O_TRUNC;
  if ((flags & H5F_ACC_CREAT) != 0) mode |= O_CREAT;
  if ((flags & H5F_ACC_EXCL) != 0) mode |= O_EXCL;
  const int descriptor = open(name, mode | O_CLOEXEC, 0666);
  open_error = descriptor < 0 ? errno : 0;
  if (descriptor < 0) return nullptr;
  struct stat info {};
  auto* file = new (std::nothrow) CheckedFile;
  if (file == nullptr || fstat(descriptor, &info) != 0) {
    close(descriptor);
    delete file;
    return nullptr;
  }
  try {
    file->failure = std::make_shared<WriteFailure>();
  } catch (const std::bad_alloc&) {
    close(descriptor);
    delete file;
    return nullptr;
  }
  // The library opens files that this one shows with the same properties.
  if (const void* const given = H5Pget_driver_info(access); given != nullptr)
    if (auto* const written = static_cast<const DriverInfo*>(given)->written;
        written != nullptr && written->is_of(info.st_dev, info.st_ino))
      file->written = written;
  file->descriptor = descriptor;
  file->end = static_cast<haddr_t>(info.st_size);
  file->device = info.st_dev;
  file->inode = info.st_ino;
  return &file->library;
}

herr_t close_file(H5FD_t* file) {
  CheckedFile* f = ours(file);
  if (close(f->descriptor) != 0) f->fail(errno);
  delete f;
  return 0;
}

int compare(const H5FD_t* a, const H5FD_t* b) {
  const CheckedFile *f = ours(a), *g = ours(b);
  if (f->device != g->device) return f->device < g->device ? -1 : 1;
  if (f->inode != g->inode) return f->inode < g->inode ? -1 : 1;
  return 0;
}

herr_t features(const H5FD_t*, unsigned long* flags) {
  *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA |
           H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

haddr_t end_allocated(const H5FD_t* file, H5FD_mem_t) { return ours(file)->end_allocated; }
herr_t set_end_allocated(H5FD_t* file, H5FD_mem_t, haddr_t end) {
  ours(file)->end_allocated = end;
  return 0;
}
haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t) { return ours(file)->end; }

herr_t handle(H5FD_t* file, hid_t, void** out) {
  *out = file;
  return 0;
}

/// Bytes beyond the end read as zeros, as the library expects. A failed read is reported to the
/// library: unlike a failed write it leaves no inconsistent state.
herr_t read(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t address, size_t size, void* buffer) {
  CheckedFile* f = ours(file);
  auto* to = static_cast<unsigned char*>(buffer);
  f->keep_track([&](const WrittenBytes& written) { written.compare(address, size); });
  if (f->failure->any()) return -1;  // the library crashes over some damage
  while (size > 0) {
    const ssize_t got = pread(f->descriptor, to, size, static_cast<off_t>(address));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      f->fail(errno);
      return -1;
    }
    if (got == 0) {
      std::memset(to, 0, size);
      return 0;
    }
    to += got;
    address += static_cast<haddr_t>(got);
    size -= static_cast<size_t>(got);
  }
  return 0;
}

herr_t write(H5FD_t* file, H5FD_mem_t kind, hid_t, haddr_t address, size_t size,
             const void* buffer) {
  CheckedFile* f = ours(file);
  const auto* from = static_cast<const unsigned char*>(buffer);
  f->keep_track([&](WrittenBytes& written) {
    written.add(address, {from, size}, {f->name(kind)});
  });
  f->end = std::max(f->end, address + size);
  while (size > 0) {
    if (f->failure->any()) return 0;  // the file is lost: spare a full disk the rest
    const ssize_t put = pwrite(f->descriptor, from, size, static_cast<off_t>(address));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) {
      f->fail(put < 0 ? errno : EIO);
      return 0;
    }
    from += put;
    address += static_cast<haddr_t>(put);
    size -= static_cast<size_t>(put);
  }
  return 0;
}

herr_t truncate(H5FD_t* file, hid_t, hbool_t) {
  CheckedFile* f = ours(file);
  if (f->end == f->end_allocated) return 0;
  f->keep_track([&](WrittenBytes& written) { written.end_at(f->end_allocated); });
  if (!f->failure->any() && ftruncate(f->descriptor, static_cast<off_t>(f->end_allocated)) != 0)
    f->fail(errno);
  f->end = f->end_allocated;
  return 0;
}

H5FD_class_t driver() {
  H5FD_class_t c{};
#ifdef H5FD_CLASS_VERSION
  c.version = H5FD_CLASS_VERSION;
  c.value = static_cast<H5FD_class_value_t>(511);  // values below 512 are not registered
#endif
  c.name = "tangere";
  c.maxaddr = static_cast<haddr_t>(std::numeric_limits<off_t>::max());
  c.fc_degree = H5F_CLOSE_WEAK;
  c.fapl_size = sizeof(DriverInfo);
  c.open = open_file;
  c.close = close_file;
  c.cmp = compare;
  c.query = features;
  c.get_eoa = end_allocated;
  c.set_eoa = set_end_allocated;
  c.get_eof = end_of_file;
  c.get_handle = handle;
  c.read = read;
  c.write = write;
  c.truncate = truncate;
  const H5FD_mem_t map[] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(map), std::end(map), c.fl_map);
  return c;
}

/// Registered with the library once, for as long as the process lives.
hid_t driver_id() {
  static const H5FD_class_t c = driver();
  static const hid_t id = H5FDregister(&c);
  return id;
}

}  // namespace

void WriteFailure::raise(const std::string& doing) const {
  if (error == ENOMEM) throw std::bad_alloc();
  if (!damage.empty()) throw IoError(damage);
  throw IoError(fmt::format("{}: {}", doing, std::strerror(error)));
}

NumbersOf::NumbersOf(hid_t object, const char* child) noexcept {
  numbers_of = object;
  numbers_of_child = child;
}
NumbersOf::~NumbersOf() { numbers_of = -1; }

void use_checked_driver(hid_t access, WrittenBytes* written) {
  open_error = 0;
  const DriverInfo info{written};
  if (driver_id() < 0 || H5Pset_driver(access, driver_id(), &info) < 0)
    throw IoError("HDF5 does not take a driver for files");
}

std::shared_ptr<const WriteFailure> write_failure(hid_t file) {
  const hid_t access = H5Fget_access_plist(file);
  if (access < 0) return nullptr;
  const bool is_ours = H5Pget_driver(access) == driver_id();
  H5Pclose(access);
  void* found = nullptr;
  if (!is_ours || H5Fget_vfd_handle(file, H5P_DEFAULT, &found) < 0 || found == nullptr)
    return nullptr;
  return ours(static_cast<H5FD_t*>(found))->failure;
}

int last_open_error() noexcept { return open_error; }

bool any_write_failure() noexcept { return any_failure; }

}  // namespace tangere::h5
