// SPDX-License-Identifier: Apache-2.0
// <include>: files inside a scene, with units and defaults of their own, and what goes wrong.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "engine/base/error.hpp"
#include "io/dataset/learner_notes.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kScenes = TANGERE_TEST_DATA "/scenes/";

TEST(SceneInclude, FilesKeepTheirUnitsAndDefaults) {
  const SceneFile file = read_scene(kScenes + "including.xml");
  const Scene& scene = file.scene;
  ASSERT_EQ(scene.links.size(), 2U);
  const BodyDescription& ball = scene.links[0].body;
  EXPECT_EQ(ball.name, "ball");
  EXPECT_DOUBLE_EQ(std::get<SphereShape>(ball.shape).radius, 0.02);
  EXPECT_DOUBLE_EQ(ball.density, 2000);
  EXPECT_DOUBLE_EQ(scene.links[0].joint.pose.position[2], 0.02);
  EXPECT_THAT(ball.source.file, HasSubstr("included_ball.xml"));
  EXPECT_EQ(ball.source.line, 10);
  EXPECT_DOUBLE_EQ(scene.timestep, 5e-3);  // the scene's own option, not that of the ball's file
  ASSERT_EQ(scene.sensors.size(), 1U);
  const TactileDescription& tip = scene.sensors[0];
  EXPECT_EQ(tip.name, "tip");
  EXPECT_EQ(tip.body, "finger");
  EXPECT_EQ(tip.coefficients[0], 3);  // of the <include>, in place of the file's
  ASSERT_EQ(tip.points.size(), 302U);
  EXPECT_LT(tip.points[0].normal[2], -0.9);  // half a turn about x
  EXPECT_THAT(file.warnings, ElementsAre(HasSubstr("reads forces that nothing exerts")));
}

/// The scene of a data set that has moved: its text and those of its files.
TEST(SceneInclude, TextsTakeThePlaceOfFiles) {
  const testing::Folder folder;
  const std::string scene =
      "<tangere><option unit=\"m-kg\" timestep=\"5e-3\"/><include "
      "file=\"parts/all.xml\"/></tangere>";
  std::filesystem::create_directories(folder / "parts/deep");
  std::ofstream(folder / "scene.xml") << scene;
  std::ofstream(folder / "parts/all.xml")
      << "<tangere><option unit=\"m-kg\"/><include file=\"deep/../b.xml\"/></tangere>";
  std::ofstream(folder / "parts/b.xml")
      << "<tangere><option unit=\"m-kg\"/><robot><link name=\"b\"><joint name=\"b\" "
         "type=\"prismatic\" axis=\"0 0 1\"/><body name=\"b\" type=\"sphere\" radius=\"1\" "
         "density=\"1\"/></link></robot></tangere>";
  const std::string path = folder / "scene.xml";
  const IncludedTexts texts = included_texts(path, scene);
  ASSERT_EQ(texts.size(), 2U);
  EXPECT_TRUE(texts.contains("parts/all.xml") && texts.contains("parts/b.xml"));
  EXPECT_EQ(included_texts_in(json_of(texts)), texts);
  EXPECT_THROW(included_texts_in("[1]"), IoError);
  EXPECT_THROW(parse_scene(scene, "scene"), IoError);
  SceneReadOptions stored;
  stored.included = texts;
  EXPECT_EQ(parse_scene(scene, "scene", stored).scene.links.at(0).name, "b");
  EXPECT_TRUE(included_texts("", scene).empty());  // of text in memory nothing is known
}

/// A layout that comes with the program is stored as well.
TEST(SceneInclude, TextsOfShippedFilesAreStored) {
  const testing::Folder folder;
  const std::string text =
      "<tangere><option unit=\"m-kg\"/><include file=\"rolling_ball_small.xml\"/></tangere>";
  const std::string path = folder / "scene.xml";
  std::ofstream(path) << text;
  const IncludedTexts texts = included_texts(path, text);
  ASSERT_EQ(texts.size(), 1U);
  EXPECT_THAT(texts.at("rolling_ball_small.xml"), HasSubstr("rolling_ball_small"));
}

