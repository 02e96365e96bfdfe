// SPDX-License-Identifier: Apache-2.0
// Tests bodies' shapes: mass by integration along the axis, positions of contact points, rest on
// others.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "engine/scene/mass_properties.hpp"
#include "engine/scene/shapes.hpp"
#include "kernels/contact/distance.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;
using testing::v_of;

TEST(Shapes, TheTableIsInOrder) {
  ASSERT_EQ(shape_rows().size(), std::variant_size_v<Shape>);
  for (std::size_t k = 0; k < shape_rows().size(); ++k) {
    const ShapeRow& row = shape_rows()[k];
    const Shape shape = row.make();
    EXPECT_EQ(shape.index(), k) << row.name;
    EXPECT_EQ(&row_of(shape), &row);
    if (row.distance) {
      EXPECT_EQ(&row_of(*row.distance), &row);
    }
    EXPECT_EQ(row.mass_by_size != nullptr, !row.sizes.empty()) << row.name;
  }
}

/// Sums discs of radius R(z) piece by piece with Simpson's rule: mass, I_xx, I_zz.
std::array<double, 3> integrate(double density, const std::vector<double>& pieces,
                                const std::function<double(double)>& R) {
  std::array<double, 3> sum{};
  constexpr int kCells = 400;
  for (std::size_t p = 0; p + 1 < pieces.size(); ++p)
    for (int k = 0; k <= 2 * kCells; ++k) {
      const double width = pieces[p + 1] - pieces[p], z = pieces[p] + width * k / (2 * kCells);
      const double weight = width / (6 * kCells) *
                            (k == 0 || k == 2 * kCells ? 1
                             : k % 2 == 1              ? 4
                                                       : 2);
      const double area = M_PI * R(z) * R(z), disc = density * weight * area;
      sum[0] += disc;
      sum[1] += disc * (R(z) * R(z) / 4 + z * z);
      sum[2] += disc * R(z) * R(z) / 2;
    }
  return sum;
}

void expect_mass(const Shape& shape, double density, const std::array<double, 3>& expected) {
  const MassProperties p = mass_properties(shape, density);
  EXPECT_NEAR(p.mass, expected[0], 1e-12 * expected[0]);
  EXPECT_NEAR(p.inertia.m[0][0], expected[1], 1e-10 * expected[1]);
  EXPECT_NEAR(p.inertia.m[1][1], expected[1], 1e-10 * expected[1]);
  EXPECT_NEAR(p.inertia.m[2][2], expected[2], 1e-10 * expected[2]);
  EXPECT_EQ(p.inertia.m[0][1], 0);
  EXPECT_EQ(dot(p.centre, p.centre), 0);
}

TEST(Shapes, MassAndInertiaAreTheIntegrals) {
  const auto cap = [](double r, double beyond) {
    return std::sqrt(std::max(0.0, r * r - beyond * beyond));
  };
  expect_mass(CylinderShape{0.3, 0.07}, 800,
              integrate(800, {-0.15, 0.15}, [](double) { return 0.07; }));
  for (const double length : {0.3, 0.01})
    expect_mass(
        CapsuleShape{length, 0.07}, 800,
        integrate(800, {-length / 2 - 0.07, -length / 2, length / 2, length / 2 + 0.07},
                  [&](double z) { return cap(0.07, std::max(0.0, std::abs(z) - length / 2)); }));
  expect_mass(SphereShape{0.07}, 800,
              integrate(800, {-0.07, 0.07}, [&](double z) { return cap(0.07, z); }));
  EXPECT_EQ(mass_properties(PlaneShape{}, 800).mass, 0);
}

TEST(Shapes, AnEllipsoidsMassIsTheIntegral) {
  const double size[3] = {0.3, 0.2, 0.07}, c = size[2] / 2, density = 800;
  std::array<double, 4> sum{};
  constexpr int kCells = 400;  // elliptic discs, by Simpson's rule
  for (int k = 0; k <= 2 * kCells; ++k) {
    const double z = c * (double(k) / kCells - 1), shrink = 1 - z * z / (c * c);
    const double a2 = size[0] * size[0] / 4 * shrink, b2 = size[1] * size[1] / 4 * shrink;
    const double weight = c / (3 * kCells) * (k == 0 || k == 2 * kCells ? 1 : k % 2 == 1 ? 4 : 2);
    const double disc = density * weight * M_PI * size[0] * size[1] / 4 * shrink;
    sum[0] += disc;
    sum[1] += disc * (b2 / 4 + z * z);
    sum[2] += disc * (a2 / 4 + z * z);
    sum[3] += disc * (a2 + b2) / 4;
  }
  const MassProperties p = mass_properties(EllipsoidShape{{size[0], size[1], size[2]}}, density);
  EXPECT_NEAR(p.mass, sum[0], 1e-12 * sum[0]);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(p.inertia.m[i][i], sum[i + 1], 1e-9 * sum[i + 1]);
}

