// SPDX-License-Identifier: Apache-2.0
// Sizes of what a task declares, and checks of the declaration.
#include "engine/rows/task_spec.hpp"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <numeric>

#include "engine/base/error.hpp"

namespace tangere {

std::size_t TensorSpec::size() const {
  return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
}

std::size_t TaskSpec::observation_size() const {
  std::size_t size = 0;
  for (const TensorSpec& tensor : observations) size += tensor.size();
  return size;
}

void TaskSpec::check() const {
  const auto fail = [&](const std::string& what) {
    throw InputError(fmt::format("task '{}': {}", name, what));
  };
  if (name.empty() || scene.empty()) fail("expected a name and a scene");
  if (steps_per_action < 1 || horizon < 1)
    fail(fmt::format("{} steps per action, {} actions; expected at least 1", steps_per_action,
                     horizon));
  if (control_every < 0 || settling_steps < 0 || task_state < 0) fail("a count is negative");
  if (snapshots.empty() || snapshots.front() < 1 || snapshots.back() != steps_per_action)
    fail(fmt::format("it must observe after its last step, {}", steps_per_action));
  for (std::size_t i = 1; i < snapshots.size(); ++i)
    if (snapshots[i] <= snapshots[i - 1]) fail("the steps after which it observes must ascend");
  if (!action.scale.empty()) fail("an action has bounds, not a scale");
  if (action.name.empty() || observation_size() == 0) fail("expected an action and an observation");
  for (const TensorSpec& tensor : observations) {
    if (tensor.name.empty() || tensor.name.find('/') != std::string::npos || tensor.name == "q" ||
        tensor.name == "v")
      fail(fmt::format("observation '{}'; expected another name than q and v, without '/'",
                       tensor.name));
    if (tensor.scale.size() > 1 && tensor.scale.size() != tensor.shape.back())
      fail(fmt::format("observation '{}' has {} scales; expected one, or {} for its last axis",
                       tensor.name, tensor.scale.size(), tensor.shape.back()));
    for (const double scale : tensor.scale)
      if (!(scale > 0) || !std::isfinite(scale))
        fail(fmt::format("observation '{}' has the scale {}; expected a number above 0",
                         tensor.name, scale));
    for (const TensorSpec& other : observations)
      if (&other != &tensor && other.name == tensor.name)
        fail("two observations are named " + tensor.name);
  }
}

}  // namespace tangere
