// SPDX-License-Identifier: Apache-2.0
// Reads states, end effectors and tactile fields of a block. Imperfections of sensors are the
// readout's, so whoever reads a field in a step gets the same. The rollout, the player of episodes
// and tasks use it, each with its own destination.
#pragma once

#include <array>
#include <span>

#include "engine/sense/readout.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

// `place(environment)` returns the destination for the numbers of an environment of the batch.

/// Reads coordinates (nq) and velocities (nv).
template <class PlaceQ, class PlaceV>
void read_states(const Batch& batch, int block, const PlaceQ& q, const PlaceV& v) {
  const int first = block * kernels::kBlock;
  for (int e = first; e < first + lanes_of(batch, block); ++e) {
    batch.get_q(e, q(e));
    batch.get_v(e, v(e));
  }
}

/// Returns place(environment) for each lane.
template <class T, class Place>
std::array<std::span<T>, kernels::kBlock> places_of(const Batch& batch, int block,
                                                    const Place& place) {
  std::array<std::span<T>, kernels::kBlock> places;
  for (int lane = 0; lane < lanes_of(batch, block); ++lane)
    places[static_cast<std::size_t>(lane)] = place(block * kernels::kBlock + lane);
  return places;
}

/// Reads world positions (end effectors, 3) [m]; nothing if the scene has none.
template <class Place>
void read_end_effectors(Readout& readout, const Batch& batch, int block, const Place& place) {
  if (!batch.model().end_effectors().empty())
    readout.read_end_effectors(batch, block, places_of<double>(batch, block, place));
}

/// Reads one sensor or camera in one form, numbers_of(model, output). T: double or float, or a byte
/// for a picture in colours, or an int16 for numbers of bodies.
template <class T, class Place>
void read_field(Readout& readout, const Batch& batch, int block, FieldOutput output,
                const Place& place) {
  const auto places = places_of<T>(batch, block, place);
  readout.read_block(batch, block, output, std::span<const std::span<T>>(places));
}

/// Reads some fields, one after the other: numbers_of(sensor, form) of each.
template <class T, class Place>
void read_fields(Readout& readout, const Batch& batch, int block,
                 std::span<const FieldOutput> outputs, const Place& place) {
  std::size_t offset = 0;
  for (const FieldOutput& output : outputs) {
    const std::size_t numbers = numbers_of(batch.model(), output);
    read_field<T>(readout, batch, block, output,
                  [&](int e) { return place(e).subspan(offset, numbers); });
    offset += numbers;
  }
}

/// Throws InputError if a sensor has lag, which counts in steps of the scene's length, and the step
/// length [s] differs from it.
inline void check_sensor_memory(const Model& model, double timestep) {
  for (std::size_t s = 0; s < model.sensors().size(); ++s)
    if (model.sensors()[s].past_states > 0 && timestep != model.timestep())
      throw InputError(model.scene().sensors[s].imperfections.source.prefix() +
                       "delay, low_pass and hysteresis of '" + model.sensors()[s].name +
                       "' count steps of " + std::to_string(model.timestep()) +
                       " s; expected this timestep, found " + std::to_string(timestep) + " s");
}

}  // namespace tangere
