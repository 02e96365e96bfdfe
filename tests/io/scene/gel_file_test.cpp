// SPDX-License-Identifier: Apache-2.0
// Tests files of gels and pictures of scenes: what is read, and where mistakes are.
#include "io/scene/gel_file.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "engine/model/model.hpp"
#include "engine/sense/readout.hpp"
#include "io/files/png_file.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class GelFile : public ::testing::Test {
 protected:
  GelFile() {
    gel_.pixel = 1e-4, gel_.reach = 2e-3, gel_.blur = 3e-4;
    for (std::size_t c = 0; c < kColours; ++c)
      for (std::size_t j = 0; j < kShades; ++j)
        for (std::size_t k = 0; k < kShadePlaces; ++k)
          gel_.lamps[c][j][k] = double(c) + 0.1 * double(j) - 0.01 * double(k);
    put("ground.png", png_bytes({2, 3, std::vector<std::uint8_t>(18, 77)}));
  }
  void put(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ + "/" + name, std::ios::binary) << text;
  }
  [[nodiscard]] Gel read() const {
    std::vector<std::string> warnings;
    Gel gel = read_gel(folder_ + "/gel.xml", warnings);
    EXPECT_THAT(warnings, IsEmpty());
    return gel;
  }
  [[nodiscard]] std::string error_of(const std::string& text) const {
    put("gel.xml", text);
    try {
      static_cast<void>(read());
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }
  /// A scene whose pad has the picture.
  [[nodiscard]] std::string scene(const std::string& picture) const {
    return "<tangere><option unit=\"m-kg\"/>\n<robot><link name=\"a\"><joint name=\"a\" "
           "type=\"prismatic\" axis=\"0 0 1\"/><body name=\"a\" type=\"cuboid\" size=\"0.02 0.02 "
           "0.01\" "
           "density=\"1000\"/></link></robot>\n<sensor><tactile name=\"pad\" body=\"a\" "
           "type=\"rect_array\" resolution=\"5 6\" rect_pos0=\"-0.005 -0.005 0.005\" "
           "rect_pos1=\"0.005 0.005 0.005\" axis0=\"1 0 0\" axis1=\"0 1 0\" kn=\"10\" ks=\"1\">\n" +
           picture + "</tactile></sensor></tangere>";
  }
  [[nodiscard]] std::string scene_error(const std::string& picture) const {
    put("scene.xml", scene(picture));
    try {
      static_cast<void>(Model(read_scene(folder_ + "/scene.xml").scene));
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }

  testing::Folder temporary_;
  std::string folder_ = temporary_.path();
  Gel gel_;
};

TEST_F(GelFile, ReadsWhatItWrote) {
  put("gel.xml", gel_text(gel_, "ground.png", {{"psnr", "31"}}));
  const Gel found = read();
  EXPECT_EQ(found.name, "gel");
  EXPECT_DOUBLE_EQ(found.pixel, 1e-4);
  EXPECT_DOUBLE_EQ(*found.reach, 2e-3);
  EXPECT_DOUBLE_EQ(found.blur, 3e-4);
  for (std::size_t c = 0; c < kColours; ++c)
    for (std::size_t j = 0; j < kShades; ++j)
      for (std::size_t k = 0; k < kShadePlaces; ++k)
        EXPECT_NEAR(found.lamps[c][j][k], gel_.lamps[c][j][k], 1e-6);
  EXPECT_EQ(found.background.rows, 2);
  EXPECT_EQ(found.background.levels, std::vector<float>(18, 77));
  put("ground.png", png_bytes({2, 3, std::vector<std::uint8_t>(18, 78)}));
  EXPECT_NE(read().checksum, found.checksum);
}

TEST_F(GelFile, MistakesAreErrorsWithTheirLine) {
  const std::string good = gel_text(gel_, "ground.png", {});
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return text.replace(text.find(from), from.size(), to);
  };
  EXPECT_THAT(error_of("<scene/>"), HasSubstr("gel.xml:1: <scene>: not a gel"));
  EXPECT_THAT(error_of(with("ground.png", "no.png")), HasSubstr("no.png"));
  EXPECT_THAT(error_of(with("<red nx", "<red n")),
              HasSubstr("gel.xml:2: <red>: unknown attribute"));
  EXPECT_THAT(error_of(with("nx=\"0 -0.01 -0.02\"", "nx=\"0 1\"")),
              HasSubstr("gel.xml:2: <red>: nx=\"0 1\" has 2 numbers; expected 3"));
  EXPECT_THAT(error_of(with("blur=\"0.0003\"", "blur=\"-1\"")), HasSubstr("expected zero or more"));
  EXPECT_THAT(error_of(with("<blue", "<green")), HasSubstr("a second time in one <gel>"));
  EXPECT_THAT(error_of(with("pixel=\"0.0001\"", "pixel=\"0.2\"")),
              HasSubstr("gel.xml:1: <gel>: pixel=\"0.2\"; expected 0.1 m at most"));
  EXPECT_THAT(error_of(with("reach=\"0.002\"", "reach=\"1\"")),
              HasSubstr("expected 0.1 m at most"));
  EXPECT_THAT(error_of(with("blur=\"0.0003\"", "blur=\"1\"")), HasSubstr("expected 0.1 m at most"));
  EXPECT_THAT(
      error_of(with("nx=\"0 -0.01 -0.02\"", "nx=\"0 -2e5 0\"")),
      HasSubstr("gel.xml:2: <red>: nx=\"0 -2e5 0\"; expected numbers from -100000 to 100000"));
  put("ground.png", "no picture");
  EXPECT_THAT(error_of(good), HasSubstr("ground.png: "));
  EXPECT_THAT(error_of(good), HasSubstr("expected a picture as PNG"));
}

