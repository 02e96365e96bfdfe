// SPDX-License-Identifier: Apache-2.0
// Keeps the affinity that a thread had before in the thread itself: arenas share threads.
#include "tasks/run/pinned_threads.hpp"

#include <fmt/format.h>
#include <sched.h>

#include <cerrno>
#include <cstring>

#include "engine/base/error.hpp"

namespace tangere {

namespace {

thread_local cpu_set_t own_processors;
thread_local bool is_pinned = false;

}  // namespace

std::vector<int> usable_processors() {
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) != 0)
    throw IoError(fmt::format("the processors of this process: {}", std::strerror(errno)));
  std::vector<int> all;
  for (int k = 0; k < CPU_SETSIZE; ++k)
    if (CPU_ISSET(k, &set)) all.push_back(k);
  return all;
}

PinnedThreads::PinnedThreads(tbb::task_arena& arena)
    : tbb::task_scheduler_observer(arena), processors_(usable_processors()) {
  observe(true);
}
PinnedThreads::~PinnedThreads() { observe(false); }

void PinnedThreads::on_scheduler_entry(bool) {
  const auto index = static_cast<std::size_t>(tbb::this_task_arena::current_thread_index());
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(processors_[index % processors_.size()], &one);
  if (sched_getaffinity(0, sizeof own_processors, &own_processors) != 0 ||
      sched_setaffinity(0, sizeof one, &one) != 0) {
    error_ = errno;
    return;
  }
  is_pinned = true;
}

void PinnedThreads::on_scheduler_exit(bool) {
  if (is_pinned && sched_setaffinity(0, sizeof own_processors, &own_processors) != 0)
    error_ = errno;
  is_pinned = false;
}

void PinnedThreads::check() const {
  if (error_ != 0)
    throw IoError(fmt::format("a thread on one processor alone: {}", std::strerror(error_)));
}

}  // namespace tangere
