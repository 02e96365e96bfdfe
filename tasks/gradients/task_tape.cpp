// SPDX-License-Identifier: Apache-2.0
// Spreads blocks of sixteen environments over threads, and keeps the caller to the order of calls.
#include "tasks/gradients/task_tape.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/base/as_size.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "tasks/gradients/task_block.hpp"
#include "tasks/run/block_threads.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

enum class Phase : std::uint8_t { forward, back, done, broken };

TapeOptions checked(const Task& task, int environments, const TapeOptions& o) {
  if (environments < 1 || o.threads < 1)
    throw InputError(fmt::format("a tape of {} environments on {} threads; expected at least 1",
                                 environments, o.threads));
  return options_for(task, o, "a tape");
}

std::int64_t blocks_of(int environments) {
  return (std::int64_t{environments} + kBlock - 1) / kBlock;
}

void expect_numbers(std::size_t found, std::size_t expected, bool may_be_empty, const char* what) {
  if (found == expected || (may_be_empty && found == 0)) return;
  throw InputError(fmt::format("{} numbers of {}; expected {}{}", found, what, expected,
                               may_be_empty ? " or none" : ""));
}

}  // namespace

struct TaskTape::Impl {
  Impl(const Task& t, int environments, const TapeOptions& requested)
      : task(t),
        options(checked(t, environments, requested)),
        e(as_size(environments)),
        nq(as_size(t.model().nq())),
        nv(as_size(t.model().nv())),
        width(t.spec().action.size()),
        seen(t.spec().observation_size()),
        numbers(options.parameters ? as_size(NumberGradients(t.model()).count()) : 0),
        point_numbers(options.points ? as_size(tactile_points(t.model()) * kPointNumbers) : 0),
        sheared(3 * shear_state_arrays(t.model()).count()),
        observation(e * seen),
        reward(e),
        q(e * nq),
        v(e * nv),
        status(e),
        threads(options.threads) {
    for (std::vector<std::uint8_t>* flags : {&alive, &terminated, &truncated, &success})
      flags->resize(e);
    const std::int64_t count = blocks_of(environments);
    blocks.reserve(as_size(count));
    for (std::int64_t b = 0; b < count; ++b) blocks.emplace_back(t, options, count);
    for (int k = 0; k < options.threads; ++k)
      steppers.emplace_back(t.model(), differentiable(options.stepper));
  }

  [[nodiscard]] std::size_t lanes(int b) const {
    return std::min(as_size(kBlock), e - as_size(b) * kBlock);
  }
  /// Environments of block b among rows by environment; empty stays empty.
  template <class T>
  [[nodiscard]] std::span<T> of(std::span<T> all, int b) const {
    const std::size_t row = all.size() / e;
    return all.subspan(as_size(b) * kBlock * row, lanes(b) * row);
  }
  [[nodiscard]] ActionCotangents of(const ActionCotangents& all, int b) const {
    return {of(all.observation, b), of(all.reward, b), of(all.q, b), of(all.v, b)};
  }

  /// Calls body(block, its index) for every block. If it throws, only a reset helps.
  template <class Body>
  void each(Phase then, const Body& body) {
    observation_is_current = false;
    phase = Phase::broken;
    threads.for_each(static_cast<int>(blocks.size()), steppers, [&](Stepper& stepper, int b) {
      blocks[as_size(b)].use(stepper);
      body(blocks[as_size(b)], b);
    });
    phase = then;
  }

  /// Copies results of a block to the arrays of all environments.
  void show(const TaskBlock& block, int b) {
    const EnvironmentData& data = block.rollout().data();
    const std::size_t first = as_size(b) * kBlock;
    const auto copy = [&](const auto& from, auto& to, std::size_t row) {
      std::copy(from.begin(), from.end(), to.begin() + static_cast<std::ptrdiff_t>(first * row));
    };
    copy(data.q, q, nq);
    copy(data.v, v, nv);
    copy(data.terminated, terminated, 1);
    copy(data.truncated, truncated, 1);
    copy(data.success, success, 1);
    for (int l = 0; l < block.lanes(); ++l) {
      const std::size_t at = first + as_size(l);
      alive[at] = block.took(l) ? 1 : 0;
      reward[at] = block.took(l) ? data.reward[as_size(l)] : 0;
      status[at] = block.rollout().batch().status(l);
    }
  }

  /// Copies a block's observations to those of all environments.
  void copy_observations(std::size_t b, std::span<double> to) const {
    std::ranges::copy(blocks[b].rollout().data().observation,
                      to.begin() + static_cast<std::ptrdiff_t>(b * kBlock * seen));
  }

