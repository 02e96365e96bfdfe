// SPDX-License-Identifier: Apache-2.0
// Philox4x32-10 and the distributions that scenes name.
#include "engine/model/random.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tangere {
namespace {

constexpr int kCountBits = 48;  // bits of episode and of step
constexpr int kIndexBits = 24;

std::array<std::uint32_t, 4> random_bits(const RandomKey& key) {
  const PhiloxCounter at = counter_of(key);
  return philox4x32(at.counter, at.key);
}

// Returns the 53 highest of 64 bits as a fraction in [0, 1).
double fraction(std::uint32_t high, std::uint32_t low) {
  const std::uint64_t bits = std::uint64_t{high} << 32 | low;
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

[[noreturn]] void refuse(const char* kind, const char* expected, double a, double b) {
  throw InputError(fmt::format("{} distribution of {} and {}: expected {}", kind, a, b, expected));
}

}  // namespace

// Packs a key's counter into 128 bits: episode (48), step (48), purpose (8), index (24).
PhiloxCounter counter_of(const RandomKey& key) {
  const auto episode = static_cast<std::uint64_t>(key.episode);
  const auto step = static_cast<std::uint64_t>(key.step);
  if ((episode | step) >> kCountBits != 0 || key.index >> kIndexBits != 0) {
    throw InputError(
        fmt::format("random number of episode {}, step {}, index {}: episode and step must be in "
                    "[0, 2^{}), the index in [0, 2^{})",
                    key.episode, key.step, key.index, kCountBits, kIndexBits));
  }
  const auto high = [](std::uint64_t x) { return static_cast<std::uint32_t>(x >> 32); };
  const auto low = [](std::uint64_t x) { return static_cast<std::uint32_t>(x); };
  const auto purpose = static_cast<std::uint32_t>(key.purpose);
  return {{low(episode), low(step), high(episode) | high(step) << 16,
           purpose << kIndexBits | key.index},
          {low(key.seed), high(key.seed)}};
}

std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> counter,
                                        std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < kPhiloxRounds; ++round) {
    const std::uint64_t even = std::uint64_t{kPhiloxMultiplier[0]} * counter[0];
    const std::uint64_t odd = std::uint64_t{kPhiloxMultiplier[1]} * counter[2];
    counter = {static_cast<std::uint32_t>(odd >> 32) ^ counter[1] ^ key[0],
               static_cast<std::uint32_t>(odd),
               static_cast<std::uint32_t>(even >> 32) ^ counter[3] ^ key[1],
               static_cast<std::uint32_t>(even)};
    key = {key[0] + kPhiloxKeyStep[0], key[1] + kPhiloxKeyStep[1]};
  }
  return counter;
}

double uniform(const RandomKey& key) {
  const auto bits = random_bits(key);
  return fraction(bits[0], bits[1]);
}

double uniform(const RandomKey& key, double low, double high) {
  if (!(std::isfinite(low) && std::isfinite(high) && low <= high)) {
    refuse("uniform", "finite numbers, low <= high", low, high);
  }
  return std::lerp(low, high, uniform(key));
}

double log_uniform(const RandomKey& key, double low, double high) {
  if (!(std::isfinite(high) && 0 < low && low <= high)) {
    refuse("log-uniform", "finite numbers, 0 < low <= high", low, high);
  }
  return std::clamp(std::exp(uniform(key, std::log(low), std::log(high))), low, high);
}

double normal(const RandomKey& key, double mean, double deviation) {
  if (!(std::isfinite(mean) && std::isfinite(deviation) && deviation >= 0)) {
    refuse("normal", "a finite mean and a finite deviation >= 0", mean, deviation);
  }
  // Box–Muller; 1 - u is in (0, 1], where the logarithm is finite.
  const auto bits = random_bits(key);
  const double radius = std::sqrt(-2 * std::log(1 - fraction(bits[0], bits[1])));
  return mean + deviation * radius * std::cos(2 * std::numbers::pi * fraction(bits[2], bits[3]));
}

double draw(const Distribution& distribution, const RandomKey& key) {
  switch (distribution.kind) {
    case Distribution::Kind::uniform: return uniform(key, distribution.a, distribution.b);
    case Distribution::Kind::log_uniform: return log_uniform(key, distribution.a, distribution.b);
    case Distribution::Kind::normal: return normal(key, distribution.a, distribution.b);
    case Distribution::Kind::list: break;
  }
  const auto& values = distribution.values;
  if (values.empty()) throw InputError("list distribution without values: expected at least one");
  const auto count = static_cast<double>(values.size());
  return values[std::min(static_cast<std::size_t>(uniform(key) * count), values.size() - 1)];
}

}  // namespace tangere
