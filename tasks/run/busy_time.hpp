// SPDX-License-Identifier: Apache-2.0
// Measures how long threads were busy with one kind of work, summed over the threads.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

namespace tangere {

class BusyTime {
 public:
  [[nodiscard]] double seconds() const { return 1e-9 * static_cast<double>(nanoseconds_.load()); }
  void add(std::int64_t nanoseconds) { nanoseconds_ += nanoseconds; }

 private:
  std::atomic<std::int64_t> nanoseconds_{0};
};

/// Measures from its construction to the end of the scope.
class Stopwatch {
 public:
  explicit Stopwatch(BusyTime& time) : time_(time), start_(Clock::now()) {}
  ~Stopwatch() {
    time_.add(std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start_).count());
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  BusyTime& time_;
  Clock::time_point start_;
};

}  // namespace tangere