  void reset(std::uint64_t seed, std::int64_t first, bool record) {
    taken = left = 0;
    recording = record;
    each(Phase::forward, [&](TaskBlock& block, int b) {
      const std::int64_t own = first + std::int64_t{b} * kBlock;
      block.start(seed, {own, own + std::int64_t(lanes(b))}, record);
      show(block, b);
    });
  }

  void check_actions(std::span<const double> actions) const {
    check_sound();
    if (phase != Phase::forward)
      throw InputError("an action on a tape that has been reversed; expected reset() before it");
    if (taken == options.length)
      throw InputError(fmt::format("action {} on a tape of {} actions; expected reset() before it",
                                   taken, options.length));
    expect_numbers(actions.size(), e * width, false, "actions");
    for (std::size_t i = 0; i < actions.size(); ++i)
      if (!std::isfinite(actions[i]) && terminated[i / width] + truncated[i / width] == 0)
        throw InputError(
            fmt::format("number {} of action {} of environment {} is {}; expected a finite number",
                        i % width, taken, i / width, actions[i]));
  }

  void check_cotangents(const ActionCotangents& by) const {
    expect_numbers(by.observation.size(), e * seen, true, "derivatives by observations");
    expect_numbers(by.reward.size(), e, true, "derivatives by rewards");
    expect_numbers(by.q.size(), e * nv, true, "derivatives by q");
    expect_numbers(by.v.size(), e * nv, true, "derivatives by v");
  }

  void check_sound() const {
    if (phase == Phase::broken)
      throw InputError("a tape in which a call has failed halfway; expected reset()");
  }
  /// Steps that are left to reverse.
  [[nodiscard]] std::int64_t to_reverse() const { return phase == Phase::forward ? taken : left; }

  void begin_reverse() {
    check_sound();
    if (!recording) throw InputError("the reverse of a run without a record; expected reset()");
    each(Phase::back, [](TaskBlock& block, int) { block.begin_reverse(); });
    left = taken;
  }

  const Task& task;
  const TapeOptions options;
  const std::size_t e, nq, nv, width, seen, numbers, point_numbers, sheared;  // of one environment
  mutable std::vector<double> observation;  // copied when observations() is called
  mutable bool observation_is_current = false;
  std::vector<double> reward, q, v;
  std::vector<std::uint8_t> alive, terminated, truncated, success;
  std::vector<StepStatus> status;
  std::vector<TaskBlock> blocks;
  std::vector<Stepper> steppers;  // by the thread's index in the arena
  BlockThreads threads;
  Phase phase = Phase::forward;
  bool recording = true;
  std::int64_t taken = 0, left = 0;  // steps; of these, to reverse
};

TaskTape::TaskTape(const Task& task, int environments, const TapeOptions& options,
                   std::uint64_t seed, std::int64_t first_episode)
    : impl_(std::make_unique<Impl>(task, environments, options)) {
  impl_->reset(seed, first_episode, true);
}
TaskTape::~TaskTape() = default;
TaskTape::TaskTape(TaskTape&&) noexcept = default;
TaskTape& TaskTape::operator=(TaskTape&&) noexcept = default;

void TaskTape::reset(std::uint64_t seed, std::int64_t first_episode, bool record) {
  impl_->reset(seed, first_episode, record);
}

void TaskTape::displace(std::span<const double> q, std::span<const double> v,
                        std::span<const double> shear_state) {
  Impl& i = *impl_;
  if (i.phase != Phase::forward || i.taken > 0)
    throw InputError("first states after the first step; expected reset() before them");
  expect_numbers(q.size(), i.e * i.nq, false, "q");
  expect_numbers(v.size(), i.e * i.nv, false, "v");
  expect_numbers(shear_state.size(), i.e * i.sheared, true, "the shear state");
  i.each(Phase::forward, [&](TaskBlock& block, int b) {
    block.displace(i.of(q, b), i.of(v, b), i.of(shear_state, b));
    i.show(block, b);
  });
}

void TaskTape::check_step(std::span<const double> actions) const { impl_->check_actions(actions); }

void TaskTape::step(std::span<const double> actions, std::span<const double> varying) {
  Impl& i = *impl_;
  i.check_actions(actions);
  const std::size_t count = i.task.model().scene().randomizations.size();
  expect_numbers(varying.size(), i.e * count, true, "numbers that vary");
  i.each(Phase::forward, [&](TaskBlock& block, int b) {
    block.step(i.of(actions, b), i.of(varying, b));
    i.show(block, b);
  });
  ++i.taken;
}

