// SPDX-License-Identifier: Apache-2.0
// A slab is one body of a pair. The other body has tunnelled if its centre crosses the mid plane of
// the slab along one of its axes, well within the slab's other widths. Contacts at rest never reach
// that depth. In substeps only pairs whose links move relative to each other by more than half of
// their smallest width are tested.
#include "engine/step/tunnelling_check.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/model/body_shape.hpp"
#include "engine/model/model_part.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/step/lane_energy.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

using kernels::Frame;
using kernels::LinkPose;
using kernels::Row;
using kernels::Vec3;

namespace {

/// Share of the slab's half widths: crossings of its mid plane farther out may pass beside it.
constexpr double kWithin = 0.7;

double component(const Vec3<double>& a, int k) { return k == 0 ? a.x : k == 1 ? a.y : a.z; }

}  // namespace

Vec3<double> TunnellingCheck::half_of(PrimitiveShape shape, const Vec3<double>& size) {
  CompiledBody body;
  body.shape = shape;
  body.size = size;
  const kernels::Hull hull = hull_of(body);
  return hull.straight + hull.round;
}

/// Returns the distance from a slab's centre within which the other body's centre is surely inside
/// [m], along an axis of half width `half`. A body that passes beside the edge of a cuboid stays
/// its own width away from it, and one that is pressed into a face stays shallower. In other shapes
/// kWithin of the widths is inside, because 2 kWithin² < 1.
double TunnellingCheck::within_of(const Slab& wall, double half) {
  if (wall.shape != PrimitiveShape::cuboid) return kWithin * half;
  return std::max(kWithin * half, half - wall.other_wide);
}

/// Returns half the widths of a slab in an environment.
Vec3<double> TunnellingCheck::half_in(const Slab& wall, const double* column) {
  if (wall.size_row < 0) return wall.half;
  return half_of(wall.shape, kernels::load_vector<double>({}, wall.size_row, column, 0));
}

void TunnellingCheck::add(int link, const Frame<double>& at, PrimitiveShape shape,
                          const Vec3<double>& size, int size_row, int other,
                          const Vec3<double>& middle, double other_wide) {
  const Vec3<double> half = half_of(shape, size);
  if (!(half.x > 0 && half.y > 0 && half.z > 0)) return;  // a plane has one side
  const double thin = std::min({half.x, half.y, half.z});
  const auto [at_bound, is_new] =
      bound_of_links_.try_emplace(std::minmax(link, other), link_pair_bounds_.size());
  const std::size_t bound = at_bound->second;
  slabs_.push_back({link, other, at, half, shape, size_row, middle, other_wide, bound});
  if (is_new) {
    link_pair_bounds_.push_back({link, other, thin});
  } else {
    link_pair_bounds_[bound].half = std::min(link_pair_bounds_[bound].half, thin);
  }
}

/// Computes balls around the slabs and centres of every pair of links. Ball centres are means, so
/// for two bodies they are the bodies' own centres.
void TunnellingCheck::bound_slab_pairs() {
  const auto for_sides = [&](const auto& f) {
    for (const Slab& wall : slabs_) {
      LinkPairBound& gate = link_pair_bounds_[wall.link_pair_bound];
      const bool own = wall.link == gate.link;
      f(own ? gate.link_ball : gate.other_ball, wall.at.p, std::sqrt(dot(wall.half, wall.half)));
      f(own ? gate.other_ball : gate.link_ball, wall.middle, 0.0);
    }
  };
  std::vector<double> count(link_pair_bounds_.size(), 0.0);
  for (const Slab& wall : slabs_) ++count[wall.link_pair_bound];
  for_sides([](Ball& ball, const Vec3<double>& at, double) { ball.centre += at; });
  for (std::size_t k = 0; k < link_pair_bounds_.size(); ++k)
    for (Ball* ball : {&link_pair_bounds_[k].link_ball, &link_pair_bounds_[k].other_ball})
      ball->centre = (1 / count[k]) * ball->centre;
  for_sides([](Ball& ball, const Vec3<double>& at, double radius) {
    const Vec3<double> arm = at - ball.centre;
    ball.radius = std::max(ball.radius, std::sqrt(dot(arm, arm)) + radius);
  });
}

