// SPDX-License-Identifier: Apache-2.0
// Forward with checkpoints, then segment by segment back: each is run again onto the tape unless it
// is the only one.
#include "tasks/gradients/gradient_block.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "kernels/numbers/block.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

std::size_t count(std::int64_t n) { return static_cast<std::size_t>(n); }

/// Steps on the tape at a time: all, or as many as make tape and checkpoints together smallest, if
/// that fits.
std::int64_t segment_length(const Model& model, Integrator integrator, const GradientOptions& o) {
  const auto tape = [&](std::int64_t steps) {
    return double(BlockTape::bytes(model, integrator, steps));
  };
  if (tape(o.steps) <= o.tape_bytes) return o.steps;
  const double checkpoint = double(model.state_bytes_per_environment()) * kBlock;
  const double step = tape(2) - tape(1);
  const auto best = std::clamp<std::int64_t>(
      std::llround(std::sqrt(double(o.steps) * checkpoint / step)), 1, o.steps);
  const double needed = tape(best) + checkpoint * std::ceil(double(o.steps) / double(best));
  if (needed > o.tape_bytes)
    throw InputError(fmt::format("tapes of {:.0f} bytes for {} steps; expected at least {:.0f}",
                                 o.tape_bytes, o.steps, needed));
  return best;
}

}  // namespace

GradientBlock::GradientBlock(const Model& model, const GradientOptions& options,
                             std::span<const RolloutLoss* const> losses)
    : model_(model),
      options_(options),
      losses_(losses.begin(), losses.end()),
      segment_(0),
      stepper_(model, options.stepper),
      readout_(model, options.precision),
      pullback_(model),
      adjoint_(model, options.stepper,
               {static_cast<int>(losses.size()), options.parameters, options.points}),
      tape_(model, stepper_.integrator(), segment_length(model, stepper_.integrator(), options)),
      reading_(model),
      parameters_(model) {
  segment_ = segment_length(model, stepper_.integrator(), options);
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    frames_.emplace_back();
    for (int l = 0; l < kBlock; ++l) frames_.back().emplace_back(model, static_cast<int>(s));
  }
}

void GradientBlock::run(Batch& batch, int block, const StepControls& controls, std::span<double> u,
                        GradientSummary& out, std::vector<FailedEnvironment>& failures) {
  const int first = block * kBlock;
  const InHand h{batch,    block, first, std::min(first + kBlock, batch.environments()),
                 controls, u,     out};
  forward(h, failures);
  backward(h);
}

bool GradientBlock::may_go_on() {
  if (go_on_ != nullptr && *go_on_ && !(*go_on_)()) stopped_ = true;
  return !stopped_;
}

void GradientBlock::step(const InHand& h, std::int64_t t, BlockTape* tape) {
  const std::size_t nu = count(model_.nu());
  for (int e = h.first; e < h.last; ++e) h.controls(t, e, h.u.subspan(count(e) * nu, nu));
  stepper_.step_block(h.batch, h.block, h.u, tape);
}

void GradientBlock::forward(const InHand& h, std::vector<FailedEnvironment>& failures) {
  const bool whole = segment_ == options_.steps;
  checkpoints_.clear();
  std::array<bool, kBlock> live{};
  for (int e = h.first; e < h.last; ++e) {
    live[count(e - h.first)] = !failed(h.batch.status(e));
    if (failed(h.batch.status(e))) failures.push_back({e, -1, h.batch.status(e)});
  }
  if (whole) tape_.start(h.batch, h.block);
  for (std::int64_t t = 0; t < options_.steps && may_go_on(); ++t) {
    if (!whole && t % segment_ == 0) checkpoints_.push_back(h.batch.save_block(h.block));
    step(h, t, whole ? &tape_ : nullptr);
    for (int e = h.first; e < h.last; ++e) {
      bool& alive = live[count(e - h.first)];
      if (!alive) continue;
      newton_iterations_ += h.batch.iterations(e);
      if (!failed(h.batch.status(e))) continue;
      failures.push_back({e, t, h.batch.status(e)});
      alive = false;
    }
  }
}

void GradientBlock::backward(const InHand& h) {
  if (stopped_) return;
  adjoint_.clear();
  const std::int64_t steps = options_.steps;
  if (segment_ == steps) {
    reverse_segment(h, 0, steps);
  } else {
    for (std::size_t k = checkpoints_.size(); k-- > 0;) {
      const std::int64_t begin = std::int64_t(k) * segment_,
                         end = std::min(begin + segment_, steps);
      h.batch.restore_block(h.block, checkpoints_[k]);
      tape_.start(h.batch, h.block);
      for (std::int64_t t = begin; t < end; ++t) step(h, t, &tape_);
      recomputed_steps_ += end - begin;
      reverse_segment(h, begin, end);
    }
  }
  if (stopped_) return;
  finish(h);
}