Shape off_centre_mesh() {
  MeshShape mesh = testing::cuboid_mesh({0.15, 0.1, 0.05});
  for (double& x : mesh.vertices) x += 0.04;
  mesh.scale = 1.3;
  return mesh;
}

TEST(Shapes, InertiaIsThatOfTheMass) {
  const double r = 0.02, l = 0.05, m = 3;
  using Six = std::array<double, 6>;
  const auto expect = [](const Shape& shape, double mass, const Six& inertia) {
    const Six has = solid_inertia(shape, mass);
    for (std::size_t k = 0; k < 6; ++k)
      EXPECT_NEAR(has[k], inertia[k], 1e-15) << shape_name(shape) << " " << k;
  };
  expect(SphereShape{r}, m, {0.4 * m * r * r, 0, 0, 0.4 * m * r * r, 0, 0.4 * m * r * r});
  expect(CuboidShape{{0.1, 0.2, 0.3}}, m, {m * 0.13 / 12, 0, 0, m * 0.1 / 12, 0, m * 0.05 / 12});
  // Volumes over pi r²: of the cylinder l, of both half balls 4 r/3.
  const double tube = m * l / (l + 4 * r / 3), balls = m - tube;
  const double across = tube * (l * l / 12 + r * r / 4) +
                        balls * (0.4 * r * r + l * l / 4 + 0.375 * l * r),
               along = tube * r * r / 2 + 0.4 * balls * r * r;
  expect(CapsuleShape{l, r}, m, {across, 0, 0, across, 0, along});
  expect(AbstractShape{2, {1, 2, 3, 4, 5, 6}, {}}, 2, {1, 2, 3, 4, 5, 6});
  expect(PlaneShape{}, 0, {});
}

TEST(Shapes, DistancesAreForPicturesToo) {
  const SurfaceDistance at =
      distance_from(CuboidShape{{0.1, 0.2, 0.3}}, {0.01, 0.02, 0.25}).value();
  EXPECT_NEAR(at.distance, 0.1, 1e-15);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(at.normal[k], k == 2 ? 1 : 0, 1e-15);
  EXPECT_NEAR(distance_from(EllipsoidShape{{0.1, 0.2, 0.3}}, {0, 0, 0.15}).value().distance, 0,
              1e-15);
  EXPECT_FALSE(distance_from(AbstractShape{}, {}));
  EXPECT_FALSE(distance_from(MeshShape{}, {}));
  EXPECT_EQ(widths(CapsuleShape{0.3, 0.1}), (std::array<double, 3>{0.2, 0.2, 0.5}));
  EXPECT_EQ(widths(PlaneShape{}), (std::array<double, 3>{0, 0, 0}));
}

TEST(Shapes, MassesFollowSizes) {
  for (const Shape& shape : {Shape(SphereShape{0.07}), Shape(CuboidShape{{0.3, 0.2, 0.1}}),
                             Shape(CylinderShape{0.3, 0.07}), Shape(CapsuleShape{0.3, 0.07}),
                             Shape(EllipsoidShape{{0.3, 0.2, 0.1}}), off_centre_mesh()})
    for (int which = 0; which < kSizeIndices; ++which) {
      Shape more = shape, less = shape;
      if (size_number(more, which) == nullptr) continue;
      *size_number(more, which) += 1e-6, *size_number(less, which) -= 1e-6;
      const MassProperties slope = mass_properties_by_size(shape, 800, which),
                           up = mass_properties(more, 800), down = mass_properties(less, 800);
      EXPECT_NEAR(slope.mass, (up.mass - down.mass) / 2e-6, 1e-6 * std::abs(slope.mass));
      EXPECT_NEAR(slope.centre.x, (up.centre.x - down.centre.x) / 2e-6, 1e-7);
      EXPECT_NEAR(slope.centre.z, (up.centre.z - down.centre.z) / 2e-6, 1e-7);
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(slope.inertia.m[i][i], (up.inertia.m[i][i] - down.inertia.m[i][i]) / 2e-6,
                    1e-7 * up.mass)
            << shape_name(shape) << " number " << which;
    }
}

