// SPDX-License-Identifier: Apache-2.0
// Kernels of layers that are contacts, of every instruction set, against the same formulas in plain
// double precision.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/base/checks.hpp"
#include "kernels/layer/layer_slopes.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::KernelTable;
using kernels::kGroup;
using kernels::LayerBody;
using kernels::LayerEight;
using kernels::LayerShape;
using kernels::Vec3;
using testing::Random;

struct Pressing {
  const char* name;
  PrimitiveShape shape;
  Vec3<double> size;
};
constexpr Pressing kPressing[] = {{"sphere", PrimitiveShape::sphere, {6e-3, 0, 0}},
                                  {"cuboid", PrimitiveShape::cuboid, {4e-3, 5e-3, 3e-3}},
                                  {"cylinder", PrimitiveShape::cylinder, {4e-3, 5e-3, 0}},
                                  {"capsule", PrimitiveShape::capsule, {3e-3, 4e-3, 0}},
                                  {"ellipsoid", PrimitiveShape::ellipsoid, {4e-3, 6e-3, 5e-3}}};

constexpr int kCandidates = 201, kStride = 208;  // the last eight are not full

/// A tilted body that presses a pad by about 0.8 mm while it moves, candidates around it, and their
/// anchors.
struct Press {
  LayerShape shape;
  LayerBody<double> body;
  kernels::LayerLaw law{1, 4e-4, 2e-3, 4e-4};
  kernels::Frame<double> pad;
  AlignedVector<double> places, anchors;

  Press(const Pressing& of, Random& random)
      : shape{of.shape, nullptr, ContactLaw::clamped, 0, true, false},
        pad{random.rotation(), random.vector(0.1)},
        places(3 * kStride),
        anchors(kernels::kAnchorNumbers * kStride) {
    kernels::Touch<double>& t = body.touch;
    t.Q = random.rotation();
    double reach = of.size.x;
    kernels::with_distance<double>(of.shape, of.size, [&](const auto& s) {
      for (double low = 0, high = 0.02; high - low > 1e-9;) {
        reach = 0.5 * (low + high);
        const double d = distance_at(s, transposed_times(t.Q, Vec3<double>{0, 0, -reach})).d;
        (d < 0 ? low : high) = reach;
      }
    });
    t.c = {1e-4, -2e-4, reach - 8e-4};
    t.omega = random.vector(2), t.v = random.vector(0.02);
    t.law.kn = 48, t.law.damping = 1.6, t.law.kt = 0.08, t.law.ks = 16, t.law.mu = 0.5;
    body.size = of.size;
    for (int k = 0; k < kCandidates; ++k) {
      const Vec3<double> at = {random.uniform(-5e-3, 5e-3), random.uniform(-5e-3, 5e-3), 0};
      put(pad.R * at + pad.p, places, k, 0);
      put(pad.R * (at + random.vector(1e-5)) + pad.p, anchors, k, 0);
      put(transposed_times(t.Q, at + random.vector(1e-5) - t.c), anchors, k, 3);
      anchors[std::size_t(6 * kStride + k)] = k % 5 == 0 ? 2e-5 : 0;
    }
  }
  static void put(const Vec3<double>& x, AlignedVector<double>& rows, int k, int first) {
    for (int i = 0; i < 3; ++i) rows[std::size_t((first + i) * kStride + k)] = (&x.x)[i];
  }
  Vec3<double> xi(int k) const {
    const Vec3<double> at = {places[std::size_t(k)], places[std::size_t(kStride + k)],
                             places[std::size_t(2 * kStride + k)]};
    Vec3<double> x = transposed_times(pad.R, at - pad.p);
    x.z = 0;
    return x;
  }
};

/// The points that a body touches.
struct Found {
  AlignedVector<LayerEight> points{std::size_t(kStride / kGroup + 1)};
  std::vector<int> candidate = std::vector<int>(kStride + kGroup, -2);
  int count = 0;

  Found(const KernelTable& table, const Press& p)
      : count(table.find_layer_points({&p.shape, &p.body, p.law, p.pad, p.places.data(),
                                       p.anchors.data(), kStride, kCandidates, points.data(),
                                       candidate.data()})) {}
  int eights() const { return (count + kGroup - 1) / kGroup; }
  /// Numbers of point k.
  kernels::LayerPoint<double> at(int k) const {
    kernels::LayerPoint<double> out;
    const auto* const from = reinterpret_cast<const double*>(&points[std::size_t(k / kGroup)]);
    auto* const to = reinterpret_cast<double*>(&out);
    for (std::size_t i = 0; i < sizeof out / sizeof(double); ++i)
      to[i] = from[std::size_t(kGroup) * i + std::size_t(k % kGroup)];
    return out;
  }
};

