// SPDX-License-Identifier: Apache-2.0
// Random numbers that depend on what they are for, never on when they are drawn: any environment,
// step or thread can be repeated alone. The generator is Philox4x32-10 (Salmon, Moraes, Dror, Shaw:
// "Parallel random numbers: as easy as 1, 2, 3", 2011): ten rounds of multiplication and exclusive
// or that turn a counter and a key into 128 random bits.
#pragma once

#include <array>
#include <cstdint>

#include "engine/model/scene.hpp"

namespace tangere {

/// 128 random bits of a counter under a key.
std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> counter,
                                        std::array<std::uint32_t, 2> key);

/// What a number is drawn for, so that no two uses share one. Part of every stored seed's meaning:
/// never renumber.
enum class Purpose : std::uint8_t {
  initial_state = 0,  ///< <randomize> of a joint's starting coordinates or velocities
  contact = 1,        ///< <randomize> of a contact's coefficients
  tactile = 2,        ///< <randomize> of a sensor's coefficients
  control = 3,        ///< knots of a random control
  joint = 4,          ///< <randomize> of a joint's effects or a motor's gains
  body = 5,           ///< <randomize> of a body
  task = 6,           ///< what a task draws at a reset or during an episode
  policy = 7,         ///< actions of a policy that draws them
};

/// Names one random number. Different keys give independent numbers; the same key gives the same
/// number always.
struct RandomKey {
  std::uint64_t seed = 0;
  std::int64_t episode = 0;  ///< [0, 2^48)
  std::int64_t step = 0;     ///< [0, 2^48); whatever counts time: a step, a knot
  Purpose purpose = Purpose::initial_state;
  std::uint32_t index = 0;  ///< [0, 2^24); counts the numbers of one purpose and step
};

/// Uniform in [0, 1), a multiple of 2^-53. Throws InputError when the key is out of its range, as
/// do all below.
double uniform(const RandomKey& key);
/// Uniform in [low, high], low <= high both finite; exactly low when they are equal.
double uniform(const RandomKey& key, double low, double high);
/// exp of a uniform number in [log low, log high]; 0 < low <= high.
double log_uniform(const RandomKey& key, double low, double high);
/// Normal with the given mean and standard deviation (>= 0).
double normal(const RandomKey& key, double mean, double deviation);

/// A number of a distribution. Throws InputError when its parameters do not describe one (an empty
/// list, NaN, …).
double draw(const Distribution& distribution, const RandomKey& key);

}  // namespace tangere
