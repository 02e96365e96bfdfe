// SPDX-License-Identifier: Apache-2.0
// Goes through every contact point by the plain distance of the shape that it may touch.
#include "engine/sense/point_depths.hpp"

#include <algorithm>

#include "kernels/contact/distance.hpp"

namespace tangere {

using kernels::Frame;
using kernels::kGroup;
using kernels::Vec3;

namespace {

void add(PointDepths& depths, double depth) {
  if (!(depth > 0)) return;
  depths.deepest = std::max(depths.deepest, depth);
  ++depths.touching;
}

}  // namespace

PointDepths pair_depths(const kernels::PairContact& pair, const PadReader& reader, int group,
                        int lane, const double* block) {
  const Frame<double> shape = compose(relative(reader.link(pair.link1, group, lane).world,
                                               reader.link(pair.link2, group, lane).world),
                                      pair.frame2);
  Vec3<double> size = pair.size;
  for (int c = 0; c < 3 && pair.size_row >= 0; ++c)
    (&size.x)[c] = kernels::row_of(block, pair.size_row + c, group)[lane];
  return kernels::with_distance<double>(
      pair.shape, size,
      [&](const auto& of) {
        PointDepths depths;
        for (int k = 0; k < pair.n_points; ++k) {
          const double* p = pair.points + 3 * k;
          const Vec3<double> at =
              transposed_times(shape.R, Vec3<double>{p[0], p[1], p[2]} - shape.p);
          add(depths, pair.ball_radius - distance_at(of, at).d);
        }
        return depths;
      },
      pair.grid);
}

PointDepths ground_depths(const kernels::GroundContact& ground, const kernels::ModelView& view,
                          const PadReader& reader, int group, int lane) {
  const Frame<double> body = reader.link(ground.link, group, lane).world;
  PointDepths depths;
  for (int k = 0; k < ground.n_points; ++k) {
    const double* p = ground.points + 3 * k;
    const Vec3<double> at = body.R * Vec3<double>{p[0], p[1], p[2]} + body.p;
    add(depths, ground.radius - dot(view.ground_normal, at - view.ground_point));
  }
  return depths;
}

}  // namespace tangere