TEST_F(GelFile, AScenesPictureHasItsAttributes) {
  put("gel.xml", gel_text(gel_, "ground.png", {}));
  put("scene.xml", scene("<markers/><picture gel=\"gel.xml\" rows=\"48\" cols=\"64\" size=\"0.012 "
                         "0.016\" mirror=\"true\" noise=\"1.5\" gain=\"0.02\" markers=\"4 3\" "
                         "marker_pitch=\"3e-3\" marker_radius=\"4e-4\"/>"));
  const Scene found = read_scene(folder_ + "/scene.xml").scene;
  const PictureDescription& picture = found.sensors[0].picture.value();
  EXPECT_EQ(picture.rows, 48);
  EXPECT_EQ(picture.cols, 64);
  EXPECT_EQ(picture.size.value(), (std::array{0.012, 0.016}));
  EXPECT_TRUE(picture.mirror);
  EXPECT_EQ(picture.noise, 1.5);
  EXPECT_EQ(picture.gain, 0.02);
  EXPECT_EQ(picture.markers, (std::array{4, 3}));
  EXPECT_EQ(picture.marker_pitch, 3e-3);
  EXPECT_EQ(picture.marker_radius, 4e-4);
  EXPECT_EQ(picture.gel->name, "gel");
  EXPECT_EQ(Model(found).sensors()[0].picture, (std::array{48, 64}));
  put("scene.xml", scene("<picture/>"));
  EXPECT_EQ(read_scene(folder_ + "/scene.xml").scene.sensors[0].picture->gel->name, "default");
}

TEST_F(GelFile, SizesOfMarkersNeedMarkers) {
  EXPECT_THAT(scene_error("<markers/><picture marker_pitch=\"3e-3\"/>"),
              HasSubstr("<picture>: marker_pitch without markers; expected markers="));
}

TEST_F(GelFile, NamesMayHoldWhatXmlUses) {
  const std::string name = "a & \"b\" <c>.png";
  put(name, png_bytes({1, 1, {1, 2, 3}}));
  put("gel.xml", gel_text(gel_, name, {{"photographs", "\"<&>\""}}));
  EXPECT_THAT(read().background.levels, ElementsAre(1, 2, 3));
}

