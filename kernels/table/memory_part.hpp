// SPDX-License-Identifier: Apache-2.0
// The functions of an instruction set's table that move what friction remembers.
#pragma once

#include "kernels/memory/memory_pullback.hpp"
#include "kernels/table/parts.hpp"

namespace tangere::kernels {

template <class Arch>
void MemoryPart<Arch>::recall(const RememberingTouch& touch, const RememberingPoints& points) {
  kernels::recall<Arch>(touch, points);
}

template <class Arch>
void MemoryPart<Arch>::advance(const RememberingTouch& end, const RememberingPoints& points,
                               double* s, double* force) {
  kernels::advance<Arch>(end, points, s, force);
}

template <class Arch>
void MemoryPart<Arch>::pull_back_memory(const MemoryPullback& m) {
  kernels::pull_back_memory<Arch>(m);
}

}  // namespace tangere::kernels