void expect_near(const Vec3<double>& a, const Vec3<double>& b, double tolerance) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

TEST(LayerKernels, PointsAreThoseOfPlainNumbers) {
  for (const KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    int kinds[4] = {};
    for (const Pressing& of : kPressing) {
      SCOPED_TRACE(of.name);
      Random random(11);
      for (int trial = 0; trial < 4; ++trial) {
        const Press press(of, random);
        const Found found(*table, press);
        int next = 0;
        kernels::with_distance<double>(of.shape, of.size, [&](const auto& shape) {
          const auto& t = press.body.touch;
          const Vec3<double> down = kernels::down_in_shape(t, press.law.outward);
          for (int k = 0; k < kCandidates; ++k) {
            const auto plain = contact_depth(shape, t, press.xi(k), press.law, down);
            if (!(plain.touches > 0 && plain.at.depth > -press.law.bulge)) continue;
            ASSERT_LT(next, found.count);
            ASSERT_EQ(found.candidate[std::size_t(next)], k);
            const auto p = found.at(next++);
            ++kinds[int(p.by)];
            EXPECT_EQ(p.by, plain.by);
            EXPECT_NEAR(p.at.depth, plain.at.depth, 1e-15);
            expect_near(p.at.slant, plain.at.slant, 1e-9);
            expect_near(p.at.place, plain.at.place, 1e-15);
            expect_near(p.xi, press.xi(k), 1e-16);
          }
        });
        EXPECT_EQ(next, found.count);
        EXPECT_EQ(found.candidate[std::size_t(next)] == -1, next % kGroup != 0);
      }
    }
    for (const int kind : {0, 2, 3}) EXPECT_GT(kinds[kind], 20) << kind;
  }
}

TEST(LayerKernels, PointsDoNotDependOnTheirNeighbours) {
  for (const KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    for (const Pressing& of : kPressing) {
      SCOPED_TRACE(of.name);
      Random random(5);
      Press press(of, random);
      const Found before(*table, press);
      ASSERT_GT(before.count, 20);
      const int poisoned = before.candidate[9];
      for (int i = 0; i < 3; ++i)
        press.places[std::size_t(i * kStride + poisoned)] =
            std::numeric_limits<double>::quiet_NaN();
      const Found after(*table, press);
      ASSERT_EQ(after.count, before.count - 1);
      for (int k = 0; k < after.count; ++k) {
        const int was = k < 9 ? k : k + 1;
        EXPECT_EQ(after.candidate[std::size_t(k)], before.candidate[std::size_t(was)]);
        const auto x = after.at(k), y = before.at(was);
        EXPECT_EQ(std::memcmp(&x, &y, sizeof x), 0) << k;
      }
    }
  }
}

/// Points with loads of their own, a fifth without.
struct Loaded : Found {
  double stiffness = 300;
  std::vector<int> cell;

  Loaded(const KernelTable& table, const Press& press) : Found(table, press) {
    for (int k = 0; k < kGroup * eights(); ++k) {
      LayerEight& e = points[std::size_t(k / kGroup)];
      const int l = k % kGroup;
      const double load = k < count && k % 5 != 0 ? 1e-3 * (1 + k % 7) : 0;
      e.load[l] = load;
      // Friction has no load, one of its own, or that of the point.
      e.friction_load[l] = std::min(load, 1e-3 * std::max(0, k % 6 - 1));
      if (int(e.by[l]) == int(kernels::DepthBy::gap)) e.friction_load[l] = 0;
      cell.push_back(load > 0 ? k % 7 : -1);
    }
  }
  kernels::LayerPoints of(const Press& press) {
    return {&press.shape, &press.body, press.law, points.data(), eights()};
  }
};

TEST(LayerKernels, ForcesAreThoseOfPlainNumbers) {
  for (const KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    int slipping = 0, sticking = 0;
    for (const Pressing& of : kPressing) {
      SCOPED_TRACE(of.name);
      Random random(7);
      const Press press(of, random);
      Loaded loaded(*table, press);
      double wrench[6] = {};
      table->add_layer_forces(loaded.of(press), wrench);
      kernels::Vec6<double> sum = kernels::zero6<double>();
      kernels::with_distance<double>(of.shape, of.size, [&](const auto& shape) {
        for (int k = 0; k < loaded.count; ++k) {
          const auto p = loaded.at(k);
          if (!(p.load > 0)) continue;
          const auto plain = layer_friction(shape, press.shape, press.body.touch, p.xi, p.by,
                                            p.anchor, p.at.slant);
          EXPECT_NEAR(p.normal, plain.normal, 1e-12);
          expect_near(p.friction, plain.ratio, 1e-9);
          const double size = std::sqrt(dot(plain.ratio, plain.ratio));
          ++(size > 0.49 ? slipping : sticking);
          const Vec3<double> f = p.load * p.at.slant + p.friction_load * plain.ratio;
          sum += {cross(p.at.place, f), f};
        }
      });
      for (int i = 0; i < 6; ++i) EXPECT_NEAR(wrench[i], (&sum.a.x)[i], 1e-12);
    }
    EXPECT_GT(slipping, 10);
    EXPECT_GT(sticking, 10);
  }
}

