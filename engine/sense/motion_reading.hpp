// SPDX-License-Identifier: Apache-2.0
// Poses and twists of bodies and end effectors: what Readout returns beside fields.
// engine/sense/readout.hpp gives shapes, units and axes.
#pragma once

#include <span>

#include "engine/sense/pad_reader.hpp"

namespace tangere {

/// The reader of these functions is of the model `m`. It moves to the group of the environment.
/// `chosen`: bodies to read; none: all.
void read_bodies(const CompiledModel& m, PadReader& reader, const Batch& batch, int environment,
                 std::span<double> pose, std::span<double> twist, std::span<const int> chosen);

/// Leaves velocities out where `velocity` is empty.
void read_end_effectors(const CompiledModel& m, PadReader& reader, const Batch& batch,
                        int environment, std::span<double> position, std::span<double> velocity);

/// Reads positions alone, in the environments from 16 block on.
void read_end_effectors(const CompiledModel& m, PadReader& reader, const Batch& batch, int block,
                        std::span<const std::span<double>> positions);

void read_end_effector_jacobian(const CompiledModel& m, PadReader& reader, const Batch& batch,
                                int environment, std::span<double> jacobian);

}  // namespace tangere
