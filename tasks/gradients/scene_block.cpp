// SPDX-License-Identifier: Apache-2.0
// A segment is as long as the tape allows and has one tape. If all steps fit, there is one segment.
#include "tasks/gradients/scene_block.hpp"

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

TapePlan plan_of(const Model& model, const TapeOptions& o) {
  const Integrator scheme = integrator_in_force(model, o.stepper);
  const auto tape = [&](std::int64_t steps) {
    return double(BlockTape::bytes(model, scheme, steps));
  };
  const auto bytes_with = [&](std::int64_t steps) {
    return tape(steps) + checkpoint_bytes(model, o.length, steps);
  };
  const std::int64_t steps =
      units_on_tape(model, o.length, tape(2) - tape(1), o.tape_bytes, bytes_with, "steps");
  return {(o.length + steps - 1) / steps, steps, 1};
}

}  // namespace

LossReading::LossReading(const Model& model)
    : q_(std::size_t(model.nq())),
      v_(std::size_t(model.nv())),
      end_effectors_(3 * model.end_effectors().size()),
      q_bar_(v_.size()),
      v_bar_(v_.size()),
      u_bar_(std::size_t(model.nu())),
      end_effectors_bar_(end_effectors_.size()),
      fields_(model.sensors().size()),
      field_bars_(fields_.size()),
      field_spans_(fields_.size()) {}

void LossReading::read_fields(const Batch& batch, Readout& readout, int environment) {
  for (std::size_t s = 0; s < fields_.size(); ++s) {
    if (own_.size() == s)
      own_.push_back(std::make_unique<CompactFrame<double>>(batch.model(), static_cast<int>(s)));
    readout.read(batch, environment, *own_[s]);
    fields_[s] = own_[s].get();
  }
}

double LossReading::evaluate(const RolloutLoss& loss, const Batch& batch, Readout& readout,
                             int environment, std::int64_t step, std::int64_t steps,
                             std::span<const double> u) {
  const bool reads_fields = loss.reads_fields(step),
             reads_end_effectors = loss.reads_end_effectors(step);
  batch.get_q(environment, q_);
  batch.get_v(environment, v_);
  for (auto* x : {&q_bar_, &v_bar_, &u_bar_, &end_effectors_bar_})
    std::fill(x->begin(), x->end(), 0.0);
  LossPoint at{step, steps, environment, q_, v_, u, {}, {}};
  LossCotangent out{q_bar_, v_bar_, u.empty() ? std::span<double>() : std::span(u_bar_), {}, {}};
  if (reads_end_effectors) {
    readout.end_effectors(batch, environment, end_effectors_);
    at.end_effectors = end_effectors_;
    out.end_effectors = end_effectors_bar_;
  }
  if (reads_fields) {
    for (std::size_t s = 0; s < fields_.size(); ++s) {
      field_bars_[s].assign(fields_[s]->values().size(), 0.0);
      field_spans_[s] = field_bars_[s];
    }
    at.fields = fields_;
    out.fields = field_spans_;
  }
  return loss.evaluate(at, out);
}

SceneBlock::SceneBlock(const Model& model, const TapeOptions& options,
                       std::span<const RolloutLoss* const> losses)
    : TapeBlock(model, options, static_cast<int>(losses.size()), plan_of(model, options)),
      options_(options),
      losses_(losses.begin(), losses.end()),
      stepper_(model, differentiable(options.stepper)),
      readout_(model, options.precision),
      reading_(model) {
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    frames_.emplace_back();
    for (int l = 0; l < kBlock; ++l) frames_.back().emplace_back(model, static_cast<int>(s));
  }
}

void SceneBlock::run(Batch& batch, int block, const StepControls& controls, std::span<double> u,
                     GradientSummary& out, std::vector<FailedEnvironment>& failures) {
  const int first = block * kBlock, lanes = lanes_of(batch, block);
  Context h{batch, block, first, first + lanes, controls, u, out, StepTally(batch, first, lanes)};
  context_ = &h;
  start_forward();
  while (taken_ < plan_.tapes && may_go_on()) take_tape(batch, block);
  if (!stopped()) start_back();
  while (left_ > 0 && may_go_on()) reverse_tape(batch, block);
  newton_iterations_ += h.tally.counts.newton_iterations;
  failures.insert(failures.end(), h.tally.failures.begin(), h.tally.failures.end());
  if (!stopped()) finish();
  context_ = nullptr;
}

std::int64_t SceneBlock::end_of(std::int64_t segment) const {
  return std::min((segment + 1) * plan_.steps, options_.length);
}

/// Fills an environment's controls of a step into u.
std::span<const double> SceneBlock::evaluate_controls(std::int64_t step, int e) {
  const std::size_t nu = as_size(model_.nu());
  const std::span<double> own = context_->u.subspan(as_size(e) * nu, nu);
  context_->controls(step, e, own);
  return own;
}

void SceneBlock::step(std::int64_t step, BlockTape* tape) {
  const Context& h = *context_;
  for (int e = h.first; e < h.last; ++e) evaluate_controls(step, e);
  stepper_.step_block(h.batch, h.block, h.u, tape);
}

