// SPDX-License-Identifier: Apache-2.0
// Tests <camera> of scene files: its attributes, its outputs, and messages with their line.
#include <gmock/gmock.h>

#include "engine/scene/field_form.hpp"
#include "engine/scene/scene_number.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::kScene;

std::string with_camera(const std::string& attributes) {
  std::string text = kScene;
  text.insert(text.find("</sensor>"), "<camera " + attributes + "/>\n");
  return text;
}
Scene camera_scene(const std::string& attributes) {
  return parse_scene(with_camera(attributes), "eye.xml").scene;
}
std::string message(const std::string& attributes) {
  try {
    static_cast<void>(camera_scene(attributes));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}
const std::string kPlace = "name=\"eye\" pos=\"0 -0.4 0.3\" look=\"0 0 0.02\"";
/// The line of the camera.
std::string line() {
  const std::string text = with_camera(kPlace);
  const auto before = text.substr(0, text.find("<camera"));
  return "eye.xml:" + std::to_string(1 + std::count(before.begin(), before.end(), '\n')) + ": ";
}

Scene drawn_scene(const std::string& lines) {
  std::string text = with_camera(kPlace);
  text.insert(text.find("</randomize>"), lines + "\n");
  return parse_scene(text, "eye.xml").scene;
}
std::string message_of_draw(const std::string& line) {
  try {
    static_cast<void>(drawn_scene(line));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(CameraFile, PoseAndLightMayBeDrawn) {
  const Scene scene = drawn_scene(
      "<camera name=\"eye\" pos=\"1\" normal=\"-0.4 0.01\"/><camera name=\"eye\" look=\"2\" "
      "uniform=\"0.01 0.03\"/><camera name=\"eye\" light=\"0\" uniform=\"-1 1\"/>"
      "<camera name=\"eye\" field=\"ambient\" list=\"0.2 0.5\"/>"
      "<camera name=\"eye\" field=\"brightness\" log_uniform=\"0.5 2\"/>");
  std::vector<std::string> names, units;
  std::vector<RandomizationDescription> drawn;
  for (const RandomizationDescription& d : scene.randomizations) {
    if (d.number.owner != NumberOwner::camera) continue;
    drawn.push_back(d);
    names.push_back(name_of(d.number));
    units.push_back(unit_of(scene, d.number));
  }
  EXPECT_THAT(names, ElementsAre("camera eye pos[1]", "camera eye look[2]", "camera eye light[0]",
                                 "camera eye ambient", "camera eye brightness"));
  EXPECT_THAT(units, ElementsAre("m", "m", "1", "1", "1"));
  EXPECT_EQ(drawn[0].distribution.a, -0.4);
  EXPECT_EQ(number_in(scene, drawn[1].number), 0.02);
}

TEST(CameraFile, MistakesInDrawsNameTheLine) {
  const auto of = [](const std::string& attributes) {
    return message_of_draw("<camera " + attributes + "/>");
  };
  EXPECT_THAT(of("name=\"eyes\" pos=\"0\" uniform=\"0 1\""),
              HasSubstr("no camera is named 'eyes'; did you mean 'eye'?"));
  EXPECT_THAT(of("name=\"eye\" uniform=\"0 1\""), HasSubstr("exactly one of pos, look, light"));
  EXPECT_THAT(of("name=\"eye\" pos=\"0\" field=\"ambient\" uniform=\"0 1\""),
              HasSubstr("exactly one of pos, look, light"));
  EXPECT_THAT(of("name=\"eye\" pos=\"3\" uniform=\"0 1\""), HasSubstr("pos=\"3\""));
  EXPECT_THAT(of("name=\"eye\" field=\"ambient\" uniform=\"0.5 1.5\""),
              HasSubstr("ambient=\"1.5\""));
  EXPECT_THAT(of("name=\"eye\" field=\"brightness\" normal=\"1 0.1\""),
              HasSubstr("normal can draw a negative value"));
  EXPECT_THAT(of("name=\"eye\" field=\"fov\" uniform=\"40 50\""), HasSubstr("field=\"fov\""));
}

TEST(CameraFile, BodiesHaveMaterials) {
  std::string text = with_camera(kPlace);
  text.insert(text.find("<body ") + 6, "specular=\"0.4\" shininess=\"0.9\" emission=\"0.1\" ");
  const Scene scene = parse_scene(text, "eye.xml").scene;
  EXPECT_EQ(scene.links[0].body.specular, 0.4);
  EXPECT_EQ(scene.links[0].body.shininess, 0.9);
  EXPECT_EQ(scene.links[0].body.emission, 0.1);
  text.replace(text.find("specular=\"0.4\""), 14, "specular=\"1.4\"");
  EXPECT_THROW(parse_scene(text, "eye.xml"), InputError);
}

TEST(CameraFile, HasItsDefaultsAndItsNumbers) {
  const Scene plain = camera_scene(kPlace);
  ASSERT_EQ(plain.cameras.size(), 1U);
  EXPECT_EQ(plain.cameras[0].rows, 128);
  EXPECT_EQ(plain.cameras[0].far, 10);
  EXPECT_EQ(plain.cameras[0].body, "");
  EXPECT_THAT(plain.cameras[0].up, ElementsAre(0, 0, 1));
  const CameraDescription all =
      camera_scene(
          "name=\"wrist\" body=\"pad\" pos=\"0 0 0.1\" look=\"0 0 0\" up=\"0 1 0\" fov=\"60\" "
          "rows=\"24\" cols=\"32\" far=\"2\" light=\"0 0 1\" ambient=\"0.5\" noise=\"1\" "
          "gain=\"0.1\"")
          .cameras[0];
  EXPECT_EQ(all.body, "pad");
  EXPECT_EQ(all.fov, 60);
  EXPECT_EQ(all.rows * 100 + all.cols, 2432);
  EXPECT_EQ(all.far, 2);
  EXPECT_THAT(all.light, ElementsAre(0, 0, 1));
  EXPECT_EQ(all.ambient + all.noise + all.gain, 1.6);
}

TEST(CameraFile, CountsInTheUnitsOfTheFile) {
  std::string text = with_camera("name=\"eye\" pos=\"0 -40 30\" look=\"0 0 2\" far=\"300\"");
  const std::string unit = "unit=\"m-kg\"";
  text.replace(text.find(unit), unit.size(), "unit=\"cm-g\"");
  const Scene scene = parse_scene(text, "eye.xml").scene;
  EXPECT_THAT(scene.cameras[0].position, ElementsAre(0, -0.4, 0.3));
  EXPECT_EQ(scene.cameras[0].far, 3);
}

TEST(CameraFile, ItsPicturesAreOutputs) {
  std::string text = with_camera(kPlace);
  text.insert(text.find("<robot>"), "<outputs record=\"q,eye.rgb/10,eye.ids\"/>\n");
  const Scene scene = parse_scene(text, "eye.xml").scene;
  const std::vector<FieldOutput> outputs = requested_fields(scene);
  ASSERT_EQ(outputs.size(), 2U);
  EXPECT_EQ(outputs[0].form, FieldForm::view_rgb);
  EXPECT_EQ(outputs[0].times.every, 10);
  EXPECT_EQ(outputs[1].form, FieldForm::view_ids);
  EXPECT_THAT(output_names(scene), ::testing::IsSupersetOf({"eye.rgb", "eye.depth", "eye.ids"}));
  text.replace(text.find("eye.ids"), 7, "eye.id");
  EXPECT_THAT([&] { parse_scene(text, "eye.xml"); },
              ::testing::ThrowsMessage<InputError>(HasSubstr("'eye.id'; did you mean 'eye.ids'?")));
}

TEST(CameraFile, MistakesAreErrorsWithTheirLine) {
  EXPECT_THAT(message("pos=\"0 0 1\" look=\"0 0 0\""), HasSubstr(line()));
  EXPECT_THAT(message(kPlace + " body=\"bal\""), HasSubstr("did you mean 'ball'?"));
  EXPECT_THAT(message("name=\"eye\" pos=\"0 0 1\" look=\"0 0 0\""),
              HasSubstr(line() + "<camera>: up=\"0 0 1\" lies along the view"));
  EXPECT_THAT(message("name=\"skin\" pos=\"0 -1 1\" look=\"0 0 0\""),
              HasSubstr("a tactile sensor is named 'skin'"));
  EXPECT_THAT(message("name=\"a/b\" pos=\"0 -1 1\" look=\"0 0 0\""), HasSubstr("without '/'"));
  EXPECT_THAT(message(kPlace + "/>\n<camera " + kPlace), HasSubstr("'eye' is used twice"));
  EXPECT_THAT(message(kPlace + " rows=\"4000\""), HasSubstr("rows=\"4000\""));
  EXPECT_THAT(message(kPlace + " fov=\"0\""), HasSubstr("fov=\"0\""));
  EXPECT_THAT(message(kPlace + " far=\"-1\""), HasSubstr("far=\"-1\""));
  EXPECT_THAT(message(kPlace + " brightness=\"1e300\""),
              HasSubstr("brightness=\"1e+300\"; expected a number from 0 to 1000000"));
  EXPECT_THAT(message(kPlace + " zoom=\"2\""), HasSubstr("zoom"));
  EXPECT_THAT(message("name=\"eye\" pos=\"0 0 1\""), HasSubstr("look"));
}

TEST(CameraFile, ACameraBeforeASensorTakesItsName) {
  std::string text = kScene;
  text.insert(text.find("<sensor>") + 8,
              "\n<camera name=\"skin\" pos=\"0 -1 1\" look=\"0 0 0\"/>\n");
  EXPECT_THAT([&] { parse_scene(text, "eye.xml"); },
              ::testing::ThrowsMessage<InputError>(HasSubstr("a camera is named 'skin'")));
}

/// A sensor "eye.rgb" and the colours of a camera "eye" would be one output.
TEST(CameraFile, ASensorDoesNotHideAnOutput) {
  std::string text = kScene;
  text.replace(text.find("name=\"skin\""), 11, "name=\"eye.rgb\"");
  const std::string camera = "\n<camera name=\"eye\" pos=\"0 -1 1\" look=\"0 0 0\"/>\n";
  const std::size_t before = text.find("<sensor>") + 8, behind = text.find("</sensor>");
  ASSERT_NE(behind, std::string::npos);
  for (const std::size_t at : {before, behind}) {
    std::string both = text;
    both.insert(at, camera);
    EXPECT_THAT([&] { parse_scene(both, "eye.xml"); },
                ::testing::ThrowsMessage<InputError>(HasSubstr("'eye.rgb'")));
  }
}

}  // namespace
}  // namespace tangere
