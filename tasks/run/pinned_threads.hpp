// SPDX-License-Identifier: Apache-2.0
// Threads of an arena that stay on one processor each, so that what a thread has in its cache, or
// in the memory next to it, stays near.
#pragma once

#include <tbb/task_arena.h>
#include <tbb/task_scheduler_observer.h>

#include <atomic>
#include <vector>

namespace tangere {

/// Returns the processors that this process may use, in ascending order. Throws IoError.
std::vector<int> usable_processors();

/// While it lives, thread k of the arena runs on the k-th usable processor alone. If there are more
/// threads, they begin anew with the first one. A thread that leaves the arena may run where it
/// could before.
class PinnedThreads : public tbb::task_scheduler_observer {
 public:
  explicit PinnedThreads(tbb::task_arena& arena);
  ~PinnedThreads() override;
  PinnedThreads(const PinnedThreads&) = delete;
  PinnedThreads& operator=(const PinnedThreads&) = delete;

  /// Throws IoError if the system refused to pin a thread.
  void check() const;

 private:
  void on_scheduler_entry(bool is_worker) override;
  void on_scheduler_exit(bool is_worker) override;

  std::vector<int> processors_;
  std::atomic<int> error_{0};  ///< errno of the last refusal
};

}  // namespace tangere
