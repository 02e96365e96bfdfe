// SPDX-License-Identifier: Apache-2.0
// Annotates the happens-before relations of oneTBB for the thread sanitizer. The distribution's
// library is not built with the sanitizer, which would report false races. In other builds this
// does nothing. Only guarantees of oneTBB are annotated (a task starts after its spawn, a graph's
// message arrives after it was sent, waiting ends after all tasks), so real races are still found.
#pragma once

#include <utility>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace tangere {

/// A function that oneTBB may copy from task to task. Only a pointer is copied.
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

/// Release: everything before it in this thread happens before everything after tsan_acquire() of
/// the same address in other threads.
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

/// Orders what the graph itself did in other threads, some of it after our bodies, before what
/// follows. Call it after graph.wait_for_all(). The graph's tasks decrement a counter in its
/// header, so touching this counter is enough.
template <class Graph>
void tsan_acquire_tasks_of([[maybe_unused]] Graph& graph) {
#if defined(__SANITIZE_THREAD__)
  graph.reserve_wait();
  graph.release_wait();
#endif
}

/// Orders the tasks of one wait: each starts after begin(), and end() comes after all of them.
class TsanOrder {
 public:
  void begin() const { tsan_release(&begin_); }
  /// Call it first in a task whose function object, with its captures, was made where begin() was
  /// called.
  static void arrive() { tsan_acquire(&begin_); }
  void end() const { tsan_acquire(&end_); }

  /// Scope of a task. `mine`: data that tasks pass to each other and never use concurrently.
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
  static inline char begin_ = 0;  // only the addresses matter
  char end_ = 0;
};

}  // namespace tangere
