// SPDX-License-Identifier: Apache-2.0
// Losses that need nothing but a scene: to check gradients with, and as examples of a RolloutLoss.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/derivative/loss.hpp"

namespace tangere {

enum class LossKind {
  final_state,    ///< ½ |q_T - q(rest)|² + ½ |v_T|², number by number, after the last step
  path,           ///< ½ Σ_t |v_t|²
  tactile,        ///< ½ Σ |T|² of all sensors, every k-th step
  shear,          ///< the same of the first two components
  end_effectors,  ///< ½ |x|² of all end effectors after the last step
};
const char* to_string(LossKind value);
/// In words, for files.
const char* loss_meaning(LossKind value);
/// Every kind, in the order in which they are listed.
const std::vector<LossKind>& loss_kinds();

/// `every`: of fields. Throws InputError where a scene has no sensors, or no end effectors, for a
/// loss on them.
std::unique_ptr<RolloutLoss> make_loss(LossKind kind, const Model& model, int every);

}  // namespace tangere
