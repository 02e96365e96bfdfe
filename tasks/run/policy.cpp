// SPDX-License-Identifier: Apache-2.0
// Policies without state: the action depends on the view alone. With a noise σ, number k of action
// t of an episode is
//   a_k = clip(script_k + σ n_k, low, high),  n_k normal, keyed by (seed, episode, t, k).
#include "tasks/run/policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/model/random.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {
namespace {

// Indices of numbers with the purpose `policy`: an action that is drawn has those from 0 on.
constexpr std::uint32_t kFirstNoise = 1U << 20, kPlayer = 1U << 21;

}  // namespace

const char* to_string(PolicyKind kind) {
  switch (kind) {
    case PolicyKind::random: return "random";
    case PolicyKind::hold: return "hold";
    case PolicyKind::csv: return "csv";
    case PolicyKind::scripted: return "scripted";
    case PolicyKind::program: return "program";
  }
  return "unknown";
}

Policy::Policy(const Task& task, PolicyKind kind, std::vector<std::vector<double>> table,
               const PolicyVariation& variation)
    : task_(task),
      kind_(kind),
      name_(to_string(kind)),
      table_(std::move(table)),
      variation_(variation) {
  check(variation);
  if (kind == PolicyKind::program)
    throw InputError("a program without a name and answers; expected both");
  if (kind != PolicyKind::scripted && (variation.noise > 0 || variation.random_share > 0))
    throw InputError(fmt::format("noise, or random episodes, with the policy {}; expected scripted",
                                 to_string(kind)));
  if (kind != PolicyKind::csv) return;
  if (table_.empty()) throw InputError("a table of actions without rows; expected at least one");
  const std::size_t width = task.spec().action.size();
  for (const std::vector<double>& row : table_)
    if (row.size() != width)
      throw InputError(
          fmt::format("a row of {} numbers in a table of actions; expected {}", row.size(), width));
}

Policy::Policy(const Task& task, std::string name, PolicyFunction function,
               const PolicyVariation& variation)
    : task_(task),
      kind_(PolicyKind::program),
      name_(std::move(name)),
      function_(std::move(function)),
      variation_(variation) {
  check(variation);
}

void Policy::check(const PolicyVariation& variation) const {
  if (!(variation.noise >= 0) || !std::isfinite(variation.noise))
    throw InputError(
        fmt::format("a noise of {}; expected a finite number, 0 or above", variation.noise));
  if (!(variation.random_share >= 0 && variation.random_share <= 1))
    throw InputError(
        fmt::format("a share of {} random episodes; expected 0 to 1", variation.random_share));
}

std::vector<std::string> Policy::players() const {
  std::vector<std::string> names{name_};
  if (variation_.random_share > 0) names.emplace_back(to_string(PolicyKind::random));
  return names;
}

int Policy::player(std::uint64_t seed, std::int64_t episode) const {
  if (variation_.random_share == 0) return 0;
  const bool is_random =
      uniform({seed, episode, 0, Purpose::policy, kPlayer}) < variation_.random_share;
  return is_random ? 1 : 0;
}

void Policy::act(const TaskView& view, std::span<const double> observation,
                 std::span<double> action) const {
  const bool is_random = player(view.seed, view.episode) > 0;
  switch (is_random ? PolicyKind::random : kind_) {
    case PolicyKind::random: draw(view, action); return;
    case PolicyKind::hold: std::fill(action.begin(), action.end(), 0.0); return;
    case PolicyKind::csv: {
      const auto row = std::min(static_cast<std::size_t>(view.actions), table_.size() - 1);
      std::copy(table_[row].begin(), table_[row].end(), action.begin());
      return;
    }
    case PolicyKind::scripted:
      task_.scripted(view, observation, action);
      if (variation_.noise > 0) disturb(view, action);
      return;
    case PolicyKind::program: act(std::span(&view, 1), observation, action); return;
  }
}

void Policy::act(std::span<const TaskView> views, std::span<const double> observations,
                 std::span<double> actions) const {
  const std::size_t width = task_.spec().action.size(), seen = task_.spec().observation_size();
  if (!is_batched()) {
    for (std::size_t e = 0; e < views.size(); ++e)
      act(views[e], observations.subspan(e * seen, seen), actions.subspan(e * width, width));
    return;
  }
  std::array<std::int64_t, kernels::kBlock> episodes, taken;
  for (std::size_t e = 0; e < views.size(); ++e) {
    episodes.at(e) = views[e].episode;
    taken[e] = views[e].actions;
  }
  function_(
      {std::span(episodes).first(views.size()), std::span(taken).first(views.size()), observations},
      actions);
  for (std::size_t e = 0; e < views.size(); ++e)
    if (variation_.noise > 0) disturb(views[e], actions.subspan(e * width, width));
}

void Policy::draw(const TaskView& view, std::span<double> action) const {
  const TensorSpec& spec = task_.spec().action;
  const double low = std::isfinite(spec.low) ? spec.low : -1,
               high = std::isfinite(spec.high) ? spec.high : 1;
  for (std::size_t k = 0; k < action.size(); ++k)
    action[k] = uniform(
        {view.seed, view.episode, view.actions, Purpose::policy, static_cast<std::uint32_t>(k)},
        low, high);
}

void Policy::disturb(const TaskView& view, std::span<double> action) const {
  const TensorSpec& spec = task_.spec().action;
  for (std::size_t k = 0; k < action.size(); ++k)
    action[k] =
        std::clamp(action[k] + normal({view.seed, view.episode, view.actions, Purpose::policy,
                                       kFirstNoise + static_cast<std::uint32_t>(k)},
                                      0, variation_.noise),
                   spec.low, spec.high);
}

void Policy::act(const VectorTask& environments, std::span<double> actions) const {
  const std::size_t width = task_.spec().action.size();
  for (int e = 0; e < environments.environments(); ++e)
    act(environments.view(e), environments.observation(e),
        actions.subspan(static_cast<std::size_t>(e) * width, width));
}

}  // namespace tangere
