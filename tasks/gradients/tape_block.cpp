// SPDX-License-Identifier: Apache-2.0
// Derivatives by what a lane shows are collected until the action that led to it is reversed.
#include "tasks/gradients/tape_block.hpp"

#include <algorithm>
#include <numeric>

#include "engine/base/as_size.hpp"
#include "tasks/run/number_row.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

/// Adds to rows of lanes what there is of them.
void add_rows(std::span<const double> from, std::vector<double>& to) {
  for (std::size_t i = 0; i < from.size(); ++i) to[i] += from[i];
}

std::vector<double> lane_rows(std::size_t width) { return std::vector<double>(kBlock * width); }

}  // namespace

TapeBlock::TapeBlock(const ActionTapes& tapes, Precision precision, bool parameters, int lanes)
    : ActionBlock(tapes, precision, parameters),
      lanes_(lanes),
      shown_(lane_rows(task_.spec().observation_size())),
      shown_q_(lane_rows(as_size(task_.model().nv()))),
      shown_v_(shown_q_),
      by_reward_(kBlock) {
  if (!task_.spec().warm_up) return;
  const std::size_t moments = task_.spec().snapshots.size() - 1;
  seen_q_ = lane_rows(moments * as_size(task_.model().nq()));
  seen_v_ = lane_rows(moments * as_size(task_.model().nv()));
  seen_end_effectors_ = lane_rows(moments * task_.end_effectors_size());
  seen_tactile_ = lane_rows(moments * task_.tactile_size());
}

void TapeBlock::start(std::uint64_t seed, std::int64_t first) {
  std::vector<std::int64_t> episodes(as_size(lanes_));
  std::iota(episodes.begin(), episodes.end(), first);
  ActionBlock::start(seed, episodes);
  start_forward();
  took_.fill(false);
  for (int l = 0; l < lanes_; ++l) start_memory_[as_size(l)] = rollout_.batch().shear_state(l);
  if (!task_.spec().warm_up) return;
  for (int l = 0; l < lanes_; ++l) {
    const std::span<const Snapshot> seen = rollout_.start_view(l).snapshots;
    for (std::size_t m = 0; m + 1 < seen.size(); ++m) {
      const auto keep = [&](std::span<const double> from, std::vector<double>& to) {
        std::copy(from.begin(), from.end(),
                  part(to, l).begin() + static_cast<std::ptrdiff_t>(m * from.size()));
      };
      keep(seen[m].q, seen_q_);
      keep(seen[m].v, seen_v_);
      keep(seen[m].end_effectors, seen_end_effectors_);
      keep(seen[m].tactile, seen_tactile_);
    }
  }
}

void TapeBlock::displace(int lane, std::span<const double> q, std::span<const double> v) {
  rollout_.displace(lane, q, v);
  rollout_.record_start();
  rollout_.observe_start(lane);
}

void TapeBlock::step(std::span<const double> actions) {
  took_.fill(false);
  if (!rollout_.running()) return;
  ActionRecord& r = records_[as_size(taken_)];
  std::copy(actions.begin(), actions.end(), r.chosen.begin());
  rollout_.begin(r);
  took_ = r.taken;
  take_stretch(rollout_.batch(), 0);
}

void TapeBlock::begin_reverse() {
  start_back();
  for (std::vector<double>* x : {&by_memory_, &shown_, &shown_q_, &shown_v_})
    std::fill(x->begin(), x->end(), 0.0);
}

void TapeBlock::expect(std::span<const double> by_observation, const StateCotangents& by_state) {
  add_rows(by_observation, shown_);
  add_rows(by_state.q, shown_q_);
  add_rows(by_state.v, shown_v_);
}

/// Sets to zero what has been passed on.
void TapeBlock::forget(const std::array<bool, kBlock>& lanes) {
  for (int l = 0; l < lanes_; ++l)
    if (lanes[as_size(l)])
      for (std::vector<double>* x : {&shown_, &shown_q_, &shown_v_})
        std::fill(part(*x, l).begin(), part(*x, l).end(), 0.0);
}

