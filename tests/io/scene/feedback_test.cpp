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

TEST(Feedback, OfBodiesThatFaceEachOtherCountsOnce) {
  const std::string palm =
      R"(<tactile name="palm" body="ball" type="rect_array" rect_pos0="-0.01 -0.01 -0.02"
 rect_pos1="0.01 0.01 -0.02" axis0="1 0 0" axis1="0 1 0" resolution="3 3" kn="1" )";
  const auto beside = [&](const std::string& more, const std::string& scene) {
    return with("</sensor>", palm + more + "/></sensor>", scene);
  };
  const std::string layer = with(
      R"(kn="400" kt="0.2"
 mu="0.7" damping="20" feedback="true"/>)",
      R"(modulus="4e4" thickness="4e-3" mu="1"><layer feedback="true"/></tactile>)", kTable);
  for (const std::string& scene : {kTable, layer})
    EXPECT_THAT(feedback_refusal(beside("feedback=\"true\"", scene)),
                AllOf(HasSubstr("<tactile> of 'palm': feedback and s.xml:17: <tactile> of 'skin'"),
                      HasSubstr("contacts of 'ball' and 'table', which would count twice"),
                      HasSubstr("expected ignores=\"table\" of 'palm' or ignores=\"ball\" of "
                                "'skin'")));
  EXPECT_EQ(feedback_refusal(beside("", kTable)), "");
  // Two skins of one body are two parts of its surface.
  const std::string second =
      R"(<tactile name="edge" body="table" type="rect_array" rect_pos0="0.014 -0.01 0.01"
 rect_pos1="0.018 0.01 0.01" axis0="1 0 0" axis1="0 1 0" resolution="3 3" kn="1"
 feedback="true"/></sensor>)";
  EXPECT_EQ(feedback_scene(with("</sensor>", second, kTable)).pair_contacts.size(), 2U);
}

TEST(Feedback, OfALayerRefusesWhatItWouldNotCompute) {
  const std::string gel = with(
      R"(kn="400" kt="0.2"
 mu="0.7" damping="20" feedback="true"/>)",
      R"(modulus="4e4" thickness="4e-3" mu="1"><layer feedback="true"/></tactile>)", kTable);
  const Scene scene = feedback_scene(gel);
  ASSERT_EQ(scene.pair_contacts.size(), 1U);
  EXPECT_EQ(scene.pair_contacts[0].first_name(), "tactile skin");
  EXPECT_EQ(scene.pair_contacts[0].coefficients.damping, 0);
  EXPECT_GT(scene.pair_contacts[0].coefficients.ks, 0);
  EXPECT_THAT(
      feedback_refusal(with(
          "<sensor>",
          R"(<contact><surface_contact body1="ball" body2="table" kn="1e8"/></contact><sensor>)",
          gel)),
      AllOf(HasSubstr("<layer> of 'skin': feedback and s.xml:16: <surface_contact>"),
            HasSubstr("'ball' and 'table', which would count twice")));
  EXPECT_THAT(feedback_refusal(with("mu=\"1\">", "mu=\"1\" damping=\"2\">", gel)),
              HasSubstr("feedback and damping; expected relaxation"));
  EXPECT_THAT(feedback_refusal(with("mu=\"1\">", "mu=\"1\" feedback=\"true\">", gel)),
              HasSubstr("expected that of <layer>"));
  EXPECT_THAT(feedback_refusal(with("mu=\"1\">", "mu=\"1\" every=\"2\" memory=\"read\">", gel)),
              HasSubstr("friction that advances at every step"));
  EXPECT_THAT(
      feedback_refusal(with("<layer feedback=\"true\"/>", "<layer/>",
                            with("mu=\"1\">", "mu=\"1\" ks=\"0\" feedback=\"true\">", gel))),
      HasSubstr("expected feedback in <layer>"));
}

}  // namespace
}  // namespace tangere
