// SPDX-License-Identifier: Apache-2.0
// Random numbers of many neighbouring keys at once, for the points of a sensor: the bits are those
// of philox4x32(), the loops are ones that compilers turn into vectors. Normal numbers come from
// words of 32 bits by Box and Muller, in single precision, which is enough for noise:
//   z₀ = r cos φ, z₁ = r sin φ,  r = √(-2 ln((⌊a/2⌋ + ½)/2³¹)),  φ = 2π b/2³²
// so they are at most 6.6 in magnitude. Logarithm and sine are polynomials: the same bits whatever
// the system's library is.
#pragma once

#include <array>
#include <cstdint>

#include "engine/model/random.hpp"

namespace tangere {

inline constexpr int kRandomRun = 64;
using RandomWords = std::array<std::array<std::uint32_t, kRandomRun>, 4>;
using RandomNormals = std::array<std::array<float, kRandomRun>, 4>;

/// Fills the four words of the keys first, first.index + 1, …, which must all be in range.
void random_run(const RandomKey& first, RandomWords& words);
/// Turns words 0 and 1 into normal numbers 0 and 1 of mean 0 and deviation 1, words 2 and 3 into 2
/// and 3.
void normal_run(const RandomWords& words, RandomNormals& normals);

}  // namespace tangere