/// Files of one folder; the first is read.
class SceneFiles {
 public:
  SceneFiles& add(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    if (first_.empty()) first_ = folder_ / name;
    return *this;
  }
  std::string fault() const {
    try {
      read_scene(first_);
    } catch (const InputError& error) {
      return plain(error.what());
    } catch (const IoError& error) {
      return plain(error.what());
    }
    return "";
  }

 private:
  [[nodiscard]] std::string plain(std::string text) const {
    const std::string here = std::filesystem::path(first_).parent_path().string() + "/";
    for (std::size_t at = 0; (at = text.find(here)) != std::string::npos;)
      text.erase(at, here.size());
    return text;
  }
  testing::Folder folder_;
  std::string first_;
};

std::string metric_scene(const std::string& more) {
  return "<tangere>\n<option unit=\"m-kg\"/>\n" + more + "\n</tangere>\n";
}
const std::string kSlider =
    "<robot><link name=\"a\"><joint name=\"a\" type=\"prismatic\" axis=\"0 0 1\"/>"
    "<body name=\"a\" type=\"sphere\" radius=\"1\"/></link></robot>";

TEST(SceneInclude, ErrorsNameTheFileInWhichTheyStand) {
  EXPECT_EQ(SceneFiles()
                .add("a.xml", metric_scene("<include file=\"b.xml\"/>"))
                .add("b.xml", metric_scene(kSlider))
                .fault(),
            "");
  EXPECT_THAT(SceneFiles()
                  .add("a.xml", metric_scene("<include file=\"b.xml\"/>"))
                  .add("b.xml", metric_scene("<robott/>"))
                  .fault(),
              HasSubstr("b.xml:3: <robott>: unknown element inside <tangere>"));
  EXPECT_THAT(SceneFiles().add("a.xml", metric_scene("<include file=\"b.xml\"/>")).fault(),
              HasSubstr("a.xml:3: <include>: "));
  EXPECT_THAT(SceneFiles().add("a.xml", metric_scene("<include/>")).fault(),
              HasSubstr("a.xml:3: <include>: attribute 'file' is missing"));
  EXPECT_THAT(
      SceneFiles()
          .add("a.xml", metric_scene(kSlider + "<sensor><include file=\"b.xml\"/></sensor>"))
          .add("b.xml", metric_scene(kSlider))
          .fault(),
      HasSubstr("a.xml:3: <include>: b.xml has the root <tangere>; expected the root "
                "<sensor>"));
}

TEST(SceneInclude, RingsAndFloodsAreRefused) {
  EXPECT_THAT(SceneFiles()
                  .add("a.xml", metric_scene("<include file=\"b.xml\"/>"))
                  .add("b.xml", metric_scene("<include file=\"./a.xml\"/>"))
                  .fault(),
              HasSubstr("b.xml:3: <include>: files that include each other: a.xml includes b.xml "
                        "includes a.xml"));
  SceneFiles flood;
  for (int k = 0; k < 12; ++k) {
    const std::string next = "<include file=\"" + std::to_string(k + 1) + ".xml\"/>\n";
    flood.add(std::to_string(k) + ".xml", metric_scene(next + next));
  }
  flood.add("12.xml", metric_scene(""));
  EXPECT_THAT(flood.fault(), HasSubstr("more than 1000 files in one scene"));
  SceneFiles chain;
  for (int k = 0; k < 60; ++k)
    chain.add(std::to_string(k) + ".xml",
              metric_scene("<include file=\"" + std::to_string(k + 1) + ".xml\"/>"));
  EXPECT_THAT(chain.fault(), HasSubstr("50.xml:3: <include>: files in files, deeper than 50"));
}

