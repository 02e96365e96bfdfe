// SPDX-License-Identifier: Apache-2.0
// A thread takes sixteen episodes forward and back; blocks share nothing but the task.
#include "tasks/gradients/task_gradients.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "tasks/gradients/return_block.hpp"

namespace tangere {
namespace {

TaskGradientOptions checked(const Task& task, TaskGradientOptions o) {
  if (o.episodes < 1 || o.threads < 1)
    throw InputError(fmt::format("gradients of {} episodes on {} threads; expected at least 1",
                                 o.episodes, o.threads));
  if (o.actions < 0 || o.actions > task.spec().horizon)
    throw InputError(fmt::format(
        "gradients of {} actions of task {}; expected 1 to {}, its horizon, or 0 for all",
        o.actions, task.spec().name, task.spec().horizon));
  if (o.actions == 0) o.actions = task.spec().horizon;
  if (!(o.tape_bytes > 0))
    throw InputError(fmt::format("tapes of {} bytes; expected a positive number", o.tape_bytes));
  return o;
}

}  // namespace

TaskGradients empty_task_gradients(const Task& task, const TaskGradientOptions& o) {
  const std::size_t episodes = as_size(o.episodes),
                    actions = as_size(o.actions) * task.spec().action.size();
  TaskGradients out;
  out.value.resize(episodes);
  out.length.resize(episodes);
  out.action.resize(episodes * actions);
  out.by_action.resize(episodes * actions);
  out.by_q.resize(episodes * as_size(task.model().nv()));
  out.by_v.resize(out.by_q.size());
  if (o.parameters)
    out.by_parameter.resize(episodes * as_size(NumberGradients(task.model()).count()));
  return out;
}

TaskGradients task_gradients(const Task& task, const TaskActions& actions,
                             const TaskGradientOptions& asked, const GradientGoOn& go_on) {
  const TaskGradientOptions o = checked(task, asked);
  const auto blocks = static_cast<int>((o.episodes + kernels::kBlock - 1) / kernels::kBlock);
  TaskGradients out = empty_task_gradients(task, o);
  std::vector<ReturnBlock> workers;  // by the thread's index in the arena
  workers.reserve(as_size(o.threads));
  for (int i = 0; i < o.threads; ++i) workers.emplace_back(task, o);
  BlockThreads threads(o.threads);
  run_gradients(threads, workers, blocks, go_on, out,
                [&](ReturnBlock& worker, int b, std::vector<FailedEnvironment>& failures) {
                  const std::int64_t first = std::int64_t{b} * kernels::kBlock;
                  const auto count =
                      static_cast<int>(std::min<std::int64_t>(kernels::kBlock, o.episodes - first));
                  worker.run(o.first_episode + first, count, actions, first, out, failures);
                });
  return out;
}

double task_gradient_bytes(const Task& task, const TaskGradientOptions& asked) {
  const TaskGradientOptions o = checked(task, asked);
  const double numbers = o.parameters ? NumberGradients(task.model()).count() : 0;
  const double results = 2.0 * double(o.actions) * double(task.spec().action.size()) +
                         2.0 * task.model().nv() + numbers + 2;
  return 8 * results * double(o.episodes) + o.threads * ReturnBlock::bytes(task, o);
}

}  // namespace tangere
