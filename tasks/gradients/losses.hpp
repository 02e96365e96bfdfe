// SPDX-License-Identifier: Apache-2.0
// Losses that need only a scene. They serve gradient checks and as examples of a RolloutLoss.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/derivative/loss.hpp"

namespace tangere {

enum class LossKind {
  /// ½ |q_T - q₀|² + ½ |v_T|², by component, after the last step. q₀ is where the scene starts,
  /// before anything varies.
  final_state,
  path,           ///< ½ Σ_t |v_t|²
  tactile,        ///< ½ Σ |T|² of all sensors, every k-th step
  shear,          ///< ½ Σ of the first two components squared, every k-th step
  end_effectors,  ///< ½ |x|² of all end effectors after the last step
  markers,        ///< ½ Σ |u|² of all markers' displacements, every k-th step
  /// ½ Σ |(C - B)/255|² of all pictures by their background, before rounding, every k-th step.
  pictures,
  channels,  ///< ½ Σ |y - y₀|² of all channels by those of no field, every k-th step
};
const char* to_string(LossKind value);
/// Describes the loss in words, for files.
const char* loss_meaning(LossKind value);
/// Every kind, in the order in which they are listed.
const std::vector<LossKind>& loss_kinds();

/// `every`: steps between fields. Throws InputError for a loss on sensors or end effectors that the
/// scene does not have, for one on markers or channels where their sensor is imperfect or a list of
/// points, and for one on pictures of sensors without a layer.
std::unique_ptr<RolloutLoss> make_loss(LossKind kind, const Model& model, int every);

}  // namespace tangere
