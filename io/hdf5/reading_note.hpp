// SPDX-License-Identifier: Apache-2.0
// Which object of which file is being read, kept where another process can look it up after a
// crash of the library; and an end to calls that never return.
#pragma once

#include <sys/time.h>

#include <chrono>
#include <span>
#include <string_view>

namespace tangere::h5 {

/// From now on what is read is noted in this memory, which has to stay. Empty: nowhere.
void note_reading_in(std::span<char> memory) noexcept;

/// Notes the file that was opened last, and the group, dataset or attribute that was asked for
/// last: "'<file>', object '<object>'", cut at the end of the memory, with a zero behind it.
void note_file(std::string_view path) noexcept;
void note_object(std::string_view name) noexcept;

/// A call of the library begins; it ends.
void note_call_begins() noexcept;
void note_call_ends() noexcept;

/// While this lives, calls read or write numbers of datasets, which may take long.
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

/// While this lives, nothing is noted and no call is ended: the process computes in threads, whose
/// time would count, and reads only what it wrote itself.
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
