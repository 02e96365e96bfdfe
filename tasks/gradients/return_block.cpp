// SPDX-License-Identifier: Apache-2.0
// A stretch is one action, with a tape of its own.
// An action begins at x and finds the memory m. It leaves m⁺, with K steps and looks in between:
//   r = judge(moments, m⁺, a);  x_(k+1) = step(x_k, controls(x_0, m⁺, a));
//       x_0 = place(x, m⁺, a);  m⁺ = begin_action(x, m, a)
#include "tasks/gradients/return_block.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/as_size.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

double tape_bytes(const Task& task, const TaskGradientOptions& o) {
  const Integrator scheme = integrator_in_force(task.model(), o.stepper);
  return double(BlockTape::bytes(task.model(), scheme, task.spec().steps_per_action));
}

/// Bytes of tapes of `segment` actions and of the checkpoints between them.
double bytes_with(const Task& task, const TaskGradientOptions& o, std::int64_t segment) {
  const double records = double(o.actions) * ActionRecord::bytes(task);
  const double checkpoints = segment == o.actions ? 0
                                                  : std::ceil(double(o.actions) / double(segment)) *
                                                        checkpoint_bytes(task.model());
  return records + double(segment) * tape_bytes(task, o) + checkpoints;
}

TapePlan plan_of(const Task& task, const TaskGradientOptions& o) {
  return {o.actions, task.spec().steps_per_action,
          units_on_tape(
              task.model(), o.actions, tape_bytes(task, o), o.tape_bytes,
              [&](std::int64_t segment) { return bytes_with(task, o, segment); }, "actions")};
}

}  // namespace

ReturnBlock::ReturnBlock(const Task& task, const TaskGradientOptions& options)
    : GradientBlock(task.model(), options.stepper, {1, options.parameters}, plan_of(task, options)),
      task_(task),
      options_(options),
      rollout_(task, options.stepper, options.precision),
      moments_(task.spec().moments.size()),
      start_q_(kBlock * as_size(task.model().nv())),
      start_v_(start_q_.size()),
      by_u_(kBlock * as_size(task.model().nu())),
      by_memory_(kBlock * as_size(task.spec().memory)),
      sound_(kBlock) {
  if (task.spec().looks_at_tactile) check_has_no_memory(task.model());
  records_.assign(as_size(options.actions), ActionRecord(task));
  by_action_.assign(as_size(options.actions),
                    std::vector<double>(kBlock * task.spec().action.size()));
  for (MomentRows& m : moments_) {
    m.q = m.v = start_q_;
    m.end_effectors.resize(kBlock * task.end_effectors_size());
    m.tactile.resize(kBlock * task.tactile_size());
  }
}

double ReturnBlock::bytes(const Task& task, const TaskGradientOptions& options) {
  return std::min(bytes_with(task, options, options.actions), options.tape_bytes) +
         BlockWorker::bytes(task) + 2 * double(Stepper::workspace_bytes(task.model()));
}

void ReturnBlock::run(std::int64_t first, int count, const TaskActions& actions, std::int64_t to,
                      TaskGradients& out, std::vector<FailedEnvironment>& failures) {
  std::vector<std::int64_t> episodes;
  for (int e = 0; e < count; ++e) episodes.push_back(first + e);
  rollout_.start(options_.seed, episodes);
  choose_ = &actions;
  lost_.clear();
  note(-1);
  std::fill(by_memory_.begin(), by_memory_.end(), 0.0);
  GradientBlock::run(rollout_.batch(), 0);
  for (const FailedEnvironment& f : lost_)
    failures.push_back({static_cast<int>(to) + f.environment, f.step, f.status});
  if (!stopped()) finish(to, out);
}

/// Notes which lanes have failed in an action.
void ReturnBlock::note(std::int64_t action) {
  for (int l = 0; l < rollout_.lanes(); ++l) {
    const bool now = !failed(rollout_.batch().status(l));
    if (!now && (action < 0 || sound_[as_size(l)]))
      lost_.push_back({l, action, rollout_.batch().status(l)});
    sound_[as_size(l)] = now;
  }
}

bool ReturnBlock::begin_stretch(std::int64_t action) {
  if (!rollout_.running()) return false;
  rollout_.choose(*choose_, records_[as_size(action)]);
  rollout_.begin(records_[as_size(action)]);
  return true;
}

