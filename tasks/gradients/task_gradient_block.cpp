// SPDX-License-Identifier: Apache-2.0
// Forward with a tape for each action, or a checkpoint every so many; then action by action back.
// Of an action that begins at x, with memory m found and m⁺ left, K steps and looks in between:
//   r = judge(moments, m⁺, a);  x_(k+1) = step(x_k, controls(x_0, m⁺, a));
//       x_0 = place(x, m⁺, a);  m⁺ = begin_action(x, m, a)
#include "tasks/gradients/task_gradient_block.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tangere {

using kernels::kBlock;

namespace {

std::size_t size(std::int64_t n) { return static_cast<std::size_t>(n); }

double checkpoint_bytes(const Model& model) {
  return double(model.state_bytes_per_environment()) * kBlock;
}

double tape_bytes(const Task& task, const TaskGradientOptions& o) {
  const Integrator scheme = o.stepper.integrator.value_or(task.model().integrator());
  return double(BlockTape::bytes(task.model(), scheme, task.spec().steps_per_action));
}

/// Of tapes of `segment` actions and checkpoints between them.
double bytes_with(const Task& task, const TaskGradientOptions& o, std::int64_t segment) {
  const double records = double(o.actions) * ActionRecord::bytes(task);
  const double checkpoints = segment == o.actions ? 0
                                                  : std::ceil(double(o.actions) / double(segment)) *
                                                        checkpoint_bytes(task.model());
  return records + double(segment) * tape_bytes(task, o) + checkpoints;
}

/// Actions on tapes at a time: all, or as many as make tapes and checkpoints together smallest, if
/// that fits.
std::int64_t segment_length(const Task& task, const TaskGradientOptions& o) {
  if (bytes_with(task, o, o.actions) <= o.tape_bytes) return o.actions;
  const double ratio = double(o.actions) * checkpoint_bytes(task.model()) / tape_bytes(task, o);
  const auto best = std::clamp<std::int64_t>(std::llround(std::sqrt(ratio)), 1, o.actions);
  const double needed = bytes_with(task, o, best);
  if (needed > o.tape_bytes)
    throw InputError(fmt::format("tapes of {:.0f} bytes for {} actions; expected at least {:.0f}",
                                 o.tape_bytes, o.actions, needed));
  return best;
}

}  // namespace

TaskGradientBlock::TaskGradientBlock(const Task& task, const TaskGradientOptions& options)
    : task_(task),
      options_(options),
      rollout_(task, options.stepper, options.precision),
      adjoint_(task.model(), options.stepper, {1, options.parameters}),
      pullback_(task.model()),
      parameters_(task.model()),
      segment_(segment_length(task, options)),
      moments_(task.spec().moments.size()),
      start_q_(kBlock * size(task.model().nv())),
      start_v_(start_q_.size()),
      by_u_(kBlock * size(task.model().nu())),
      by_memory_(kBlock * size(task.spec().memory)) {
  for (std::int64_t k = 0; k < segment_; ++k)
    tapes_.emplace_back(task.model(), rollout_.integrator(), task.spec().steps_per_action);
  records_.assign(size(options.actions), ActionRecord(task));
  by_action_.assign(size(options.actions), std::vector<double>(kBlock * task.spec().action.size()));
  for (MomentRows& m : moments_) {
    m.q = m.v = start_q_;
    m.end_effectors.resize(kBlock * task.end_effectors_size());
    m.tactile.resize(kBlock * task.tactile_size());
  }
}

void TaskGradientBlock::begin(const GradientGoOn& go_on) {
  go_on_ = &go_on;
  recomputed_steps_ = 0;
  stopped_ = false;
}

double TaskGradientBlock::bytes(const Task& task, const TaskGradientOptions& options) {
  return std::min(bytes_with(task, options, options.actions), options.tape_bytes) +
         BlockWorker::bytes(task) + 2 * double(Stepper::workspace_bytes(task.model()));
}

bool TaskGradientBlock::may_go_on() {
  if (go_on_ != nullptr && *go_on_ && !(*go_on_)()) stopped_ = true;
  return !stopped_;
}

void TaskGradientBlock::run(std::int64_t first, int count, const TaskActions& actions,
                            std::int64_t to, TaskGradients& out, std::vector<LostEpisode>& lost) {
  std::vector<std::int64_t> episodes;
  for (int e = 0; e < count; ++e) episodes.push_back(first + e);
  rollout_.start(options_.seed, episodes);
  forward(actions, lost);
  if (!stopped_) backward();
  if (!stopped_) finish(to, out);
}