void SceneBlock::take_steps(std::int64_t segment, BlockTape* tape) {
  Context& h = *context_;
  if (tape != nullptr) tape->start(h.batch, h.block);
  for (std::int64_t t = segment * plan_.steps; t < end_of(segment) && may_go_on(); ++t) {
    step(t, tape);
    h.tally.count(h.batch, t);
  }
}

void SceneBlock::retake_steps(std::int64_t segment, bool /*from_checkpoint*/, BlockTape& tape) {
  tape.start(context_->batch, context_->block);
  for (std::int64_t t = segment * plan_.steps; t < end_of(segment); ++t) step(t, &tape);
}

/// Losses are evaluated at the state before a segment only where the rollout begins.
void SceneBlock::reverse_steps(std::int64_t segment, const BlockTape& tape) {
  const Context& h = *context_;
  const std::size_t nu = as_size(model_.nu()), steps = as_size(options_.length);
  const std::int64_t begin = segment * plan_.steps;
  for (std::int64_t t = end_of(segment); t > begin && may_go_on(); --t) {
    tape.show(t - begin, h.batch, h.block);
    add_losses(t);
    for (int e = h.first; e < h.last; ++e) evaluate_controls(t - 1, e);
    adjoint_.reverse_step(h.batch, h.block, tape, t - 1 - begin, h.u);
    for (std::size_t k = 0; k < losses_.size(); ++k) {
      const BlockCotangent& c = adjoint_.loss(static_cast<int>(k));
      for (int e = h.first; e < h.last; ++e)
        for (std::size_t i = 0; i < nu; ++i)
          h.out.losses[k].u[(as_size(e) * steps + as_size(t - 1)) * nu + i] =
              c.u[i * kBlock + as_size(e - h.first)];
    }
  }
  if (begin != 0 || stopped()) return;
  tape.show(0, h.batch, h.block);
  add_losses(0);
}

/// Evaluates every loss at the states in the batch, after `step` steps, and adds their derivatives
/// to the adjoint's cotangents.
void SceneBlock::add_losses(std::int64_t step) {
  const Context& h = *context_;
  if (std::any_of(losses_.begin(), losses_.end(), [&](auto* l) { return l->reads_fields(step); }))
    for (auto& frames : frames_)
      readout_.read_block(h.batch, h.block, std::span(frames).first(as_size(h.last - h.first)));
  bool placed = false;
  for (std::size_t k = 0; k < losses_.size(); ++k) {
    const bool reads = losses_[k]->reads_fields(step) || losses_[k]->reads_end_effectors(step);
    if (reads && !placed) pullback_.place(h.batch, h.block);
    placed = placed || reads;
    if (reads) pullback_.clear();
    for (int e = h.first; e < h.last; ++e) add_loss(step, k, e);
    if (reads) pullback_.finish(adjoint_.loss(static_cast<int>(k)));
  }
}

/// Evaluates one loss at one environment's state.
void SceneBlock::add_loss(std::int64_t step, std::size_t loss, int e) {
  const Context& h = *context_;
  const RolloutLoss& l = *losses_[loss];
  const int lane = e - h.first;
  const std::size_t nu = as_size(model_.nu()), steps = as_size(options_.length);
  const bool fields = l.reads_fields(step);
  std::span<const double> u;
  if (step < options_.length) u = evaluate_controls(step, e);
  for (std::size_t s = 0; s < frames_.size() && fields; ++s)
    reading_.set_field(s, frames_[s][as_size(lane)]);
  LossGradient& result = h.out.losses[loss];
  result.value[as_size(e)] += reading_.evaluate(l, h.batch, readout_, e, step, options_.length, u);
  BlockCotangent& c = adjoint_.loss(static_cast<int>(loss));
  for (std::size_t i = 0; i < as_size(model_.nv()); ++i) {
    c.q[i * kBlock + as_size(lane)] += reading_.q_bar()[i];
    c.v[i * kBlock + as_size(lane)] += reading_.v_bar()[i];
  }
  for (std::size_t i = 0; i < u.size(); ++i)
    result.u[(as_size(e) * steps + as_size(step)) * nu + i] += reading_.u_bar()[i];
  for (std::size_t s = 0; s < frames_.size() && fields; ++s)
    pullback_.field(lane, static_cast<int>(s), frames_[s][as_size(lane)].tiles(),
                    reading_.field_bar(s), c.parameters,
                    c.points_of(model_, static_cast<int>(s), lane));
  for (std::size_t k = 0; k < model_.end_effectors().size() && l.reads_end_effectors(step); ++k)
    pullback_.end_effector(lane, static_cast<int>(k),
                           reading_.end_effectors_bar().subspan(3 * k, 3));
}

/// Writes derivatives by the initial state and by the scene's numbers.
void SceneBlock::finish() {
  const Context& h = *context_;
  for (std::size_t k = 0; k < losses_.size(); ++k) {
    LossGradient& g = h.out.losses[k];
    for (int e = h.first; e < h.last; ++e) {
      const auto own = [&](std::vector<double>& all) {
        const std::size_t width = all.size() / as_size(h.batch.environments());
        return std::span(all).subspan(as_size(e) * width, width);
      };
      get_start(static_cast<int>(k), h.batch, e, own(g.q), own(g.v), own(g.parameters),
                own(g.points));
    }
  }
}

}  // namespace tangere
