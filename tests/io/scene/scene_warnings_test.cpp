// SPDX-License-Identifier: Apache-2.0
// Every way in which a sensor stays silent, or tells of forces that are not there, is told when the
// scene is read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A finger of 20 × 20 × 20 mm with a skin, another one, and an object between them.
struct Grasp {
  std::string object = "type=\"cuboid\" size=\"0.02 0.02 0.02\"", inside_object, inside_finger;
  std::string contact =
      "<general_primitive_contact general_body=\"object\" primitive_body=\"finger\" kn=\"100\"/>";
  std::string corner0 = "-0.008 -0.008 0.01", corner1 = "0.008 0.008 0.01";
  std::string kn = "20", resolution = "5 5";

  [[nodiscard]] std::vector<std::string> warnings() const {
    const auto body = [](const std::string& name, const std::string& shape, const char* at,
                         const std::string& inside = "", const std::string& on = "") {
      return "<robot><link name=\"" + name + "\"><joint name=\"" + name +
             "\" type=\"free3d\" pos=\"0 0 " + at + "\"/><body name=\"" + name + "\" " + shape +
             ">" + inside + "</body>" + on + "</link></robot>\n";
    };
    const std::string finger = "type=\"cuboid\" size=\"0.02 0.02 0.02\"";
    return parse_scene("<tangere><option unit=\"m-kg\"/><ground/>\n" +
                           body("finger", finger, "0", "", inside_finger) +
                           body("thumb", finger, "0.05") +
                           body("object", object, "0.025", inside_object) + "<contact>" + contact +
                           "</contact>\n<sensor><tactile name=\"skin\" body=\"finger\" "
                           "type=\"rect_array\" rect_pos0=\"" +
                           corner0 + "\" rect_pos1=\"" + corner1 +
                           "\" axis0=\"1 0 0\" axis1=\"0 1 0\" resolution=\"" + resolution +
                           "\" kn=\"" + kn + "\"/></sensor></tangere>",
                       "s.xml")
        .warnings;
  }
};

const std::string kOnGround = "<ground_contact body=\"finger\" kn=\"100\"/>";

TEST(SceneWarnings, ASkinThatFeelsWhatTouchesIsWell) { EXPECT_THAT(Grasp{}.warnings(), IsEmpty()); }

/// It could feel the thumb, which no contact names, and cannot feel the object, which touches.
TEST(SceneWarnings, WhatTouchesAndIsNotFeltIsTold) {
  Grasp g;
  g.object = "type=\"abstract\" mass=\"0.1\" inertia=\"1e-5 1e-5 1e-5\"";
  g.inside_object = "<collision radius=\"0.01\" count=\"25\"/>";
  EXPECT_THAT(g.warnings(), ElementsAre(HasSubstr("sensor 'skin' on body 'finger' does not feel "
                                                  "'object', which touches that body")));
  g.contact =
      "<general_primitive_contact general_body=\"finger\" primitive_body=\"thumb\" kn=\"100\"/>";
  EXPECT_THAT(g.warnings(), IsEmpty());
}

TEST(SceneWarnings, TheGroundIsNotFelt) {
  Grasp g;
  g.contact += kOnGround;
  EXPECT_THAT(g.warnings(), ElementsAre(HasSubstr("does not feel the ground, which touches")));
  g.contact = kOnGround;
  EXPECT_THAT(g.warnings(), ElementsAre(::testing::AllOf(HasSubstr("reads forces that nothing"),
                                                         HasSubstr("No sensor feels the ground"))));
}

/// The world has the ground and the thumb, which does not move and is felt.
TEST(SceneWarnings, TheGroundIsNotFeltWhereSurfacesTouchIt) {
  const auto text = [](const char* below) {
    return std::string(R"(<tangere><option unit="m-kg"/><ground/><robot>
      <link name="base"><joint name="base" type="fixed"/>
        <body name="base" type="cuboid" pos="0 0 0.2" size="0.02 0.02 0.02"/>
        <link name="finger"><joint name="finger" type="prismatic" axis="0 0 1"/>
          <body name="finger" type="cuboid" size="0.02 0.02 0.02" density="500"/></link></link>
      </robot><contact><surface_contact body1="finger" body2="ground" kn="1e8" kt="1e6" mu="1"
      damping="1e8"/></contact><sensor><tactile name="skin" body="finger" type="rect_array"
      rect_pos0="-0.008 -0.008 -0.01" rect_pos1="0.008 0.008 -0.01" axis0="1 0 0" axis1="0 -1 0"
      resolution="5 5" kn="1280" feels=")") +
           below + R"("/></sensor></tangere>)";
  };
  EXPECT_THAT(parse_scene(text("base"), "s.xml").warnings,
              ElementsAre(HasSubstr("does not feel the ground, which touches")));
}

