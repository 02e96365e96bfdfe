// SPDX-License-Identifier: Apache-2.0
// Counter-based random numbers, keyed by their purpose and independent of the order of draws: any
// environment or step can be repeated alone. The generator is Philox4x32-10 (Salmon, Moraes, Dror,
// Shaw: "Parallel random numbers: as easy as 1, 2, 3", 2011). Ten rounds of multiplication and
// exclusive or turn a counter and a key into 128 random bits.
#pragma once

#include <array>
#include <cstdint>

#include "engine/scene/scene.hpp"

namespace tangere {

inline constexpr int kPhiloxRounds = 10;
inline constexpr std::array<std::uint32_t, 2> kPhiloxMultiplier{0xD2511F53, 0xCD9E8D57};
/// Added to the key after each round: the golden ratio and sqrt(3) - 1, in units of 2^-32.
inline constexpr std::array<std::uint32_t, 2> kPhiloxKeyStep{0x9E3779B9, 0xBB67AE85};

/// Returns 128 random bits for a counter and a key.
std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> counter,
                                        std::array<std::uint32_t, 2> key);

/// Purpose of a number, so that no two uses share one. Stored seeds depend on the values: never
/// renumber.
enum class Purpose : std::uint8_t {
  initial_state = 0,     ///< <randomize> of a joint's starting coordinates or velocities
  contact = 1,           ///< <randomize> of a contact's coefficients
  tactile = 2,           ///< <randomize> of a sensor's coefficients
  control = 3,           ///< knots of a random control
  joint = 4,             ///< <randomize> of a joint's effects or a motor's gains
  body = 5,              ///< <randomize> of a body
  task = 6,              ///< draws of a task at a reset or during an episode
  policy = 7,            ///< actions of a policy that draws them
  sensor_noise = 8,      ///< noise of a tactile point in a step
  sensor_point = 9,      ///< gain and bias of a tactile point
  dead_point = 10,       ///< whether a tactile point is dead
  sensor_gain = 11,      ///< gain of a sensor
  picture_noise = 12,    ///< noise of a pixel in a step
  picture_gain = 13,     ///< gains of a camera's channels
  channel_noise = 14,    ///< noise of a sensor's channel in a step
  channel_episode = 15,  ///< gain, offset and drift of a sensor's channel
  camera = 16,           ///< <randomize> of a camera's pose and light
};

/// Identifies one random number. Different keys give independent numbers. The same key always gives
/// the same number.
struct RandomKey {
  std::uint64_t seed = 0;
  std::int64_t episode = 0;  ///< [0, 2^48)
  std::int64_t step = 0;     ///< [0, 2^48); counts a step, a knot or another unit of time
  Purpose purpose = Purpose::initial_state;
  std::uint32_t index = 0;  ///< [0, 2^24); counts the numbers of one purpose and step
};

/// What philox4x32() takes for a key. Neighbours in `index` differ by 1 in the last word.
struct PhiloxCounter {
  std::array<std::uint32_t, 4> counter;
  std::array<std::uint32_t, 2> key;
};
/// Throws InputError when the key is out of range.
PhiloxCounter counter_of(const RandomKey& key);

/// Returns a uniform number in [0, 1), a multiple of 2^-53. Like all functions below, throws
/// InputError when the key is out of range.
double uniform(const RandomKey& key);
/// Returns a uniform number in [low, high], low <= high both finite; exactly low when they are
/// equal.
double uniform(const RandomKey& key, double low, double high);
/// Returns exp of a uniform number in [log low, log high]; 0 < low <= high.
double log_uniform(const RandomKey& key, double low, double high);
/// Returns a normal number with the given mean and standard deviation (>= 0).
double normal(const RandomKey& key, double mean, double deviation);

/// Draws a number from a distribution. Throws InputError when its parameters do not describe one
/// (an empty list, NaN, …).
double draw(const Distribution& distribution, const RandomKey& key);

}  // namespace tangere
