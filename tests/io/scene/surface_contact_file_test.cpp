// SPDX-License-Identifier: Apache-2.0
// Contacts of surfaces in scene files: what they become, what is refused, units, numbers that vary,
// and skins of the same material.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "engine/derivative/number_gradients.hpp"
#include "engine/scene/mass_properties.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A rod over a box on the ground. `units`: the option; lengths are in those of the file.
std::string rod_over_box(const std::string& contact, const std::string& units = "m-kg",
                         const std::string& more = "") {
  const bool metres = units == "m-kg";
  const auto length = [&](double metre) { return std::to_string(metres ? metre : 100 * metre); };
  return "<tangere model=\"m\"><option unit=\"" + units +
         "\"/><ground/>\n<robot><link name=\"box\">"
         "<joint name=\"box\" type=\"free3d\" pos=\"0 0 " +
         length(0.02) +
         "\"/>\n"
         "<body name=\"box\" type=\"cuboid\" size=\"" +
         length(0.1) + " " + length(0.06) + " " + length(0.04) +
         "\" density=\"1000\"/></link></robot>\n<robot><link name=\"rod\">"
         "<joint name=\"rod\" type=\"free3d\" pos=\"0 0 " +
         length(0.06) +
         "\"/>\n"
         "<body name=\"rod\" type=\"cylinder\" radius=\"" +
         length(0.01) + "\" length=\"" + length(0.08) +
         "\" density=\"1000\"/></link></robot>\n"
         "<robot><link name=\"abstract\"><joint name=\"abstract\" type=\"free3d\"/>\n"
         "<body name=\"abstract\" type=\"abstract\" mass=\"1\" inertia=\"1 0 0 1 0 1\"/></link>"
         "</robot>\n<robot><link name=\"wall\"><joint name=\"wall\" type=\"fixed\"/>\n"
         "<body name=\"wall\" type=\"plane\"/></link></robot>\n"
         "<contact>\n" +
         contact + "</contact>" + more + "</tangere>";
}