using D = kernels::Dual<double>;

/// A body that moves along one of the twelve directions.
LayerBody<D> moved(const LayerBody<double>& body, int direction) {
  const auto unit = [direction](int first) {
    const auto one = [&](int i) { return direction == first + i ? 1.0 : 0.0; };
    return Vec3<double>{one(0), one(1), one(2)};
  };
  const auto lifted = [](const Vec3<double>& x, const Vec3<double>& dot) {
    return Vec3<D>{{x.x, dot.x}, {x.y, dot.y}, {x.z, dot.z}};
  };
  const kernels::Touch<double>& t = body.touch;
  LayerBody<D> out;
  const kernels::Mat3<double> turned = kernels::skew(unit(0)) * t.Q;
  for (int i = 0; i < 9; ++i)
    out.touch.Q.m[i / 3][i % 3] = {t.Q.m[i / 3][i % 3], turned.m[i / 3][i % 3]};
  out.touch.c = lifted(t.c, unit(3) + cross(unit(0), t.c));
  out.touch.omega = lifted(t.omega, unit(6)), out.touch.v = lifted(t.v, unit(9));
  out.touch.law = transformed(t.law, [](double x) { return D(x); });
  out.size = lifted(body.size, {0, 0, 0});
  return out;
}

/// Slopes along one direction: of the wrench where no cell yields, and of the depths by cell.
struct Expected {
  kernels::Vec6<double> wrench = kernels::zero6<double>();
  double depth[7] = {};
};
Expected expected_slopes(const Press& press, const Loaded& loaded, int direction) {
  Expected out;
  const LayerBody<D> body = moved(press.body, direction);
  kernels::with_distance<D>(press.shape.shape, body.size, [&](const auto& shape) {
    for (int k = 0; k < loaded.count; ++k) {
      const auto p = loaded.at(k);
      if (!(p.load > 0)) continue;
      const Vec3<D> xi = kernels::broadcast<D>(p.xi);
      const auto at = contact_depth(shape, body.touch, xi, press.law,
                                    kernels::down_in_shape(body.touch, press.law.outward));
      const kernels::Anchor<D> anchor = {kernels::broadcast<D>(p.anchor.b),
                                         kernels::broadcast<D>(p.anchor.a), p.anchor.gap};
      const auto friction =
          layer_friction(shape, press.shape, body.touch, xi, at.by, anchor, at.at.slant);
      const double rise = loaded.stiffness * at.at.depth.epsilon;
      const D load(p.load, rise), friction_load(p.friction_load, p.friction_load > 0 ? rise : 0);
      const Vec3<D> f = load * at.at.slant + friction_load * friction.ratio;
      const Vec3<D> moment = cross(at.at.place, f);
      out.wrench += {{moment.x.epsilon, moment.y.epsilon, moment.z.epsilon},
                     {f.x.epsilon, f.y.epsilon, f.z.epsilon}};
      out.depth[k % 7] += at.at.depth.epsilon;
    }
  });
  return out;
}

TEST(LayerKernels, SlopesMatchDualNumbers) {
  for (const KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    for (const Pressing& of : kPressing) {
      SCOPED_TRACE(of.name);
      Random random(13);
      const Press press(of, random);
      Loaded loaded(*table, press);
      double wrench[6] = {}, rows[6][kernels::kLayerDirections] = {};
      AlignedVector<double> cells(7 * kernels::kCellNumbers, 0.0);
      table->add_layer_forces(loaded.of(press), wrench);
      table->add_layer_slopes(
          {loaded.of(press), loaded.stiffness, loaded.cell.data(), cells.data(), &rows[0][0]});
      for (int k = 0; k < kernels::kLayerDirections; ++k) {
        const Expected expected = expected_slopes(press, loaded, k);
        const double* const w = &expected.wrench.a.x;
        double scale = 0;
        for (int r = 0; r < 6; ++r) scale = std::max(scale, std::abs(w[r]));
        for (int r = 0; r < 6; ++r) EXPECT_NEAR(rows[r][k], w[r], 1e-9 * scale) << r << ' ' << k;
        for (int c = 0; c < 7; ++c)
          EXPECT_NEAR(cells[std::size_t(c * kernels::kCellNumbers + kernels::kCellWrench + k)],
                      expected.depth[c], 1e-9 * std::abs(expected.depth[c]) + 1e-12);
      }
    }
  }
}

