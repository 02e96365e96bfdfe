// SPDX-License-Identifier: Apache-2.0
// A thread takes a block forward and back; blocks share nothing but the model or the task.
#include "tasks/gradients/gradients.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "engine/base/as_size.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "tasks/gradients/scene_block.hpp"
#include "tasks/gradients/task_block.hpp"
#include "tasks/run/block_threads.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

void check(const TapeOptions& options) {
  if (options.length < 1)
    throw InputError("gradients of " + std::to_string(options.length) +
                     " steps; expected at least 1");
  if (!(options.tape_bytes > 0))
    throw InputError("a tape of " + std::to_string(options.tape_bytes) +
                     " bytes; expected a positive number");
  if (options.threads < 1)
    throw InputError("gradients on " + std::to_string(options.threads) +
                     " threads; expected at least 1");
}

TapeOptions checked(const Task& task, std::int64_t episodes, const TapeOptions& options) {
  if (episodes < 1 || options.threads < 1)
    throw InputError(fmt::format("gradients of {} episodes on {} threads; expected at least 1",
                                 episodes, options.threads));
  TapeOptions o = options_for(task, options, "gradients");
  o.points = false;
  return o;
}

/// Numbers of one gradient of an environment, without points.
std::int64_t parameter_count(const Model& model, const TapeOptions& o) {
  return o.parameters ? NumberGradients(model).count() : 0;
}
std::int64_t point_count(const Model& model, const TapeOptions& o) {
  return o.points ? std::int64_t{tactile_points(model)} * kPointNumbers : 0;
}

/// `width`: derivatives by controls or by an action.
LossGradient zeros(const Model& model, std::int64_t environments, const TapeOptions& o,
                   std::int64_t width) {
  const auto rows = [environments](std::int64_t each) {
    return std::vector<double>(as_size(environments * each));
  };
  return {rows(1),          rows(o.length * width),          rows(model.nv()),
          rows(model.nv()), rows(parameter_count(model, o)), rows(point_count(model, o))};
}

/// Numbers of a LossGradient per environment.
double numbers_of(const Model& model, const TapeOptions& o, double width) {
  return double(o.length) * width + 2.0 * model.nv() + double(parameter_count(model, o)) +
         double(point_count(model, o)) + 1;
}

/// Runs and reverses all blocks on all threads; `run` processes one block with a thread's worker.
/// Fills the counts of the summary. The same bits for any number of threads.
template <class Worker, class Run>
void run_blocks(BlockThreads& threads, std::vector<Worker>& workers, int blocks,
                const std::stop_token& stop, GradientCounts& out, const Run& run) {
  std::vector<std::vector<FailedEnvironment>> failures(as_size(blocks));
  for (Worker& worker : workers) worker.begin(stop);
  threads.for_each(blocks, workers,
                   [&](Worker& worker, int b) { run(worker, b, failures[as_size(b)]); });
  for (const auto& block_failures : failures)
    out.failures.insert(out.failures.end(), block_failures.begin(), block_failures.end());
  std::ranges::sort(out.failures, {}, &FailedEnvironment::environment);
  for (const Worker& worker : workers) {
    out.newton_iterations += worker.newton_iterations();
    out.recomputed_steps += worker.recomputed_steps();
    out.stopped = out.stopped || worker.stopped();
  }
}

}  // namespace

struct GradientRollouts::Impl {
  Model model;
  TapeOptions options;
  std::vector<SceneBlock> workers;  // by the thread's index in the arena
  std::size_t losses;
  BlockThreads threads;

  Impl(const Model& m, const TapeOptions& o, std::span<const RolloutLoss* const> l)
      : model(m), options(o), losses(l.size()), threads(o.threads) {
    workers.reserve(as_size(o.threads));
    for (int i = 0; i < o.threads; ++i) workers.emplace_back(model, o, l);
  }
};

