// SPDX-License-Identifier: Apache-2.0
// Tests feedback="true" of a sensor: what cannot act is refused with a line.
#include <gmock/gmock.h>

#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/feedback_scene.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using testing::kTable;
using testing::with;

Scene feedback_scene(const std::string& text) { return parse_scene(text, "s.xml").scene; }

std::string feedback_refusal(const std::string& text) {
  try {
    feedback_scene(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Sensors, ThatRememberReadingsSayHowOftenTheyAreRead) {
  const std::string waits = with("feedback=\"true\"", "ks=\"90\" memory=\"read\"", kTable);
  EXPECT_THAT(feedback_refusal(waits),
              AllOf(HasSubstr("s.xml:17:"), HasSubstr("memory=\"read\" without every")));
  const Scene scene = feedback_scene(with("memory=\"read\"", "memory=\"read\" every=\"5\"", waits));
  EXPECT_TRUE(scene.sensors[0].shear_at_readings);
  EXPECT_THAT(feedback_refusal(with("memory=\"read\"", "memory=\"reed\"", waits)),
              HasSubstr("did you mean 'read'"));
}

TEST(Feedback, RefusesAndWarns) {
  EXPECT_THAT(
      feedback_refusal(with(
          "type=\"free3d-exp\"", "type=\"fixed\"",
          with("<initial><joint name=\"ball\" v=\"0.05 -0.02 0 0 0 3\"/></initial>", "", kTable))),
      AllOf(HasSubstr("s.xml:17:"), HasSubstr("feedback of 'skin' would touch nothing")));
  EXPECT_THAT(
      feedback_refusal(with("</tangere>",
                            "<randomize><tactile name=\"skin\" field=\"kn\" uniform=\"1 2\"/>"
                            "</randomize></tangere>",
                            kTable)),
      HasSubstr("the sensor has feedback, so its coefficients act on the motion as well"));
  EXPECT_THAT(feedback_refusal(with("damping=\"20\"", "damping=\"20\" ks=\"1\"", kTable)),
              AllOf(HasSubstr("s.xml:17:"), HasSubstr("feedback and ks")));
  const std::string both =
      with("<sensor>",
           "<contact><general_primitive_contact general_body=\"table\" primitive_body=\"ball\" "
           "kn=\"1\" kt=\"0\" mu=\"0\" damping=\"0\"/></contact><sensor>",
           kTable);
  EXPECT_THAT(parse_scene(both, "s.xml").warnings,
              Contains(AllOf(HasSubstr("s.xml:16:"), HasSubstr("'table' and 'ball' touch"))));
}

}  // namespace
}  // namespace tangere
