// SPDX-License-Identifier: Apache-2.0
// Records the file and object being read in memory that another process can read after a crash of
// the library, and ends calls that never return.
#pragma once

#include <sys/time.h>

#include <chrono>
#include <span>
#include <string_view>

namespace tangere::h5 {

/// Sets the memory for the record, which must stay valid. Empty: no record.
void note_reading_in(std::span<char> memory) noexcept;

/// Records the file that was opened last, and the group, dataset or attribute that was requested
/// last: "'<file>', object '<object>'", truncated to the memory and zero-terminated.
void note_file(std::string_view path) noexcept;
void note_object(std::string_view name) noexcept;

/// A call of the library begins; it ends.
void note_call_begins() noexcept;
void note_call_ends() noexcept;

/// RAII: calls in this scope transfer the numbers of datasets, and have a longer time limit.
class LongCall {
 public:
  LongCall() noexcept;
  ~LongCall();
  LongCall(const LongCall&) = delete;
  LongCall& operator=(const LongCall&) = delete;
};

/// Other calls have this part of the time of those.
constexpr int kTicksOfNumbers = 5;

/// From now on one call that computes for so long, if it reads numbers, or for a fifth of it, ends
/// the process by SIGPROF, a fifth later at most: the library loops for ever over some damaged
/// files.
void end_endless_calls(std::chrono::milliseconds computing) noexcept;

/// RAII: suspends record and time limits in this scope, in which the process computes in threads,
/// whose CPU time would count, and reads only its own files.
class NotReading {
 public:
  NotReading() noexcept;
  ~NotReading();
  NotReading(const NotReading&) = delete;
  NotReading& operator=(const NotReading&) = delete;

 private:
  std::span<char> note_;
  itimerval timer_{};
};

}  // namespace tangere::h5
