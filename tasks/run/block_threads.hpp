// SPDX-License-Identifier: Apache-2.0
// Distributes independent blocks of environments over threads.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <cstddef>
#include <optional>

#include "tasks/run/pinned_threads.hpp"
#include "tasks/run/thread_probe.hpp"
#include "tasks/run/tsan_order.hpp"

namespace tangere {

/// A number of threads, of which the caller's is one.
class BlockThreads {
 public:
  /// `pinned`: each thread stays on a processor of its own. Throws InputError when the system
  /// refuses so many threads.
  explicit BlockThreads(int threads, bool pinned = false) : threads_(threads), arena_(threads) {
    require_threads(threads);
    if (pinned) pinned_.emplace(arena_);
  }

  /// Calls body(workers[k], block) for every block. A thread that becomes free takes the next
  /// block, because some blocks take longer and other programs may use some cores. No two threads
  /// use a worker at once. Passes on what body throws.
  template <class Workers, class Body>
  void for_each(int blocks, Workers& workers, const Body& body) {
    if (threads_ == 1 && !pinned_) {
      for (int b = 0; b < blocks; ++b) body(workers[0], b);
      return;
    }
    // The arena alone is not enough if there are more threads than cores.
    const tbb::global_control cap(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads_));
    const auto run = [&](const tbb::blocked_range<int>& range) {
      TsanOrder::arrive();
      auto& worker =
          workers[static_cast<std::size_t>(tbb::this_task_arena::current_thread_index())];
      const TsanOrder::Task task(order_, &worker);
      for (int b = range.begin(); b != range.end(); ++b) body(worker, b);
    };
    order_.begin();
    arena_.execute([&] {
      tbb::parallel_for(tbb::blocked_range<int>(0, blocks, 1), ByReference<decltype(run)>{&run},
                        tbb::simple_partitioner{});
    });
    order_.end();
    if (pinned_) pinned_->check();
  }

 private:
  int threads_;
  TsanOrder order_;
  tbb::task_arena arena_;
  std::optional<PinnedThreads> pinned_;
};

}  // namespace tangere