/// Expects every contact point on the surface of its own body, to rounding.
void expect_on_surface(const Shape& shape, PrimitiveShape kind, const kernels::Vec3<double>& size) {
  const std::vector<double> p = contact_points(shape);
  for (std::size_t k = 0; k < p.size(); k += 3)
    kernels::with_distance<double>(kind, size, [&](const auto& s) {
      EXPECT_NEAR(distance_at(s, kernels::Vec3<double>{p[k], p[k + 1], p[k + 2]}).d, 0, 1e-16)
          << "point " << k / 3;
    });
}

bool holds(const std::vector<double>& points, double x, double y, double z) {
  for (std::size_t k = 0; k < points.size(); k += 3)
    if (std::hypot(points[k] - x, points[k + 1] - y, points[k + 2] - z) < 1e-16) return true;
  return false;
}

TEST(Shapes, CylinderPointsAreCentresAndRingsOfItsFaces) {
  const CylinderShape shape{0.2, 0.06, 6, 3};
  const std::vector<double> p = contact_points(shape);
  ASSERT_EQ(p.size(), 3U * 2 * (1 + 6 * 3));
  expect_on_surface(shape, PrimitiveShape::cylinder, {0.06, 0.1, 0});
  for (const double z : {-0.1, 0.1}) {
    EXPECT_TRUE(holds(p, 0, 0, z));
    for (const double r : {0.02, 0.04, 0.06}) {
      EXPECT_TRUE(holds(p, r, 0, z)) << r;  // angles start along x
      EXPECT_TRUE(holds(p, -r, 0, z)) << r;
      EXPECT_TRUE(holds(p, 0.5 * r, std::sqrt(0.75) * r, z)) << r;
    }
  }
  EXPECT_EQ(contact_points(CylinderShape{1, 1}).size(), 3U * 2 * (1 + 8 * 3));
}

TEST(Shapes, CapsulePointsArePolesAndRings) {
  const CapsuleShape shape{0.2, 0.06, 5, 4};
  const std::vector<double> p = contact_points(shape);
  ASSERT_EQ(p.size(), 3U * (2 + 5 * 4));
  expect_on_surface(shape, PrimitiveShape::capsule, {0.06, 0.1, 0});
  EXPECT_TRUE(holds(p, 0, 0, 0.16));
  EXPECT_TRUE(holds(p, 0, 0, -0.16));
  for (const double z : {-0.1, -0.05, 0.0, 0.05, 0.1}) {
    EXPECT_TRUE(holds(p, 0.06, 0, z)) << z;
    EXPECT_TRUE(holds(p, 0, -0.06, z)) << z;
  }
  EXPECT_EQ(contact_points(CapsuleShape{1, 1}).size(), 3U * (2 + 5 * 4));
  EXPECT_TRUE(holds(contact_points(CapsuleShape{0.2, 0.06, 1, 4}), 0.06, 0, 0));
  EXPECT_TRUE(contact_points(SphereShape{1}).empty());
  EXPECT_TRUE(contact_points(PlaneShape{}).empty());
}

TEST(Shapes, EllipsoidPointsAreSpreadOverIt) {
  const EllipsoidShape shape{{0.2, 0.12, 0.06}, 400};
  const std::vector<double> p = contact_points(shape);
  ASSERT_EQ(p.size(), 3U * 400);
  expect_on_surface(shape, PrimitiveShape::ellipsoid, {0.1, 0.06, 0.03});
  // On the ball from which they are stretched, every cap of a fiftieth of its area has a point.
  for (int k = 0; k < 500; ++k) {
    const double z = 1 - (k + 0.5) / 250, turn = 2.1 * k, across = std::sqrt(1 - z * z);
    double nearest = -1;
    for (std::size_t i = 0; i < p.size(); i += 3)
      nearest = std::max(nearest, (p[i] / 0.1) * across * std::cos(turn) +
                                      (p[i + 1] / 0.06) * across * std::sin(turn) +
                                      (p[i + 2] / 0.03) * z);
    EXPECT_GT(nearest, 1 - 2.0 / 50);
  }
}