/// From the state after `end` steps to that after `begin`, which is looked at only where the
/// rollout begins.
void GradientBlock::reverse_segment(const InHand& h, std::int64_t begin, std::int64_t end) {
  const std::size_t nu = count(model_.nu()), steps = count(options_.steps);
  for (std::int64_t t = end; t > begin && may_go_on(); --t) {
    tape_.show(t - begin, h.batch, h.block);
    look(h, t);
    for (int e = h.first; e < h.last; ++e) h.controls(t - 1, e, h.u.subspan(count(e) * nu, nu));
    adjoint_.reverse_step(h.batch, h.block, tape_, t - 1 - begin, h.u);
    for (std::size_t k = 0; k < losses_.size(); ++k) {
      const BlockCotangent& c = adjoint_.loss(static_cast<int>(k));
      for (int e = h.first; e < h.last; ++e)
        for (std::size_t i = 0; i < nu; ++i)
          h.out.losses[k].u[(count(e) * steps + count(t - 1)) * nu + i] =
              c.u[i * kBlock + count(e - h.first)];
    }
  }
  if (begin != 0 || stopped_) return;
  tape_.show(0, h.batch, h.block);
  look(h, 0);
}

/// Fields that some loss looks at after `step` steps.
void GradientBlock::read(const InHand& h, std::int64_t step) {
  if (std::none_of(losses_.begin(), losses_.end(),
                   [&](const RolloutLoss* l) { return l->reads_fields(step); }))
    return;
  for (auto& frames : frames_)
    readout_.read_block(h.batch, h.block, std::span(frames).first(count(h.last - h.first)));
}

/// Every loss at the state in the batch: values, and cotangents into the adjoint.
void GradientBlock::look(const InHand& h, std::int64_t step) {
  read(h, step);
  bool placed = false;
  for (std::size_t k = 0; k < losses_.size(); ++k) {
    const bool fields = losses_[k]->reads_fields(step),
               end_effectors = losses_[k]->reads_end_effectors(step);
    if ((fields || end_effectors) && !placed) {
      pullback_.place(h.batch, h.block);
      placed = true;
    }
    if (fields || end_effectors) pullback_.clear();
    for (int e = h.first; e < h.last; ++e) judge(h, step, k, e);
    if (fields || end_effectors) pullback_.finish(adjoint_.loss(static_cast<int>(k)));
  }
}

/// One loss at one environment's state.
void GradientBlock::judge(const InHand& h, std::int64_t step, std::size_t loss, int e) {
  const RolloutLoss& l = *losses_[loss];
  const int lane = e - h.first;
  const std::size_t nu = count(model_.nu()), steps = count(options_.steps);
  const bool fields = l.reads_fields(step);
  std::span<const double> u;
  if (step < options_.steps) {
    h.controls(step, e, h.u.subspan(count(e) * nu, nu));
    u = h.u.subspan(count(e) * nu, nu);
  }
  for (std::size_t s = 0; s < frames_.size() && fields; ++s)
    reading_.set_field(s, frames_[s][count(lane)]);
  LossGradient& result = h.out.losses[loss];
  result.value[count(e)] += reading_.evaluate(l, h.batch, readout_, e, step, options_.steps, u);
  BlockCotangent& c = adjoint_.loss(static_cast<int>(loss));
  for (std::size_t i = 0; i < count(model_.nv()); ++i) {
    c.q[i * kBlock + count(lane)] += reading_.q_bar()[i];
    c.v[i * kBlock + count(lane)] += reading_.v_bar()[i];
  }
  for (std::size_t i = 0; i < u.size(); ++i)
    result.u[(count(e) * steps + count(step)) * nu + i] += reading_.u_bar()[i];
  for (std::size_t s = 0; s < frames_.size() && fields; ++s)
    pullback_.field(lane, static_cast<int>(s), frames_[s][count(lane)].tiles(),
                    reading_.field_bar(s), c.parameters,
                    c.points_of(model_, static_cast<int>(s), lane));
  for (std::size_t k = 0; k < model_.end_effectors().size() && l.reads_end_effectors(step); ++k)
    pullback_.end_effector(lane, static_cast<int>(k),
                           reading_.end_effectors_bar().subspan(3 * k, 3));
}

/// Gradients by the initial state and by the scene's numbers.
void GradientBlock::finish(const InHand& h) {
  const std::size_t nv = count(model_.nv()), numbers = count(parameters_.count());
  for (std::size_t k = 0; k < losses_.size(); ++k) {
    const BlockCotangent& c = adjoint_.loss(static_cast<int>(k));
    LossGradient& result = h.out.losses[k];
    const std::size_t points = c.points.size() / kBlock;
    for (int e = h.first; e < h.last; ++e) {
      for (std::size_t i = 0; i < nv; ++i) {
        result.q[count(e) * nv + i] = c.q[i * kBlock + count(e - h.first)];
        result.v[count(e) * nv + i] = c.v[i * kBlock + count(e - h.first)];
      }
      if (options_.parameters)
        parameters_.gradient(c, h.batch, e,
                             std::span(result.parameters).subspan(count(e) * numbers, numbers));
      std::copy_n(c.points.begin() + std::ptrdiff_t(count(e - h.first) * points), points,
                  result.points.begin() + std::ptrdiff_t(count(e) * points));
    }
  }
}

}  // namespace tangere
