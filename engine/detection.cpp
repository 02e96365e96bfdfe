// SPDX-License-Identifier: Apache-2.0
// Tiles by their bounding sphere, then points, one lane after the other.
#include "engine/detection.hpp"

#include <algorithm>

#include "kernels/distance.hpp"

namespace tangere {

using kernels::kContactTile;
using kernels::kGroup;
using kernels::LaneRow;
using kernels::PairContact;
using kernels::Vec3;

namespace {

constexpr double kFarAway = 1e6;  // [m] filler for lanes with shorter lists: finite, and no shape is there

/// Appends the points within `margin` of the shape; returns how many.
template <class Shape>
int gather(const PairContact& pair, const Shape& shape, const kernels::Frame<double>& pose, double margin,
           LaneRow* points, int lane) {
  const auto distance = [&](const double* p) {
    double unused;
    const Vec3<double> arm = Vec3<double>{p[0], p[1], p[2]} - pose.p;
    if constexpr (Shape::kFlat) return shape.evaluate(kernels::transposed_times(pose.R, arm), unused).d;
    return shape.evaluate(arm, unused).d;
  };
  int count = 0;
  for (int t = 0; t < pair.n_tiles; ++t) {
    const double* tile = pair.tiles + 4 * t;
    if (!(distance(tile) < tile[3] + margin)) continue;
    const int end = std::min(pair.n_points, (t + 1) * kContactTile);
    for (int k = t * kContactTile; k < end; ++k) {
      const double* p = pair.points + 3 * k;
      if (!(distance(p) < margin)) continue;
      for (int c = 0; c < 3; ++c) points[3 * count + c][lane] = p[c];
      ++count;
    }
  }
  return count;
}

void pad(Workspace& w, int k) {
  kernels::GroupStage::List& list = w.lists[k];
  const auto& count = w.list_count[k];
  list.count = *std::max_element(count.begin(), count.end());
  for (int l = 0; l < kGroup; ++l)
    for (int row = 3 * count[l]; row < 3 * list.count; ++row) list.points[row][l] = kFarAway;
}

}  // namespace

void clear_candidates(Workspace& w) {
  for (std::size_t k = 0; k < w.lists.size(); ++k) {
    w.list_count[k].fill(0);
    w.lists[k].count = 0;
  }
}

void find_candidates(const CompiledModel& model, const kernels::KernelTable& table, Workspace& w, LaneBits lanes) {
  if (model.pairs.empty()) return;
  table.pair_poses(model.view, w.stage, w.poses);
  for (std::size_t k = 0; k < model.pairs.size(); ++k) {
    const PairContact& pair = model.pairs[k];
    kernels::GroupStage::List& list = w.lists[k];
    for (int l = 0; l < kGroup; ++l) {
      if (!has(lanes, l)) continue;
      const LaneRow* row = w.poses + 12 * k;
      kernels::Frame<double> pose;
      for (int i = 0; i < 9; ++i) pose.R.m[i / 3][i % 3] = row[i][l];
      pose.p = {row[9][l], row[10][l], row[11][l]};
      for (int i = 0; i < 12; ++i) list.reference[i][l] = row[i][l];
      w.list_count[k][l] =
          pair.shape == PrimitiveShape::sphere
              ? gather(pair, kernels::SphereDistance<double>{pair.size.x}, pose, list.margin, list.points, l)
              : gather(pair, kernels::CuboidDistance<double>{pair.size}, pose, list.margin, list.points, l);
    }
    pad(w, static_cast<int>(k));
  }
}

}  // namespace tangere
