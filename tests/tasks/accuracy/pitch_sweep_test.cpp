// SPDX-License-Identifier: Apache-2.0
// Tests what pads of other pitches feel, against sums that can be written down.
#include "tasks/accuracy/pitch_sweep.hpp"

#include <gmock/gmock.h>

#include "engine/step/control.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// A plate is 1 mm deep in a still pad and swings. `sensor`: more attributes of the pad.
FixedEpisodes pressed_plate(const std::string& plate, const std::string& sensor) {
  const Model model(parse_scene(R"(<tangere model="plate">
  <option unit="m-kg" gravity="0 0 0" timestep="5e-3" integrator="SDIRK2"/>
  <robot>
    <link name="pad">
      <joint name="pad" type="fixed"/>
      <body name="pad" type="cuboid" size="0.05 0.05 0.01" density="1000"/>
    </link>
  </robot>
  <robot>
    <link name="plate">
      <joint name="plate" type="prismatic" axis="0 0 1" pos="0 0 -0.014" stiffness="50"/>
      <body name="plate" )" + plate +
                                    R"( density="1000"/>
    </link>
  </robot>
  <sensor>
    <tactile name="pad" body="pad" type="rect_array" rect_pos0="-0.02 0.02 -0.005"
             rect_pos1="0.02 -0.02 -0.005" axis0="0 -1 0" axis1="1 0 0" )" +
                                    sensor + R"(/>
  </sensor>
  <initial><joint name="plate" v="0.01"/></initial>
</tangere>)",
                                "plate.xml")
                        .scene);
  const Batch start(model, 3, 1);
  return scene_episodes(start, ControlProgram(model, model.timestep(), 1), 10, 5);
}

TEST(PitchSweep, PointsStandForTheirArea) {
  // A plate that is wider than the pad presses every point alike. So all pads feel the same.
  const FixedEpisodes episodes =
      pressed_plate(R"(type="cuboid" size="0.2 0.2 0.02")", R"(resolution="17 9" kn="3")");
  const auto sweeps = sweep_pitches(episodes, 0.05, {});
  ASSERT_THAT(sweeps, SizeIs(1));
  const PitchSweep& sweep = sweeps[0];
  EXPECT_THAT(sweep.left_out, IsEmpty());
  EXPECT_EQ(sweep.reference.rows, 68);
  EXPECT_EQ(sweep.reference.cols, 36);
  const int rows[] = {2, 4, 9, 17, 34}, cols[] = {2, 2, 5, 9, 18};
  ASSERT_THAT(sweep.points, SizeIs(5));
  for (std::size_t i = 0; i < 5; ++i) {
    const PitchPoint& p = sweep.points[i];
    EXPECT_EQ(p.rows, rows[i]);
    EXPECT_EQ(p.cols, cols[i]);
    EXPECT_NEAR(p.pitch[0] * p.rows, 17 * 0.04 / 16, 1e-12);
    EXPECT_NEAR(p.pitch[1] * p.cols, 9 * 0.04 / 8, 1e-12);
    EXPECT_NEAR(p.force_error, 0, 1e-12);
    EXPECT_EQ(p.force_bound, p.force_error) << "three environments have one motion";
    EXPECT_NEAR(p.centre_error, 0, 1e-12) << "the middle of the pad, at every pitch";
    EXPECT_EQ(p.own, i == 3);
    EXPECT_GT(p.rate, 0);
  }
  EXPECT_EQ(sweep.advice, 0) << "the coarsest";
}

TEST(PitchSweep, ErrorsFallWithThePitchInsideThePad) {
  // A halved pitch brings four times as much accuracy, on the average over where the circle's rim
  // lies between points.
  const auto sweeps =
      sweep_pitches(pressed_plate(R"(type="sphere" radius="0.01" pos="0.0013 0.0007 0")",
                                  R"(resolution="33 33" kn="3" kt="0.1" mu="0.5")"),
                    1e-2, {});
  const std::vector<PitchPoint>& points = sweeps.at(0).points;
  ASSERT_THAT(points, SizeIs(5));
  EXPECT_LT(points[4].force_error, 0.003);
  EXPECT_LT(points[4].force_error, points[2].force_error / 4);
  EXPECT_LT(points[2].force_error, points[0].force_error / 4);
  EXPECT_LT(points[4].centre_error, 2e-5);
  ASSERT_GE(sweeps[0].advice, 0);
  EXPECT_LE(points[static_cast<std::size_t>(sweeps[0].advice)].force_bound, 1e-2);
}

TEST(PitchSweep, SaysWhyASensorIsLeftOut) {
  const std::string ball = R"(type="sphere" radius="0.01")";
  for (const auto& [sensor, reason] :
       {std::pair(R"(resolution="1 1" kn="3")", "it has one point"),
        std::pair(R"(resolution="9 9" kn="3" ks="1" mu="0.5")", "it has ks")}) {
    const auto sweeps = sweep_pitches(pressed_plate(ball, sensor), 1e-2, {});
    ASSERT_THAT(sweeps, SizeIs(1));
    EXPECT_THAT(sweeps[0].left_out, HasSubstr(reason));
    EXPECT_THAT(sweeps[0].points, IsEmpty());
  }
}

TEST(PitchSweep, StopsWhereItIsTold) {
  std::stop_source source;
  source.request_stop();
  const auto sweeps =
      sweep_pitches(pressed_plate(R"(type="sphere" radius="0.01")", R"(resolution="9 9" kn="3")"),
                    1e-2, source.get_token());
  EXPECT_THAT(sweeps, IsEmpty());
}

}  // namespace
}  // namespace tangere