void TaskGradientBlock::forward(const TaskActions& actions, std::vector<LostEpisode>& lost) {
  const bool whole = segment_ == options_.actions;
  checkpoints_.clear();
  std::vector<bool> sound(size(rollout_.lanes()));
  const auto note = [&](std::int64_t action) {
    for (int l = 0; l < rollout_.lanes(); ++l) {
      const bool now = !failed(rollout_.batch().status(l));
      if (!now && (action < 0 || sound[size(l)]))
        lost.push_back({rollout_.data().episodes[size(l)], action, rollout_.batch().status(l)});
      sound[size(l)] = now;
    }
  };
  note(-1);
  for (taken_ = 0; taken_ < options_.actions && rollout_.running() && may_go_on(); ++taken_) {
    rollout_.choose(actions, records_[size(taken_)]);
    rollout_.begin(records_[size(taken_)]);
    if (!whole && taken_ % segment_ == 0) checkpoints_.push_back(rollout_.batch().save_block(0));
    rollout_.take_steps(whole ? &tapes_[size(taken_)] : nullptr);
    rollout_.conclude();
    note(taken_);
  }
}

void TaskGradientBlock::backward() {
  adjoint_.clear();
  std::fill(by_memory_.begin(), by_memory_.end(), 0.0);
  if (segment_ == options_.actions) {
    for (std::int64_t a = taken_; a-- > 0 && may_go_on();) reverse(a, tapes_[size(a)]);
    return;
  }
  for (std::size_t k = checkpoints_.size(); k-- > 0;) {
    const std::int64_t first = std::int64_t(k) * segment_, end = std::min(first + segment_, taken_);
    rollout_.batch().restore_block(0, checkpoints_[k]);
    for (std::int64_t a = first; a < end; ++a) {
      if (a > first) rollout_.place_again(records_[size(a)], a);
      rollout_.retake_steps(records_[size(a)], a, tapes_[size(a - first)]);
    }
    recomputed_steps_ += (end - first) * task_.spec().steps_per_action;
    for (std::int64_t a = end; a-- > first && may_go_on();) reverse(a, tapes_[size(a - first)]);
  }
}

/// From the state after an action, whose cotangents stand in the adjoint, to that in which it was
/// chosen.
void TaskGradientBlock::reverse(std::int64_t action, const BlockTape& tape) {
  const ActionRecord& r = records_[size(action)];
  const std::vector<int>& looks = task_.spec().moments;
  const int every = task_.spec().control_every;
  for (std::vector<double>* x : {&start_q_, &start_v_, &by_u_, &by_action_[size(action)]})
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
        by_u[k] += adjoint_.loss(0).u[k * kBlock + size(l)];
    }
    if ((t - 1) % every == 0) reverse_controls(r, action, t - 1, tape);
  }
  reverse_start(r, action);
}

void TaskGradientBlock::reverse_rewards(const ActionRecord& r, std::int64_t action) {
  for (MomentRows& m : moments_)
    for (std::vector<double>* x : {&m.q, &m.v, &m.end_effectors, &m.tactile})
      std::fill(x->begin(), x->end(), 0.0);
  std::vector<MomentCotangent> to(moments_.size());
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[size(l)]) continue;
    for (std::size_t m = 0; m < to.size(); ++m) to[m] = cotangent(m, l);
    task_.reward_vjp(rollout_.view(r, action + 1, l, part(r.memory, l), rollout_.moments(l)), 1,
                     {to, part(by_action_[size(action)], l), part(by_memory_, l)});
  }
}

/// Of the state after one of an action's steps.
void TaskGradientBlock::add_moment(std::size_t moment, const BlockTape& tape) {
  const MomentRows& m = moments_[moment];
  BlockCotangent& c = adjoint_.loss(0);
  for (int l = 0; l < rollout_.lanes(); ++l) {
    const std::span<const double> q = part(m.q, l), v = part(m.v, l);
    for (std::size_t i = 0; i < q.size(); ++i) {
      c.q[i * kBlock + size(l)] += q[i];
      c.v[i * kBlock + size(l)] += v[i];
    }
  }
  if (m.end_effectors.empty() && m.tactile.empty()) return;
  tape.show(task_.spec().moments[moment], rollout_.batch(), 0);
  pullback_.place(rollout_.batch(), 0);
  pullback_.clear();
  for (int l = 0; l < rollout_.lanes(); ++l) add_fields(moment, l);
  pullback_.finish(c);
}

