// SPDX-License-Identifier: Apache-2.0
// Plays episodes on a TaskTape and goes back, with numbers that depend on the episode alone.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "engine/model/random.hpp"
#include "tasks/gradients/task_tape.hpp"
#include "tests/tasks/task_check.hpp"

namespace tangere::testing {

using Numbers = std::vector<double>;

inline constexpr std::uint64_t kTapeSeed = 2;

/// A number for an episode, an action and an index, the same in any batch.
inline double keyed(std::int64_t episode, std::int64_t action, std::size_t index) {
  return uniform({17, episode, action, Purpose::control, std::uint32_t(index)}, -1, 1);
}

inline TapeOptions tape_options(std::int64_t actions, int threads = 1, double tape_bytes = 1e9) {
  TapeOptions o;
  o.length = actions;
  o.threads = threads;
  o.precision = Precision::mixed;
  o.tape_bytes = tape_bytes;
  return o;
}

/// The least tape_bytes with which such a tape can be made, by its own message: those of
/// checkpoints.
inline double least_tape_bytes(const Task& task, int environments, TapeOptions options) {
  options.tape_bytes = 1;
  try {
    const TaskTape none(task, environments, options);
  } catch (const InputError& error) {
    const std::string message = error.what(), before = "at least ";
    return std::stod(message.substr(message.find(before) + before.size())) + 1;
  }
  ADD_FAILURE() << "one byte held a tape";
  return 1;
}

/// Scripted actions, pulled towards zero and moved a little by keyed numbers.
inline Numbers scripted_actions(const TaskTape& tape) {
  const Task& task = tape.task();
  const std::size_t width = task.spec().action.size(), seen = task.spec().observation_size();
  Numbers all(std::size_t(tape.environments()) * width);
  for (int e = 0; e < tape.environments(); ++e) {
    const std::span<double> a = std::span(all).subspan(std::size_t(e) * width, width);
    const TaskView view = tape.view(e);
    task.scripted(view, tape.observations().subspan(std::size_t(e) * seen, seen), a);
    for (std::size_t k = 0; k < width; ++k)
      a[k] = std::clamp(0.8 * a[k], -0.4, 0.4) + 0.05 * keyed(view.episode, view.actions, k);
  }
  return all;
}

/// All that comes out of an episode and back.
struct Swept {
  Numbers observations, rewards, action_bar, q_bar, v_bar, parameter_bar;  // (step, E, …), (E, …)
  std::vector<std::uint8_t> alive, flags;
  bool operator==(const Swept&) const = default;
};

/// What comes in: the derivative by number `index` of what environment e shows after `step` steps.
using Incoming = std::function<double(int e, std::int64_t step, std::size_t index)>;

inline double keyed_incoming(int e, std::int64_t step, std::size_t index) {
  return keyed(e, step, index);
}

/// Plays `actions` steps and goes back with derivatives by observations and rewards.
inline Swept sweep_of(TaskTape& tape, std::int64_t actions, const Incoming& incoming,
                      std::size_t numbers = 0) {
  const std::size_t e = std::size_t(tape.environments()), width = tape.task().spec().action.size(),
                    seen = tape.task().spec().observation_size(),
                    nv = std::size_t(tape.task().model().nv());
  Swept out;
  const auto add = [](auto& to, auto from) { to.insert(to.end(), from.begin(), from.end()); };
  for (std::int64_t t = 0; t < actions; ++t) {
    tape.step(scripted_actions(tape));
    add(out.observations, tape.observations());
    add(out.rewards, tape.rewards());
    add(out.alive, tape.alive());
    for (const auto flags : {tape.terminated(), tape.truncated(), tape.success()})
      add(out.flags, flags);
  }
  Numbers by_o(e * seen), by_r(e);
  const auto arrive = [&](std::int64_t step) {
    for (std::size_t i = 0; i < e; ++i) {
      for (std::size_t k = 0; k < seen; ++k) by_o[i * seen + k] = incoming(int(i), step, k);
      by_r[i] = incoming(int(i), step, seen);
    }
  };
  out.action_bar.resize(std::size_t(actions) * e * width);
  for (std::int64_t t = actions; t-- > 0;) {
    arrive(t + 1);
    tape.reverse({by_o, by_r},
                 std::span(out.action_bar).subspan(std::size_t(t) * e * width, e * width));
  }
  arrive(0);
  out.q_bar.resize(e * nv);
  out.v_bar.resize(e * nv);
  out.parameter_bar.resize(e * numbers);
  tape.reverse_start({by_o}, {out.q_bar, out.v_bar, out.parameter_bar});
  return out;
}

/// Environment e's rows of (step, E, width).
inline Numbers rows_of(const Numbers& all, std::size_t environments, std::size_t e,
                       std::size_t steps) {
  const std::size_t width = all.size() / environments / steps;
  Numbers out;
  for (std::size_t t = 0; t < steps; ++t) {
    const auto from = all.begin() + std::ptrdiff_t((t * environments + e) * width);
    out.insert(out.end(), from, from + std::ptrdiff_t(width));
  }
  return out;
}

/// Expects that environments have the same rows in both, and the same derivatives.
inline void expect_same_rows(const Swept& a, std::size_t in_a, std::size_t e_a, const Swept& b,
                             std::size_t in_b, std::size_t e_b, std::size_t steps) {
  for (const auto part : {&Swept::observations, &Swept::rewards, &Swept::action_bar})
    EXPECT_EQ(rows_of(a.*part, in_a, e_a, steps), rows_of(b.*part, in_b, e_b, steps))
        << "environments " << e_a << ", " << e_b;
  for (const auto part : {&Swept::q_bar, &Swept::v_bar})
    EXPECT_EQ(rows_of(a.*part, in_a, e_a, 1), rows_of(b.*part, in_b, e_b, 1))
        << "environments " << e_a << ", " << e_b;
}

}  // namespace tangere::testing
