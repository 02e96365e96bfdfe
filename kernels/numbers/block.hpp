// SPDX-License-Identifier: Apache-2.0
// How many environments stand side by side, the same on every machine.
#pragma once

namespace tangere::kernels {

inline constexpr int kGroup = 8;  ///< lanes that iterate together
inline constexpr int kBlock =
    16;  ///< environments in a block: two groups of double, one vector of float

}  // namespace tangere::kernels
