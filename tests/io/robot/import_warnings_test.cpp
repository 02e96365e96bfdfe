// SPDX-License-Identifier: Apache-2.0
// Imports with skins and contacts warn of what is wrong, and of nothing else.
#include <gmock/gmock.h>

#include "io/robot/robot_import.hpp"
#include "tests/files.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

PadRequest pad(const std::string& link, const std::string& layout, const std::string& face) {
  const std::string file = TANGERE_SOURCE_DIR "/scenes/sensors/" + layout + ".xml";
  return {link, layout, file_bytes(file), {}, face};
}

std::vector<std::string> warnings(const std::string& robot, const RobotOptions& options) {
  const std::string folder = TANGERE_SOURCE_DIR "/examples/";
  return import_robot(folder + robot, folder + "scene.xml", options).warnings;
}

TEST(ImportWarnings, AHandWithSkinsThatTouchesHasNone) {
  RobotOptions options;
  for (const char* tip : {"thumb_tip", "index_tip", "middle_tip"})
    options.pads.push_back(pad(tip, "uskin_4x4_guess", "-x"));
  options.touches = {{"thumb_tip", "index_tip"}, {"thumb_tip", "middle_tip"}};
  EXPECT_THAT(warnings("hand/hand.urdf", options), IsEmpty());
}

TEST(ImportWarnings, AGripperWithSkinsThatTouchesHasNone) {
  for (const char* layout : {"gelsight_mini_measured", "grid_16x16_guess", "uskin_4x4_guess"}) {
    RobotOptions options;
    options.pads = {pad("left_finger", layout, "-y"), pad("right_finger", layout, "+y")};
    options.touches = {{"left_finger", "right_finger"}};
    EXPECT_THAT(warnings("grasp/gripper.urdf", options), IsEmpty()) << layout;
  }
}

/// A mat of 12 x 32 taxels is larger than the face of a tip.
TEST(ImportWarnings, ASkinLargerThanItsFaceIsTold) {
  RobotOptions options;
  options.pads = {pad("thumb_tip", "flexitac_12x32_guess", "-x"),
                  pad("index_tip", "uskin_4x4_guess", "-x")};
  options.touches = {{"thumb_tip", "index_tip"}};
  EXPECT_THAT(warnings("hand/hand.urdf", options),
              ElementsAre(AllOf(HasSubstr("on body 'thumb_tip' has "), HasSubstr(" of 384 points"),
                                HasSubstr("off what bodies touch there"))));
}

/// A skin lies on the tip, and only the finger beside it has a contact.
TEST(ImportWarnings, ASkinOnALinkWithoutAContactIsTold) {
  RobotOptions options;
  options.pads = {pad("thumb_tip", "uskin_4x4_guess", "-x")};
  options.touches = {{"index_tip", "middle_tip"}};
  EXPECT_THAT(warnings("hand/hand.urdf", options),
              ElementsAre(HasSubstr("reads forces that nothing exerts")));
}

}  // namespace
}  // namespace tangere
