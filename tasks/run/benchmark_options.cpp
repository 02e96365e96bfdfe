// SPDX-License-Identifier: Apache-2.0
// Names of the kinds of frames.
#include "tasks/run/benchmark_options.hpp"

namespace tangere {

const char* to_string(FrameKind value) {
  switch (value) {
    case FrameKind::none: return "none";
    case FrameKind::dense: return "dense";
    case FrameKind::compact: return "compact";
  }
  return "unknown";
}

}  // namespace tangere
