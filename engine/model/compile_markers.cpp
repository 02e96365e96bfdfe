// SPDX-License-Identifier: Apache-2.0
// The stiffness of a marker's gel is that of the skin's spring unless another is given.
#include "engine/model/compile_markers.hpp"

#include <fmt/format.h>

#include "engine/model/lateral_spread.hpp"

namespace tangere {

CompiledMarkers compile_markers(const TactileDescription& d, int pressure_sign) {
  const MarkersDescription& of = *d.markers;
  if (d.layer) {
    if (of.stiffness > 0 || of.thickness > 0 || of.spread > 0)
      throw InputError(of.source.prefix() + "markers of '" + d.name +
                       "': stiffness, thickness or spread beside <layer>, whose material moves "
                       "them; expected <markers/>");
    return {};
  }
  const std::string where = fmt::format("{}markers of '{}': ", of.source.prefix(), d.name);
  const double stiffness = of.stiffness > 0 ? of.stiffness : d.coefficients.ks;
  if (!(stiffness > 0))
    throw InputError(
        where +
        "no stiffness, and the sensor has no ks; expected stiffness=\"…\" [N/m], which "
        "'tangere skin' prints as ks");
  const bool grid = has_grid(d);
  const char* const needs = of.thickness > 0 ? "thickness" : of.spread > 0 ? "spread" : nullptr;
  if (needs != nullptr && !grid)
    throw InputError(where + needs +
                     " on a list of points, which have no neighbours; expected it on type "
                     "rect_array");
  CompiledMarkers markers;
  markers.pressure_sign = pressure_sign;
  markers.compliance = 1 / stiffness;
  markers.rows = grid ? d.array.rows : 1;
  markers.cols = grid ? d.array.cols : static_cast<int>(d.points.size());
  if (!grid) return markers;
  markers.pitch = pitches(d.array);
  markers.bulge = of.thickness / (2 * stiffness);
  if (of.spread > 0) markers.spread = lateral_spread(d.array, of.spread, where);
  return markers;
}

}  // namespace tangere