TEST(SceneWarnings, PointsBelowOrOffTheSurfaceAreTold) {
  Grasp g;
  g.corner0 = "-0.005 -0.005 0.006";
  g.corner1 = "0.005 0.005 0.006";
  EXPECT_THAT(g.warnings(), ElementsAre(HasSubstr("lies at least 0.004 m below the surface")));
  g.corner0 = "-0.005 -0.005 0.009";
  g.corner1 = "0.005 0.005 0.009";
  EXPECT_THAT(g.warnings(), IsEmpty());  // a millimetre of 20
  g.corner0 = "-0.008 -0.008 1";
  g.corner1 = "0.008 0.008 1";
  EXPECT_THAT(g.warnings(), ElementsAre(HasSubstr("lies at least 0.99 m off that body, which is "
                                                  "0.02 m across")));
}

/// The finger ends at 10 mm, and points are 5 mm apart. A part that is rigidly joined to it carries
/// points, and one that moves does not.
TEST(SceneWarnings, PointsBesideTheFaceAreTold) {
  Grasp g;
  g.corner0 = "-0.01 -0.01 0.012", g.corner1 = "0.01 0.01 0.012";
  EXPECT_THAT(g.warnings(), IsEmpty());  // less than half the distance between points
  g.corner0 = "-0.014 -0.01 0.01", g.corner1 = "0.014 0.01 0.01";
  EXPECT_THAT(g.warnings(), ElementsAre(HasSubstr(
                                "has 10 of 25 points up to 0.004 m off what bodies touch there: "
                                "that body and what is rigidly joined to it")));
  Grasp one;  // a single point has no distance to another
  one.corner0 = one.corner1 = "0.003 0 0.0100001";
  one.resolution = "1 1";
  EXPECT_THAT(one.warnings(), IsEmpty());
  one.corner0 = one.corner1 = "0.003 0 0.011";
  EXPECT_THAT(one.warnings(), ElementsAre(HasSubstr("1 of 1 points up to 0.001 m off")));
  const auto with_part = [&](const char* joint) {
    g.inside_finger = std::string("<link name=\"rim\"><joint name=\"rim\" type=\"") + joint +
                      "\" pos=\"0 0 0.009\" quat=\"0.7071067811865476 0 0 0.7071067811865476\"/>"
                      "<body name=\"rim\" type=\"cuboid\" size=\"0.02 0.03 0.002\"/></link>";
    return g.warnings();
  };
  // Bodies pass through a part without a contact.
  EXPECT_THAT(with_part("fixed"), ElementsAre(::testing::AllOf(
                                      HasSubstr("10 of 25"), HasSubstr("a contact of 'rim', or"))));
  const std::string finger_contact = g.contact;
  g.contact +=
      "<general_primitive_contact general_body=\"object\" primitive_body=\"rim\" kn=\"100\"/>";
  EXPECT_THAT(with_part("fixed"), IsEmpty());
  g.contact = finger_contact;
  g.inside_finger =
      "<link name=\"i\"><joint name=\"i\" type=\"fixed\"/><body name=\"i\" type=\"abstract\" "
      "mass=\"1\" inertia=\"1 1 1\"/></link>";
  EXPECT_THAT(g.warnings(), ElementsAre(HasSubstr("10 of 25")));  // a part without a surface
  EXPECT_THAT(with_part("revolute\" axis=\"1 0 0"), ElementsAre(HasSubstr("10 of 25")));
}

