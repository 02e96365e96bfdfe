// SPDX-License-Identifier: Apache-2.0
// A control holds for all steps between two samples in this comparison, so derivatives by these
// steps are added, and mean the same whatever the step is.
#include "tasks/accuracy/gradient_run.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/as_size.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/run/thread_time.hpp"

namespace tangere {
namespace {

constexpr double kTapeBytes = 2.5e8;  // of a thread; longer episodes are played from checkpoints

/// A loss over the samples of each episode alone.
class SampledLoss : public RolloutLoss {
 public:
  SampledLoss(const FixedEpisodes& episodes, int parts)
      : episodes_(episodes), parts_(parts), loss_(loss_of(episodes.start.model(), parts)) {}
  [[nodiscard]] bool reads_fields(std::int64_t step) const override {
    return loss_->reads_fields(step);
  }
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    const int samples = episodes_.samples_of[as_size(at.environment)];
    if (at.step == 0 || at.step % parts_ != 0 || at.step / parts_ > samples) return 0;
    return loss_->evaluate(at, out);
  }

 private:
  static std::unique_ptr<RolloutLoss> loss_of(const Model& model, int every) {
    return make_loss(model.sensors().empty() ? LossKind::path : LossKind::tactile, model, every);
  }

  const FixedEpisodes& episodes_;
  int parts_;
  std::unique_ptr<RolloutLoss> loss_;
};

TapeOptions options_of(const FixedEpisodes& episodes, const AccuracySetting& setting, int threads) {
  TapeOptions options;
  options.length = std::int64_t{episodes.samples} * setting.parts;
  options.threads = threads;
  options.stepper = {.integrator = setting.integrator,
                     .timestep = episodes.interval() / setting.parts,
                     .tolerance = setting.tolerance,
                     .accuracy = setting.accuracy,
                     .sleep = 0};
  options.tape_bytes = kTapeBytes;
  return options;
}

}  // namespace

GradientRun::GradientRun(const FixedEpisodes& episodes, int threads)
    : episodes_(episodes), threads_(threads) {
  const Model& model = episodes.start.model();
  const bool has_controls = model.nu() > 0;
  rows_ = has_controls ? as_size(episodes.samples) : 2;
  width_ = as_size(has_controls ? model.nu() : model.nv());
}

AccuracyOutcome GradientRun::play(const AccuracySetting& setting, const std::stop_token& stop,
                                  std::vector<double>& derivatives) const {
  const Batch& start = episodes_.start;
  const SampledLoss loss(episodes_, setting.parts);
  const RolloutLoss* const losses[] = {&loss};
  const TapeOptions options = options_of(episodes_, setting, threads_);
  GradientRollouts rollouts(start.model(), options, losses);
  const std::size_t nu = as_size(start.model().nu());
  const auto controls = [&](std::int64_t step, int e, std::span<double> u) {
    const auto all = episodes_.controls_of(static_cast<int>(step / setting.parts), setting.parts,
                                           static_cast<int>(step % setting.parts));
    std::ranges::copy(all.subspan(as_size(e) * nu, nu), u.begin());
  };
  const double begin = process_seconds();
  const GradientSummary found = rollouts.run(start, controls, stop);
  AccuracyOutcome out;
  out.step_seconds = process_seconds() - begin;
  out.failures = found.failures;
  out.counts.newton_iterations = found.newton_iterations;
  out.stopped = found.stopped;
  out.counts.simulation_steps = options.length * start.environments();
  for (const FailedEnvironment& f : out.failures)
    out.counts.simulation_steps -= options.length - std::max<std::int64_t>(0, f.step);
  out.simulated_seconds =
      static_cast<double>(out.counts.simulation_steps) * episodes_.interval() / setting.parts;
  const LossGradient& g = found.losses.front();
  const std::size_t environments = as_size(start.environments());
  derivatives.assign(environments * rows_ * width_, 0);
  if (nu > 0) {
    for (std::size_t k = 0; k < g.u.size(); ++k) {  // (E, steps, nu)
      const std::size_t row = k / nu / as_size(setting.parts);
      derivatives[row * nu + k % nu] += g.u[k];
    }
  } else {
    for (std::size_t e = 0; e < environments; ++e) {
      const auto from = static_cast<std::ptrdiff_t>(e * width_);
      const auto to = derivatives.begin() + 2 * from;
      std::copy_n(g.q.begin() + from, width_, to);
      std::copy_n(g.v.begin() + from, width_, to + static_cast<std::ptrdiff_t>(width_));
    }
  }
  return out;
}

/// A derivative weighs by the largest by the same motor or dof in all environments.
void GradientRun::weigh(const AccuracyOutcome& out) {
  const std::size_t environments = as_size(episodes_.start.environments());
  no_reference_.assign(environments, 0);
  for (const FailedEnvironment& f : out.failures) no_reference_[as_size(f.environment)] = 1;
  const std::size_t kinds = episodes_.start.model().nu() > 0 ? width_ : 2 * width_;
  const std::size_t each = rows_ * width_;
  std::vector<double> largest(kinds);
  for (std::size_t k = 0; k < reference_.size(); ++k)
    if (no_reference_[k / each] == 0)
      largest[k % kinds] = std::max(largest[k % kinds], std::abs(reference_[k]));
  weight_.resize(kinds);
  for (std::size_t i = 0; i < kinds; ++i) weight_[i] = largest[i] > 0 ? 1 / largest[i] : 0;
  norm_.assign(environments, 0);
  for (std::size_t k = 0; k < reference_.size(); ++k) {
    const double x = weight_[k % kinds] * reference_[k];
    norm_[k / each] += x * x;
  }
}

AccuracyOutcome GradientRun::make_reference(const AccuracySetting& setting,
                                            const std::stop_token& stop) {
  AccuracyOutcome out = play(setting, stop, reference_);
  if (!out.stopped) weigh(out);
  return out;
}

AccuracyOutcome GradientRun::compare(const AccuracySetting& setting, const std::stop_token& stop) {
  std::vector<double> found;
  AccuracyOutcome out = play(setting, stop, found);
  if (out.stopped) return out;
  std::vector<double> sum(norm_.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    const double x = weight_[k % weight_.size()] * (found[k] - reference_[k]);
    sum[k / (rows_ * width_)] += x * x;
  }
  out.error[0] = relative_errors(sum, norm_, no_reference_, out.failures);
  return out;
}

double GradientRun::bytes(const FixedEpisodes& episodes, int threads) {
  const AccuracySetting finest{Integrator::reference, episodes.every * kFinestParts};
  return gradient_bytes(episodes.start.model(), episodes.start.environments(),
                        options_of(episodes, finest, threads), 1);
}

}  // namespace tangere