/// Computes, for every pair of links with a slab, the radii around its slabs and centres.
void TunnellingCheck::bound_link_pairs() {
  const auto length = [](const Vec3<double>& a) { return std::sqrt(dot(a, a)); };
  for (std::size_t g = 0; g < model_.link_pairs.size(); ++g) {
    const kernels::LinkPair& links = model_.link_pairs[g];
    RadiusBound bound{g, -1};
    const auto found = bound_of_links_.find(std::minmax(links.link1, links.link2));
    if (found == bound_of_links_.end()) continue;
    const auto [first, end] =
        std::ranges::equal_range(slabs_, found->second, {}, &Slab::link_pair_bound);
    for (const Slab& wall : std::ranges::subrange(first, end)) {
      const bool link_has_shapes = wall.link == links.link2 && wall.other == links.link1;
      const Vec3<double>& at = link_has_shapes ? links.shapes_middle : links.points_middle;
      const Vec3<double>& other = link_has_shapes ? links.points_middle : links.shapes_middle;
      bound.radius_sum =
          std::max(bound.radius_sum,
                   length(wall.at.p - at) + length(wall.middle - other) + length(wall.half));
    }
    if (bound.radius_sum >= 0) bounds_.push_back(bound);
  }
  const std::vector<kernels::Link>& links = model_.links;
  // Where the place of a joint varies, its arms are not known here.
  bounded_ = std::none_of(links.begin(), links.end(), [](const kernels::Link& link) {
    return link.parent >= 0 && link.place_row >= 0;
  });
  const auto turned = [&](const kernels::Link& link) {
    for (int i = link.parent; i >= 0; i = links[std::size_t(i)].parent)
      if (!kernels::slides(links[std::size_t(i)].kind)) return true;
    return false;
  };
  for (const kernels::Link& link : links)
    for (int k = 0; kernels::slides(link.kind) && turned(link) && k < kernels::dofs(link.kind); ++k)
      sliders_.push_back(link.q + k);
}

/// Whether the balls of two links were farther apart than any point of one can have moved in the
/// axes of the other.
template <int L>
bool TunnellingCheck::stay_apart(const LinkPairBound& gate,
                                 const AlignedVector<LinkPose<Row<L>>>& before,
                                 const AlignedVector<LinkPose<Row<L>>>& after, int lane) {
  const auto other_in_link = [&](const AlignedVector<LinkPose<Row<L>>>& poses) {
    const auto world = [&](int link) {
      return link < 0 ? Frame<double>{kernels::diagonal(1.0), {0, 0, 0}}
                      : frame_in_lane<L>(poses[std::size_t(link)], lane);
    };
    return relative(world(gate.link), world(gate.other));
  };
  const auto length = [](const Vec3<double>& a) { return std::sqrt(dot(a, a)); };
  const Frame<double> from = other_in_link(before), to = other_in_link(after);
  const Vec3<double>&a = gate.link_ball.centre, &b = gate.other_ball.centre;
  double square = 0;
  for (int i = 0; i < 9; ++i) {
    const double turn = to.R.m[i / 3][i % 3] - from.R.m[i / 3][i % 3];
    square += turn * turn;
  }
  const Vec3<double> start = from.R * b + from.p, end = to.R * b + to.p;
  const double own = length(end - start), back = length(transposed_times(to.R, a - to.p) -
                                                        transposed_times(from.R, a - from.p));
  const double radius = gate.link_ball.radius + gate.other_ball.radius;
  return length(start - a) > radius + std::max(own, back) + std::sqrt(square) * radius;
}

TunnellingCheck::TunnellingCheck(const CompiledModel& m) : model_(m), arm_(m.links.size(), 0.0) {
  for (const kernels::PairContact& p : m.pairs) {
    if (!can_exert_force(p.parameters)) continue;  // it holds nothing back
    if (p.body1 < 0) {
      add(p.link2, p.frame2, p.shape, p.size, p.size_row, p.link1, p.middle, HUGE_VAL);
      continue;
    }
    const kernels::Solid& solid = m.solids[std::size_t(p.body1)];
    const auto wide = [](PrimitiveShape shape, const Vec3<double>& size) {
      if (row_of(shape).half_widths == nullptr) return HUGE_VAL;
      const Vec3<double> half = half_of(shape, size);
      return std::max({half.x, half.y, half.z});
    };
    const double wide1 = wide(solid.shape, solid.size);  // its middle is not that of a skin on it
    add(p.link2, p.frame2, p.shape, p.size, p.size_row, p.link1,
        wide1 < HUGE_VAL ? solid.frame.p : p.middle, wide1);
    // Bodies with points of their own need not be convex. A ball has none.
    // Sizes of a part of a model that vary are taken as in the scene; only whole models are checked
    // with those of an environment.
    const int row = m.bodies.empty() ? -1 : m.bodies[std::size_t(p.body1)].size_row;
    if (solid.stretches || p.ball_radius > 0)
      add(p.link1, solid.frame, solid.shape, solid.size, row, p.link2, p.frame2.p,
          wide(p.shape, p.size));
  }
  bound_slab_pairs();
  // tunnelled() visits each pair of links once.
  std::stable_sort(slabs_.begin(), slabs_.end(), [](const Slab& a, const Slab& b) {
    return a.link_pair_bound < b.link_pair_bound;
  });
  for (const Slab& wall : slabs_)
    for (const auto& [link, place] : {std::pair{wall.link, wall.at.p}, {wall.other, wall.middle}}) {
      double arm = std::sqrt(dot(place, place));
      for (int i = link; i >= 0; i = m.links[std::size_t(i)].parent) {
        arm_[std::size_t(i)] = std::max(arm_[std::size_t(i)], arm);
        const Vec3<double>& p = m.links[std::size_t(i)].frame.p;
        arm += std::sqrt(dot(p, p));
      }
    }
  bound_link_pairs();
}

