// SPDX-License-Identifier: Apache-2.0
// Frames of a page: which rows become frames, and what of them is drawn.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "io/view/view_scene.hpp"

namespace tangere {

/// Of a trace where it has no value.
inline constexpr float kNoValue = std::numeric_limits<float>::quiet_NaN();

/// Rows of a file that become frames: every `stride`-th from 0 on, and the last one.
std::vector<std::int64_t> frames_of(std::int64_t rows, std::int64_t stride);

/// Returns the stride that keeps all episodes within the options: at most options.frames each, and
/// together below options.bytes of a page. `rows`: of each episode.
std::int64_t stride_for(const std::vector<std::int64_t>& rows, std::size_t numbers_per_frame,
                        const ViewOptions& options);

/// Float32 numbers that a frame takes in a page: poses, end effectors, traces and fields.
std::size_t numbers_per_frame(const Scene& scene, const std::vector<ViewSensor>& sensors,
                              std::size_t traces);

/// Makes traces of the coordinates, without numbers. A coordinate's unit is its group.
std::vector<ViewTrace> coordinate_traces(const std::vector<std::string>& names,
                                         const std::vector<std::string>& units);

/// Throws IoError where a field has a number that is not finite.
void check_finite_field(std::span<const double> force, const std::string& where);

}  // namespace tangere