void TaskTape::reverse(const ActionCotangents& results_bar, std::span<double> action_bar,
                       std::span<double> parameter_bar) {
  Impl& i = *impl_;
  i.check_cotangents(results_bar);
  expect_numbers(parameter_bar.size(), i.e * i.numbers, true, "derivatives by the scene's numbers");
  expect_numbers(action_bar.size(), i.e * i.width, false, "derivatives by actions");
  i.check_sound();
  if (i.to_reverse() == 0)
    throw InputError(fmt::format(
        "one more reverse than the {} actions on tape; expected reverse_start() or reset()",
        i.taken));
  if (i.phase == Phase::forward) i.begin_reverse();
  i.each(Phase::back, [&](TaskBlock& block, int b) {
    block.reverse(i.left - 1, i.of(results_bar, b), i.of(action_bar, b), i.of(parameter_bar, b));
  });
  --i.left;
}

void TaskTape::reverse_start(const ActionCotangents& results_bar, const StartCotangents& out) {
  Impl& i = *impl_;
  i.check_cotangents(results_bar);
  expect_numbers(out.q.size(), i.e * i.nv, true, "derivatives by the first q");
  expect_numbers(out.v.size(), i.e * i.nv, true, "derivatives by the first v");
  expect_numbers(out.parameters.size(), i.e * i.numbers, true,
                 "derivatives by the scene's numbers");
  expect_numbers(out.points.size(), i.e * i.point_numbers, true, "derivatives by tactile points");
  expect_numbers(out.shear_state.size(), i.e * i.sheared, true, "derivatives by the shear state");
  i.check_sound();
  if (i.phase == Phase::done)
    throw InputError("a second end of a reverse pass; expected begin_reverse() or reset()");
  if (i.to_reverse() > 0)
    throw InputError(
        fmt::format("the end of a reverse pass with {} of {} actions left; expected reverse() for "
                    "each",
                    i.to_reverse(), i.taken));
  if (i.phase == Phase::forward) i.begin_reverse();
  i.each(Phase::done, [&](TaskBlock& block, int b) {
    block.reverse_reset(i.of(results_bar, b),
                        {i.of(out.q, b), i.of(out.v, b), i.of(out.parameters, b),
                         i.of(out.points, b), i.of(out.shear_state, b)});
  });
}

void TaskTape::begin_reverse() { impl_->begin_reverse(); }

const Task& TaskTape::task() const { return impl_->task; }
int TaskTape::environments() const { return static_cast<int>(impl_->e); }
std::int64_t TaskTape::taken() const { return impl_->taken; }
std::span<const double> TaskTape::observations() const {
  const Impl& i = *impl_;
  for (std::size_t b = 0; b < i.blocks.size() && !i.observation_is_current; ++b)
    i.copy_observations(b, i.observation);
  i.observation_is_current = true;
  return i.observation;
}
void TaskTape::get_observations(std::span<double> to) {
  Impl& i = *impl_;
  expect_numbers(to.size(), i.e * i.seen, false, "observations");
  i.threads.for_each(static_cast<int>(i.blocks.size()), i.steppers,
                     [&](Stepper&, int b) { i.copy_observations(as_size(b), to); });
}
std::span<const double> TaskTape::rewards() const { return impl_->reward; }
std::span<const std::uint8_t> TaskTape::alive() const { return impl_->alive; }
std::span<const std::uint8_t> TaskTape::terminated() const { return impl_->terminated; }
std::span<const std::uint8_t> TaskTape::truncated() const { return impl_->truncated; }
std::span<const std::uint8_t> TaskTape::success() const { return impl_->success; }
std::span<const double> TaskTape::q() const { return impl_->q; }
std::span<const double> TaskTape::v() const { return impl_->v; }
StepStatus TaskTape::status(int environment) const { return impl_->status[as_size(environment)]; }
TaskView TaskTape::view(int environment) const {
  const TaskRollout& r = impl_->blocks[as_size(environment / kBlock)].rollout();
  return view_of(r.batch(), r.data(), environment % kBlock);
}

std::int64_t TaskTape::recomputed_steps() const {
  std::int64_t sum = 0;
  for (const TaskBlock& block : impl_->blocks) sum += block.recomputed_steps();
  return sum;
}

double TaskTape::bytes(const Task& task, int environments, const TapeOptions& options) {
  const std::size_t shown = task.spec().observation_size() + 2 * as_size(task.model().nv());
  return TaskBlock::bytes(task, checked(task, environments, options), blocks_of(environments)) +
         options.threads * double(Stepper::workspace_bytes(task.model())) +
         double(environments) * (2 * 8.0 * double(shown) + EnvironmentData::bytes(task));
}

}  // namespace tangere
