// SPDX-License-Identifier: Apache-2.0
// A stretch is as long as the tape allows. If all steps fit, there is one stretch.
#include "tasks/gradients/loss_block.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {

using kernels::kBlock;

namespace {

std::size_t count(std::int64_t n) { return static_cast<std::size_t>(n); }

TapePlan plan_of(const Model& model, const GradientOptions& o) {
  const Integrator scheme = integrator_in_force(model, o.stepper);
  const auto tape = [&](std::int64_t steps) {
    return double(BlockTape::bytes(model, scheme, steps));
  };
  const auto bytes_with = [&](std::int64_t steps) {
    return tape(steps) + (steps == o.steps ? 0
                                           : checkpoint_bytes(model) *
                                                 std::ceil(double(o.steps) / double(steps)));
  };
  const std::int64_t steps =
      units_on_tape(model, o.steps, tape(2) - tape(1), o.tape_bytes, bytes_with, "steps");
  return {(o.steps + steps - 1) / steps, steps, 1};
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

LossBlock::LossBlock(const Model& model, const GradientOptions& options,
                     std::span<const RolloutLoss* const> losses)
    : GradientBlock(model, options.stepper,
                    {static_cast<int>(losses.size()), options.parameters, options.points},
                    plan_of(model, options)),
      options_(options),
      losses_(losses.begin(), losses.end()),
      stepper_(model, for_gradients(model, options.stepper)),
      readout_(model, options.precision),
      reading_(model) {
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    frames_.emplace_back();
    for (int l = 0; l < kBlock; ++l) frames_.back().emplace_back(model, static_cast<int>(s));
  }
}

void LossBlock::run(Batch& batch, int block, const StepControls& controls, std::span<double> u,
                    GradientSummary& out, std::vector<FailedEnvironment>& failures) {
  const int first = block * kBlock, lanes = lanes_of(batch, block);
  Context h{batch, block, first, first + lanes, controls, u, out, StepTally(batch, first, lanes)};
  context_ = &h;
  GradientBlock::run(batch, block);
  newton_iterations_ += h.tally.counts.newton_iterations;
  failures.insert(failures.end(), h.tally.failures.begin(), h.tally.failures.end());
  if (!stopped()) finish();
  context_ = nullptr;
}

std::int64_t LossBlock::end_of(std::int64_t stretch) const {
  return std::min((stretch + 1) * plan_.steps, options_.steps);
}

/// Fills the controls of a step of all lanes into u.
void LossBlock::ask(std::int64_t step) {
  const std::size_t nu = count(model_.nu());
  for (int e = context_->first; e < context_->last; ++e)
    context_->controls(step, e, context_->u.subspan(count(e) * nu, nu));
}

void LossBlock::take_steps(std::int64_t stretch, BlockTape* tape) {
  Context& h = *context_;
  if (tape != nullptr) tape->start(h.batch, h.block);
  for (std::int64_t t = stretch * plan_.steps; t < end_of(stretch) && may_go_on(); ++t) {
    ask(t);
    stepper_.step_block(h.batch, h.block, h.u, tape);
    h.tally.count(h.batch, t);
  }
}

void LossBlock::retake_steps(std::int64_t stretch, bool /*from_checkpoint*/, BlockTape& tape) {
  tape.start(context_->batch, context_->block);
  for (std::int64_t t = stretch * plan_.steps; t < end_of(stretch); ++t) {
    ask(t);
    stepper_.step_block(context_->batch, context_->block, context_->u, &tape);
  }
}

/// The losses look at the state before a stretch only where the rollout begins.
void LossBlock::reverse(std::int64_t stretch, const BlockTape& tape) {
  const Context& h = *context_;
  const std::size_t nu = count(model_.nu()), steps = count(options_.steps);
  const std::int64_t begin = stretch * plan_.steps;
  for (std::int64_t t = end_of(stretch); t > begin && may_go_on(); --t) {
    tape.show(t - begin, h.batch, h.block);
    look(t);
    ask(t - 1);
    adjoint_.reverse_step(h.batch, h.block, tape, t - 1 - begin, h.u);
    for (std::size_t k = 0; k < losses_.size(); ++k) {
      const BlockCotangent& c = adjoint_.loss(static_cast<int>(k));
      for (int e = h.first; e < h.last; ++e)
        for (std::size_t i = 0; i < nu; ++i)
          h.out.losses[k].u[(count(e) * steps + count(t - 1)) * nu + i] =
              c.u[i * kBlock + count(e - h.first)];
    }
  }
  if (begin != 0 || stopped()) return;
  tape.show(0, h.batch, h.block);
  look(0);
}

/// Reads the fields that some loss needs after `step` steps.
void LossBlock::read(std::int64_t step) {
  const Context& h = *context_;
  if (std::none_of(losses_.begin(), losses_.end(),
                   [&](const RolloutLoss* l) { return l->reads_fields(step); }))
    return;
  for (auto& frames : frames_)
    readout_.read_block(h.batch, h.block, std::span(frames).first(count(h.last - h.first)));
}

/// Evaluates every loss at the state in the batch. Adds the cotangents to the adjoint.
void LossBlock::look(std::int64_t step) {
  const Context& h = *context_;
  read(step);
  bool placed = false;
  for (std::size_t k = 0; k < losses_.size(); ++k) {
    const bool fields = losses_[k]->reads_fields(step),
               end_effectors = losses_[k]->reads_end_effectors(step);
    if ((fields || end_effectors) && !placed) {
      pullback_.place(h.batch, h.block);
      placed = true;
    }
    if (fields || end_effectors) pullback_.clear();
    for (int e = h.first; e < h.last; ++e) judge(step, k, e);
    if (fields || end_effectors) pullback_.finish(adjoint_.loss(static_cast<int>(k)));
  }
}

/// Evaluates one loss at one environment's state.
void LossBlock::judge(std::int64_t step, std::size_t loss, int e) {
  const Context& h = *context_;
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

/// Writes gradients by the initial state and by the scene's numbers.
void LossBlock::finish() {
  for (std::size_t k = 0; k < losses_.size(); ++k) {
    LossGradient& g = context_->out.losses[k];
    const auto part = [&](std::vector<double>& all, int e) {
      const std::size_t width = all.size() / count(context_->batch.environments());
      return std::span(all).subspan(count(e) * width, width);
    };
    for (int e = context_->first; e < context_->last; ++e)
      get_start(static_cast<int>(k), context_->batch, e, part(g.q, e), part(g.v, e),
                part(g.parameters, e), part(g.points, e));
  }
}

}  // namespace tangere
