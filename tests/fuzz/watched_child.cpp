// SPDX-License-Identifier: Apache-2.0
// The child counts in shared memory and leaves its last words in a file.
#include "tests/fuzz/watched_child.hpp"

#include <execinfo.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <new>
#include <sstream>
#include <stdexcept>

#include "io/hdf5/reading_note.hpp"

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
/// HDF5 asks for what a damaged file claims and takes a refusal; what we ask for ends the child.
extern "C" const char* __asan_default_options() {
  return "handle_abort=1:allocator_may_return_null=1:max_allocation_size_mb=1024:detect_leaks=1";
}
#endif

namespace tangere::fuzz {
namespace {

constexpr unsigned kMostSeconds = 10;
constexpr long kMostKilobytes = 1L << 20;
constexpr const char *kTooLong = "took longer than 10 s\n", *kCrashed = "crashed\n";
constexpr int kException = 70, kTooMuch = 71, kLeak = 72;

struct Counts {
  std::uint64_t done, accepted;
};

/// Where it happened, innermost first; a line holds the path of each function's library.
void tell_crash(int signal) {
  std::array<void*, 64> frames{};
  const char* const words = signal == SIGALRM ? kTooLong : kCrashed;
  if (write(STDERR_FILENO, words, std::strlen(words)) < 0) _exit(kException);
  backtrace_symbols_fd(frames.data(), backtrace(frames.data(), 64), STDERR_FILENO);
  std::signal(signal, SIG_DFL);
  raise(signal);
}

/// A stack that overflowed has no room for a handler.
void catch_crashes() {
  std::array<void*, 2> once{};
  backtrace(once.data(), 2);  // loads a library the first time
  static std::array<char, 1 << 16> room{};
  const stack_t stack{room.data(), 0, room.size()};
  sigaltstack(&stack, nullptr);
  struct sigaction action {};
  action.sa_handler = tell_crash;
  action.sa_flags = SA_ONSTACK | SA_RESETHAND;
  sigaction(SIGALRM, &action, nullptr);
#ifndef __SANITIZE_ADDRESS__  // which tells more
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL})
    sigaction(signal, &action, nullptr);
#endif
}

long peak_kilobytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-union-access): the member's name stands for a union
  return usage.ru_maxrss;
}

[[noreturn]] void be_child(std::uint64_t first, std::uint64_t end, Counts& counts, int words,
                           const std::function<bool(std::uint64_t)>& read) {
  dup2(words, STDERR_FILENO);
  catch_crashes();
  h5::end_endless_calls(std::chrono::milliseconds(250));  // the files are small
  const long before = peak_kilobytes();
  for (std::uint64_t mutant = first; mutant < end; ++mutant) {
    alarm(kMostSeconds);
    try {
      if (read(mutant)) ++counts.accepted;
    } catch (const std::exception& error) {
      std::fprintf(stderr, "exception: %s\n", error.what());
      _exit(kException);
    }
    if (peak_kilobytes() - before > kMostKilobytes) {
      std::fputs("took more than 1 GB\n", stderr);
      _exit(kTooMuch);
    }
    ++counts.done;
  }
  alarm(0);
#ifdef __SANITIZE_ADDRESS__
  if (end - first > 1 && __lsan_do_recoverable_leak_check() != 0) _exit(kLeak);
#endif
  _exit(0);
}

bool holds_any(const std::string& line, std::initializer_list<const char*> words) {
  for (const char* word : words)
    if (line.find(word) != std::string::npos) return true;
  return false;
}

/// Whether HDF5's functions come before ours in the first stack of a report, innermost first.
/// Those of the system and of the sanitizer do not count: who gave them wrong numbers called them.
bool in_hdf5(const std::string& words) {
  std::istringstream lines(words);
  bool in_handler = holds_any(words, {kCrashed, kTooLong});  // up to the system's call of it
  for (std::string line; std::getline(lines, line);) {
    if (!holds_any(line, {"    #", "(+0x", "+0x"}) || line.starts_with("==")) continue;
    if (in_handler) {
      in_handler = !holds_any(line, {"libc.so"});
    } else if (holds_any(line, {"libhdf5"})) {
      return true;
    } else if (holds_any(line, {TANGERE_SOURCE_DIR, "fuzz_test"})) {
      return false;
    }
  }
  return false;
}

/// Whether in_hdf5() holds for every leak of a report.
bool leaks_in_hdf5(const std::string& words) {
  constexpr const char* kLeakOf = " leak of ";
  std::size_t at = words.find(kLeakOf);
  if (at == std::string::npos) return false;
  while (at != std::string::npos) {
    const std::size_t next = words.find(kLeakOf, at + 1);
    if (!in_hdf5(words.substr(at, next - at))) return false;
    at = next;
  }
  return true;
}

std::string text_of(int file) {
  lseek(file, 0, SEEK_SET);
  std::string text(1 << 14, '\0');
  const ssize_t size = read(file, text.data(), text.size());
  text.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return text;
}

}  // namespace

ChildEnd run_in_watched_child(std::uint64_t first, std::uint64_t end,
                              const std::function<bool(std::uint64_t)>& read) {
  void* const memory =
      mmap(nullptr, sizeof(Counts), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  std::FILE* const words = std::tmpfile();
  if (memory == MAP_FAILED || words == nullptr) throw std::runtime_error("no room for a child");
  Counts& counts = *new (memory) Counts{};
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no child");
  if (child == 0) be_child(first, end, counts, fileno(words), read);
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
  }
  ChildEnd result{.done = counts.done, .accepted = counts.accepted, .finding = {}};
  const bool well = WIFEXITED(status) && WEXITSTATUS(status) == 0;
  if (!well) {
    const std::string told = text_of(fileno(words));
    const int code = WIFEXITED(status) ? WEXITSTATUS(status) : 0;
    const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
    result.leaked = code == kLeak;
    result.crashed = !result.leaked;
    result.slow = signal == SIGALRM;
    const bool ours = code == kException || code == kTooMuch;
    const bool library = signal == SIGPROF || (result.leaked ? leaks_in_hdf5(told) : in_hdf5(told));
    if (ours || !library)
      result.finding = told.empty() ? "ended with status " + std::to_string(status) : told;
  }
  std::fclose(words);
  munmap(memory, sizeof(Counts));
  return result;
}

}  // namespace tangere::fuzz