/// The system of a layer of n cells, some of whose points press.
struct System {
  int n;
  std::vector<double> M, factor, x;
  std::vector<int> cell;  // and counts
  AlignedVector<double> cells, work;

  explicit System(int size)
      : n(size),
        M(std::size_t(n * n)),
        x(std::size_t(n)),
        cells(std::size_t(2 * n * kernels::kCellNumbers)),
        work(std::size_t(n * kernels::kCellWrench)) {
    Random random(3);
    for (int a = 0; a < n; ++a) {
      for (int b = 0; b <= a; ++b)
        M[std::size_t(a * n + b)] = M[std::size_t(b * n + a)] =
            random.uniform(0, 1) / (1 + (a - b) * (a - b)) + (a == b ? 3 : 0);
      x[std::size_t(a)] = random.normal();
      cell.push_back(2 * a + a % 2), cell.push_back(1 + a % 3);
      for (int i = 0; i < kernels::kCellNumbers; ++i)
        cells[std::size_t(cell[std::size_t(2 * a)] * kernels::kCellNumbers + i)] = random.normal();
    }
    factor = M;
  }
  std::vector<double> product(const std::vector<double>& y) const {
    std::vector<double> out(y.size());
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b)
        out[std::size_t(a)] += M[std::size_t(a * n + b)] * y[std::size_t(b)];
    return out;
  }
};

TEST(LayerKernels, SystemsHaveTheSameBitsEverywhere) {
  for (const int n : {1, 4, 7, 23, 64}) {
    SCOPED_TRACE(n);
    std::vector<double> first, product;
    for (const KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(table->name);
      System s(n);
      const std::vector<double> b = s.x;
      table->factor_layer(s.factor.data(), n);
      table->solve_layer(s.factor.data(), n, s.x.data());
      const std::vector<double> back = s.product(s.x);
      for (int a = 0; a < n; ++a) EXPECT_NEAR(back[std::size_t(a)], b[std::size_t(a)], 1e-13);
      std::vector<int> all;
      for (int a = 0; a < n; ++a) all.push_back(a);
      std::vector<double> out(b.size());
      table->couple_cells({s.M.data(), n, all.data(), b.data(), n, all.data(), n, out.data()});
      const std::vector<double> plain = s.product(b);
      for (int a = 0; a < n; ++a) EXPECT_NEAR(out[std::size_t(a)], plain[std::size_t(a)], 1e-13);
      if (first.empty()) first = s.x, product = out;
      EXPECT_EQ(s.x, first);
      EXPECT_EQ(out, product);
    }
  }
}

// Σ (v y_i - A_i) m_i with M y = A/n, as it is written.
TEST(LayerKernels, YieldSlopesAreThoseOfASolution) {
  for (const int n : {1, 3, 4, 23}) {
    SCOPED_TRACE(n);
    for (const KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(table->name);
      System s(n);
      table->factor_layer(s.factor.data(), n);
      double rows[6][kernels::kLayerDirections] = {};
      constexpr double kWhole = 1.7;
      table->add_yield_slopes({s.factor.data(), n, s.cell.data(), s.cell.data() + 1, 2, kWhole,
                               s.cells.data(), s.work.data(), &rows[0][0]});
      for (int r = 0; r < 6; ++r) {
        const auto number = [&](int a, int i) {
          return s.cells[std::size_t(s.cell[std::size_t(2 * a)] * kernels::kCellNumbers + i)];
        };
        const auto count = [&](int a) { return s.cell[std::size_t(2 * a + 1)]; };
        std::vector<double> y;
        for (int a = 0; a < n; ++a) y.push_back(number(a, r) / count(a));
        table->solve_layer(s.factor.data(), n, y.data());
        for (int k = 0; k < kernels::kLayerDirections; ++k) {
          double sum = 0;
          for (int a = 0; a < n; ++a)
            sum += (kWhole * y[std::size_t(a)] - number(a, r)) *
                   number(a, kernels::kCellWrench + k) / count(a);
          EXPECT_NEAR(rows[r][k], sum, 1e-12 * (1 + std::abs(sum)));
        }
      }
    }
  }
}

}  // namespace
}  // namespace tangere
