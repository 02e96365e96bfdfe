// SPDX-License-Identifier: Apache-2.0
// Does not allocate, and is fast: objects of large files are recorded one by one. The memory begins
// with the file, and the object follows.
#include "io/hdf5/reading_note.hpp"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdint>

namespace tangere::h5 {
namespace {

std::span<char> note;
std::size_t file_end = 0;

std::atomic<int> depth{0};            // of calls within calls
std::atomic<std::uint64_t> begun{0};  // calls so far
std::atomic<bool> numbers{false};     // the call reads a dataset
std::uint64_t begun_before = 0;       // at the last tick, if one was under way; else 0
int ticks = 0;                        // that found the same call under way

void tick(int signal) {
  const std::uint64_t now = depth > 0 ? begun.load() : 0;
  ticks = now != 0 && now == begun_before ? ticks + 1 : 0;
  if (ticks >= (numbers ? kTicksOfNumbers : 1)) {
    std::signal(signal, SIG_DFL);
    raise(signal);
  }
  begun_before = now;
}

std::size_t put(std::size_t at, std::string_view text) {
  const std::size_t bytes = std::min(text.size(), note.size() - 1 - at);
  std::copy_n(text.data(), bytes, note.data() + at);
  note[at + bytes] = '\0';
  return at + bytes;
}

}  // namespace

void note_reading_in(std::span<char> memory) noexcept { note = memory; }

void note_file(std::string_view path) noexcept {
  if (note.empty()) return;
  file_end = put(put(put(0, "'"), path), "'");
}

void note_object(std::string_view name) noexcept {
  if (note.empty() || file_end == 0) return;
  put(put(put(file_end, ", object '"), name), "'");
}

void note_call_begins() noexcept {
  begun.fetch_add(1, std::memory_order_relaxed);
  depth.fetch_add(1, std::memory_order_relaxed);
}

LongCall::LongCall() noexcept { numbers = true; }
LongCall::~LongCall() { numbers = false; }

void note_call_ends() noexcept { depth.fetch_sub(1, std::memory_order_relaxed); }

void end_endless_calls(std::chrono::milliseconds computing) noexcept {
  struct sigaction action {};
  action.sa_handler = tick;
  action.sa_flags = SA_RESTART;
  sigaction(SIGPROF, &action, nullptr);
  const auto length = std::chrono::microseconds(computing) / kTicksOfNumbers;
  const timeval tick_length{length.count() / 1'000'000, length.count() % 1'000'000};
  const itimerval every{tick_length, tick_length};
  setitimer(ITIMER_PROF, &every, nullptr);
}

NotReading::NotReading() noexcept : note_(note) {
  if (!note.empty()) note.front() = '\0';
  note = {};
  const itimerval never{};
  setitimer(ITIMER_PROF, &never, &timer_);
}

NotReading::~NotReading() {
  note = note_;
  file_end = 0;
  setitimer(ITIMER_PROF, &timer_, nullptr);
}

}  // namespace tangere::h5
