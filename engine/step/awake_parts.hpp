// SPDX-License-Identifier: Apache-2.0
// Sub-models of the awake trees, each with its step and scratch. Lanes with different sleeping
// trees use different sub-models, so the work and the bits of a lane depend on its own trees alone.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "engine/model/model_part.hpp"
#include "engine/step/group_step.hpp"

namespace tangere {

struct AwakePart {
  std::vector<std::uint8_t> asleep;  ///< (trees) those that it leaves out
  std::unique_ptr<ModelPart> part;
  GroupStep step;
  std::unique_ptr<Workspace> work;  ///< made when several lanes need it
  SingleWorkspace single;
  int inner_stages;

  AwakePart(std::unique_ptr<ModelPart> of, std::span<const std::uint8_t> left_out,
            const StepSettings& settings)
      : asleep(left_out.begin(), left_out.end()),
        part(std::move(of)),
        step(part->model, settings),
        single(part->model, settings.integrator.scheme().most_inner_stages()),
        inner_stages(settings.integrator.scheme().most_inner_stages()) {}

  /// Returns the scratch for one lane, or for eight.
  template <int L>
  BasicWorkspace<L>& workspace() {
    if constexpr (L == 1) {
      return single;
    } else {
      if (!work) work = std::make_unique<Workspace>(part->model, inner_stages);
      return *work;
    }
  }
};

/// Cache of the most recently used sub-models. A sub-model is built, with heap allocations, the
/// first time a lane needs it.
class AwakeParts {
 public:
  AwakeParts(const CompiledModel& model, const StepSettings& settings)
      : model_(model), settings_(settings) {}

  /// Returns the sub-model without the trees that are marked in `asleep`; at least one is awake.
  /// Valid until the next call. `tree`: tree of each link.
  AwakePart& without(std::span<const std::uint8_t> asleep, std::span<const int> tree) {
    const auto found = std::ranges::find_if(
        parts_, [&](const auto& p) { return std::ranges::equal(p->asleep, asleep); });
    if (found != parts_.end()) {
      std::rotate(parts_.begin(), found, found + 1);
    } else {
      if (parts_.size() == kMost) parts_.pop_back();
      parts_.insert(parts_.begin(),
                    std::make_unique<AwakePart>(part_of(model_, tree, asleep), asleep, settings_));
    }
    return *parts_.front();
  }

 private:
  static constexpr std::size_t kMost = 64;
  const CompiledModel& model_;
  StepSettings settings_;
  std::vector<std::unique_ptr<AwakePart>> parts_;  // the last used first
};

}  // namespace tangere