void ReturnBlock::take_steps(std::int64_t action, BlockTape* tape) {
  rollout_.take_steps(tape);
  rollout_.conclude();
  note(action);
}

void ReturnBlock::retake_steps(std::int64_t action, bool from_checkpoint, BlockTape& tape) {
  if (!from_checkpoint) rollout_.place_again(records_[as_size(action)], action);
  rollout_.retake_steps(records_[as_size(action)], action, tape);
}

/// Moves the adjoint's cotangents from the state after an action to the state in which the action
/// was chosen.
void ReturnBlock::reverse(std::int64_t action, const BlockTape& tape) {
  const ActionRecord& r = records_[as_size(action)];
  const std::vector<int>& looks = task_.spec().moments;
  const int every = task_.spec().control_every;
  for (std::vector<double>* x : {&start_q_, &start_v_, &by_u_, &by_action_[as_size(action)]})
    std::fill(x->begin(), x->end(), 0.0);
  rollout_.look_again(tape);
  reverse_rewards(r, action);
  std::size_t next = looks.size();
  for (int t = task_.spec().steps_per_action; t > 0; --t) {
    if (next > 0 && looks[next - 1] == t) add_moment(--next, tape);
    if (t % every == 0 || t == task_.spec().steps_per_action)
      rollout_.ask_again(r, action, (t - 1) / every * every, tape);
    adjoint_.reverse_step(rollout_.batch(), 0, tape, t - 1, rollout_.u());
    for (int l = 0; l < rollout_.lanes(); ++l) {
      const std::span<double> by_u = part(by_u_, l);
      for (std::size_t k = 0; k < by_u.size(); ++k)
        by_u[k] += adjoint_.loss(0).u[k * kBlock + as_size(l)];
    }
    if ((t - 1) % every == 0) reverse_controls(r, action, t - 1, tape);
  }
  reverse_start(r, action);
}

void ReturnBlock::reverse_rewards(const ActionRecord& r, std::int64_t action) {
  for (MomentRows& m : moments_)
    for (std::vector<double>* x : {&m.q, &m.v, &m.end_effectors, &m.tactile})
      std::fill(x->begin(), x->end(), 0.0);
  std::vector<MomentCotangent> to(moments_.size());
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    for (std::size_t m = 0; m < to.size(); ++m) to[m] = cotangent(m, l);
    task_.reward_vjp(rollout_.view(r, action + 1, l, part(r.memory, l), rollout_.moments(l)), 1,
                     {to, part(by_action_[as_size(action)], l), part(by_memory_, l)});
  }
}

/// Adds cotangents of the state after one of an action's steps.
void ReturnBlock::add_moment(std::size_t moment, const BlockTape& tape) {
  const MomentRows& m = moments_[moment];
  BlockCotangent& c = adjoint_.loss(0);
  for (int l = 0; l < rollout_.lanes(); ++l) {
    const std::span<const double> q = part(m.q, l), v = part(m.v, l);
    for (std::size_t i = 0; i < q.size(); ++i) {
      c.q[i * kBlock + as_size(l)] += q[i];
      c.v[i * kBlock + as_size(l)] += v[i];
    }
  }
  if (m.end_effectors.empty() && m.tactile.empty()) return;
  tape.show(task_.spec().moments[moment], rollout_.batch(), 0);
  pullback_.place(rollout_.batch(), 0);
  pullback_.clear();
  for (int l = 0; l < rollout_.lanes(); ++l) add_fields(moment, l);
  pullback_.finish(c);
}

void ReturnBlock::add_fields(std::size_t moment, int lane) {
  const std::span<const double> end_effectors = part(moments_[moment].end_effectors, lane);
  std::span<const double> fields = part(moments_[moment].tactile, lane);
  for (std::size_t k = 0; 3 * k < end_effectors.size(); ++k)
    pullback_.end_effector(lane, static_cast<int>(k), end_effectors.subspan(3 * k, 3));
  const auto sensors = task_.model().sensors();
  for (std::size_t s = 0; s < sensors.size() && !fields.empty(); ++s) {
    const std::size_t numbers = 3 * as_size(sensors[s].points);
    pullback_.dense_field(lane, static_cast<int>(s), fields.first(numbers),
                          adjoint_.loss(0).parameters);
    fields = fields.subspan(numbers);
  }
}

