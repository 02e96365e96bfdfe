// SPDX-License-Identifier: Apache-2.0
// The scene of a press: a sensor's layout that faces z, and an indenter above it.
#pragma once

#include <optional>

#include "io/scene/layout_file.hpp"

namespace tangere::apps {

/// A ball, or the flat end of a cylinder or of a cuboid; one of them is given [m].
struct Indenter {
  std::optional<double> ball, flat;  ///< radii
  std::vector<double> box;           ///< lengths along x and y
};

/// Returns the scene for tasks/calibration/press.hpp, without imperfections and feedback of the
/// sensor. Throws InputError as reading a scene does, at the line of the layout.
Scene press_scene(const LayoutFile& layout, const Indenter& indenter);

}  // namespace tangere::apps
