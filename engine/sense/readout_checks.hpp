// SPDX-License-Identifier: Apache-2.0
// Checks of the arguments of Readout.
#pragma once

#include <algorithm>
#include <span>

#include "engine/base/checks.hpp"
#include "engine/step/batch.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {

/// Throws InputError for a batch of another model, and for an environment that does not exist.
inline void check_environment(const Model& model, const Batch& batch, int environment) {
  if (batch.model() != model)
    throw InputError("the batch is of another Model; expected the Model of the readout");
  checked_index("environment", environment, batch.environments());
}
/// The same for a frame.
inline void check_frame(const Model& model, const Batch& batch, int environment,
                        const Model& model_of_frame) {
  check_environment(model, batch, environment);
  if (model_of_frame != model)
    throw InputError("the frame is of another Model; expected the Model of the readout");
}

/// Throws InputError unless there are as many arrays as the block has environments.
inline void check_block(const Model& model, const Batch& batch, int block, const char* what,
                        std::size_t arrays) {
  checked_index("block", block, batch.blocks());
  check_environment(model, batch, block * kernels::kBlock);
  const int left = batch.environments() - block * kernels::kBlock;
  const std::size_t environments = as_size(std::min(kernels::kBlock, left));
  if (arrays < environments) refuse_size(what, arrays, environments);
}
/// The same, with `numbers` in each array.
template <class T>
void check_block(const Model& model, const Batch& batch, int block, const char* what,
                 std::span<const std::span<T>> arrays, std::size_t numbers) {
  check_block(model, batch, block, what, arrays.size());
  const std::size_t last = as_size(batch.environments() - block * kernels::kBlock);
  for (std::size_t e = 0; e < std::min(arrays.size(), last); ++e)
    check_size(what, arrays[e].size(), numbers);
}
/// Throws InputError unless there is a frame of one sensor and form for each environment of a
/// block.
template <class Frame>
void check_frames(const Model& model, const Batch& batch, int block,
                  std::span<const Frame> frames) {
  if (frames.empty()) return;
  check_block(model, batch, block, "frames of a block", frames.size());
  for (const Frame& frame : frames) {
    check_frame(model, batch, block * kernels::kBlock, frame.model());
    bool same = frame.sensor() == frames[0].sensor();
    if constexpr (requires { frame.form(); }) same = same && frame.form() == frames[0].form();
    if (!same) throw InputError("frames of several kinds; expected one sensor and one form");
  }
}

}  // namespace tangere