TEST_F(GelFile, TextInAGelIsAWarningOfTheScene) {
  gel_.pixel = 0;
  std::string text = gel_text(gel_, "ground.png", {});
  put("gel.xml", text.insert(text.find("</gel>"), "stray"));
  put("scene.xml", scene("<picture gel=\"gel.xml\"/>"));
  EXPECT_THAT(read_scene(folder_ + "/scene.xml").warnings,
              Contains(AllOf(HasSubstr("gel.xml:"), HasSubstr("stray"))));
}

TEST_F(GelFile, OfAnotherSizeThanThePictureIsAWarning) {
  gel_.pixel = 0.004;  // 8 x 12 mm
  const auto warnings = [&](const std::string& picture) {
    put("gel.xml", gel_text(gel_, "ground.png", {}));
    put("scene.xml", scene(picture));
    std::vector<std::string> found;
    for (const std::string& warning : read_scene(folder_ + "/scene.xml").warnings)
      if (warning.find("<picture>") != std::string::npos) found.push_back(warning);
    return found;
  };
  const std::string own = "<picture gel=\"gel.xml\"/>",
                    sized = "<picture gel=\"gel.xml\" size=\"0.008 0.012\"/>";
  EXPECT_THAT(warnings(own),
              ElementsAre(AllOf(HasSubstr("scene.xml:4: <picture>: the picture shows 12.5 x 12 mm"),
                                HasSubstr("of the gel 'gel', by its pixel, 8 x 12 mm"))));
  EXPECT_THAT(warnings(sized), IsEmpty());
  gel_.pixel = 0.0046;
  EXPECT_THAT(warnings(sized), IsEmpty());
  gel_.pixel = 0.005;
  EXPECT_THAT(warnings(sized), SizeIs(1));
  gel_.pixel = 0;
  EXPECT_THAT(warnings(own), IsEmpty());
}

/// The picture of an untouched gel is its photograph, byte by byte.
TEST_F(GelFile, KeepsTheOrderOfChannelsAndRows) {
  std::vector<std::uint8_t> bytes(4 * 5 * 3);
  for (std::size_t k = 0; k < bytes.size(); ++k) bytes[k] = static_cast<std::uint8_t>(4 * k + 1);
  put("ground.png", png_bytes({4, 5, bytes}));
  gel_.pixel = 0;
  put("gel.xml", gel_text(gel_, "ground.png", {}));
  put("scene.xml", scene("<picture gel=\"gel.xml\" rows=\"4\" cols=\"5\"/>"));
  const Model model(read_scene(folder_ + "/scene.xml").scene);
  const Batch batch(model, 1, 0);
  std::vector<std::uint8_t> found(bytes.size());
  const std::span<std::uint8_t> to(found);
  Readout(model).read_block(batch, 0, {0, FieldForm::rgb},
                            std::span<const std::span<std::uint8_t>>(&to, 1));
  EXPECT_EQ(found, bytes);
}

TEST_F(GelFile, MistakesOfAScenesPictureAreErrorsWithTheirLine) {
  EXPECT_THAT(scene_error("<picture gel=\"no.xml\"/>"), HasSubstr("scene.xml:4: <picture>: "));
  EXPECT_THAT(scene_error("<picture rows=\"0\"/>"),
              HasSubstr("scene.xml:4: <picture>: rows=\"0\"; expected an integer from 1 to 2048"));
  EXPECT_THAT(scene_error("<picture markers=\"3 3\"/>"),
              HasSubstr("scene.xml:4: picture of 'pad': markers without <markers>"));
  EXPECT_THAT(scene_error("<picture/><picture/>"), HasSubstr("a second time in one <tactile>"));
}

}  // namespace
}  // namespace tangere
