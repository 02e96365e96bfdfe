// SPDX-License-Identifier: Apache-2.0
// Tests that a scene warns where a flat sensor and the contact points of its own body stand for
// skins of different stiffness, with both stiffnesses per area.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A pad of 20 × 10 × 2 mm under a ball. Its sensor has 21 × 11 points, 1 mm apart. Contact points
/// are 1 mm apart too.
std::vector<std::string> warnings(const std::string& felt, const std::string& pressed,
                                  const std::string& pad =
                                      "type=\"cuboid\" size=\"0.02 0.01 0.002\" "
                                      "general_contact_resolution=\"21 11 2\"") {
  return parse_scene(
             "<tangere model=\"m\"><option unit=\"m-kg\"/>\n"
             "<robot><link name=\"pad\"><joint name=\"pad\" type=\"free3d\"/>\n"
             "<body name=\"pad\" density=\"1000\" " +
                 pad +
                 "/></link></robot>\n"
                 "<robot><link name=\"ball\"><joint name=\"ball\" type=\"fixed\"/>\n"
                 "<body name=\"ball\" type=\"sphere\" radius=\"0.02\"/></link></robot>\n"
                 "<contact><general_primitive_contact general_body=\"pad\" "
                 "primitive_body=\"ball\" kn=\"" +
                 pressed +
                 "\"/></contact>\n"
                 "<sensor><tactile name=\"skin\" body=\"pad\" type=\"rect_array\" "
                 "rect_pos0=\"-0.01 -0.005 0.001\" rect_pos1=\"0.01 0.005 0.001\" "
                 "axis0=\"1 0 0\" axis1=\"0 1 0\" resolution=\"21 11\" kn=\"" +
                 felt + "\" mu=\"0.5\"/></sensor></tangere>",
             "s.xml")
      .warnings;
}

TEST(UnlikeSkins, StiffnessesThatDifferByOrdersAreTold) {
  EXPECT_THAT(warnings("50", "50"), IsEmpty());
  EXPECT_THAT(warnings("50", "450"), IsEmpty());
  EXPECT_THAT(warnings("30", "1200"),
              ElementsAre(AllOf(HasSubstr("s.xml:7: <tactile>: kn of 'skin' is 30 N/m per mm²"),
                                HasSubstr("'ball' is 1.2e+03"), HasSubstr("shows 0.025 times"))));
  EXPECT_THAT(warnings("1200", "30"), ElementsAre(HasSubstr("shows 40 times")));
}

TEST(UnlikeSkins, CapsOfCylindersCountAndNothingThatIsNotKnownDoes) {
  // 1 + 3 · 8 points on π (12 mm)² are 0.0553 per mm²
  const std::string disc = "type=\"cylinder\" radius=\"0.012\" length=\"0.002\"";
  EXPECT_THAT(warnings("50", "904", disc), IsEmpty());
  EXPECT_THAT(warnings("50", "36160", disc), ElementsAre(HasSubstr("shows 0.025 times")));
  EXPECT_THAT(warnings("50", "0"), IsEmpty());
  EXPECT_THAT(warnings("0", "50"), IsEmpty());
}

}  // namespace
}  // namespace tangere