void TaskGradientBlock::add_fields(std::size_t moment, int lane) {
  const std::span<const double> end_effectors = part(moments_[moment].end_effectors, lane);
  std::span<const double> fields = part(moments_[moment].tactile, lane);
  for (std::size_t k = 0; 3 * k < end_effectors.size(); ++k)
    pullback_.end_effector(lane, static_cast<int>(k), end_effectors.subspan(3 * k, 3));
  const auto sensors = task_.model().sensors();
  for (std::size_t s = 0; s < sensors.size() && !fields.empty(); ++s) {
    const std::size_t numbers = 3 * size(sensors[s].points);
    pullback_.dense_field(lane, static_cast<int>(s), fields.first(numbers),
                          adjoint_.loss(0).parameters);
    fields = fields.subspan(numbers);
  }
}

/// Of the controls that hold from `step` on.
void TaskGradientBlock::reverse_controls(const ActionRecord& r, std::int64_t action, int step,
                                         const BlockTape& tape) {
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[size(l)]) continue;
    const Moment first = rollout_.first_moment(tape, l);
    const MomentCotangent to{part(start_q_, l), part(start_v_, l), {}, {}};
    task_.controls_vjp(rollout_.view(r, action, l, part(r.memory, l), {&first, 1}), step,
                       part(by_u_, l),
                       {{&to, 1}, part(by_action_[size(action)], l), part(by_memory_, l)});
  }
  std::fill(by_u_.begin(), by_u_.end(), 0.0);
}

/// Where the action was chosen: back through a restart, and through what the task keeps of it.
void TaskGradientBlock::reverse_start(const ActionRecord& r, std::int64_t action) {
  BlockCotangent& c = adjoint_.loss(0);
  const std::size_t nv = size(task_.model().nv());
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[size(l)]) continue;
    const auto at = [l](AlignedVector<double>& rows, std::size_t i) -> double& {
      return rows[i * kBlock + size(l)];
    };
    const std::span<double> q = part(start_q_, l), v = part(start_v_, l),
                            memory = part(by_memory_, l);
    const std::span<double> by_action = part(by_action_[size(action)], l);
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

void TaskGradientBlock::finish(std::int64_t to, TaskGradients& out) {
  const TensorSpec& spec = task_.spec().action;
  const std::size_t width = spec.size(), nv = size(task_.model().nv()),
                    numbers = size(parameters_.count());
  for (int l = 0; l < rollout_.lanes(); ++l) {
    const std::size_t e = size(to + l);
    out.value[e] = rollout_.data().returns[size(l)];
    out.length[e] = rollout_.data().length[size(l)];
    for (std::size_t a = 0; a < size(out.length[e]); ++a)
      for (std::size_t k = 0; k < width; ++k) {
        const std::size_t at = (e * size(options_.actions) + a) * width + k;
        const double asked = part(records_[a].asked, l)[k];
        out.action[at] = asked;
        out.by_action[at] = asked < spec.low || asked > spec.high ? 0 : part(by_action_[a], l)[k];
      }
    const BlockCotangent& c = adjoint_.loss(0);
    for (std::size_t i = 0; i < nv; ++i) {
      out.by_q[e * nv + i] = c.q[i * kBlock + size(l)];
      out.by_v[e * nv + i] = c.v[i * kBlock + size(l)];
    }
    if (options_.parameters)
      parameters_.gradient(c, rollout_.batch(), l,
                           std::span(out.by_parameter).subspan(e * numbers, numbers));
  }
}

std::span<double> TaskGradientBlock::part(std::vector<double>& all, int lane) const {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(size(lane) * width, width);
}
std::span<const double> TaskGradientBlock::part(const std::vector<double>& all, int lane) const {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(size(lane) * width, width);
}

MomentCotangent TaskGradientBlock::cotangent(std::size_t moment, int lane) {
  MomentRows& m = moments_[moment];
  return {part(m.q, lane), part(m.v, lane), part(m.end_effectors, lane), part(m.tactile, lane)};
}

}  // namespace tangere
