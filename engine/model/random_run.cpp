// SPDX-License-Identifier: Apache-2.0
// Philox and Box-Muller over 64 neighbours, loop by loop.
//   ln x = e ln 2 + 2 artanh((m - 1)/(m + 1)),  x = 2^e m,  √½ <= m < √2
//   φ = (k + r) π/2 with a whole k: sine and cosine of r π/2 by Taylor, then turned by k quarters
#include "engine/model/random_run.hpp"

#include <bit>
#include <cmath>
#include <numbers>

namespace tangere {
namespace {

/// Returns ln x of a positive normal number, without a branch.
inline double logarithm(double x) {
  constexpr std::uint64_t kHalfRoot = 0x3FE6A09E667F3BCD;  // √½
  constexpr std::uint64_t kMantissa = 0x000FFFFFFFFFFFFF;
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x) - kHalfRoot;
  // e + 2048 as the lowest bits of 2^52, so that it becomes a double without a conversion.
  const std::uint64_t biased = (bits >> 52) ^ 0x800;
  const double e = std::bit_cast<double>((biased & 0xFFF) | 0x4330000000000000) - (0x1p52 + 2048);
  const double m = std::bit_cast<double>((bits & kMantissa) + kHalfRoot);
  const double s = (m - 1) / (m + 1), z = s * s;
  double sum = 1.0 / 17;
  for (const double c : {1.0 / 15, 1.0 / 13, 1.0 / 11, 1.0 / 9, 1.0 / 7, 1.0 / 5, 1.0 / 3, 1.0})
    sum = sum * z + c;
  return e * std::numbers::ln2 + 2 * s * sum;
}

/// Fills cosine and sine of 2π word/2³².
inline void cosine_and_sine(std::uint32_t word, double& cosine, double& sine) {
  const std::uint32_t quarter = (word + 0x20000000U) >> 30;
  const auto rest = static_cast<std::int32_t>(word - (quarter << 30));
  const double x = double(rest) * (2 * std::numbers::pi * 0x1p-32), z = x * x;
  double c = 1.0 / 87178291200 * -1, s = 1.0 / 6227020800;
  for (const double next :
       {1.0 / 479001600, -1.0 / 3628800, 1.0 / 40320, -1.0 / 720, 1.0 / 24, -1.0 / 2, 1.0})
    c = c * z + next;
  for (const double next : {-1.0 / 39916800, 1.0 / 362880, -1.0 / 5040, 1.0 / 120, -1.0 / 6, 1.0})
    s = s * z + next;
  s *= x;
  const bool odd = (quarter & 1U) != 0;
  const double a = odd ? s : c, b = odd ? c : s;
  cosine = ((quarter + 1) & 2U) != 0 ? -a : a;
  sine = (quarter & 2U) != 0 ? -b : b;
}

}  // namespace

void random_run(const RandomKey& first, RandomWords& words) {
  const PhiloxCounter counter = counter_of(first);
  RandomWords c;
  for (int l = 0; l < kRandomRun; ++l)
    for (std::size_t k = 0; k < 4; ++k) c[k][l] = counter.counter[k] + (k == 3 ? unsigned(l) : 0);
  std::array<std::uint32_t, 2> key = counter.key;
  for (int round = 0; round < kPhiloxRounds; ++round) {
    for (int l = 0; l < kRandomRun; ++l) {
      const std::uint64_t even = std::uint64_t{kPhiloxMultiplier[0]} * c[0][l];
      const std::uint64_t odd = std::uint64_t{kPhiloxMultiplier[1]} * c[2][l];
      c[0][l] = static_cast<std::uint32_t>(odd >> 32) ^ c[1][l] ^ key[0];
      c[1][l] = static_cast<std::uint32_t>(odd);
      c[2][l] = static_cast<std::uint32_t>(even >> 32) ^ c[3][l] ^ key[1];
      c[3][l] = static_cast<std::uint32_t>(even);
    }
    key = {key[0] + kPhiloxKeyStep[0], key[1] + kPhiloxKeyStep[1]};
  }
  words = c;
}

void normal_run(const RandomWords& words, RandomNormals& normals) {
  for (std::size_t pair = 0; pair < 4; pair += 2)
    for (int l = 0; l < kRandomRun; ++l) {
      const double radius = std::sqrt(-2 * logarithm(fraction_of(words[pair][l])));
      double cosine, sine;
      cosine_and_sine(words[pair + 1][l], cosine, sine);
      normals[pair][l] = radius * cosine;
      normals[pair + 1][l] = radius * sine;
    }
}

}  // namespace tangere
