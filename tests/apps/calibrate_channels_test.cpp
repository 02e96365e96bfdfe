// SPDX-License-Identifier: Apache-2.0
// Tests `tangere calibrate --channels` as a user runs it, with recordings that are made: channels
// are known functions of the loads of springs under a ball or a flat end.
#include <gmock/gmock.h>

#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "tests/apps/arrays.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

constexpr int kSide = 11;          // points, 1 mm apart
constexpr double kStiffness = 80;  // of a point [N/m]
constexpr double kBallRadius = 6e-3;

const char* const kSkin =
    "<sensor unit=\"m-kg\"><tactile name=\"skin_guess\" type=\"rect_array\" resolution=\"11 11\" "
    "rect_pos0=\"-0.005 0.005 0\" rect_pos1=\"0.005 -0.005 0\" axis0=\"0 -1 0\" axis1=\"1 0 0\" "
    "kn=\"80\" ks=\"30\" mu=\"5\"/></sensor>";

/// Loads of 2 × 2 nodes at the corners, by their definition. Row 0 is at the largest y.
std::array<double, 4> corner_loads(double x, double y, double depth) {
  std::array<double, 4> out{};
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const double dx = 1e-3 * (j - 5) - x, dy = 1e-3 * (5 - i) - y, dz = kBallRadius - depth;
      const double far = std::sqrt(dx * dx + dy * dy + dz * dz);
      if (far >= kBallRadius) continue;
      const double force = kStiffness * (kBallRadius - far) * dz / far;
      const double down = i / 10.0, right = j / 10.0;
      out[0] += (1 - down) * (1 - right) * force;
      out[1] += (1 - down) * right * force;
      out[2] += down * (1 - right) * force;
      out[3] += down * right * force;
    }
  return out;
}

/// Presses at places; `noise`: of the channels.
std::string presses(int rows, double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-4e-3, 4e-3), depth(2e-4, 2e-3);
  std::normal_distribution<double> normal;
  std::ostringstream text;
  text << std::setprecision(12) << "depth_mm,x,y,channel_bx,temperature,channel_bz\n";
  for (int k = 0; k < rows; ++k) {
    const double x = place(random), y = place(random), d = depth(random);
    const auto n = corner_loads(x, y, d);
    const double bx = 12 + 300 * (n[1] + n[3] - n[0] - n[2]) + 900 * n[0] * n[3],
                 bz = -4 - 200 * (n[0] + n[1] + n[2] + n[3]) + 400 * n[1] * n[1];
    text << 1e3 * d << ',' << x << ',' << y << ',' << bx + noise * normal(random) << ",21,"
         << bz + noise * normal(random) << '\n';
  }
  return text.str();
}

TEST(CalibrateChannels, AKnownMapIsFound) {
  const Folder folder;
  folder.write("skin.xml", kSkin);
  folder.write("presses.csv", presses(120, 0, 1));
  folder.write("others.csv", presses(40, 0, 2));
  const json answer =
      run_json(folder, {"calibrate", "presses.csv", "--sensor", "skin.xml", "--ball", "0.006",
                        "--channels", "map.xml", "--nodes", "2,2", "--unit", "uT", "--check",
                        "others.csv", "-o", "out.xml"});
  EXPECT_EQ(answer["channels"], json::array({"bx", "bz"}));
  EXPECT_EQ(answer["held_out"]["rows"], 24);
  EXPECT_GT(answer["held_out"]["whole"], 0.9999);
  EXPECT_GT(answer["other"]["mean"], 0.9999);
  EXPECT_EQ(answer["loads"], 4);
  const std::string map = folder.read("map.xml");
  EXPECT_THAT(map, HasSubstr("<channels nodes=\"2 2\" loads=\"pressure\" unit=\"uT\">"));
  EXPECT_THAT(map, HasSubstr("recording=\"presses.csv\""));
  EXPECT_THAT(folder.read("out.xml"), HasSubstr("<channels file=\"map.xml\"/>"));
  // The layout is one of a scene: its channels are those of the recording.
  folder.write("scene.xml", R"(<tangere model="press"><option unit="m-kg" gravity="0 0 0"/>
<robot><link name="skin"><joint name="skin" type="fixed"/>
<body name="skin" type="cuboid" size="0.02 0.02 0.01" pos="0 0 -0.005" density="1000"/></link>
</robot>
<robot><link name="ball"><joint name="ball" type="translational" pos="0.002 0.001 0.0049"/>
<body name="ball" type="sphere" radius="0.006" density="1000"/></link></robot>
<sensor><include file="out.xml" name="pad" body="skin" pos="0 0 0.005"/></sensor></tangere>)");
  run_json(folder, {"simulate", "scene.xml", "-o", "run.h5", "--steps", "1", "--timestep", "1e-9",
                    "--record", "pad.channels"});
  EXPECT_THAT(run(folder, {"inspect", "scene.xml"}).out, HasSubstr("2 channels in uT, map 'map'"));
  const std::vector<double> read = array_of(folder.path("run.h5"), "tactile/pad/channels").values;
  ASSERT_EQ(read.size(), 2U);
  const auto n = corner_loads(2e-3, 1e-3, 1.1e-3);
  EXPECT_NEAR(read[0], 12 + 300 * (n[1] + n[3] - n[0] - n[2]) + 900 * n[0] * n[3], 0.05);
  EXPECT_NEAR(read[1], -4 - 200 * (n[0] + n[1] + n[2] + n[3]) + 400 * n[1] * n[1], 0.05);
}

