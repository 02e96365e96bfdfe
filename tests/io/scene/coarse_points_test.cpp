// SPDX-License-Identifier: Apache-2.0
// Tests that a scene warns where a body fits between the contact points of a box, with both
// numbers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A box of 50 mm with `resolution` above a body, and what else touches.
std::vector<std::string> point_warnings(const std::string& resolution, const std::string& below,
                                        const std::string& more = "") {
  return parse_scene(
             "<tangere model=\"m\"><option unit=\"m-kg\"/>\n"
             "<robot><link name=\"box\"><joint name=\"box\" type=\"free3d\" pos=\"0 0 0.2\"/>\n"
             "<body name=\"box\" type=\"cuboid\" size=\"0.05 0.05 0.05\" density=\"1000\" "
             "general_contact_resolution=\"" +
                 resolution +
                 "\"/></link></robot>\n"
                 "<robot><link name=\"below\"><joint name=\"below\" type=\"fixed\"/>\n"
                 "<body name=\"below\" " +
                 below +
                 "/></link></robot>\n"
                 "<contact><general_primitive_contact general_body=\"box\" "
                 "primitive_body=\"below\" kn=\"1e3\"/>" +
                 more + "</contact></tangere>",
             "s.xml")
      .warnings;
}

TEST(CoarsePoints, ABodyThatFitsBetweenThemIsTold) {
  const std::string post = "type=\"cuboid\" size=\"0.006 0.006 0.1\"";
  EXPECT_THAT(point_warnings("2 2 2", post),
              ElementsAre(AllOf(HasSubstr("s.xml:6: <general_primitive_contact>: contact points of "
                                          "'box' are up to 0.05 m apart, and 'below' is 0.006 m "
                                          "across"),
                                HasSubstr("general_contact_resolution"))));
  EXPECT_THAT(point_warnings("10 10 10", post), IsEmpty());
  EXPECT_THAT(
      point_warnings("2 2 2", post,
                     "<general_primitive_contact general_body=\"below\" primitive_body=\"box\" "
                     "kn=\"1e3\"/>"),
      IsEmpty());
  const std::string sphere = "type=\"sphere\" radius=\"0.02\"";
  EXPECT_THAT(point_warnings("2 2 2", sphere),
              ElementsAre(AllOf(HasSubstr("'below' is 0.04 m across"),
                                HasSubstr("or the two bodies swapped"))));
  // With its surface it would need no points of the box, whose forces add to its own.
  EXPECT_THAT(
      point_warnings("2 2 2", sphere,
                     "<general_primitive_contact general_body=\"below\" primitive_body=\"box\" "
                     "kn=\"1e3\"/>"),
      ElementsAre(HasSubstr("the forces of both contacts add up; expected one of them")));
}

/// A shift leaves the corners of a box without the box below.
TEST(CoarsePoints, ABoxOnItsEqualIsTold) {
  const std::string equal = "type=\"cuboid\" size=\"0.05 0.05 0.05\"";
  EXPECT_THAT(point_warnings("2 2 2", equal), ElementsAre(HasSubstr("or out from under them")));
  EXPECT_THAT(point_warnings("3 3 3", equal),
              ElementsAre(HasSubstr("it can come out from under them")));
  EXPECT_THAT(point_warnings("4 4 4", equal), IsEmpty());
}

/// Whatever the shapes are. In both directions, both must be fine enough or one of them.
TEST(CoarsePoints, OtherShapesAreTold) {
  const std::string rod = "type=\"cylinder\" radius=\"0.01\" length=\"0.2\"",
                    other_way =
                        "<general_primitive_contact general_body=\"below\" primitive_body=\"box\" "
                        "kn=\"1e3\"/>";
  EXPECT_THAT(point_warnings("2 2 2", rod), ElementsAre(HasSubstr("'below' is 0.02 m across")));
  EXPECT_THAT(point_warnings("2 2 2", rod, other_way),
              ElementsAre(HasSubstr("contact points of 'box' are up to 0.05 m apart"),
                          AllOf(HasSubstr("contact points of 'below' are up to 0.2 m apart"),
                                HasSubstr("expected the same contact the other way round"))));
  EXPECT_THAT(point_warnings("8 8 8", rod, other_way), IsEmpty());
}

/// A pile has many such contacts. Five lines say it, and one how many there are.
TEST(CoarsePoints, ManyContactsAreCounted) {
  std::string bodies, contacts;
  for (int k = 0; k < 9; ++k) {
    const std::string name = "b" + std::to_string(k);
    bodies +=
        "<robot><link name=\"" + name + "\"><joint name=\"" + name +
        "\" type=\"free3d\"/><body name=\"" + name +
        "\" type=\"cuboid\" size=\"1 1 1\" general_contact_resolution=\"2 2 2\"/></link></robot>";
    if (k > 0)
      contacts += "<general_primitive_contact general_body=\"" + name + "\" primitive_body=\"b" +
                  std::to_string(k - 1) + "\" kn=\"1\"/>";
  }
  const auto lines = parse_scene("<tangere model=\"m\">" + bodies + "<contact>" + contacts +
                                     "</contact></tangere>",
                                 "s.xml")
                         .warnings;
  ASSERT_EQ(lines.size(), 6U);
  EXPECT_THAT(lines[4], HasSubstr("contact points of 'b5'"));
  EXPECT_THAT(lines[5], HasSubstr("3 more contacts have such points"));
}

TEST(CoarsePoints, ARoundBodyOnTheGroundIsToldToHaveCorners) {
  const auto rolls = [](const std::string& shape, const std::string& kn = "2e3") {
    return parse_scene(
               "<tangere model=\"m\"><option unit=\"m-kg\" gravity=\"0 0 -9.8\"/>\n"
               "<ground pos=\"0 0 0\" normal=\"0 0 1\"/>\n"
               "<robot><link name=\"roll\"><joint name=\"roll\" type=\"free3d\" "
               "quat=\"0.7071067811865476 0.7071067811865476 0 0\"/>\n"
               "<body name=\"roll\" density=\"500\" " +
                   shape +
                   "/></link></robot>\n"
                   "<contact><ground_contact body=\"roll\" kn=\"" +
                   kn + "\"/></contact></tangere>",
               "s.xml")
        .warnings;
  };
  EXPECT_THAT(rolls("type=\"cylinder\" radius=\"0.05\" length=\"0.1\""),
              ElementsAre(AllOf(HasSubstr("s.xml:5: <ground_contact>: 'roll'"),
                                HasSubstr("8 points around"),
                                HasSubstr("a general_contact_angle_resolution of 16 or more"))));
  EXPECT_THAT(rolls("type=\"cylinder\" radius=\"0.05\" length=\"0.1\" "
                    "general_contact_angle_resolution=\"16\""),
              IsEmpty());
  EXPECT_THAT(rolls("type=\"capsule\" radius=\"0.05\" length=\"0.1\""),
              ElementsAre(HasSubstr("second number of general_contact_resolution")));
  EXPECT_THAT(rolls("type=\"ellipsoid\" size=\"0.1 0.1 0.2\"", "2e4"),
              ElementsAre(HasSubstr("with 100 points, so it rolls over a polygon")));
  EXPECT_THAT(rolls("type=\"sphere\" radius=\"0.05\""), IsEmpty());
}

TEST(CoarsePoints, BoxesOnPlatesAreNot) {
  EXPECT_THAT(point_warnings("2 2 2", "type=\"cuboid\" size=\"0.3 0.3 0.01\""), IsEmpty());
}

}  // namespace
}  // namespace tangere
