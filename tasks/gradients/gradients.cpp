// SPDX-License-Identifier: Apache-2.0
// A thread takes a block forward and back; blocks share nothing but the model.
#include "tasks/gradients/gradients.hpp"

#include <algorithm>
#include <string>

#include "engine/derivative/tactile_point_numbers.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/gradients/loss_block.hpp"

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
  const int numbers = o.parameters ? NumberGradients(model).count() : 0;
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
  std::vector<LossBlock> workers;  // by the thread's index in the arena
  std::size_t losses;
  BlockThreads threads;

  Impl(const Model& m, const GradientOptions& o, std::span<const RolloutLoss* const> l)
      : model(m), options(o), losses(l.size()), threads(o.threads) {
    workers.reserve(std::size_t(o.threads));
    for (int i = 0; i < o.threads; ++i) workers.emplace_back(model, o, l);
  }
};

/// Losses of fields cannot have sensors with memory. Points of sensors with ks have no derivatives
/// of their own.
static void check_memories(const Model& model, const GradientOptions& options,
                           std::span<const RolloutLoss* const> losses) {
  const auto reads_fields = [&](const RolloutLoss* loss) {
    for (std::int64_t step = 0; step <= options.steps; ++step)
      if (loss->reads_fields(step)) return true;
    return false;
  };
  if (!std::any_of(losses.begin(), losses.end(), reads_fields)) return;
  check_has_no_lag(model);
  if (options.points) check_has_plain_points(model);
}

GradientRollouts::GradientRollouts(const Model& model, const GradientOptions& options,
                                   std::span<const RolloutLoss* const> losses) {
  check(options);
  check_memories(model, options, losses);
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
  run_gradients(i.threads, i.workers, batch.blocks(), go_on, out,
                [&](LossBlock& worker, int b, std::vector<FailedEnvironment>& failures) {
                  worker.run(batch, b, controls, u, out, failures);
                });
  return out;
}

double gradient_bytes(const Model& model, int environments, const GradientOptions& o, int losses) {
  const double numbers = o.parameters ? NumberGradients(model).count() : 0;
  const double results =
      double(o.steps) * model.nu() + 2.0 * model.nv() + numbers + double(point_count(model, o)) + 1;
  const Integrator scheme = integrator_in_force(model, o.stepper);
  const double tape = std::min(double(BlockTape::bytes(model, scheme, o.steps)), o.tape_bytes);
  const double of_points =
      double(kernels::kBlock) * double(point_count(model, o)) * losses;  // each thread's own sums
  return 8 * results * environments * losses +
         o.threads * (tape + 2 * double(Stepper::workspace_bytes(model)) + 8 * of_points);
}

GradientSummary rollout_gradients(const Batch& start, const StepControls& controls,
                                  const GradientOptions& options,
                                  std::span<const RolloutLoss* const> losses) {
  return GradientRollouts(start.model(), options, losses).run(start, controls);
}

}  // namespace tangere
