// SPDX-License-Identifier: Apache-2.0
// A handler may do little more than set a flag, or remove files and end. Code that works in steps
// checks the flag.
#include "apps/stop_signals.hpp"

#include <unistd.h>

#include <atomic>

#include "io/files/part_file.hpp"

namespace tangere::apps {
namespace {

constexpr std::array kSignals{SIGINT, SIGTERM};

std::atomic<int> first_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "the handler may not wait");
// A request sets a bit of an atomic number. Tokens of this source are polled: it has no callbacks,
// which a request would call.
std::stop_source stop_source;

/// What the process ends with, made beforehand: a handler may not allocate.
struct LastWords {
  int signal;
  ExitCode code;
  const char* reason;
  std::string text = {}, object = {};
};
std::array<LastWords, 5> last_words{{
    {SIGINT, kInterrupted, "stopped by SIGINT; no half-written file is left"},
    {SIGTERM, kTerminated, "stopped by SIGTERM; no half-written file is left"},
    {SIGSEGV, kUsage, "memory ran out in a library, or this is a mistake in tangere (SIGSEGV)"},
    {SIGBUS, kUsage, "memory ran out in a library, or this is a mistake in tangere (SIGBUS)"},
    {SIGABRT, kUsage, "memory ran out in a library, or this is a mistake in tangere (SIGABRT)"},
}};

void record_signal(int signal) {
  int none = 0;
  first_signal.compare_exchange_strong(none, signal);
  stop_source.request_stop();
}

void end(int signal) {
  remove_parts();
  for (const LastWords& words : last_words) {
    if (words.signal != signal) continue;
    // A closed stream has no effect here.
    static_cast<void>(!write(STDERR_FILENO, words.text.data(), words.text.size()));
    static_cast<void>(!write(STDOUT_FILENO, words.object.data(), words.object.size()));
    _exit(words.code);
  }
}

/// Ends as the signal would, without the .parts.
void end_by_itself(int signal) {
  remove_parts();
  std::signal(signal, SIG_DFL);
  raise(signal);
}

/// Returns what was there before.
struct sigaction handle(int signal, void (*handler)(int), int flags) {
  struct sigaction action {
  }, previous{};
  action.sa_handler = handler;
  action.sa_flags = flags;
  for (const int other : kSignals) sigaddset(&action.sa_mask, other);
  sigaction(signal, nullptr, &previous);
  if (previous.sa_handler != SIG_IGN) sigaction(signal, &action, nullptr);
  return previous;
}

bool is_crash(int signal) { return signal != SIGINT && signal != SIGTERM; }

}  // namespace

void end_by_signals(const ObjectOfError& object, bool child) {
  std::signal(SIGXFSZ, SIG_IGN);
  for (LastWords& words : last_words) {
    words.text = std::string("tangere: ") + words.reason + "\n";
    words.object = object(words.code, words.reason);
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    if (is_crash(words.signal)) continue;  // the sanitizer explains it
#endif
    handle(words.signal, child && is_crash(words.signal) ? end_by_itself : end, SA_ONSTACK);
  }
  static std::array<char, 1 << 14> stack;  // where the thread's own is used up
  const stack_t other{stack.data(), 0, stack.size()};
  sigaltstack(&other, nullptr);
}

void ignore_signals() {
  for (const int signal : kSignals) std::signal(signal, SIG_IGN);
}

StopSignals::StopSignals() {
  first_signal = 0;
  stop_source = {};
  for (std::size_t i = 0; i < kSignals.size(); ++i)
    previous_[i] = handle(kSignals[i], record_signal, SA_RESTART);
}

StopSignals::~StopSignals() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &previous_[i], nullptr);
}

std::stop_token StopSignals::token() const { return stop_source.get_token(); }

int StopSignals::received() const { return first_signal; }

}  // namespace tangere::apps