/// Noise that no map explains is not fitted: held-out rows are as good as the noise lets them.
TEST(CalibrateChannels, NoiseIsNotFitted) {
  const Folder folder;
  folder.write("skin.xml", kSkin);
  folder.write("presses.csv", presses(240, 30, 3));
  const json answer =
      run_json(folder, {"calibrate", "presses.csv", "--sensor", "skin.xml", "--ball", "0.006",
                        "--channels", "map.xml", "--nodes", "4,4", "--hold-out", "0.5"});
  EXPECT_GT(answer["held_out"]["whole"], 0.95);
  EXPECT_LT(answer["fitted"]["whole"], 0.995) << "120 rows, 152 numbers and noise of a tenth";
}

/// On a path friction has memory: a channel of the side load.
TEST(CalibrateChannels, ASideLoadIsAChannel) {
  const Folder folder;
  folder.write("skin.xml", kSkin);
  std::ostringstream text;
  text << "depth,shear,channel_side,channel_down\n";
  const double n = 37;  // points under the flat end
  for (int k = 0; k < 40; ++k) {
    const double d = 1e-4 + 2e-6 * k, s = 2e-4 * std::sin(0.4 * k);
    text << std::setprecision(12) << d << ',' << s << ',' << 50 * n * 30 * s << ','
         << 7 * n * 80 * d << '\n';
  }
  folder.write("path.csv", text.str());
  const json answer = run_json(folder, {"calibrate", "path.csv", "--sensor", "skin.xml", "--flat",
                                        "0.0035", "--channels", "map.xml", "--nodes", "1,1"});
  EXPECT_EQ(answer["loads"], 3);
  EXPECT_GT(answer["held_out"]["each"][0], 0.98);
  EXPECT_GT(answer["held_out"]["each"][1], 0.98);
  EXPECT_THAT(folder.read("map.xml"), HasSubstr("loads=\"force\""));
}

TEST(CalibrateChannels, RefusesWhatItCannotUse) {
  const Folder folder;
  folder.write("skin.xml", kSkin);
  folder.write("presses.csv", presses(20, 0, 1));
  folder.write("forces.csv", "depth,force\n1e-4,1\n2e-4,2\n3e-4,3\n");
  folder.write("half.csv", "depth,x,channel_a\n1e-4,0,1\n2e-4,0,2\n3e-4,0,3\n");
  folder.write("far.csv", "depth,x,y,channel_a\n1e-4,1,1,1\n2e-4,1,1,2\n3e-4,1,1,3\n4e-4,1,1,4\n");
  const auto refusal = [&](const std::string& table, const std::vector<std::string>& more) {
    std::vector<std::string> words = {"calibrate", table,   "--sensor",   "skin.xml",
                                      "--ball",    "0.006", "--channels", "map.xml"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 2) << table;
    return outcome.err;
  };
  EXPECT_THAT(refusal("forces.csv", {}), HasSubstr("no column 'channel_NAME' among depth, force"));
  EXPECT_THAT(refusal("half.csv", {}), HasSubstr("x without y"));
  EXPECT_THAT(refusal("far.csv", {}), HasSubstr("feels nothing in any row"));
  EXPECT_THAT(refusal("presses.csv", {"--nodes", "12,2"}), HasSubstr("12 x 2 nodes on 11 x 11"));
  EXPECT_THAT(refusal("presses.csv", {"--loads", "side"}), HasSubstr("expected pressure or force"));
  EXPECT_THAT(refusal("presses.csv", {"--table", "4"}), HasSubstr("--table beside --channels"));
  EXPECT_THAT(run(folder, {"calibrate", "presses.csv", "--sensor", "skin.xml", "--ball", "0.006",
                           "--nodes", "2,2"})
                  .err,
              HasSubstr("--nodes without --channels"));
  EXPECT_THAT(run(folder, {"calibrate", "presses.csv", "--sensor", "skin.xml", "--ball", "0.006",
                           "--channels", "map.xml"})
                  .err,
              HasSubstr("column 'temperature' is not used"));
}

}  // namespace
}  // namespace tangere::apps
