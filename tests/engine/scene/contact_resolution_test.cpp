// SPDX-License-Identifier: Apache-2.0
// Tests which contacts count as having too few points, against distances and polygons in closed
// form.
#include "engine/scene/contact_resolution.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::link;

Scene two(const Shape& one, const Shape& other, bool both_ways = false) {
  Scene s;
  s.links = {link("one", JointType::free, {0, 0, 0}, one, 1000),
             link("other", JointType::free, {0, 0, 1}, other, 1000)};
  s.pair_contacts.push_back({"one", "other", {1000, 1, 0.5, 1}, ContactLaw::clamped, 1e-5, {}});
  if (both_ways)
    s.pair_contacts.push_back({"other", "one", {1000, 1, 0.5, 1}, ContactLaw::clamped, 1e-5, {}});
  return s;
}

/// A closed box of eight corners.
MeshShape box_mesh(double half) {
  MeshShape m;
  for (int k = 0; k < 8; ++k)
    for (int c = 0; c < 3; ++c) m.vertices.push_back((k >> c & 1) != 0 ? half : -half);
  m.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                 {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return m;
}

TEST(ContactResolution, GapsAreTheLargestEmptyBallsOfTheSurface) {
  // Half way along a cylinder, between two rows of rim points.
  constexpr double kLength = 0.1, kRadius = 0.01;
  const double beside = 2 * kRadius * std::sin(std::numbers::pi / 16),
               gap = 2 * std::hypot(kLength / 2, beside);
  EXPECT_NEAR(contact_point_gap(CylinderShape{kLength, kRadius, 8, 3}), gap, 0.03 * gap);
  // In the middle of a face of a mesh of eight corners.
  EXPECT_NEAR(contact_point_gap(box_mesh(0.03)), 2 * 0.03 * std::sqrt(2), 0.005);
  EXPECT_NEAR(contact_point_gap(CuboidShape{{0.1, 0.2, 0.3}, {3, 3, 4}}), 0.1, 1e-15);
  EXPECT_EQ(contact_point_gap(SphereShape{0.1}), 0);
  // Points of an ellipsoid are evenly spread: four times as many are half as far apart.
  const double few = contact_point_gap(EllipsoidShape{{0.1, 0.1, 0.1}, 100}),
               many = contact_point_gap(EllipsoidShape{{0.1, 0.1, 0.1}, 400});
  EXPECT_NEAR(many, few / 2, 0.15 * few);
}

TEST(ContactResolution, NamesContactsWhoseBodiesFitBetweenPoints) {
  const CuboidShape finger{{0.01, 0.02, 0.02}};
  const auto found = [](const Scene& s) {
    return coarse_contacts(s, ComparedWidth::second).size();
  };
  EXPECT_EQ(found(two(CylinderShape{0.1, 0.015}, finger)), 1U);
  EXPECT_EQ(found(two(finger, CylinderShape{0.1, 0.015})), 0U);
  EXPECT_EQ(found(two(CylinderShape{0.1, 0.015}, finger, true)), 0U) << "the finger's points do";
  EXPECT_EQ(found(two(CapsuleShape{0.1, 0.01}, finger)), 1U);
  EXPECT_EQ(found(two(EllipsoidShape{{0.3, 0.3, 0.3}, 20}, finger)), 1U);
  EXPECT_EQ(found(two(box_mesh(0.03), finger)), 1U);
  EXPECT_EQ(found(two(box_mesh(0.03), box_mesh(0.01))), 1U);
  EXPECT_EQ(found(two(box_mesh(0.03), SphereShape{0.02})), 1U);
  const CuboidShape along_x{{0.4, 0.02, 0.01}, {2, 2, 2}}, along_y{{0.02, 0.4, 0.01}, {2, 2, 2}};
  EXPECT_EQ(found(two(along_x, along_y, true)), 2U) << "crossed planks, both ways";
  const auto cube = [](int n) { return CuboidShape{{0.05, 0.05, 0.05}, {n, n, n}}; };
  EXPECT_EQ(found(two(cube(3), cube(3))), 1U) << "one row of points is not in the rims";
  EXPECT_EQ(found(two(cube(4), cube(4))), 0U);
  const CuboidShape card{{0.06, 0.1, 0.002}, {7, 10, 2}};
  EXPECT_EQ(found(two(card, card)), 0U) << "the thickness needs two rows alone";
  Scene idle = two(CylinderShape{0.1, 0.015}, finger);
  idle.pair_contacts[0].coefficients = {};
  EXPECT_EQ(found(idle), 0U) << "it never pushes";
  // A plate that falls on its edge fits between points that it lies on when flat.
  const Scene plate = two(CuboidShape{{0.1, 0.1, 0.1}, {3, 3, 3}}, CuboidShape{{0.002, 0.1, 0.1}});
  EXPECT_EQ(found(plate), 0U);
  EXPECT_EQ(coarse_contacts(plate, ComparedWidth::smallest).size(), 1U);
  EXPECT_THAT(coarse_contact_lines(two(CylinderShape{0.1, 0.015}, finger)).front(),
              HasSubstr("up to 0.101 m apart, and 'other' is 0.02 m across"));
}

/// A polygon of as many corners as the line names stands out by no more than the body sinks in, and
/// one of fewer corners by more.
TEST(ContactResolution, SaysHowManyPointsRollingNeeds) {
  Scene s;
  s.ground = GroundDescription{};
  constexpr double kRadius = 0.05, kLength = 0.1, kKn = 2000;
  s.ground_contacts.push_back({"body", {kKn, 1, 0.5, 1}, ContactLaw::linear, 1e-5, {}});
  const Quaternion kLying = {std::sqrt(0.5), std::sqrt(0.5), 0, 0};
  const auto with = [&](int around) {
    s.links = {
        link("body", JointType::free, {0, 0, 0}, CylinderShape{kLength, kRadius, around, 3}, 500)};
    s.links[0].joint.pose.orientation = kLying;
    return polygonal_rolling_lines(s);
  };
  const double mass = 500 * std::numbers::pi * kRadius * kRadius * kLength,
               depth = mass * 9.8 / (2 * kKn);
  int enough = 3;
  while (kRadius * (1 - std::cos(std::numbers::pi / enough)) > depth) ++enough;
  ASSERT_GT(enough, 8);
  ASSERT_EQ(with(8).size(), 1U);
  EXPECT_THAT(with(8).front(), HasSubstr("of " + std::to_string(enough) + " or more"));
  EXPECT_EQ(with(enough - 1).size(), 1U);
  EXPECT_THAT(with(enough), IsEmpty());
  // Nothing rolls that stands on its end, or that does not move freely.
  with(8);
  s.links[0].joint.type = JointType::prismatic;
  EXPECT_THAT(polygonal_rolling_lines(s), IsEmpty());
  s.links[0].joint.type = JointType::free;
  s.links[0].joint.pose.orientation = {1, 0, 0, 0};
  EXPECT_THAT(polygonal_rolling_lines(s), IsEmpty());
  // A cuboid is ground as well.
  s.links[0].joint.pose.orientation = kLying;
  s.ground_contacts.clear();
  s.links.push_back(link("floor", JointType::fixed, {0, 0, 0}, CuboidShape{{1, 1, 0.1}}, 500));
  s.pair_contacts.push_back({"body", "floor", {kKn, 1, 0.5, 1}, ContactLaw::clamped, {}, {}});
  ASSERT_EQ(polygonal_rolling_lines(s).size(), 1U);
  EXPECT_THAT(polygonal_rolling_lines(s).front(),
              HasSubstr("touches 'floor' with 8 points around"));
}

}  // namespace
}  // namespace tangere