void TapeBlock::reverse(std::int64_t action, std::span<const double> by_observation,
                        std::span<const double> by_reward, const StateCotangents& by_state,
                        std::span<double> by_action) {
  expect(by_observation, by_state);
  std::fill(by_reward_.begin(), by_reward_.end(), 0.0);
  add_rows(by_reward, by_reward_);
  std::fill(by_action.begin(), by_action.end(), 0.0);
  if (action >= taken_) return;  // no lane took it
  reverse_stretch(rollout_.batch(), 0);
  const ActionRecord& r = records_[as_size(action)];
  const TensorSpec& spec = task_.spec().action;
  for (int l = 0; l < lanes_; ++l)
    for (std::size_t k = 0; k < spec.size() && r.taken[as_size(l)]; ++k) {
      const double asked = part(r.chosen, l)[k];
      if (asked >= spec.low && asked <= spec.high)
        by_action[as_size(l) * spec.size() + k] = part(by_action_, l)[k];
    }
  forget(r.taken);
}

void TapeBlock::reverse(std::int64_t action, const BlockTape& tape) {
  reverse_action(action, tape, {by_reward_, shown_, shown_q_, shown_v_});
}

/// Makes the batch show the states in which the first actions began.
void TapeBlock::show_start() {
  const TaskRollout& rollout = rollout_;
  const std::size_t nq = as_size(task_.model().nq()), nv = as_size(task_.model().nv());
  for (int l = 0; l < lanes_; ++l) {
    const bool began = taken_ > 0;
    rollout_.batch().displace_state(
        l, began ? part(records_[0].q, l) : number_row(rollout.data().q, l, nq),
        began ? part(records_[0].v, l) : number_row(rollout.data().v, l, nv));
    rollout_.batch().set_shear_state(l, start_memory_[as_size(l)]);
  }
  rollout_.record_start();
}

void TapeBlock::reverse_reset(std::span<const double> by_observation,
                              const StateCotangents& by_state, std::span<double> by_q,
                              std::span<double> by_v, std::span<double> by_parameter) {
  expect(by_observation, by_state);
  show_start();
  clear_moments();
  const std::size_t last = task_.spec().snapshots.size() - 1;
  const std::vector<double> no_action(task_.spec().action.size());
  std::vector<double> by_no_action(no_action.size()), by_memory(by_memory_.size() / kBlock);
  for (int l = 0; l < lanes_; ++l) {
    TaskView view = rollout_.start_view(l);
    std::vector<Snapshot> seen(view.snapshots.begin(), view.snapshots.end());
    for (std::size_t m = 0; m + 1 < seen.size(); ++m) {
      const auto kept = [&](const std::vector<double>& all) {
        const std::size_t width = all.size() / kBlock / last;
        return part(all, l).subspan(m * width, width);
      };
      seen[m] = {kept(seen_q_), kept(seen_v_), kept(seen_end_effectors_), kept(seen_tactile_)};
    }
    view.actions = 0;
    view.action = no_action;
    if (taken_ > 0) view.task_state = part(records_[0].found, l);
    view.snapshots = seen;
    const std::span<const SnapshotCotangent> to = cotangents(l);
    add_seen(view, l, {by_reward_, shown_, shown_q_, shown_v_},
             {to.last(seen.size()), by_no_action, by_memory});
  }
  add_moment(last);
  const std::size_t nv = as_size(task_.model().nv()), count = by_parameter.size() / as_size(lanes_);
  for (int l = 0; l < lanes_; ++l) {
    const auto own = [l](std::span<double> all, std::size_t width) {
      return all.empty() ? all : all.subspan(as_size(l) * width, width);
    };
    get_start(0, rollout_.batch(), l, own(by_q, nv), own(by_v, nv), own(by_parameter, count), {});
  }
}

}  // namespace tangere