/// A cylinder standing on its face sinks into a half-space until the springs of that face carry it.
TEST(Shapes, ACylinderRestsOnAPlane) {
  Scene s;
  s.links = {link("floor", JointType::fixed, {0, 0, 0.5}, PlaneShape{}, 1),
             link("can", JointType::free, {0, 0, 0.5499}, CylinderShape{0.1, 0.03, 6, 2}, 1000)};
  s.pair_contacts.push_back({"can", "floor", {500, 5, 0.5, 100}, ContactLaw::clamped, 1e-5, {}});
  const Model model(s);
  Stepper stepper(model, testing::options(Integrator::bdf1, 0.01));
  Batch batch(model, 1);
  for (int k = 0; k < 400; ++k) stepper.step(batch, {});
  const double depth = model.mass(1) * 9.8 / (13 * 500);
  EXPECT_NEAR(q_of(batch)[2], 0.05 - depth - 0.0499, 1e-9);  // q is relative to the joint's place
  for (const double v : v_of(batch)) EXPECT_NEAR(v, 0, 1e-8);
}

/// A plate on two parallel fixed rods sinks until their four lines of points carry it.
TEST(Shapes, APlateRestsOnRods) {
  for (const Shape& rod : {Shape(CylinderShape{0.4, 0.02}), Shape(CapsuleShape{0.4, 0.02})}) {
    Scene s;
    s.links = {link("left", JointType::fixed, {-0.05, 0, 0}, rod, 1),
               link("right", JointType::fixed, {0.05, 0, 0}, rod, 1),
               link("plate", JointType::free, {0, 0, 0.0249},
                    CuboidShape{{0.1, 0.1, 0.01}, {3, 3, 2}}, 1000)};
    for (LinkDescription& l : s.links)
      if (l.joint.type == JointType::fixed)
        l.body.pose.orientation = {std::sqrt(0.5), std::sqrt(0.5), 0, 0};  // along y
    for (const char* name : {"left", "right"})
      s.pair_contacts.push_back({"plate", name, {300, 5, 0.5, 100}, ContactLaw::clamped, 1e-5, {}});
    const Model model(s);
    Stepper stepper(model, testing::options(Integrator::bdf1, 0.01));
    Batch batch(model, 1);
    for (int k = 0; k < 400; ++k) stepper.step(batch, {});
    EXPECT_NEAR(q_of(batch)[2], 0.0001 - model.mass(2) * 9.8 / (6 * 300), 1e-9);
    for (const double v : v_of(batch)) EXPECT_NEAR(v, 0, 1e-8);
  }
}

/// A pad pressed on a rod reads the rod's shape: peak depth, no shear, symmetry, and zero where
/// nothing touches.
TEST(Shapes, APadReadsTheRodsItLiesOn) {
  for (const Shape& rod : {Shape(CylinderShape{0.032, 0.02}), Shape(CapsuleShape{0.032, 0.02})}) {
    Scene s;
    s.links = {link("pad", JointType::translational, {0, 0, 0.0245},
                    CuboidShape{{0.05, 0.05, 0.01}, {5, 5, 3}}, 1000),
               link("rod", JointType::fixed, {0, 0, 0}, rod, 1000)};
    s.links[1].body.pose.orientation = {std::sqrt(0.5), 0, std::sqrt(0.5), 0};  // along x
    TactileDescription t;
    t.name = t.body = "pad";
    t.coefficients = {100, 0.01, 2, 0};
    t.array = {{-0.025, 0.025, -0.005}, {0.025, -0.025, -0.005}, {0, -1, 0}, {1, 0, 0}, 21, 21};
    s.sensors.push_back(t);
    const Model model(s);
    Readout readout(model);
    const Batch batch(model, 1);
    std::vector<double> force(3 * 441);
    readout.tactile(batch, 0, 0, force);
    for (std::size_t i = 0; i < 21; ++i)
      for (std::size_t j = 0; j < 21; ++j) {
        const double y = 0.025 - 0.0025 * double(i),
                     x = -0.025 + 0.0025 * double(j);  // columns run along the rod
        double d = std::hypot(y, 0.0195) - 0.02;
        if (std::abs(x) > 0.016)
          d = rod.index() == 3 ? std::hypot(y, 0.0195, std::abs(x) - 0.016) - 0.02 : 1;
        const double* f = &force[3 * (21 * i + j)];
        EXPECT_NEAR(std::hypot(f[0], f[1], f[2]), 100 * std::max(0.0, -d), 1e-12) << x << " " << y;
      }
  }
}

}  // namespace
}  // namespace tangere
