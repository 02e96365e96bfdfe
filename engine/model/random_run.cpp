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
inline float logarithm(float x) {
  constexpr std::uint32_t kHalfRoot = 0x3f3504f3;  // √½
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(x) - kHalfRoot;
  const auto e = static_cast<float>(static_cast<std::int32_t>(bits) >> 23);
  const float m = std::bit_cast<float>((bits & 0x7fffff) + kHalfRoot);
  const float s = (m - 1) / (m + 1), z = s * s;
  float sum = 1.0F / 9;
  for (const float c : {1.0F / 7, 1.0F / 5, 1.0F / 3, 1.0F}) sum = sum * z + c;
  return e * std::numbers::ln2_v<float> + 2 * s * sum;
}

struct CosineAndSine {
  float cosine, sine;
};
/// Returns those of 2π word/2³².
inline CosineAndSine cosine_and_sine(std::uint32_t word) {
  const std::uint32_t quarter = (word + 0x20000000U) >> 30;
  const auto rest = static_cast<float>(static_cast<std::int32_t>(word - (quarter << 30)));
  const float x = rest * (2 * std::numbers::pi_v<float> * 0x1p-32F), z = x * x;
  float c = 1.0F / 40320, s = -1.0F / 5040;
  for (const float next : {-1.0F / 720, 1.0F / 24, -0.5F, 1.0F}) c = c * z + next;
  for (const float next : {1.0F / 120, -1.0F / 6, 1.0F}) s = s * z + next;
  s *= x;
  const bool odd = (quarter & 1U) != 0;
  const float a = odd ? s : c, b = odd ? c : s;
  return {((quarter + 1) & 2U) != 0 ? -a : a, (quarter & 2U) != 0 ? -b : b};
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
      const auto a = static_cast<float>(static_cast<std::int32_t>(words[pair][l] >> 1));
      const float radius = std::sqrt(-2 * logarithm((a + 0.5F) * 0x1p-31F));
      const auto [cosine, sine] = cosine_and_sine(words[pair + 1][l]);
      normals[pair][l] = radius * cosine;
      normals[pair + 1][l] = radius * sine;
    }
}

}  // namespace tangere
