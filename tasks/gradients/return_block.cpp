// SPDX-License-Identifier: Apache-2.0
// The reward of every action has the derivative 1, and observations have none: the actions are
// given.
#include "tasks/gradients/return_block.hpp"

#include <algorithm>
#include <numeric>

#include "engine/base/as_size.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

ActionTapes tapes_of(const Task& task, const TaskGradientOptions& o) {
  return {task, o.stepper, o.actions, 1, o.tape_bytes};
}

}  // namespace

ReturnBlock::ReturnBlock(const Task& task, const TaskGradientOptions& options)
    : ActionBlock(tapes_of(task, options), options.precision, options.parameters),
      options_(options),
      by_actions_(as_size(options.actions), by_action_),
      ones_(kBlock, 1.0),
      solved_(kBlock) {}

double ReturnBlock::bytes(const Task& task, const TaskGradientOptions& options) {
  return bytes_of(tapes_of(task, options)) + workspace_bytes(task);
}

void ReturnBlock::run(std::int64_t first, int count, const TaskActions& actions, std::int64_t to,
                      TaskGradients& out, std::vector<FailedEnvironment>& failures) {
  std::vector<std::int64_t> episodes(as_size(count));
  std::iota(episodes.begin(), episodes.end(), first);
  start(options_.seed, episodes);
  choose_ = &actions;
  failures_.clear();
  note(-1);
  GradientBlock::run(rollout_.batch(), 0);
  newton_iterations_ += rollout_.counts().steps.newton_iterations;
  for (const FailedEnvironment& f : failures_)
    failures.push_back({static_cast<int>(to) + f.environment, f.step, f.status});
  if (!stopped()) finish(to, out);
}

/// Notes which lanes have failed in an action.
void ReturnBlock::note(std::int64_t action) {
  for (int l = 0; l < rollout_.lanes(); ++l) {
    const bool now = !failed(rollout_.batch().status(l));
    if (!now && (action < 0 || solved_[as_size(l)]))
      failures_.push_back({l, action, rollout_.batch().status(l)});
    solved_[as_size(l)] = now;
  }
}

bool ReturnBlock::begin_stretch(std::int64_t action) {
  if (!rollout_.running()) return false;
  rollout_.choose(*choose_, records_[as_size(action)]);
  rollout_.begin(records_[as_size(action)]);
  return true;
}

void ReturnBlock::take_steps(std::int64_t action, BlockTape* tape) {
  ActionBlock::take_steps(action, tape);
  note(action);
}

void ReturnBlock::reverse(std::int64_t action, const BlockTape& tape) {
  reverse_action(action, tape, {ones_, {}, {}, {}});
  by_actions_[as_size(action)] = by_action_;
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
        const double asked = part(records_[a].chosen, l)[k];
        out.action[at] = asked;
        out.by_action[at] = asked < spec.low || asked > spec.high ? 0 : part(by_actions_[a], l)[k];
      }
    get_start(0, rollout_.batch(), l, std::span(out.by_q).subspan(e * nv, nv),
              std::span(out.by_v).subspan(e * nv, nv),
              std::span(out.by_parameter).subspan(e * numbers, numbers), {});
  }
}

}  // namespace tangere
