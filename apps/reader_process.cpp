// SPDX-License-Identifier: Apache-2.0
// fork before any thread starts. The child writes the object that it reads to shared memory, which
// outlives it.
#include "apps/reader_process.hpp"

#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#endif

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <span>

#include "apps/console.hpp"
#include "engine/base/error.hpp"
#include "io/hdf5/reading_note.hpp"

namespace tangere::apps {
namespace {

constexpr std::size_t kNoteBytes = 4096;
// Of computing, for one call of HDF5, unless TANGERE_READ_SECONDS says otherwise. The longest call
// reads one dataset of one episode; others have a fifth of it.
constexpr std::chrono::seconds kEndless{10}, kLongest{86'400};

std::chrono::seconds endless() {
  const char* const text = std::getenv("TANGERE_READ_SECONDS");
  if (text == nullptr) return kEndless;
  const char* const end = text + std::strlen(text);
  std::chrono::seconds::rep seconds = 0;
  const auto [at, error] = std::from_chars(text, end, seconds);
  if (error != std::errc() || at != end || seconds < 1 || seconds > kLongest.count())
    throw InputError(
        fmt::format("TANGERE_READ_SECONDS={}; expected a whole number of seconds, 1 to {}", text,
                    kLongest.count()));
  return std::chrono::seconds(seconds);
}

std::atomic<int> child{0}, passed_on{0};
static_assert(std::atomic<int>::is_always_lock_free, "the handler may not wait");

/// A signal that the terminal sends reaches the child by itself; what a process sends does not.
void pass_on(int signal, siginfo_t* info, void*) {
  passed_on = signal;
  if (child > 0 && info->si_code <= 0) kill(child, signal);
}

/// RAII: signals that would end this process are forwarded to the child.
class PassSignals {
 public:
  PassSignals() {
    struct sigaction action {};
    action.sa_sigaction = pass_on;
    action.sa_flags = SA_SIGINFO;
    for (std::size_t i = 0; i < 2; ++i) {
      sigaction(kSignals[i], nullptr, &previous_[i]);
      if (previous_[i].sa_handler != SIG_IGN) sigaction(kSignals[i], &action, nullptr);
    }
    // Ignored by some parents: the child would then leave without a trace.
    struct sigaction wait {};
    wait.sa_handler = SIG_DFL;
    sigaction(SIGCHLD, &wait, &child_);
  }
  ~PassSignals() { restore(); }
  PassSignals(const PassSignals&) = delete;
  PassSignals& operator=(const PassSignals&) = delete;
  void restore() {
    for (std::size_t i = 0; i < 2; ++i) sigaction(kSignals[i], &previous_[i], nullptr);
    sigaction(SIGCHLD, &child_, nullptr);
  }

 private:
  static constexpr int kSignals[] = {SIGINT, SIGTERM};
  struct sigaction previous_[2]{}, child_{};
};

/// Memory shared by parent and child; empty if it cannot be allocated.
std::span<char> shared_note() {
  void* const memory =
      mmap(nullptr, kNoteBytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return {};
  return {static_cast<char*>(memory), kNoteBytes};
}

[[noreturn]] void be_child(pid_t parent, const std::function<int()>& command, std::span<char> note,
                           std::chrono::seconds limit) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // the child ends with its parent
  if (getppid() != parent) _exit(kInputOutput);
  h5::note_reading_in(note);
  h5::end_endless_calls(limit);
  int code = command();
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    std::fputs("tangere: writing to stdout failed\n", stderr);
    code = kInputOutput;
  }
#ifdef __SANITIZE_ADDRESS__
  __lsan_do_leak_check();  // else it runs at the end of main
#endif
  _exit(code);
}

/// Signals by which the system ends a process for what it did itself.
bool crashed(int signal) {
  return signal == SIGSEGV || signal == SIGBUS || signal == SIGABRT || signal == SIGFPE ||
         signal == SIGILL;
}

}  // namespace

int run_in_child(const std::function<int()>& command) {
  const std::chrono::seconds limit = endless();
  const std::span<char> note = shared_note();
  const pid_t parent = getpid();
  PassSignals signals;
  child = 0;
  passed_on = 0;
  std::fflush(stdout);
  const pid_t process = fork();
  if (process == 0) {
    signals.restore();
    be_child(parent, command, note, limit);
  }
  if (process < 0) {  // no process to be had: read without that protection
    signals.restore();
    if (!note.empty()) munmap(note.data(), note.size());
    return command();
  }
  child = process;
  if (passed_on != 0) kill(process, passed_on);  // it came before there was a child to send it to
  int status = 0;
  while (waitpid(process, &status, 0) < 0)
    if (errno != EINTR)
      throw IoError(fmt::format("cannot wait for the reading process: {}", std::strerror(errno)));
  child = 0;
  const std::string reading(note.data(), note.empty() ? 0 : strnlen(note.data(), note.size()));
  if (!note.empty()) munmap(note.data(), note.size());
  if (WIFEXITED(status)) return WEXITSTATUS(status);
  const int signal = WTERMSIG(status);
  if (signal == SIGINT) return kInterrupted;
  if (signal == SIGTERM) return kTerminated;
  if (signal == SIGPROF)
    throw IoError(fmt::format(
        "the HDF5 library did not come back within {} s of computing ({:g} s where it reads no "
        "numbers); it had last read {}; a file over which the library loops is damaged",
        limit.count(), static_cast<double>(limit.count()) / h5::kTicksOfNumbers, reading));
  if (!crashed(signal) || reading.empty()) {  // a closed pipe, a limit: end as the child did
    signals.restore();
    std::signal(signal, SIG_DFL);
    raise(signal);
  }
  throw IoError(fmt::format(
      "the reading process was ended by a signal ({}); it had last read {}; a file that makes the "
      "HDF5 library crash is damaged, or the disk could not read it",
      strsignal(signal), reading));
}

}  // namespace tangere::apps
