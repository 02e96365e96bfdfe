// SPDX-License-Identifier: Apache-2.0
// Tips have one size on the page, whatever the direction in the scene.
#include "io/picture/projection.hpp"

#include <fmt/format.h>

namespace tangere::svg {

std::string path_of(const std::vector<Place>& places, bool closed) {
  std::string d;
  for (const Place& p : places)
    d += fmt::format("{}{:.1f} {:.1f}", d.empty() ? "M" : "L", p.x, p.y);
  return d + (closed ? "Z" : "");
}

std::string arrow(const std::vector<Place>& way, const char* colour) {
  const Place &end = way.back(), &before = way[way.size() - 2];
  const double dx = end.x - before.x, dy = end.y - before.y, length = std::hypot(dx, dy);
  std::string out =
      fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"/>\n",
                  path_of(way, false), colour);
  if (length < 1e-6) return out;  // it points at the eye
  const double ux = dx / length, uy = dy / length;
  const std::vector<Place> tip = {{end.x + 5 * ux, end.y + 5 * uy},
                                  {end.x - 3 * ux - 3.6 * uy, end.y - 3 * uy + 3.6 * ux},
                                  {end.x - 3 * ux + 3.6 * uy, end.y - 3 * uy - 3.6 * ux}};
  return out + fmt::format("<path d=\"{}\" fill=\"{}\"/>\n", path_of(tip, true), colour);
}

}  // namespace tangere::svg
