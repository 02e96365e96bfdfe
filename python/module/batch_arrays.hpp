// SPDX-License-Identifier: Apache-2.0
// What batches and environments of a task both show: poses and the faces of bodies.
#pragma once

#include "engine/sense/readout.hpp"
#include "engine/step/batch.hpp"
#include "python/module/arrays.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere::python {

/// Returns (poses, twists) of all bodies, (E, nb, 7) and (E, nb, 6), as Readout::bodies does.
nb::tuple body_arrays(Readout& readout, const Batch& batch);

/// Returns transmission_forces() of every environment, (E, n). `controls`: (E, nu).
Array<double> transmission_force_array(const Batch& batch, std::span<const double> controls);

/// Returns (corners, body, rgba) of the triangles that bound the bodies of an environment, with the
/// sizes that it has: (T, 3, 3) [m] in the frame of the body, (T), (T, 4). An abstract body is the
/// hull of its contact points. A half-space is a square of this half edge [m]; the ground, body -1
/// in the world's frame, is one around its position. Throws InputError for an environment that is
/// not there and for a half edge that is negative or not finite.
nb::tuple face_arrays(const Batch& batch, int environment, double half_space);

/// Throws InputError for rows of q and v that are not finite, and for quaternions without length.
void check_state(const Model& model, std::span<const double> q, std::span<const double> v);

/// Names of counts in Python.
inline constexpr std::pair<const char*, std::int64_t StepCounts::*> kCountNames[] = {
    {"simulation_steps", &StepCounts::simulation_steps},
    {"newton_iterations", &StepCounts::newton_iterations},
    {"split_steps", &StepCounts::split_steps},
    {"accuracy_not_met_steps", &StepCounts::accuracy_not_met_steps},
    {"tunnelled_steps", &StepCounts::tunnelled_steps},
    {"damped_steps", &StepCounts::damped_steps},
    {"overlapping_steps", &StepCounts::overlapping_steps}};

// Signatures and docstrings of what both show.
inline constexpr const char* kFacesSignature =
    "def faces(self, env: int, half_space: float = 0.0) -> "
    "tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int32], "
    "numpy.typing.NDArray[numpy.float64]]";
inline constexpr const char* kFacesText =
    "Triangles that bound the bodies of one environment, with the sizes that it has: corners\n"
    "(T, 3, 3) [m] in the body's frame, anticlockwise seen from outside, the body of each (T),\n"
    "and its colour (T, 4). An abstract body is the hull of its contact points. A half-space is\n"
    "a square with the half edge `half_space` [m]. The ground is such a square, of body -1, in\n"
    "the world's frame. InputError: no such environment, or no such length.";

}  // namespace tangere::python
