// SPDX-License-Identifier: Apache-2.0
// A thread takes a block forward and back; blocks share nothing but the model.
#include "tasks/gradients/gradients.hpp"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <string>

#include "engine/derivative/point_numbers.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/gradients/gradient_block.hpp"
#include "tasks/run/thread_order.hpp"

namespace tangere {
namespace {

void check(const GradientOptions& options) {
  if (options.steps < 1)
    throw InputError("gradients of " + std::to_string(options.steps) +
                     " steps; expected at least 1");
  if (!(options.tape_bytes > 0))
    throw InputError("a tape of " + std::to_string(options.tape_bytes) +
                     " bytes; expected a positive number");
  if (options.threads < 1)
    throw InputError("gradients on " + std::to_string(options.threads) +
                     " threads; expected at least 1");
}

std::int64_t point_count(const Model& model, const GradientOptions& o) {
  return o.points ? std::int64_t{tactile_points(model)} * kPointNumbers : 0;
}

}  // namespace

GradientSummary empty_gradients(const Model& model, int environments, const GradientOptions& o,
                                std::size_t losses) {
  const auto size = [environments](std::int64_t each) {
    return std::size_t(environments) * std::size_t(each);
  };
  GradientSummary out;
  const int numbers = o.parameters ? Parameters(model).count() : 0;
  out.losses.assign(
      losses,
      {std::vector<double>(size(1)), std::vector<double>(size(o.steps * model.nu())),
       std::vector<double>(size(model.nv())), std::vector<double>(size(model.nv())),
       std::vector<double>(size(numbers)), std::vector<double>(size(point_count(model, o)))});
  return out;
}

struct GradientRollouts::Impl {
  Model model;
  GradientOptions options;
  std::vector<GradientBlock> workers;  // by the thread's index in the arena
  std::size_t losses;
  TaskOrder order;
  tbb::global_control cap;
  tbb::task_arena arena;

  Impl(const Model& m, const GradientOptions& o, std::span<const RolloutLoss* const> l)
      : model(m),
        options(o),
        losses(l.size()),
        cap(tbb::global_control::max_allowed_parallelism, std::size_t(o.threads)),
        arena(o.threads) {
    workers.reserve(std::size_t(o.threads));
    for (int i = 0; i < o.threads; ++i) workers.emplace_back(model, o, l);
  }
};

GradientRollouts::GradientRollouts(const Model& model, const GradientOptions& options,
                                   std::span<const RolloutLoss* const> losses) {
  check(options);
  impl_ = std::make_unique<Impl>(model, options, losses);
}
GradientRollouts::~GradientRollouts() = default;
GradientRollouts::GradientRollouts(GradientRollouts&&) noexcept = default;
GradientRollouts& GradientRollouts::operator=(GradientRollouts&&) noexcept = default;

GradientSummary GradientRollouts::run(const Batch& start, const StepControls& controls,
                                      const GradientGoOn& go_on) {
  Impl& i = *impl_;
  if (start.model() != i.model)
    throw InputError("a batch of scene '" + start.model().scene().name +
                     "' for gradients of a model of scene '" + i.model.scene().name +
                     "'; expected the same Model");
  GradientSummary out = empty_gradients(i.model, start.environments(), i.options, i.losses);
  Batch batch = start;
  std::vector<double> u(std::size_t(start.environments()) * std::size_t(i.model.nu()));
  std::vector<std::vector<FailedEnvironment>> failures(std::size_t(start.blocks()));
  for (GradientBlock& worker : i.workers) worker.begin(go_on);
  const auto run_blocks = [&](const tbb::blocked_range<int>& blocks) {
    TaskOrder::arrive();
    GradientBlock& worker = i.workers[std::size_t(tbb::this_task_arena::current_thread_index())];
    const TaskOrder::Task task(i.order, &worker);
    for (int b = blocks.begin(); b != blocks.end(); ++b)
      worker.run(batch, b, controls, u, out, failures[std::size_t(b)]);
  };
  i.order.begin();
  i.arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<int>(0, batch.blocks(), 1),
                      ByReference<decltype(run_blocks)>{&run_blocks}, tbb::simple_partitioner{});
  });
  i.order.end();
  for (const auto& of_block : failures)
    out.failures.insert(out.failures.end(), of_block.begin(), of_block.end());
  std::sort(out.failures.begin(), out.failures.end(),
            [](const auto& a, const auto& b) { return a.environment < b.environment; });
  for (const GradientBlock& worker : i.workers) {
    out.newton_iterations += worker.newton_iterations();
    out.recomputed_steps += worker.recomputed_steps();
    out.stopped = out.stopped || worker.stopped();
  }
  return out;
}

double gradient_bytes(const Model& model, int environments, const GradientOptions& o, int losses) {
  const double numbers = o.parameters ? Parameters(model).count() : 0;
  const double results =
      double(o.steps) * model.nu() + 2.0 * model.nv() + numbers + double(point_count(model, o)) + 1;
  const Integrator scheme = o.stepper.integrator.value_or(model.integrator());
  const double tape = std::min(double(BlockTape::bytes(model, scheme, o.steps)), o.tape_bytes);
  const double of_points =
      double(kernels::kBlock) * double(point_count(model, o)) * losses;  // every thread's own sums
  return 8 * results * environments * losses +
         o.threads * (tape + 2 * double(Stepper::workspace_bytes(model)) + 8 * of_points);
}

GradientSummary rollout_gradients(const Batch& start, const StepControls& controls,
                                  const GradientOptions& options,
                                  std::span<const RolloutLoss* const> losses) {
  return GradientRollouts(start.model(), options, losses).run(start, controls);
}

}  // namespace tangere