template <int L>
LaneBits TunnellingCheck::far_movers(const Row<L>* x, Row<L>* way) const {
  if (link_pair_bounds_.empty()) return kNoLane;
  for (std::size_t i = 0; i < model_.links.size(); ++i) {  // links are no more than dofs
    const kernels::Link& link = model_.links[i];
    const double arm = kernels::slides(link.kind) ? 1 : arm_[i];
    for (int l = 0; l < L; ++l) {
      double sum = link.parent < 0 ? 0 : way[link.parent][l];
      for (int k = 0; k < kernels::dofs(link.kind); ++k) sum += std::abs(x[link.v + k][l]) * arm;
      way[i][l] = sum;
    }
  }
  LaneBits far = 0;
  for (const LinkPairBound& gate : link_pair_bounds_)
    for (int l = 0; l < L; ++l) {
      const double sum =
          (gate.link < 0 ? 0 : way[gate.link][l]) + (gate.other < 0 ? 0 : way[gate.other][l]);
      if (sum > gate.half) far |= 1U << l;
    }
  return far;
}

// Bound. Let d be the vector from the slab's centre to the other centre, at the end of the solve.
// In the slab's axes d moved by at most travel₁ + travel₂ + |d| · rotation of the slab. It can have
// crossed the slab only if |d| ≤ this displacement + radius_sum. travel is a sum over joints of
// slide, and of angle times arm; here over all joints of the scene. If the final evaluation was
// skipped, kinematics ran once more, so |d| is that at the end.
template <int L>
LaneBits TunnellingCheck::out_of_reach(const BasicWorkspace<L>& w, LaneBits lanes) const {
  if (slabs_.empty()) return lanes;
  if (w.stage.considered != nullptr) return kNoLane;  // `between` is not that of all pairs
  if (!bounded_ || std::any_of(bounds_.begin(), bounds_.end(), [&](const RadiusBound& bound) {
        return w.candidates->apart[std::size_t(bound.link_pair)] == 0;
      }))
    return kNoLane;
  Row<L> slid{}, way{}, angle{};
  for (const int q : sliders_)
    for (int l = 0; l < L; ++l) slid[l] += std::abs(w.q1[q][l]);
  for (std::size_t i = 0; i < model_.links.size(); ++i) {
    const kernels::Link& link = model_.links[i];
    const bool slides = kernels::slides(link.kind);
    for (int k = 0; k < kernels::dofs(link.kind); ++k) {
      const Row<L>& x = w.stage.x[link.v + k];
      if (slides) {
        for (int l = 0; l < L; ++l) way[l] += std::abs(x[l]);
      } else {
        for (int l = 0; l < L; ++l) {
          way[l] += std::abs(x[l]) * (arm_[i] + slid[l]);
          angle[l] += std::abs(x[l]);
        }
      }
    }
  }
  for (const RadiusBound& bound : bounds_)
    for (int l = 0; l < L; ++l) {
      const double nearer = 1 - angle[l], reach = bound.radius_sum + way[l];
      if (!(nearer > 0 && w.stage.between[bound.link_pair][l] * nearer * nearer > reach * reach))
        lanes &= ~(1U << l);
    }
  return lanes;
}