/// Reverses the controls that hold from `step` on.
void ReturnBlock::reverse_controls(const ActionRecord& r, std::int64_t action, int step,
                                   const BlockTape& tape) {
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const Moment first = rollout_.first_moment(tape, l);
    const MomentCotangent to{part(start_q_, l), part(start_v_, l), {}, {}};
    task_.controls_vjp(rollout_.view(r, action, l, part(r.memory, l), {&first, 1}), step,
                       part(by_u_, l),
                       {{&to, 1}, part(by_action_[as_size(action)], l), part(by_memory_, l)});
  }
  std::fill(by_u_.begin(), by_u_.end(), 0.0);
}

/// Goes back to where the action was chosen, through a restart and through the update of the
/// memory.
void ReturnBlock::reverse_start(const ActionRecord& r, std::int64_t action) {
  BlockCotangent& c = adjoint_.loss(0);
  const std::size_t nv = as_size(task_.model().nv());
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const auto at = [l](AlignedVector<double>& rows, std::size_t i) -> double& {
      return rows[i * kBlock + as_size(l)];
    };
    const std::span<double> q = part(start_q_, l), v = part(start_v_, l),
                            memory = part(by_memory_, l);
    const std::span<double> by_action = part(by_action_[as_size(action)], l);
    const Moment seen{part(r.q, l), part(r.v, l), {}, {}};
    if (task_.spec().restarts) {
      std::vector<double> placed_q(q.begin(), q.end()), placed_v(v.begin(), v.end());
      for (std::size_t i = 0; i < nv; ++i) {
        placed_q[i] += at(c.q, i);
        placed_v[i] += at(c.v, i);
        q[i] = v[i] = at(c.q, i) = at(c.v, i) = at(c.previous_q, i) = at(c.previous_v, i) = 0;
      }
      const MomentCotangent to{q, v, {}, {}};
      task_.place_vjp(rollout_.view(r, action, l, part(r.memory, l), {&seen, 1}), placed_q,
                      placed_v, {{&to, 1}, by_action, memory});
    }
    const MomentCotangent to{q, v, {}, {}};
    task_.begin_action_vjp(rollout_.view(r, action, l, part(r.found, l), {&seen, 1}), memory,
                           {{&to, 1}, by_action, {}});
    for (std::size_t i = 0; i < nv; ++i) {
      at(c.q, i) += q[i];
      at(c.v, i) += v[i];
    }
  }
}

void ReturnBlock::finish(std::int64_t to, TaskGradients& out) {
  const TensorSpec& spec = task_.spec().action;
  const std::size_t width = spec.size(), nv = as_size(task_.model().nv()),
                    numbers = options_.parameters ? as_size(parameters_.count()) : 0;
  for (int l = 0; l < rollout_.lanes(); ++l) {
    const std::size_t e = as_size(to + l);
    out.value[e] = rollout_.data().returns[as_size(l)];
    out.length[e] = rollout_.data().length[as_size(l)];
    for (std::size_t a = 0; a < as_size(out.length[e]); ++a)
      for (std::size_t k = 0; k < width; ++k) {
        const std::size_t at = (e * as_size(options_.actions) + a) * width + k;
        const double asked = part(records_[a].asked, l)[k];
        out.action[at] = asked;
        out.by_action[at] = asked < spec.low || asked > spec.high ? 0 : part(by_action_[a], l)[k];
      }
    get_start(0, rollout_.batch(), l, std::span(out.by_q).subspan(e * nv, nv),
              std::span(out.by_v).subspan(e * nv, nv),
              std::span(out.by_parameter).subspan(e * numbers, numbers), {});
  }
}

std::span<double> ReturnBlock::part(std::vector<double>& all, int lane) const {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(as_size(lane) * width, width);
}
std::span<const double> ReturnBlock::part(const std::vector<double>& all, int lane) const {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(as_size(lane) * width, width);
}

MomentCotangent ReturnBlock::cotangent(std::size_t moment, int lane) {
  MomentRows& m = moments_[moment];
  return {part(m.q, lane), part(m.v, lane), part(m.end_effectors, lane), part(m.tactile, lane)};
}

}  // namespace tangere