GradientRollouts::GradientRollouts(const Model& model, const TapeOptions& options,
                                   std::span<const RolloutLoss* const> losses) {
  check(options);
  impl_ = std::make_unique<Impl>(model, options, losses);
}
GradientRollouts::~GradientRollouts() = default;
GradientRollouts::GradientRollouts(GradientRollouts&&) noexcept = default;
GradientRollouts& GradientRollouts::operator=(GradientRollouts&&) noexcept = default;

GradientSummary GradientRollouts::run(const Batch& start, const StepControls& controls,
                                      const std::stop_token& stop) {
  Impl& i = *impl_;
  if (start.model() != i.model)
    throw InputError("a batch of scene '" + start.model().scene().name +
                     "' for gradients of a model of scene '" + i.model.scene().name +
                     "'; expected the same Model");
  GradientSummary out = empty_gradients(i.model, start.environments(), i.options, i.losses);
  Batch batch = start;
  std::vector<double> u(as_size(start.environments()) * as_size(i.model.nu()));
  run_blocks(i.threads, i.workers, batch.blocks(), stop, out,
             [&](SceneBlock& worker, int b, std::vector<FailedEnvironment>& failures) {
               worker.run(batch, b, controls, u, out, failures);
             });
  return out;
}

GradientSummary rollout_gradients(const Batch& start, const StepControls& controls,
                                  const TapeOptions& options,
                                  std::span<const RolloutLoss* const> losses) {
  return GradientRollouts(start.model(), options, losses).run(start, controls);
}

TaskGradients task_gradients(const Task& task, const TaskActions& actions, std::uint64_t seed,
                             EpisodeRange episodes, const TapeOptions& options,
                             const std::stop_token& stop) {
  const std::int64_t all = episodes.end - episodes.first;
  const TapeOptions o = checked(task, all, options);
  TaskGradients out = empty_gradients(task, all, o);
  std::vector<TaskBlock> workers;  // by the thread's index in the arena
  workers.reserve(as_size(o.threads));
  for (int i = 0; i < o.threads; ++i) workers.emplace_back(task, o, 1);
  BlockThreads threads(o.threads);
  run_blocks(threads, workers, static_cast<int>((all + kBlock - 1) / kBlock), stop, out,
             [&](TaskBlock& worker, int b, std::vector<FailedEnvironment>& failures) {
               const std::int64_t first = std::int64_t{b} * kBlock;
               const EpisodeRange some{episodes.first + first,
                                       episodes.first + std::min(first + kBlock, all)};
               worker.play(seed, some, actions, first, out, failures);
             });
  return out;
}

GradientSummary empty_gradients(const Model& model, int environments, const TapeOptions& o,
                                std::size_t losses) {
  GradientSummary out;
  out.losses.assign(losses, zeros(model, environments, o, model.nu()));
  return out;
}

TaskGradients empty_gradients(const Task& task, std::int64_t episodes, const TapeOptions& o) {
  const auto width = static_cast<std::int64_t>(task.spec().action.size());
  TaskGradients out{{}, zeros(task.model(), episodes, o, width), {}, {}};
  out.length.resize(out.value.size());
  out.action.resize(out.u.size());
  return out;
}

double gradient_bytes(const Model& model, int environments, const TapeOptions& o, int losses) {
  const Integrator scheme = integrator_in_force(model, o.stepper);
  const double tape = std::min(double(BlockTape::bytes(model, scheme, o.length)), o.tape_bytes);
  const double point_sums = kBlock * double(point_count(model, o)) * losses;  // each thread's sums
  return 8 * numbers_of(model, o, model.nu()) * environments * losses +
         o.threads * (tape + 2 * double(Stepper::workspace_bytes(model)) + 8 * point_sums);
}

double gradient_bytes(const Task& task, std::int64_t episodes, const TapeOptions& requested) {
  const TapeOptions o = checked(task, episodes, requested);
  const auto width = double(task.spec().action.size());
  const double results = numbers_of(task.model(), o, 2 * width) + 1;  // actions and lengths, too
  return 8 * results * double(episodes) +
         o.threads *
             (TaskBlock::bytes(task, o, 1) + double(Stepper::workspace_bytes(task.model())));
}

}  // namespace tangere
