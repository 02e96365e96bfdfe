// SPDX-License-Identifier: Apache-2.0
// Tests the kernels of shear springs against dual numbers: stiffness and damping of a
// point, of a point on the ground, and the memory of a step in reverse. Points stick, slip and
// touch for the first time.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/contact/elastic_face_contact.hpp"
#include "kernels/contact/elastic_sphere_contact.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/shear/shear_pullback.hpp"
#include "tests/kernels/contact/product_sums.hpp"
#include "tests/kernels/lift.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere::kernels {
namespace {

/// Coefficients count per point.
constexpr const double* kByPoint = nullptr;

using D = Dual<double>;
using testing::lift;
using testing::Random;

/// A frame displaced by ε = (θ; ρ) in the outer axes.
template <class N>
Frame<N> displaced(const Frame<double>& f, const Vec6<double>& e) {
  const Mat3<double> turn = skew(e.a) * f.R;
  Frame<N> out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out.R.m[i][j] = lift<N>(f.R.m[i][j], turn.m[i][j]);
  out.p = lift<N>(f.p, e.l + cross(e.a, f.p));
  return out;
}
Vec3<double> epsilon(const Vec3<D>& x) { return {x.x.epsilon, x.y.epsilon, x.z.epsilon}; }

const Vec3<double> kSize = {0.02, 0.015, 0.011};

/// A step of one point: where it begins and ends, what it remembers, and its law.
struct Step {
  PrimitiveShape shape;
  bool ground;
  double radius;
  Frame<double> start, end;
  Vec6<double> twist;
  Vec3<double> xi, s;
  LawParameters<double> law;
};

/// The point lies `depth` under the surface at the end. In a third of the cases it did not touch
/// where the step began.
Step random_step(Random& random, PrimitiveShape shape, bool ground) {
  Step x{};
  x.shape = shape;
  x.ground = ground;
  x.radius = ground && random.uniform(0, 1) < 0.5 ? 0.02 : 0;
  const auto frame = [&] { return Frame<double>{random.rotation(), random.vector(0.05)}; };
  x.end = frame();
  Vec3<double> place, out;
  double depth = random.uniform(1e-4, 2e-3);
  if (shape == PrimitiveShape::sphere) {
    out = random.direction();
    place = (kSize.x - depth) * out;
  } else if (shape == PrimitiveShape::cylinder) {
    const double around = random.uniform(-3, 3);
    out = {std::cos(around), std::sin(around), 0};
    place = (kSize.x - depth) * out + Vec3<double>{0, 0, random.uniform(-0.004, 0.004)};
  } else if (shape == PrimitiveShape::cuboid) {  // near an edge, which the point may come across
    depth = random.uniform(5e-5, 9e-5);
    out = {0, 0, 1};
    place = {kSize.x - 1e-4, 0.01 * random.uniform(-1, 1), kSize.z - depth};
  } else {
    out = {0, 0, 1};
    place = {0.01 * random.normal(), 0.01 * random.normal(), x.radius - depth};
  }
  x.xi = x.end.R * place + x.end.p;
  const bool first = random.uniform(0, 1) < 0.33;
  // The shape turned about the point and moved.
  const Vec3<double> turn = random.vector(0.02);
  const Mat3<double> turned = rotation_exp(turn, rotation_series(turn));
  x.start = {turned * x.end.R, x.xi + turned * (x.end.p - x.xi)};
  const Vec3<double> way =
      x.end.R * ((first ? -1.5 * depth : 0.2 * depth) * out + random.vector(2e-4));
  x.start.p = x.start.p + way;
  x.twist = random.motion(0.3);
  const Vec3<double> n = x.start.R * out;
  const Vec3<double> s = random.vector(5e-4);
  x.s = s - dot(n, s) * n;
  const double stiffer = shape == PrimitiveShape::cuboid ? 1e2 : 1;  // it is less deep
  x.law = {{stiffer * random.uniform(100, 1000), random.uniform(0.05, 2), random.uniform(0.1, 1),
            random.uniform(0, 10), random.uniform(50, 500)},
           ContactLaw::clamped,
           0};
  return x;
}

/// Tangents of everything that a step depends on.
struct Change {
  Vec6<double> start{}, end{}, twist{};
  Vec3<double> s{}, xi{};
  Coefficients<double> law{};
};

template <class N>
LoadedTouch<N> touch(const Step& x, const Frame<N>& at, const Vec6<N>& twist,
                     const Coefficients<double>& change) {
  Coefficients<N> law;
  for (std::size_t k = 0; k < kCoefficients; ++k) law[k] = lift<N>(x.law[k], change[k]);
  return {at.R, at.p, twist.a, twist.l, {law, x.law.law, x.law.ramp}, N(x.radius), x.ground};
}

template <class N>
struct Outcome {
  Vec3<N> s, force, place;
  bool slips = false, first = false;
};
template <class N>
Outcome<N> outcome(const Step& x, const Change& c) {
  const Vec3<N> xi = lift<N>(x.xi, c.xi);
  const Vec6<N> twist = {lift<N>(x.twist.a, c.twist.a), lift<N>(x.twist.l, c.twist.l)};
  const LoadedTouch<N> start = touch<N>(x, displaced<N>(x.start, c.start), twist, c.law),
                       end = touch<N>(x, displaced<N>(x.end, c.end), twist, c.law);
  Outcome<N> out;
  with_distance<N>(x.shape, kSize, [&](const auto& shape) {
    const Anchor<N> anchor = recalled(shape, start, xi, lift<N>(x.s, c.s));
    const ElasticPoint<N> p = meet_elastic(shape, end, end.law, xi, anchor);
    out.s = p.hold * p.s;
    out.force = p.force;
    out.place = p.x2;
    out.slips = any(N(0.0) < p.inverse_w);
    out.first = any(N(0.0) < anchor.gap);
  });
  return out;
}

class Elastic : public ::testing::TestWithParam<std::tuple<PrimitiveShape, bool>> {};

/// The cotangents of everything, times a change, are the change of s' and force.
TEST_P(Elastic, MemoryInReverseMatchesDualNumbers) {
  const auto [shape_kind, ground] = GetParam();
  Random random(5);
  int slips = 0, sticks = 0, first = 0;
  for (int k = 0; k < 300; ++k) {
    const Step x = random_step(random, shape_kind, ground);
    const Vec3<double> f_bar = random.vector(1), s_bar = random.vector(1000),
                       x_bar = random.vector(10);
    const Vec6<double> twist = x.twist;
    const LoadedTouch<double> start = touch<double>(x, x.start, twist, {}),
                              end = touch<double>(x, x.end, twist, {});
    TouchCotangent<double> of_end{};
    Vec6<double> of_start{};
    Vec3<double> of_s{};
    OwnCotangent<double> own{};
    with_distance<double>(x.shape, kSize, [&]<class Shape>(const Shape& shape) {
      const Anchor<double> anchor = recalled(shape, start, x.xi, x.s);
      const ElasticPoint<double> p = meet_elastic(shape, end, end.law, x.xi, anchor);
      ASSERT_LT(p.d, 0);
      const Anchor<double> bar = pull_back_elastic<Shape>(end, end.law, {1, 1, 1, 1, 1}, p, x.xi,
                                                          anchor, f_bar, x_bar, s_bar, of_end, own);
      of_s = pull_back_recall(shape, start, x.xi, x.s, bar, of_start, own.xi);
    });
    for (int way = 0; way < 6; ++way) {
      Change c;
      if (way == 0) c.start = random.motion(1);
      if (way == 1) c.end = random.motion(1);
      if (way == 2) c.twist = random.motion(1);
      if (way == 3) c.s = random.vector(1);
      if (way == 4)
        for (std::size_t i = 0; i < kCoefficients; ++i) c.law[i] = random.normal();
      if (way == 5) c.xi = random.vector(1);
      const Outcome<D> o = outcome<D>(x, c);
      double reverse = dot(of_start, c.start) + dot(of_end.displacement, c.end) +
                       dot(of_end.twist, c.twist) + dot(of_s, c.s) + dot(own.xi, c.xi);
      for (std::size_t i = 0; i < kCoefficients; ++i) reverse += of_end.law[i] * c.law[i];
      const double forward =
          dot(f_bar, epsilon(o.force)) + dot(s_bar, epsilon(o.s)) + dot(x_bar, epsilon(o.place));
      const double scale = 1e-12 + std::abs(forward) + std::abs(dot(f_bar, epsilon(o.force))) +
                           std::abs(dot(s_bar, epsilon(o.s)));
      EXPECT_NEAR(reverse, forward, 1e-10 * scale) << "way " << way << ", case " << k;
      slips += o.slips ? 1 : 0;
      sticks += o.slips ? 0 : 1;
      first += o.first ? 1 : 0;
    }
  }
  EXPECT_GT(slips, 100);
  EXPECT_GT(sticks, 100);
  EXPECT_GT(first, 100);
}

INSTANTIATE_TEST_SUITE_P(Shapes, Elastic,
                         ::testing::Values(std::tuple{PrimitiveShape::plane, false},
                                           std::tuple{PrimitiveShape::plane, true},
                                           std::tuple{PrimitiveShape::cuboid, false},
                                           std::tuple{PrimitiveShape::sphere, false},
                                           std::tuple{PrimitiveShape::cylinder, false}));

/// Wrench and its derivative of one point of a pair.
template <class N>
PairSums<N> sums_of(const Step& x, const Anchor<double>& anchor, const Vec6<double>& e,
                    const Vec6<double>& rate) {
  PairSums<N> out = PairSums<N>::zero();
  const Frame<N> at = displaced<N>(x.end, e);
  const Anchor<N> a = {lift<N>(anchor.b, {0, 0, 0}), lift<N>(anchor.a, {0, 0, 0}), N(anchor.gap)};
  const LoadedTouch<N> t =
      touch<N>(x, at, {lift<N>(x.twist.a, rate.a), lift<N>(x.twist.l, rate.l)}, {});
  constexpr bool kDerivatives = std::is_same_v<N, double>;
  const Vec3<N> xi = lift<N>(x.xi, {0, 0, 0});
  if (x.ground) {
    // The ground moves against the body, whose own twist is the opposite.
    const Vec3<N> m = {at.R.m[0][2], at.R.m[1][2], at.R.m[2][2]};
    accumulate_elastic_ground<kDerivatives>(out, t.law, m, -dot(m, at.p), {-t.omega, -t.v}, xi,
                                            t.radius, at, a);
    return out;
  }
  with_distance<N>(x.shape, kSize, [&](const auto& shape) {
    accumulate_elastic<kDerivatives>(out, shape, t.law, at.R, at.p, t.omega, t.v, xi, a);
  });
  return out;
}

Vec6<double> product(const Mat3<double> (&m)[2][2], const Vec6<double>& x) {
  return {m[0][0] * x.a + m[0][1] * x.l, m[1][0] * x.a + m[1][1] * x.l};
}

TEST_P(Elastic, StiffnessAndDampingMatchDualNumbers) {
  const auto [shape_kind, ground] = GetParam();
  Random random(6);
  for (int k = 0; k < 300; ++k) {
    const Step x = random_step(random, shape_kind, ground);
    Anchor<double> anchor{};
    with_distance<double>(x.shape, kSize, [&](const auto& shape) {
      anchor = recalled(shape, touch<double>(x, x.start, x.twist, {}), x.xi, x.s);
    });
    const Vec6<double> none = zero6<double>(), e = random.motion(1);
    const PairSums<double> at = sums_of<double>(x, anchor, none, none);
    for (const bool by_pose : {true, false}) {
      const Vec6<double> analytic = product(by_pose ? at.k : at.d, e);
      const Vec6<D> dual = sums_of<D>(x, anchor, by_pose ? e : none, by_pose ? none : e).wrench;
      const Vec6<double> difference = analytic - Vec6<double>{epsilon(dual.a), epsilon(dual.l)};
      EXPECT_LT(std::sqrt(dot(difference, difference)),
                1e-11 * (1e-9 + std::sqrt(dot(analytic, analytic))))
          << "case " << k << (by_pose ? " by pose" : " by rate");
    }
  }
}

/// Places of a few points that stick, slip, land and do not touch, with the general sums of them.
struct Several {
  Step of;
  std::vector<Anchor<double>> anchors;
  std::vector<ElasticPlace<double>> places;
  PairSums<double> general;
};
Several random_points(Random& random, PrimitiveShape shape_kind) {
  Several out{random_step(random, shape_kind, false), {}, {}, PairSums<double>::zero()};
  constexpr int kCount = 12;
  out.anchors.reserve(kCount);  // places point at them
  const Step& x = out.of;
  with_distance<double>(x.shape, kSize, [&](const auto& shape) {
    for (int k = 0; k < kCount; ++k) {
      const Vec3<double> xi = k == 0 ? x.xi : x.xi + random.vector(k < 6 ? 2e-4 : 3e-3);
      const auto start = touch<double>(x, x.start, x.twist, {});
      const Anchor<double> anchor = recalled(shape, start, xi, k < 3 ? x.s : random.vector(1e-4));
      out.anchors.push_back(anchor);
      out.places.push_back({xi, reinterpret_cast<const double*>(&out.anchors.back()), 1});
      accumulate_elastic<true>(out.general, shape, x.law, x.end.R, x.end.p, x.twist.a, x.twist.l,
                               xi, anchor);
    }
  });
  return out;
}

/// Compares sums in products, chunk by chunk, with the general sums. Returns how many points slip.
template <class Motion, class Finish>
int expect_same_sums(const Motion& motion, const Several& points, const Finish& finish) {
  PairSums<double> finished = PairSums<double>::zero(), values = finished;
  typename Motion::Sums sums, forces;
  clear<true>(sums);
  clear<false>(forces);
  PointChunk<typename Motion::Point> chunk;
  int slips = 0;
  for (std::size_t k = 0; k < points.places.size(); k += 6) {
    fill_chunk<true>(motion, points.of.law, &points.places[k], kByPoint, 6, chunk);
    add_chunk<true>(sums, chunk);
    slips += chunk.slips;
    fill_chunk<false>(motion, points.of.law, &points.places[k], kByPoint, 6, chunk);
    add_chunk<false>(forces, chunk);
  }
  finish(sums, finished, std::true_type{});
  finish(forces, values, std::false_type{});
  testing::expect_finished_sums(finished, values, points.general, 2e-11);
  return slips;
}

TEST(Elastic, SumsInProductsAreTheGeneralSums) {
  for (const PrimitiveShape kind : {PrimitiveShape::sphere, PrimitiveShape::plane,
                                    PrimitiveShape::cuboid, PrimitiveShape::cylinder}) {
    SCOPED_TRACE(int(kind));
    Random random(8);
    int slips = 0;
    for (int trial = 0; trial < 200; ++trial) {
      const Several points = random_points(random, kind);
      const Step& x = points.of;
      with_distance<double>(
          kind, kSize, [&]<template <class> class Shape>(const Shape<double>& shape) {
            if constexpr (Shape<double>::kSums == PointSumForm::about_centre) {
              const ElasticSphereMotion<double> motion = {
                  sphere_motion(x.end.p, x.twist, shape.radius), x.end.R, x.law.kt, x.law.ks};
              slips += expect_same_sums(motion, points, [&](const auto& sums, auto& to, auto with) {
                add_finished<with()>(motion, x.twist, sums, to);
              });
            } else if constexpr (Shape<double>::kSums == PointSumForm::faces) {
              const ElasticFaceMotion<Shape, double> motion = {
                  {x.end, x.twist, shape}, x.law.kt, x.law.ks};
              slips += expect_same_sums(motion, points, [&](const auto& sums, auto& to, auto with) {
                add_finished<with()>(x.twist, sums, to);
              });
            }
          });
    }
    EXPECT_GT(slips, 50);
  }
}

/// Points of a patch, fixed in it, under a sphere that is moved along x and back in small steps, at
/// a constant depth. Per area k_n = 2e8 and k_s = 0.8e8 N/m³, R = 10 mm, depth 0.5 mm, μ = 0.6.
class SpherePatch {
 public:
  explicit SpherePatch(int per_radius) {
    const double a = std::sqrt(2 * kRadius * kDepth), pitch = a / per_radius;
    law_ = {{2e8 * pitch * pitch, 0, 0.6, 0, 0.8e8 * pitch * pitch}, ContactLaw::clamped, 0};
    for (int i = -per_radius; i <= per_radius; ++i)
      for (int j = -per_radius; j <= per_radius; ++j) {
        // Winkler: a point's depth is the parabola's, so that its normal is the patch's.
        const Vec3<double> at = {(i + 0.5) * pitch, (j + 0.5) * pitch, 0};
        const double depth = kDepth - (at.x * at.x + at.y * at.y) / (2 * kRadius);
        if (depth > 0) points_.push_back({at, depth, zero3<double>()});
      }
  }
  /// Moves the sphere to x and returns the force along x that holds it there.
  double move(double x) {
    double force = 0;
    for (Point& p : points_) {
      const LoadedTouch<double> from = touch(x_, p.depth), to = touch(x, p.depth);
      const Anchor<double> anchor = recalled(PlaneDistance<double>{}, from, p.at, p.s);
      const ElasticPoint<double> e = meet_elastic(PlaneDistance<double>{}, to, law_, p.at, anchor);
      p.s = e.hold * e.s;
      force -= e.force.x;
    }
    x_ = x;
    return -force;
  }

