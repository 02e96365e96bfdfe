// SPDX-License-Identifier: Apache-2.0
// What oneTBB orders, told to the thread sanitizer: it cannot see into the distribution's library,
// which is not built with it, and would call every hand-over a race. Nothing in other builds. Says
// no more than oneTBB promises (a task starts after what spawned it, a graph's message arrives
// after it was sent, waiting ends after all tasks), so real races are still found.
#pragma once

#include <utility>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace tangere {

/// A function as oneTBB may copy it from task to task: a pointer is all that is copied.
template <class Function>
struct ByReference {
  const Function* function;
  template <class Argument>
  auto operator()(Argument&& argument) const {
    return (*function)(std::forward<Argument>(argument));
  }
};
template <class Function>
ByReference(const Function*) -> ByReference<Function>;

/// What this thread did until now comes before what others do after tsan_acquire() of the same
/// address.
inline void tsan_release([[maybe_unused]] const void* address) {
#if defined(__SANITIZE_THREAD__)
  __tsan_release(const_cast<void*>(address));
#endif
}

inline void tsan_acquire([[maybe_unused]] const void* address) {
#if defined(__SANITIZE_THREAD__)
  __tsan_acquire(const_cast<void*>(address));
#endif
}

/// After graph.wait_for_all(): what the graph itself did in other threads, the last of it after our
/// bodies, is over. Its tasks count themselves off in the header, so touching the counter here is
/// enough.
template <class Graph>
void tsan_acquire_tasks_of([[maybe_unused]] Graph& graph) {
#if defined(__SANITIZE_THREAD__)
  graph.reserve_wait();
  graph.release_wait();
#endif
}

/// The tasks of one wait: each starts after begin(), and end() comes after all of them.
class TsanOrder {
 public:
  void begin() const { tsan_release(&begin_); }
  /// First thing in a task whose function itself, with what it captured, lives where begin() was
  /// called.
  static void arrive() { tsan_acquire(&begin_); }
  void end() const { tsan_acquire(&end_); }

  /// While a task runs. `mine`: what tasks hand from one to the next and none uses at the same time
  /// as another.
  class Task {
   public:
    Task(const TsanOrder& order, const void* mine) : order_(order), mine_(mine) {
      arrive();
      tsan_acquire(mine_);
    }
    ~Task() {
      tsan_release(mine_);
      tsan_release(&order_.end_);
    }
    Task(const Task&) = delete;
    Task& operator=(const Task&) = delete;

   private:
    const TsanOrder& order_;
    const void* mine_;
  };

 private:
  static inline char begin_ = 0;  // addresses matter, nothing is in them
  char end_ = 0;
};

}  // namespace tangere