/// The skin lies on the finger, and only a part that is rigidly joined to it has a contact.
TEST(SceneWarnings, PointsOnABodyWithoutAContactAreTold) {
  Grasp g;
  g.inside_finger =
      "<link name=\"rim\"><joint name=\"rim\" type=\"fixed\" pos=\"0 0 -0.02\"/>"
      "<body name=\"rim\" type=\"cuboid\" size=\"0.02 0.02 0.02\"/></link>";
  EXPECT_THAT(g.warnings(), IsEmpty());
  g.contact =
      "<general_primitive_contact general_body=\"object\" primitive_body=\"rim\" kn=\"100\"/>";
  EXPECT_THAT(g.warnings(), ElementsAre(::testing::AllOf(
                                HasSubstr("25 of 25 points up to 0.02 m off what bodies"),
                                HasSubstr("expected a contact of 'finger', or"))));
  // Points of a part without a distance may lie anywhere.
  g.inside_finger =
      "<link name=\"rim\"><joint name=\"rim\" type=\"fixed\"/><body name=\"rim\" type=\"abstract\" "
      "mass=\"1\" inertia=\"1 1 1\"><collision radius=\"0.01\" count=\"25\"/></body></link>";
  g.contact =
      "<general_primitive_contact general_body=\"rim\" primitive_body=\"object\" kn=\"20\"/>";
  EXPECT_THAT(g.warnings(), IsEmpty());
}

/// Points of the object are 4 mm apart, those of the skin too.
TEST(SceneWarnings, SkinsUnlikeThePointsOfWhatTouchesThemAreTold) {
  Grasp g;
  g.kn = "2";
  EXPECT_THAT(g.warnings(), IsEmpty());
  g.kn = "0.5";
  EXPECT_THAT(g.warnings(),
              ElementsAre(HasSubstr("kn of 'skin' is 0.0312 N/m per mm² of skin, that "
                                    "of its contact with 'object' is about 6.25, so "
                                    "the field shows about 0.005 times")));
  g.kn = "50000";
  EXPECT_THAT(g.warnings(), ElementsAre(HasSubstr("shows about 5e+02 times")));
}

/// An arm whose joint 'a' starts at `q`; 'b' follows it: q_b = 2 q_a + 3.
std::vector<std::string> starts(const std::string& q, const std::string& more = "",
                                const std::string& stiffness = "100") {
  const auto link = [&](const std::string& name, const std::string& rest, const std::string& in) {
    return "<link name='" + name + "'><joint name='" + name + "' type='revolute' axis='0 0 1' " +
           rest + " lim_stiffness='" + stiffness + "'/><body name='" + name +
           "' type='sphere' radius='0.1' density='100' pos='1 0 0'/>" + in + "</link>";
  };
  return parse_scene("<tangere><option unit='m-kg'/><robot>\n" +
                         link("a", "lim='-1 1'",
                              link("b", "lim='-0.5 0.5' follows='a' ratio='2' offset='3'", "")) +
                         "</robot><initial><joint name='a' q='" + q + "'/></initial>" + more +
                         "</tangere>",
                     "arm.xml")
      .warnings;
}

TEST(SceneWarnings, AStartOutsideTheLimitsIsTold) {
  EXPECT_THAT(starts("-1.5"),
              ElementsAre(HasSubstr("arm.xml:2: <joint>: a joint starts outside its "
                                    "limits, in m or rad: 'a' at -1.5 with limits "
                                    "-1 1")))
      << "b is at 0";
  EXPECT_THAT(starts("0"), ElementsAre(HasSubstr("'b' at 3 with limits -0.5 0.5")));
  EXPECT_THAT(starts("1.1"), ElementsAre(HasSubstr("joints start outside their limits")));
  EXPECT_THAT(starts("-1.5", "", "0"), Each(HasSubstr("'lim' has no effect")))
      << "limits without springs do not push";
  EXPECT_THAT(starts("-1.5", "<randomize><joint name='a' q='0' uniform='-1 1'/></randomize>"),
              IsEmpty())
      << "the start is drawn";
}

/// Each joint follows the two before it, so joint n has as many paths to the first as Fibonacci's
/// number n.
TEST(SceneWarnings, StartsOfManyFollowersAreFoundOnce) {
  std::string links, ends;
  for (int k = 0; k < 60; ++k) {
    const std::string name = "j" + std::to_string(k);
    links += "<link name='" + name + "'><joint name='" + name +
             "' type='revolute' axis='0 0 1' lim='-1 1' lim_stiffness='10'";
    if (k > 1)
      links += " ratio='0.5 0.5' follows='j" + std::to_string(k - 1) + " j" +
               std::to_string(k - 2) + "'";
    links += "/><body name='" + name + "' type='sphere' radius='0.1' density='100'/>";
    ends += "</link>";
  }
  EXPECT_THAT(
      parse_scene("<tangere><option unit='m-kg'/><robot>" + links + ends + "</robot></tangere>",
                  "chain.xml")
          .warnings,
      IsEmpty());
}

}  // namespace
}  // namespace tangere