 private:
  static constexpr double kRadius = 10e-3, kDepth = 0.5e-3;
  struct Point {
    Vec3<double> at;
    double depth;
    Vec3<double> s;
  };
  /// The flat piece of the sphere above a point, at this place.
  [[nodiscard]] LoadedTouch<double> touch(double x, double depth) const {
    return {diagonal(1.0), {x, 0, depth}, zero3<double>(), zero3<double>(), law_, 0, false};
  }
  LawParameters<double> law_;
  std::vector<Point> points_;
  double x_ = 0;
};

/// Closed forms: F = μP(1 - (1 - y)²) at the first loading to y u₁, and a loop of (4/3) μP u₁ y³ in
/// a cycle between ±y u₁ (Cattaneo, Mindlin, Masing).
TEST(Elastic, ASphereUnderTangentialLoadSlipsFromTheEdgeInwards) {
  constexpr double kP = 1.570796, kMu = 0.6, kU1 = 0.75e-3;
  for (const double y : {0.3, 0.6, 0.9}) {
    SpherePatch patch(16);
    constexpr int kQuarter = 20;
    double loaded = 0;
    for (int k = 1; k <= kQuarter; ++k) loaded = patch.move(y * kU1 * k / kQuarter);
    EXPECT_NEAR(loaded, kMu * kP * (1 - (1 - y) * (1 - y)), 5e-3 * loaded) << y;
    double loop = 0, before = loaded, x = y * kU1;
    for (int k = 1; k <= 4 * kQuarter; ++k) {
      const double to =
          y * kU1 * (k <= 2 * kQuarter ? 1 - double(k) / kQuarter : double(k) / kQuarter - 3);
      const double force = patch.move(to);
      loop += 0.5 * (force + before) * (to - x);
      before = force, x = to;
    }
    EXPECT_NEAR(loop, 4.0 / 3 * kMu * kP * kU1 * y * y * y, (y < 0.5 ? 4e-2 : 1e-2) * loop) << y;
  }
}

/// A point that is sheared, tilted, sheared back and tilted back does no work on the whole.
TEST(Elastic, ACycleOfShearAndRockingGivesOutNoEnergy) {
  const LawParameters<double> law = {{1e3, 0, 1e6, 0, 100}, ContactLaw::clamped, 0};
  constexpr double kDepth = 1e-3, kShear = 1e-4, kTurn = 0.1;
  constexpr int kPart = 200;
  const PlaneDistance<double> plane;
  Vec3<double> s = zero3<double>(), xi = {0, 0, -kDepth};
  const auto at = [&](double shear, double turn) {  // the plane turns about the interface
    const Vec3<double> axis = {0, turn, 0};
    return Frame<double>{rotation_exp(axis, rotation_series(axis)), {shear, 0, 0}};
  };
  const auto touch = [&](const Frame<double>& f) {
    return LoadedTouch<double>{f.R, f.p, zero3<double>(), zero3<double>(), law, 0, false};
  };
  Frame<double> now = at(0, 0);
  double work = 0;
  Vec3<double> force_before{};
  bool first = true;
  for (int k = 1; k <= 4 * kPart; ++k) {
    const double t = double(k) / kPart;
    const double shear = kShear * (t < 1   ? t
                                   : t < 2 ? 1
                                   : t < 3 ? 3 - t
                                           : 0),
                 turn = kTurn * (t < 1   ? 0
                                 : t < 2 ? t - 1
                                 : t < 3 ? 1
                                         : 4 - t);
    const Frame<double> next = at(shear, turn);
    const Anchor<double> anchor = recalled(plane, touch(now), xi, s);
    const ElasticPoint<double> p = meet_elastic(plane, touch(next), law, xi, anchor);
    s = p.hold * p.s;
    // Work that the plane does on the point: its material at the interface moves.
    const Vec3<double> in_plane = transposed_times(now.R, p.x2 - now.p),
                       way = next.R * in_plane + next.p - p.x2,
                       tangential = p.force - dot(p.n, p.force) * p.n;
    const Vec3<double> mean = first ? 0.5 * tangential : 0.5 * (tangential + force_before);
    work += dot(mean, way);
    force_before = tangential;
    first = false;
    now = next;
  }
  EXPECT_LT(std::abs(work), 0.02 * 0.5 * 100 * kShear * kShear);
}

}  // namespace
}  // namespace tangere::kernels
