// SPDX-License-Identifier: Apache-2.0
// Policies without state: the action depends on the view alone.
#include "tasks/run/policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/model/random.hpp"

namespace tangere {

const char* to_string(PolicyKind kind) {
  switch (kind) {
    case PolicyKind::random: return "random";
    case PolicyKind::hold: return "hold";
    case PolicyKind::csv: return "csv";
    case PolicyKind::scripted: return "scripted";
  }
  return "unknown";
}

Policy::Policy(const Task& task, PolicyKind kind, std::vector<std::vector<double>> table)
    : task_(task), kind_(kind), table_(std::move(table)) {
  if (kind != PolicyKind::csv) return;
  if (table_.empty()) throw InputError("a table of actions without rows; expected at least one");
  const std::size_t width = task.spec().action.size();
  for (const std::vector<double>& row : table_)
    if (row.size() != width)
      throw InputError(
          fmt::format("a row of {} numbers in a table of actions; expected {}", row.size(), width));
}

void Policy::act(const TaskView& view, std::span<const double> observation,
                 std::span<double> action) const {
  switch (kind_) {
    case PolicyKind::random: {
      const TensorSpec& spec = task_.spec().action;
      const double low = std::isfinite(spec.low) ? spec.low : -1,
                   high = std::isfinite(spec.high) ? spec.high : 1;
      for (std::size_t k = 0; k < action.size(); ++k)
        action[k] = uniform(
            {view.seed, view.episode, view.actions, Purpose::policy, static_cast<std::uint32_t>(k)},
            low, high);
      return;
    }
    case PolicyKind::hold: std::fill(action.begin(), action.end(), 0.0); return;
    case PolicyKind::csv: {
      const auto row = std::min(static_cast<std::size_t>(view.actions), table_.size() - 1);
      std::copy(table_[row].begin(), table_[row].end(), action.begin());
      return;
    }
    case PolicyKind::scripted: task_.scripted(view, observation, action); return;
  }
}

void Policy::act(const VectorTask& environments, std::span<double> actions) const {
  const std::size_t width = task_.spec().action.size();
  for (int e = 0; e < environments.environments(); ++e)
    act(environments.view(e), environments.observation(e),
        actions.subspan(static_cast<std::size_t>(e) * width, width));
}

}  // namespace tangere
