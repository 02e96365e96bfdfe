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
std::vector<std::string> warnings(const std::string& resolution, const std::string& below,
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
  EXPECT_THAT(warnings("2 2 2", post),
              ElementsAre(AllOf(HasSubstr("s.xml:6: <general_primitive_contact>: contact points of "
                                          "'box' are up to 0.05 m apart, and 'below' is 0.006 m "
                                          "across"),
                                HasSubstr("general_contact_resolution"))));
  EXPECT_THAT(warnings("10 10 10", post), IsEmpty());
  EXPECT_THAT(warnings("2 2 2", post,
                       "<general_primitive_contact general_body=\"below\" primitive_body=\"box\" "
                       "kn=\"1e3\"/>"),
              IsEmpty());
  const std::string sphere = "type=\"sphere\" radius=\"0.02\"";
  EXPECT_THAT(warnings("2 2 2", sphere),
              ElementsAre(AllOf(HasSubstr("'below' is 0.04 m across"),
                                HasSubstr("or the two bodies swapped"))));
  // With its surface it would need no points of the box, whose forces add to its own.
  EXPECT_THAT(warnings("2 2 2", sphere,
                       "<general_primitive_contact general_body=\"below\" primitive_body=\"box\" "
                       "kn=\"1e3\"/>"),
              ElementsAre(HasSubstr("the forces of both contacts add up; expected one of them")));
}

/// A shift leaves the corners of a box without the box below.
TEST(CoarsePoints, ABoxOnItsEqualIsTold) {
  const std::string equal = "type=\"cuboid\" size=\"0.05 0.05 0.05\"";
  EXPECT_THAT(warnings("2 2 2", equal), ElementsAre(HasSubstr("or out from under them")));
  EXPECT_THAT(warnings("3 3 3", equal), IsEmpty());
}

TEST(CoarsePoints, BoxesOnPlatesAreNot) {
  EXPECT_THAT(warnings("2 2 2", "type=\"cuboid\" size=\"0.3 0.3 0.01\""), IsEmpty());
}

}  // namespace
}  // namespace tangere
