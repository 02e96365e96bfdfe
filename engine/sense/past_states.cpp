// SPDX-License-Identifier: Apache-2.0
// Copies rows of a block: numbers that vary to all lanes, q and v of each earlier state to its own.
#include "engine/sense/past_states.hpp"

#include <algorithm>

namespace tangere {

using kernels::kBlock;

PastStates::PastStates(const Model& model) : model_(model), lanes_(model, kBlock) {}

void PastStates::recall(const Batch& batch, int environment, int lag, int count) {
  const BlockLayout& layout = compiled(model_).layout;
  const double* const from = batch.block(environment / kBlock) + environment % kBlock;
  double* const to = lanes_.block(0);
  for (int row = layout.parameters; row < layout.past; ++row)
    std::fill_n(to + row * kBlock, count, from[row * kBlock]);
  const int numbers = layout.previous_q - layout.q;
  const std::int64_t states = layout.past_states, steps = batch.steps(environment);
  for (int lane = 0; lane < count; ++lane) {
    const int ago = lag + lane;
    const auto slot = static_cast<int>(((steps - ago) % states + states) % states);
    const int first = ago == 0 ? layout.q : layout.past + slot * numbers;
    for (int row = 0; row < numbers; ++row)
      to[(layout.q + row) * kBlock + lane] = from[(first + row) * kBlock];
  }
}

}  // namespace tangere
