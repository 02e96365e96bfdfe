// SPDX-License-Identifier: Apache-2.0
// Tests files of maps from fields to channels: they keep their numbers, and mistakes have lines.
#include "io/scene/channel_file.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "engine/base/error.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using testing::kScene;
using testing::with;
namespace fs = std::filesystem;

class ChannelFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              ("tangere_channels_" +
               std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) const {
    const std::string path = (folder_ / name).string();
    std::ofstream(path) << text;
    return path;
  }
  std::string refusal(const std::string& text) const {
    try {
      std::vector<std::string> warnings;
      read_channel_map(write("map.xml", text), warnings);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder_;
};

const char* const kMap = R"(<channels nodes="1 2" unit="uT">
<channel name="bx" offset="3" linear="1 -2" quadratic="0.1 0.2 0.3"/>
<channel name="by" offset="-1.5" linear="4 5" quadratic="0 0 -1"/>
</channels>)";

TEST_F(ChannelFile, KeepsItsNumbers) {
  std::vector<std::string> warnings;
  const ChannelMap map = read_channel_map(write("hall.xml", kMap), warnings);
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(map.name, "hall");
  EXPECT_EQ(map.unit, "uT");
  EXPECT_FALSE(map.shear);
  EXPECT_EQ(map.names, (std::vector<std::string>{"bx", "by"}));
  EXPECT_EQ(map.linear, (std::vector<double>{1, -2, 4, 5}));
  EXPECT_EQ(map.quadratic, (std::vector<double>{0.1, 0.2, 0.3, 0, 0, -1}));
  const std::string text = channel_map_text(map, {{"recording", "a & b.csv"}});
  EXPECT_THAT(text, HasSubstr("<fit recording=\"a &amp; b.csv\"/>"));
  const ChannelMap again = read_channel_map(write("again.xml", text), warnings);
  EXPECT_EQ(again.offset, map.offset);
  EXPECT_EQ(again.linear, map.linear);
  EXPECT_EQ(again.quadratic, map.quadratic);
  EXPECT_NE(again.checksum, map.checksum);
}

TEST_F(ChannelFile, MistakesHaveLines) {
  EXPECT_THAT(refusal("<gel/>"), HasSubstr("map.xml:1: <gel>: not a map of channels"));
  EXPECT_THAT(refusal("<channels nodes=\"1.5 1\"/>"), HasSubstr("two whole numbers from 1 to 64"));
  EXPECT_THAT(refusal("<channels nodes=\"9 9\"/>"), HasSubstr("at most 64 in all"));
  EXPECT_THAT(refusal("<channels nodes=\"1 1\"/>"), HasSubstr("no channel"));
  EXPECT_THAT(refusal(with("linear=\"4 5\"", "linear=\"4\"", kMap)),
              HasSubstr("map.xml:3: <channel>: linear=\"4\" has 1 numbers"));
  EXPECT_THAT(refusal(with(" quadratic=\"0 0 -1\"", "", kMap)),
              HasSubstr("map.xml:3: <channel>: quadratic of some channels alone"));
  EXPECT_THAT(refusal(with("unit=", "loads=\"pressures\" unit=", kMap)),
              HasSubstr("did you mean 'pressure'"));
}

TEST_F(ChannelFile, StandsBesideItsScene) {
  write("hall.xml", kMap);
  const auto scene_of = [&](const std::string& part) {
    return with("damping=\"0.003\"/>", "damping=\"0.003\">" + part + "</tactile>", kScene);
  };
  const Scene scene =
      read_scene(write("scene.xml", scene_of("<channels file=\"hall.xml\" noise=\"2\"/>"))).scene;
  ASSERT_TRUE(scene.sensors[0].channels);
  EXPECT_EQ(scene.sensors[0].channels->noise, 2);
  EXPECT_EQ(scene.sensors[0].channels->map->channels(), 2U);
  EXPECT_THROW(read_scene(write("scene.xml", scene_of("<channels file=\"hole.xml\"/>"))), IoError);
  EXPECT_THROW(read_scene(write("scene.xml", scene_of("<channels noise=\"2\"/>"))), InputError);
}

}  // namespace
}  // namespace tangere
