// SPDX-License-Identifier: Apache-2.0
// The overlap of two bodies with distances φ₁ and φ₂ is δ = -min over x of max(φ₁(x), φ₂(x)), the
// radius of the largest ball that lies in both. For convex bodies the maximum is a convex function,
// and the ellipsoid method finds its minimum between bounds: an ellipsoid that holds it, with
// matrix P, centre x and a gradient g there, is cut by g, and
//   f(x) - √(gᵀPg) ≤ min f ≤ f(x).
// Distances change by no more than the bodies move. So while bodies have moved by less than what
// was missing to the overlap that counts, nothing is computed. A mesh is not convex: an overlap
// that is found is one, but its lower bound is none.
#include "engine/step/interpenetration.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/model/model_part.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/step/lane_energy.hpp"
#include "kernels/contact/distance.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

using kernels::Distance;
using kernels::Frame;
using kernels::kBlock;
using kernels::kGroup;
using kernels::Row;
using kernels::Vec3;

namespace {

constexpr int kMostCuts = 120;

double euclidean(const Vec3<double>& a) { return std::sqrt(dot(a, a)); }

/// A ball around a body, body frame.
struct BoundingBall {
  Vec3<double> centre{};
  double radius = 0;  ///< [m]
};

/// Returns half the widths of a shape of this size along its axes [m]; zeros of a mesh or a plane.
Vec3<double> half_extents(PrimitiveShape shape, const Vec3<double>& size) {
  const ShapeRow& row = row_of(shape);
  if (row.half_widths == nullptr) return {0, 0, 0};
  const HalfWidths half = row.half_widths({size.x, size.y, size.z});
  return {half.straight[0] + half.round[0], half.straight[1] + half.round[1],
          half.straight[2] + half.round[2]};
}

BoundingBall ball_around(const CompiledBody& body, const Vec3<double>& size) {
  if (body.grid == nullptr) return {{0, 0, 0}, euclidean(half_extents(body.shape, size))};
  BoundingBall ball;
  const double* const low = body.grid->low;
  const double* const high = body.grid->high;
  ball.centre = 0.5 * size.x * Vec3<double>{low[0] + high[0], low[1] + high[1], low[2] + high[2]};
  ball.radius = 0.5 * size.x * euclidean({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  return ball;
}

}  // namespace

/// One environment at the poses of a workspace.
class Interpenetration::Lane {
 public:
  Lane(const CompiledModel& m, const AlignedVector<kernels::LinkPose<Row<1>>>& poses,
       const double* column)
      : m_(m), poses_(poses), column_(column) {}

  /// Bounds of the overlap of two bodies [m].
  struct Overlap {
    double least, most;  ///< bounds of δ; negative where bodies are apart
    bool sure = true;    ///< `most` is a bound
  };

  /// Returns the share of an inscribed radius that counts [m]; 0 where it is not known.
  [[nodiscard]] double threshold(const CoarsePair& pair) const {
    return kOverlapShare * std::min(inscribed(pair.body1), inscribed(pair.body2));
  }

  /// Bounds the overlap until it is clear whether it exceeds `threshold`, to a quarter of it.
  [[nodiscard]] Overlap overlap(const CoarsePair& pair, double threshold) const {
    const Solid one = solid(pair.body1), two = solid(pair.body2);
    const double apart = euclidean(two.centre - one.centre) - one.ball.radius - two.ball.radius;
    if (apart > 0) return {-HUGE_VAL, -apart};
    const Solid& smaller = one.ball.radius < two.ball.radius ? one : two;
    Vec3<double> x = smaller.centre;
    kernels::Mat3<double> P = kernels::diagonal(smaller.ball.radius * smaller.ball.radius);
    double low = -HUGE_VAL, best = HUGE_VAL;
    for (int k = 0; k < kMostCuts && best - low > 0.25 * threshold; ++k) {
      const Distance<double> a = distance(one, x), b = distance(two, x);
      const Distance<double>& f = a.d > b.d ? a : b;
      best = std::min(best, f.d);
      const Vec3<double> Pg = P * f.n;
      const double reach = std::sqrt(dot(f.n, Pg));
      if (!(reach > 0)) break;
      low = std::max(low, f.d - reach);
      // A cut through x, deeper where x is no better than the best place so far.
      const double alpha = std::min((f.d - best) / reach, 0.99);
      const Vec3<double> step = (1 / reach) * Pg;
      x -= ((1 + 3 * alpha) / 4) * step;
      const double shrink = 9.0 / 8 * (1 - alpha * alpha),
                   along = (1 + 3 * alpha) / (2 * (1 + alpha));
      P = shrink * (P - along * outer(step, step));
    }
    return {-best, -low, !one.mesh && !two.mesh};
  }

  /// Returns how deep the deepest contact point of a pair of bodies lies in the other body [m].
  [[nodiscard]] double deepest_point(const CoarsePair& pair) const {
    double depth = 0;
    for (const int k : pair.contacts) {
      const kernels::PairContact& contact = m_.pairs[std::size_t(k)];
      const Frame<double> link = world(contact.link1);
      const Solid touched = solid(contact.body2);
      for (int i = 0; i < contact.n_points; ++i) {
        const double* const p = contact.points + 3 * i;
        const Vec3<double> at = link.R * Vec3<double>{p[0], p[1], p[2]} + link.p;
        depth = std::max(depth, contact.ball_radius - distance(touched, at).d);
      }
    }
    return depth;
  }

 private:
  struct Solid {
    const CompiledBody& body;
    Frame<double> frame;  ///< in the world
    Vec3<double> size;
    BoundingBall ball;
    Vec3<double> centre;  ///< of the ball, in the world
    bool mesh;
  };

  [[nodiscard]] Frame<double> world(int link) const {
    return link < 0 ? Frame<double>{kernels::diagonal(1.0), {0, 0, 0}}
                    : frame_in_lane<1>(poses_[std::size_t(link)], 0);
  }
  [[nodiscard]] Vec3<double> size(const CompiledBody& body) const {
    return kernels::load_vector<double>(body.size, body.size_row, column_, 0);
  }
  [[nodiscard]] Solid solid(int b) const {
    const CompiledBody& body = m_.bodies[std::size_t(b)];
    Solid s{body, compose(world(body.link), body.frame), size(body), {}, {}, body.grid != nullptr};
    s.ball = ball_around(body, s.size);
    s.centre = s.frame.R * s.ball.centre + s.frame.p;
    return s;
  }
  [[nodiscard]] static Distance<double> distance(const Solid& s, const Vec3<double>& x) {
    Distance<double> at = kernels::with_distance<double>(
        s.body.shape, s.size,
        [&](const auto& shape) {
          return kernels::distance_at(shape, transposed_times(s.frame.R, x - s.frame.p));
        },
        s.body.grid);
    at.n = s.frame.R * at.n;
    return at;
  }
  [[nodiscard]] double inscribed(int b) const {
    const CompiledBody& body = m_.bodies[std::size_t(b)];
    const Vec3<double> size = this->size(body);
    if (body.grid != nullptr) return size.x * body.inscribed;
    const Vec3<double> half = half_extents(body.shape, size);
    return std::min({half.x, half.y, half.z});
  }

  const CompiledModel& m_;
  const AlignedVector<kernels::LinkPose<Row<1>>>& poses_;
  const double* column_;
};

Interpenetration::Interpenetration(const CompiledModel& m)
    : model_(m),
      passing_(m),
      arm_(m.links.size(), 0.0),
      checked_(m.links.size(), 0),
      way_(m.links.size() * kGroup) {
  for (const auto& [body1, body2] : m.coarse_pairs) {
    CoarsePair pair{body1, body2, {}};
    for (std::size_t k = 0; k < m.pairs.size(); ++k) {
      const kernels::PairContact& c = m.pairs[k];
      if (std::minmax(c.body1, c.body2) == std::minmax(body1, body2))
        pair.contacts.push_back(static_cast<int>(k));
    }
    coarse_.push_back(std::move(pair));
  }
  bound_arms();
}

/// Finds how far from the origins of links the bodies are that they move.
void Interpenetration::bound_arms() {
  const std::vector<kernels::Link>& links = model_.links;
  for (const kernels::PairContact& c : model_.pairs)
    for (const int b : {c.body1, c.body2}) {
      if (b < 0 || !can_exert_force(c.parameters)) continue;
      const CompiledBody& body = model_.bodies[std::size_t(b)];
      if (body.link >= 0) checked_[std::size_t(body.link)] = 1;
      has_pairs_ = true;
      const BoundingBall ball = ball_around(body, body.size);
      const Vec3<double> centre = body.frame.R * ball.centre + body.frame.p;
      // A sphere is where its centre is, however it turns.
      double arm = euclidean(centre);
      if (body.shape != PrimitiveShape::sphere) arm += std::max(ball.radius, body.extent);
      for (int i = body.link; i >= 0; i = links[std::size_t(i)].parent) {
        arm_[std::size_t(i)] = std::max(arm_[std::size_t(i)], arm);
        arm += euclidean(links[std::size_t(i)].frame.p);
      }
    }
  std::vector<std::uint8_t> turned(links.size(), 0);  // by a link that carries it
  for (std::size_t i = 0; i < links.size(); ++i) {
    const kernels::Link& link = links[i];
    if (link.parent < 0) continue;
    const std::size_t parent = std::size_t(link.parent);
    turned[i] = turned[parent] != 0 || !kernels::slides(links[parent].kind) ? 1 : 0;
    if (turned[i] != 0 && kernels::slides(link.kind))
      for (int k = 0; k < kernels::dofs(link.kind); ++k) sliders_.push_back(link.q + k);
  }
}

/// Returns how many times as long as in the scene an arm can be in an environment, whose sizes and
/// places of joints may vary; infinite where a place is at the origin in the scene.
double Interpenetration::arm_ratio(const double* column) const {
  const auto in_lane = [&](const Vec3<double>& value, int row) {
    return euclidean(kernels::load_vector<double>(value, row, column, 0));
  };
  double ratio = 1;
  for (const CompiledBody& body : model_.bodies)
    if (body.size_row >= 0)
      ratio = std::max(ratio, in_lane(body.size, body.size_row) / euclidean(body.size));
  for (const kernels::Link& link : model_.links)
    if (link.place_row >= 0 && link.parent >= 0)
      ratio = std::max(ratio, in_lane(link.frame.p, link.place_row) / euclidean(link.frame.p));
  return ratio;
}

// A joint that turns by θ moves a point at distance a by no more than θ a. Of unit quaternions,
// |q - q'| = 2 sin(θ/4) ≥ θ/π for θ ≤ π.
template <int L>
Row<L> Interpenetration::motions(const double* rows) {
  const BlockLayout& layout = model_.layout;
  const auto now = [&](int i) { return rows + (layout.q + i) * kBlock; };
  const auto before = [&](int i) { return rows + (layout.previous_q + i) * kBlock; };
  Row<L> slid{}, first{}, second{};
  for (const int q : sliders_)
    for (int l = 0; l < L; ++l) slid[l] += std::abs(now(q)[l]);
  for (std::size_t i = 0; i < model_.links.size(); ++i) {
    const kernels::Link& link = model_.links[i];
    double* const way = &way_[i * kGroup];
    for (int l = 0; l < L; ++l)
      way[l] = link.parent < 0 ? 0 : way_[std::size_t(link.parent) * kGroup + std::size_t(l)];
    if (link.kind == kernels::JointKind::spherical) {
      Row<L> minus{}, plus{};  // q and -q are the same rotation
      for (int k = 0; k < 4; ++k)
        for (int l = 0; l < L; ++l) {
          const double a = now(link.q + k)[l], b = before(link.q + k)[l];
          minus[l] += (a - b) * (a - b);
          plus[l] += (a + b) * (a + b);
        }
      for (int l = 0; l < L; ++l)
        way[l] += std::numbers::pi * std::sqrt(std::min(minus[l], plus[l])) * (arm_[i] + slid[l]);
    } else {
      const bool slides = kernels::slides(link.kind);
      for (int k = 0; k < kernels::dofs(link.kind); ++k)
        for (int l = 0; l < L; ++l)
          way[l] += std::abs(now(link.q + k)[l] - before(link.q + k)[l]) *
                    (slides ? 1 : arm_[i] + slid[l]);
    }
    if (checked_[i] == 0) continue;
    for (int l = 0; l < L; ++l) {
      second[l] = std::max(second[l], std::min(first[l], way[l]));
      first[l] = std::max(first[l], way[l]);
    }
  }
  for (int l = 0; l < L; ++l) first[l] += second[l];
  return first;
}
template Row<kGroup> Interpenetration::motions(const double*);
template Row<1> Interpenetration::motions(const double*);

Interpenetration::Finding Interpenetration::check(const kernels::KernelTable& table,
                                                  SingleWorkspace& w, const double* column,
                                                  double motion) const {
  w.stage.block = column;
  w.stage.group = 0;
  const auto find_poses = [&](int first, Row<1>* q, auto& poses) {
    for (int i = 0; i < model_.nq; ++i) q[i][0] = column[(first + i) * kBlock];
    table.stage<1>().poses_at(model_.view, w.stage, q, w.zero, w.zero, poses.data());
  };
  Finding found;
  find_poses(model_.layout.q, w.q1, w.poses_after);
  found.clearance = passing_.clearance(w.poses_after, column);
  const double ratio = arm_ratio(column);
  if (found.clearance <= ratio * motion) {  // else nothing can have come from the other side
    find_poses(model_.layout.previous_q, w.q0, w.poses_before);
    found.tunnelled = passing_.changed_sides(w.poses_before, w.poses_after, column);
  }
  const Lane lane(model_, w.poses_after, column);
  for (const CoarsePair& pair : coarse_) {
    const double threshold = lane.threshold(pair);
    if (!(threshold > 0)) continue;
    const Lane::Overlap overlap = lane.overlap(pair, threshold);
    if (overlap.least > threshold) {
      found.clearance = 0;
      if (lane.deepest_point(pair) < overlap.least) found.overlapping = true;
      continue;
    }
    const double missing = overlap.sure ? threshold - overlap.most : 0.25 * threshold;
    found.clearance = std::min(found.clearance, std::max(missing, 0.0));
  }
  found.clearance /= ratio;
  return found;
}

}  // namespace tangere
