// SPDX-License-Identifier: Apache-2.0
// Preloaded into a program (LD_PRELOAD), it makes one call of the operating system fail, or lie.
//
// TANGERE_FAULT=kind:n fails the n-th call of a kind, counted from 1, with EIO (writes: ENOSPC,
// threads: EAGAIN, and all later ones too, memory: ENOMEM). TANGERE_FAULT=count:0 fails none, and
// TANGERE_FAULT_COUNT=file writes there, when the program ends, how many calls of each kind there
// were. Kinds: write, sync, rename, close, truncate, open, read, thread, memory. Allocations by
// HDF5 and zlib are not among memory: HDF5 uses about one in thirty without a check, and stores a
// chunk as it is where zlib gets no memory (docs/failures.md). Two more kinds are those of
// a disk that lies: the n-th write or truncation (lost) does nothing, or the n-th write puts zeros
// in place of the bytes (zeros), and says that it succeeded.
#include <dlfcn.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <new>

extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
}

namespace {

// Nothing here may allocate: memory is one of the kinds. The environment is read when the library
// is loaded; calls before that succeed.
constexpr const char* kKinds[] = {"write", "sync",   "rename", "close", "truncate", "open",
                                  "read",  "thread", "memory", "lost",  "zeros"};
char kind[16];
bool counting = false;  // all kinds
long failing = -1;      // -1: not loaded yet
/// Calls by kind; of the one that fails where none are counted.
struct Calls {
  std::atomic<long> counts[std::size(kKinds)], failing;
};
Calls unshared{};
Calls* calls = &unshared;  // of the program and of its child processes together

/// Code of a library whose allocations do not fail, [begin, end).
struct Exempt {
  const char* library;
  std::uintptr_t begin = 0, end = 0;
};
Exempt exempt[] = {{"libhdf5"}, {"libz."}};

/// Whether an allocation that returns to `caller` is one of an exempt library.
bool is_exempt(void* caller) {
  const auto address = reinterpret_cast<std::uintptr_t>(caller);
  return std::any_of(std::begin(exempt), std::end(exempt),
                     [&](const Exempt& e) { return e.begin <= address && address < e.end; });
}

int find_exempt(dl_phdr_info* library, std::size_t, void*) {
  for (Exempt& e : exempt) {
    if (e.begin != 0 || std::strstr(library->dlpi_name, e.library) == nullptr) continue;
    for (int i = 0; i < library->dlpi_phnum; ++i) {
      const ElfW(Phdr)& segment = library->dlpi_phdr[i];
      if (segment.p_type != PT_LOAD || (segment.p_flags & PF_X) == 0) continue;
      e.begin = library->dlpi_addr + segment.p_vaddr;
      e.end = e.begin + segment.p_memsz;
    }
  }
  return 0;
}

/// Whether this call is the one that fails.
bool fails(const char* of) {
  if (failing < 0) return false;
  if (!counting) return std::strcmp(of, kind) == 0 && ++calls->failing == failing;
  for (std::size_t k = 0; k < std::size(kKinds); ++k)
    if (std::strcmp(of, kKinds[k]) == 0) ++calls->counts[k];
  return false;
}

template <class F>
F* real(const char* name) {
  void* const found = dlsym(RTLD_NEXT, name);
  F* function = nullptr;
  static_assert(sizeof function == sizeof found);
  std::memcpy(&function, &found, sizeof found);
  return function;
}

__attribute__((constructor)) void load() {
  const char* const fault = std::getenv("TANGERE_FAULT");
  const char* const colon = fault == nullptr ? nullptr : std::strchr(fault, ':');
  if (colon == nullptr || colon - fault >= static_cast<long>(sizeof kind)) return;
  std::memcpy(kind, fault, static_cast<std::size_t>(colon - fault));
  void* const page =
      mmap(nullptr, sizeof *calls, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  dl_iterate_phdr(find_exempt, nullptr);
  if (page != MAP_FAILED) calls = new (page) Calls{};
  counting = std::strcmp(kind, "count") == 0;
  failing = std::atol(colon + 1);
}

__attribute__((destructor)) void report() {
  const char* const path = std::getenv("TANGERE_FAULT_COUNT");
  if (path == nullptr) return;
  failing = -1;
  if (std::FILE* const file = std::fopen(path, "w")) {
    for (std::size_t k = 0; k < std::size(kKinds); ++k)
      std::fprintf(file, "%s %ld\n", kKinds[k], calls->counts[k].load());
    std::fclose(file);
  }
}

}  // namespace

// FAULTY(kind, errno, type, name, (parameters), (arguments)): the call, or its failure. Only calls
// that return -1 when they fail.
#define FAULTY(of, error, type, name, parameters, arguments) \
  extern "C" type name parameters {                          \
    static auto* const call = real<type parameters>(#name);  \
    if (fails(of)) {                                         \
      errno = error;                                         \
      return static_cast<type>(-1);                          \
    }                                                        \
    return call arguments;                                   \
  }

namespace {

size_t all_of(const iovec* pieces, int count) {
  size_t size = 0;
  for (int i = 0; i < count; ++i) size += pieces[i].iov_len;
  return size;
}

/// Zeros at a place of a file; at = -1: where its writer stands.
ssize_t put_zeros(int fd, size_t size, off_t at) {
  static auto* const call = real<ssize_t(int, const void*, size_t)>("write");
  static auto* const call_at = real<ssize_t(int, const void*, size_t, off_t)>("pwrite");
  static const char zeros[4096] = {};
  for (size_t done = 0; done < size;) {
    const size_t some = size - done < sizeof zeros ? size - done : sizeof zeros;
    const ssize_t put =
        at < 0 ? call(fd, zeros, some) : call_at(fd, zeros, some, at + static_cast<off_t>(done));
    if (put <= 0) return -1;
    done += static_cast<size_t>(put);
  }
  return static_cast<ssize_t>(size);
}

}  // namespace

// A write of `size` bytes at `at`.
#define FAULTY_WRITE(name, parameters, arguments, size, at)    \
  extern "C" ssize_t name parameters {                         \
    static auto* const call = real<ssize_t parameters>(#name); \
    if (fails("lost")) return static_cast<ssize_t>(size);      \
    if (fails("zeros")) return put_zeros(fd, size, at);        \
    if (fails("write")) {                                      \
      errno = ENOSPC;                                          \
      return -1;                                               \
    }                                                          \
    return call arguments;                                     \
  }
FAULTY_WRITE(write, (int fd, const void* data, size_t size), (fd, data, size), size, -1)
FAULTY_WRITE(pwrite, (int fd, const void* data, size_t size, off_t at), (fd, data, size, at), size,
             at)
FAULTY_WRITE(pwrite64, (int fd, const void* data, size_t size, off64_t at), (fd, data, size, at),
             size, at)
FAULTY_WRITE(writev, (int fd, const iovec* pieces, int count), (fd, pieces, count),
             all_of(pieces, count), -1)
FAULTY_WRITE(pwritev, (int fd, const iovec* pieces, int count, off_t at), (fd, pieces, count, at),
             all_of(pieces, count), at)
FAULTY_WRITE(pwritev64, (int fd, const iovec* pieces, int count, off64_t at),
             (fd, pieces, count, at), all_of(pieces, count), at)
FAULTY("read", EIO, ssize_t, read, (int fd, void* to, size_t size), (fd, to, size))
FAULTY("read", EIO, ssize_t, pread, (int fd, void* to, size_t size, off_t at), (fd, to, size, at))
FAULTY("read", EIO, ssize_t, pread64, (int fd, void* to, size_t size, off64_t at),
       (fd, to, size, at))
FAULTY("read", EIO, ssize_t, readv, (int fd, const iovec* pieces, int count), (fd, pieces, count))
FAULTY("sync", EIO, int, fsync, (int fd), (fd))
FAULTY("sync", EIO, int, fdatasync, (int fd), (fd))
FAULTY("rename", EIO, int, rename, (const char* from, const char* to), (from, to))
FAULTY("rename", EIO, int, renameat2,
       (int a, const char* from, int b, const char* to, unsigned flags), (a, from, b, to, flags))
#define FAULTY_TRUNCATION(name, type)                      \
  extern "C" int name(int fd, type size) {                 \
    static auto* const call = real<int(int, type)>(#name); \
    if (fails("lost")) return 0;                           \
    if (fails("truncate")) {                               \
      errno = EIO;                                         \
      return -1;                                           \
    }                                                      \
    return call(fd, size);                                 \
  }
FAULTY_TRUNCATION(ftruncate, off_t)
FAULTY_TRUNCATION(ftruncate64, off64_t)

/// The file is closed even where closing says that something failed, as on Linux.
extern "C" int close(int fd) {
  static auto* const call = real<int(int)>("close");
  const bool failed = fails("close");
  const int result = call(fd);
  if (!failed) return result;
  errno = EIO;
  return -1;
}

#define FAULTY_OPEN(name)                                              \
  extern "C" int name(const char* path, int flags, ...) {              \
    static auto* const call = real<int(const char*, int, ...)>(#name); \
    va_list rest;                                                      \
    va_start(rest, flags);                                             \
    const auto mode = static_cast<mode_t>(va_arg(rest, int));          \
    va_end(rest);                                                      \
    if (fails("open")) {                                               \
      errno = EIO;                                                     \
      return -1;                                                       \
    }                                                                  \
    return call(path, flags, mode);                                    \
  }
FAULTY_OPEN(open)
FAULTY_OPEN(open64)

extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* how, void* (*run)(void*),
                              void* with) {
  static auto* const call =
      real<int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*)>("pthread_create");
  // A limit on threads stays met: all later ones fail as well.
  return fails("thread") ||
                 (std::strcmp(kind, "thread") == 0 && failing > 0 && calls->failing > failing)
             ? EAGAIN
             : call(thread, how, run, with);
}

#define FAULTY_MEMORY(name, parameters, arguments)                  \
  extern "C" void* name parameters {                                \
    if (is_exempt(__builtin_return_address(0)) || !fails("memory")) \
      return __libc_##name arguments;                               \
    errno = ENOMEM;                                                 \
    return nullptr;                                                 \
  }
FAULTY_MEMORY(malloc, (std::size_t size), (size))
FAULTY_MEMORY(calloc, (std::size_t count, std::size_t size), (count, size))
FAULTY_MEMORY(realloc, (void* pointer, std::size_t size), (pointer, size))
/// The C library's own calls malloc, which then returns into that library.
extern "C" char* strdup(const char* text) {
  const std::size_t size = std::strlen(text) + 1;
  // NOLINTNEXTLINE(cppcoreguidelines-no-malloc): the malloc above
  void* const copy =
      is_exempt(__builtin_return_address(0)) ? __libc_malloc(size) : std::malloc(size);
  return copy == nullptr ? nullptr : static_cast<char*>(std::memcpy(copy, text, size));
}