/// Returns the other body's centre in a slab's axes.
template <int L>
Vec3<double> TunnellingCheck::middle_in(const Slab& wall,
                                        const AlignedVector<LinkPose<Row<L>>>& poses, int lane) {
  const auto pose = [&](int link) {
    return link < 0 ? Frame<double>{kernels::diagonal(1.0), {0, 0, 0}}
                    : frame_in_lane<L>(poses[std::size_t(link)], lane);
  };
  const Frame<double> slab_pose = pose(wall.link), other_pose = pose(wall.other);
  const Vec3<double> arm =
      (other_pose.R * wall.middle + other_pose.p) - (slab_pose.R * wall.at.p + slab_pose.p);
  return transposed_times(wall.at.R, transposed_times(slab_pose.R, arm));
}

bool TunnellingCheck::came_through(const Slab& wall, const Vec3<double>& half,
                                   const Vec3<double>& from, const Vec3<double>& to) {
  const double thin = std::min({half.x, half.y, half.z});
  for (int axis = 0; axis < 3; ++axis) {
    // The centre of a hollow body may lie outside its material.
    if (!wall.other_convex() && component(half, axis) > thin) continue;
    const double a = component(from, axis), b = component(to, axis);
    if (!(a * b < 0)) continue;
    const double share = a / (a - b);
    bool within = true;
    for (int k = 0; k < 3; ++k) {
      const double at = component(from, k) + share * (component(to, k) - component(from, k));
      within = within && (k == axis || std::abs(at) < within_of(wall, component(half, k)));
    }
    if (within) return true;
  }
  return false;
}

template <int L>
bool TunnellingCheck::tunnelled(const AlignedVector<LinkPose<Row<L>>>& before,
                                const AlignedVector<LinkPose<Row<L>>>& after, int lane) const {
  std::size_t gate = link_pair_bounds_.size();
  bool apart = false;
  return std::any_of(slabs_.begin(), slabs_.end(), [&](const Slab& wall) {
    if (std::exchange(gate, wall.link_pair_bound) != wall.link_pair_bound)
      apart = stay_apart<L>(link_pair_bounds_[wall.link_pair_bound], before, after, lane);
    return !apart && came_through(wall, wall.half, middle_in<L>(wall, before, lane),
                                  middle_in<L>(wall, after, lane));
  });
}

bool TunnellingCheck::changed_sides(const AlignedVector<LinkPose<Row<1>>>& before,
                                    const AlignedVector<LinkPose<Row<1>>>& after,
                                    const double* column) const {
  return std::any_of(slabs_.begin(), slabs_.end(), [&](const Slab& wall) {
    return wall.other_convex() &&
           came_through(wall, half_in(wall, column), middle_in<1>(wall, before, 0),
                        middle_in<1>(wall, after, 0));
  });
}

double TunnellingCheck::clearance(const AlignedVector<LinkPose<Row<1>>>& poses,
                                  const double* column) const {
  const auto in_world = [&](int link, const Vec3<double>& p) {
    if (link < 0) return p;
    const Frame<double> at = frame_in_lane<1>(poses[std::size_t(link)], 0);
    return at.R * p + at.p;
  };
  double least = HUGE_VAL;
  for (const Slab& wall : slabs_) {
    if (!wall.other_convex()) continue;
    const Vec3<double> arm = in_world(wall.other, wall.middle) - in_world(wall.link, wall.at.p);
    const Vec3<double> half = half_in(wall, column);
    const double far = least + std::sqrt(dot(half, half));
    if (dot(arm, arm) >= far * far) continue;
    const Vec3<double> at = middle_in<1>(wall, poses, 0);
    double nearest = HUGE_VAL;
    for (int axis = 0; axis < 3; ++axis) {
      double square = 0;
      for (int k = 0; k < 3; ++k) {
        const double edge = k == axis ? 0 : within_of(wall, component(half, k)),
                     beyond = std::max(std::abs(component(at, k)) - edge, 0.0);
        square += beyond * beyond;
      }
      nearest = std::min(nearest, square);
    }
    least = std::min(least, std::sqrt(nearest));
  }
  return least;
}

#define TANGERE_FOR_LANES(L)                                                                    \
  template LaneBits TunnellingCheck::far_movers<L>(const Row<L>*, Row<L>*) const;               \
  template LaneBits TunnellingCheck::out_of_reach<L>(const BasicWorkspace<L>&, LaneBits) const; \
  template bool TunnellingCheck::tunnelled<L>(const AlignedVector<LinkPose<Row<L>>>&,           \
                                              const AlignedVector<LinkPose<Row<L>>>&, int) const;
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES

}  // namespace tangere