std::string refused_contact(const std::string& contact) {
  try {
    parse_scene(rod_over_box(contact), "s.xml");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(SurfaceContactFile, BecomesPointsWithAreas) {
  const SceneFile file = parse_scene(
      rod_over_box("<surface_contact body1=\"rod\" body2=\"box\" kn=\"1e8\" mu=\"0.5\"/>\n"
                   "<surface_contact body1=\"box\" body2=\"ground\" kn=\"1e8\" pitch=\"0.01\"/>\n"
                   "<surface_contact body1=\"wall\" body2=\"box\" kn=\"2e8\"/>\n"),
      "s.xml");
  EXPECT_THAT(file.warnings, IsEmpty());
  const auto& pairs = file.scene.pair_contacts;
  ASSERT_EQ(pairs.size(), 4U);
  for (const PairContactDescription& c : pairs) EXPECT_EQ(3 * c.areas.size(), c.points.size());
  const auto area = [&](int k) {
    return std::accumulate(pairs[std::size_t(k)].areas.begin(), pairs[std::size_t(k)].areas.end(),
                           0.0);
  };
  const double box = 2 * (0.1 * 0.06 + 0.1 * 0.04 + 0.06 * 0.04);
  EXPECT_EQ(pairs[0].general_body, "rod");
  EXPECT_NEAR(area(0), 0.5 * 2 * M_PI * 0.01 * 0.09, 1e-9) << "both have half of the stiffness";
  EXPECT_TRUE(pairs[1].second_half);
  EXPECT_NEAR(area(1), 0.5 * box, 1e-9);
  EXPECT_TRUE(pairs[2].on_ground);
  EXPECT_NEAR(area(2), box, 1e-9);
  EXPECT_EQ(pairs[3].general_body, "box") << "a plane has no points";
  EXPECT_EQ(unit_of(file.scene, first_number(pairs[0])), "N/m^3");
}

TEST(SurfaceContactFile, TwoShapesWithFacesShareTheStiffness) {
  std::string text = rod_over_box("<surface_contact body1=\"rod\" body2=\"box\" kn=\"1e8\"/>\n");
  text.replace(text.find("type=\"cylinder\""), 15, "type=\"cuboid\" size=\"0.02 0.02 0.02\"");
  text.replace(text.find("radius=\"0.010000\" length=\"0.080000\" "), 36, "");
  const Scene scene = parse_scene(text, "s.xml").scene;
  ASSERT_EQ(scene.pair_contacts.size(), 2U);
  EXPECT_TRUE(scene.pair_contacts[1].second_half);
  double area = 0;
  for (const double a : scene.pair_contacts[0].areas) area += a;
  EXPECT_NEAR(area, 0.5 * 6 * 0.02 * 0.02, 1e-12);
  // One contact has one number of each kind.
  const Model model(scene);
  const NumberGradients numbers(model);
  EXPECT_EQ(std::ranges::count_if(numbers.infos(),
                                  [](const NumberInfo& i) {
                                    return i.number.owner == NumberOwner::contact &&
                                           i.number.field == NumberField::kn;
                                  }),
            1);
}

TEST(SurfaceContactFile, UnitsOfCentimetresAndGrams) {
  // 1 N/m³ = 1e3 g cm/s² / (1e2 cm · 1e4 cm²) and so on.
  const std::string metre =
      "<surface_contact body1=\"rod\" body2=\"box\" kn=\"1e8\" kt=\"1e6\" mu=\"0.5\" "
      "damping=\"1e7\" ks=\"1e5\" pitch=\"0.002\"/>\n";
  const std::string centimetre =
      "<surface_contact body1=\"rod\" body2=\"box\" kn=\"1e7\" kt=\"1e5\" mu=\"0.5\" "
      "damping=\"1e4\" ks=\"1e4\" pitch=\"0.2\"/>\n";
  const Scene m = parse_scene(rod_over_box(metre), "s.xml").scene,
              cm = parse_scene(rod_over_box(centimetre, "cm-g"), "s.xml").scene;
  ASSERT_EQ(m.pair_contacts[0].areas.size(), cm.pair_contacts[0].areas.size());
  for (std::size_t k = 0; k < kCoefficients; ++k)
    EXPECT_NEAR(m.pair_contacts[0].coefficients[k] / cm.pair_contacts[0].coefficients[k], 1, 1e-12)
        << k;
}

TEST(SurfaceContactFile, WhatCannotTouchIsRefusedWithItsLine) {
  const auto contact = [](const std::string& attributes) {
    return refused_contact("<surface_contact " + attributes + "/>\n");
  };
  EXPECT_THAT(contact("body1=\"rod\" body2=\"rod\" kn=\"1\""),
              AllOf(HasSubstr("s.xml:11: "), HasSubstr("body 'rod' against itself")));
  EXPECT_THAT(contact("body1=\"rod\" body2=\"bx\" kn=\"1\""),
              AllOf(HasSubstr("no body has this name"), HasSubstr("'box'")));
  EXPECT_THAT(contact("body1=\"rod\" body2=\"grund\" kn=\"1\""),
              HasSubstr("did you mean 'ground'"));
  EXPECT_THAT(contact("body1=\"rod\" body2=\"abstract\" kn=\"1\""),
              HasSubstr("'abstract' is an abstract body, which has no surface"));
  EXPECT_THAT(contact("body1=\"wall\" body2=\"ground\" kn=\"1\""), HasSubstr("have no end"));
  EXPECT_THAT(contact("body1=\"rod\" body2=\"box\""),
              AllOf(HasSubstr("kn=\"0\"; expected a positive stiffness by area"),
                    HasSubstr("0.1 percent of its width deep")));
  EXPECT_THAT(contact("body1=\"rod\" body2=\"box\" kn=\"1\" law=\"linear\""), HasSubstr("law"));
  EXPECT_THAT(contact("body1=\"rod\" body2=\"box\" kn=\"1\" pitch=\"0\""), HasSubstr("pitch"));
  EXPECT_THAT(contact("body1=\"rod\" body2=\"box\" kn=\"1\" mu=\"-1\""), HasSubstr("mu"));
  EXPECT_THAT(refused_contact("<surface_contact body1=\"rod\" body2=\"box\" kn=\"1e8\"/>\n"
                              "<surface_contact body1=\"box\" body2=\"rod\" kn=\"1e8\"/>\n"),
              HasSubstr("'box' and 'rod' touch already (line 11)"));
  EXPECT_THAT(contact("body1=\"ground\" body2=\"rod\" kn=\"1\""),
              HasSubstr("expected the ground as body2"));
  EXPECT_THAT(contact("body1=\"rod\" body2=\"box\" kn=\"1\" pitch=\"1e-6\""),
              AllOf(HasSubstr("points; expected"), HasSubstr("or more")));
}

TEST(SurfaceContactFile, ATooStiffContactOfABallIsTold) {
  EXPECT_THAT(parse_scene(rod_over_box("<surface_contact body1=\"rod\" body2=\"ground\" "
                                       "kn=\"1e14\"/>\n"),
                          "s.xml")
                  .warnings,
              ElementsAre(AllOf(HasSubstr("s.xml:11: <surface_contact>: the "),
                                HasSubstr("points of 'rod' are"),
                                HasSubstr("expected a smaller kn, or a pitch of"))));
}

TEST(SurfaceContactFile, BothHalvesVaryTogetherInEitherOrder) {
  for (const char* const order : {"body1=\"rod\" body2=\"box\"", "body1=\"box\" body2=\"rod\""}) {
    const Scene scene =
        parse_scene(
            rod_over_box("<surface_contact body1=\"rod\" body2=\"box\" kn=\"1e8\"/>\n", "m-kg",
                         std::string("<randomize><surface_contact ") + order +
                             " field=\"kn\" uniform=\"1e8 3e8\"/></randomize>"),
            "s.xml")
            .scene;
    ASSERT_EQ(scene.randomizations.size(), 1U);
    EXPECT_EQ(scene.randomizations[0].number.name, "rod");
    EXPECT_EQ(scene.randomizations[0].number.second_name, "box");
    const Model model(scene);
    Batch batch(model, 3, 1);
    EXPECT_NE(batch.randomized_value(0, 0), batch.randomized_value(1, 0));
    EXPECT_GE(batch.randomized_value(2, 0), 1e8);
  }
}

/// The sum of the normal forces that a skin reads under an object that lies on it, over the
/// object's weight. `object`: attributes of its body.
double felt_share(const std::string& object, double top) {
  const std::string text =
      "<tangere model=\"m\"><option unit=\"m-kg\" gravity=\"0 0 -10\" timestep=\"1e-3\" "
      "integrator=\"BDF2\"/>\n<robot><link name=\"pad\"><joint name=\"pad\" type=\"fixed\"/>\n"
      "<body name=\"pad\" type=\"cuboid\" size=\"0.06 0.06 0.01\" pos=\"0 0 -0.005\"/></link>"
      "</robot>\n<robot><link name=\"object\"><joint name=\"object\" type=\"prismatic\" "
      "axis=\"0 0 1\" pos=\"0.0013 0.0007 " +
      std::to_string(top) + "\"/>\n<body name=\"object\" " + object +
      " density=\"2000\"/></link></robot>\n<contact><surface_contact body1=\"pad\" "
      "body2=\"object\" kn=\"1e8\" mu=\"0.5\" damping=\"1e9\"/></contact>\n"
      "<sensor><tactile name=\"skin\" body=\"pad\" type=\"rect_array\" per=\"area\" "
      "rect_pos0=\"-0.0298 -0.0298 0.005\" rect_pos1=\"0.0298 0.0298 0.005\" axis0=\"1 0 0\" "
      "axis1=\"0 1 0\" resolution=\"150 150\" kn=\"1e8\" mu=\"0.5\" damping=\"1e9\"/></sensor>"
      "</tangere>";
  const SceneFile file = parse_scene(text, "s.xml");
  EXPECT_THAT(file.warnings, IsEmpty());
  const Model model(file.scene);
  Stepper stepper(model);
  Batch batch(model, 1);
  for (int k = 0; k < 800; ++k) stepper.step(batch, {});
  std::vector<double> field(3 * std::size_t(model.sensors()[0].points));
  Readout(model).tactile(batch, 0, 0, field);
  double sum = 0;
  for (std::size_t k = 2; k < field.size(); k += 3) sum += std::abs(field[k]);
  const BodyDescription& body = file.scene.links[1].body;
  return sum / (10 * mass_properties(body.shape, body.density).mass);
}

// The skin integrates the depth over the pad, the contact over the object. They differ by the depth
// over the radius of curvature, which is 3 % for the ellipsoid, and by the points.
TEST(SurfaceContactFile, ASkinOfTheSameMaterialFeelsTheForceOfTheContact) {
  EXPECT_NEAR(felt_share("type=\"sphere\" radius=\"0.02\"", 0.02), 1, 0.04);
  EXPECT_NEAR(felt_share("type=\"cylinder\" radius=\"0.015\" length=\"0.04\" "
                         "quat=\"0.7071067811865476 0.7071067811865475 0 0\"",
                         0.015),
              1, 0.04);
  EXPECT_NEAR(felt_share("type=\"capsule\" radius=\"0.015\" length=\"0.03\" "
                         "quat=\"0.7071067811865476 0.7071067811865475 0 0\"",
                         0.015),
              1, 0.04);
  EXPECT_NEAR(felt_share("type=\"ellipsoid\" size=\"0.04 0.03 0.05\"", 0.025), 1, 0.04);
  EXPECT_NEAR(felt_share("type=\"cuboid\" size=\"0.04 0.03 0.02\"", 0.01), 1, 0.04);
  EXPECT_NEAR(felt_share("type=\"cylinder\" radius=\"0.015\" length=\"0.04\"", 0.02), 1, 0.04);
}

}  // namespace
}  // namespace tangere