TEST(SceneInclude, AttributesGoToWhatIsIncluded) {
  const std::string sensor =
      "<sensor unit=\"cm-g\"><tactile type=\"hemisphere\" radius=\"1\" count=\"9\" kn=\"1\"/>"
      "</sensor>";
  const auto with = [&](const std::string& attributes) {
    return SceneFiles()
        .add("a.xml", metric_scene(kSlider + "<sensor><include file=\"b.xml\" " + attributes +
                                   "/></sensor>"))
        .add("b.xml", sensor)
        .fault();
  };
  EXPECT_EQ(with("body=\"a\""), "");
  EXPECT_THAT(with(""), HasSubstr("b.xml:1: <tactile>: attribute 'body' is missing"));
  EXPECT_THAT(with("body=\"b\""), HasSubstr("no body has this name; did you mean 'a'"));
  EXPECT_THAT(with("body=\"a\" colour=\"red\""),
              HasSubstr("a.xml:3: <include>: unknown attribute 'colour' of <tactile>"));
  EXPECT_THAT(
      with("body=\"a\" kn=\"2\""),
      HasSubstr("kn=\"2\": this file is in m-kg and b.xml in cm-g; expected the same unit"));
}

/// A file beside the scene comes before one of the same name in the folders; a file in neither is
/// an error that names the places.
TEST(SceneInclude, FilesAreAlsoFoundInFolders) {
  const testing::Folder folder;
  const std::filesystem::path here = folder.path(), library = here / "library";
  std::filesystem::create_directories(library / "parts");
  const auto write = [](const std::filesystem::path& path, const std::string& link) {
    std::string text = metric_scene(kSlider);
    for (const char* const name : {"link name=\"a", "joint name=\"a", "body name=\"a"}) {
      const std::string from = name;
      text.replace(text.find(from), from.size(), from.substr(0, from.size() - 1) + link);
    }
    std::ofstream(path) << text;
  };
  const std::string scene = metric_scene("<include file=\"parts/ball.xml\"/>");
  const auto body = [&](const std::string& text) {
    const SceneFile file =
        parse_scene(text, (here / "a.xml").string(), {.folders = {here / "none", library}});
    return file.scene.links.at(0).name;
  };
  const auto fault = [&](const std::string& text) -> std::string {
    try {
      return body(text);
    } catch (const IoError& e) {
      return e.what();
    }
  };
  EXPECT_THAT(fault(scene),
              HasSubstr("a.xml:3: <include>: 'parts/ball.xml' is in none of '" + here.string() +
                        "', '" + (here / "none").string() + "', '" + library.string()));
  write(library / "parts" / "ball.xml", "b");
  EXPECT_EQ(body(scene), "b");
  EXPECT_THAT(fault(metric_scene("<include file=\"parts/bal.xml\"/>")),
              HasSubstr("did you mean 'parts/ball.xml'"));
  std::filesystem::create_directories(here / "parts");
  write(here / "parts" / "ball.xml", "c");
  EXPECT_EQ(body(scene), "c");
}

TEST(SceneInclude, OneOfTheFilesMayHaveASectionThatIsGivenOnce) {
  const std::string ground = "<ground pos=\"0 0 -1\"/>";
  EXPECT_THAT(SceneFiles()
                  .add("a.xml", metric_scene("<include file=\"b.xml\"/><include file=\"c.xml\"/>"))
                  .add("b.xml", metric_scene(kSlider + ground))
                  .add("c.xml", metric_scene(ground))
                  .fault(),
              HasSubstr("given twice"));
  EXPECT_EQ(
      SceneFiles()
          .add("a.xml", metric_scene("<ground/><include file=\"b.xml\"/><include file=\"c.xml\"/>"))
          .add("b.xml", metric_scene(kSlider + ground))
          .add("c.xml", metric_scene(ground))
          .fault(),
      "");
}

}  // namespace
}  // namespace tangere
