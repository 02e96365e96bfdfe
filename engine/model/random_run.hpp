// SPDX-License-Identifier: Apache-2.0
// Random numbers of many neighbouring keys at once, for the points of a sensor: the bits are those
// of philox4x32(), the loops are ones that compilers turn into vectors. Normal numbers come from
// words of 32 bits by Box and Muller:
//   z₀ = r cos φ, z₁ = r sin φ,  r = √(-2 ln((a + ½)/2³²)),  φ = 2π b/2³²
// so they are at most 6.7 in magnitude. Logarithm and sine are polynomials, exact to 1e-13: the
// same bits whatever the system's library is.
#pragma once

#include <array>
#include <cstdint>

#include "engine/model/random.hpp"

namespace tangere {

inline constexpr int kRandomRun = 64;
using RandomWords = std::array<std::array<std::uint32_t, kRandomRun>, 4>;
using RandomNormals = std::array<std::array<double, kRandomRun>, 4>;

/// Fills the four words of the keys first, first.index + 1, …, which must all be in range.
void random_run(const RandomKey& first, RandomWords& words);
/// Turns words 0 and 1 into normal numbers 0 and 1 of mean 0 and deviation 1, words 2 and 3 into 2
/// and 3.
void normal_run(const RandomWords& words, RandomNormals& normals);
/// Returns a word as a number in (0, 1).
inline double fraction_of(std::uint32_t word) { return (double(word) + 0.5) * 0x1p-32; }

}  // namespace tangere
