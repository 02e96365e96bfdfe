// SPDX-License-Identifier: Apache-2.0
// Options of a benchmark: steps, repetitions and fields.
#pragma once

#include "engine/base/precision.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere {

/// How tactile fields are read.
enum class FrameKind {
  none,     ///< not at all
  dense,    ///< every point of a sensor, (points, 3) [N], in a buffer per environment
  compact,  ///< only the 8×8 tiles that something touches
};
const char* to_string(FrameKind value);

struct BenchmarkOptions {
  RolloutOptions rollout;  ///< steps (of a task: actions); for a scene also the interval of fields
  FrameKind frames = FrameKind::dense;   ///< for a scene
  Precision precision = Precision::f64;  ///< of the fields; a scene's mixed fields are float
  int threads = 1;
  int repeat = 3;       ///< timed passes over the whole episode
  bool pinned = false;  ///< each thread stays on a processor of its own
};

}  // namespace tangere
