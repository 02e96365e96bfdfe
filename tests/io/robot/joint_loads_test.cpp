// SPDX-License-Identifier: Apache-2.0
// Loops and limits of imported robots hold what motors exert, also through tendons.
#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>

#include "engine/sense/loop_readings.hpp"
#include "engine/step/stepper.hpp"
#include "io/robot/robot_import.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/files.hpp"

namespace tangere {
namespace {

/// A four-bar linkage: its crank of 30 mm, and a tendon from a post to the crank's end.
Scene linkage(const std::string& tendon, const std::string& motor, const std::string& control,
              const std::string& crank = "") {
  const testing::Folder folder;
  std::ofstream(folder / "robot.xml")
      << "<mujoco><compiler angle=\"radian\" autolimits=\"true\"/><option timestep=\"0.001\"/>"
         "<worldbody><site name=\"post\" pos=\"0.04 0 0.26\"/>"
         "<body name=\"crank\" pos=\"0 0 0.2\" quat=\"0.8775825618903728 0 -0.479425538604203 0\">"
         "<joint name=\"crank\" axis=\"0 -1 0\" damping=\"1e-4\" armature=\"2e-5\" "
      << crank
      << "/><inertial pos=\"0.012 0 0.001\" mass=\"0.02\" diaginertia=\"1e-6 3e-6 3e-6\"/>"
         "<site name=\"end\" pos=\"0.03 0 0\"/><body name=\"coupler\" pos=\"0.03 0 0\" "
         "quat=\"0.9144873448719157 0 0.4046145030385265 0\"><joint name=\"coupler\" "
         "axis=\"0 -1 0\"/><inertial pos=\"0.025 0 0.004\" mass=\"0.03\" "
         "diaginertia=\"2e-6 1e-5 1e-5\"/></body></body><body name=\"rocker\" pos=\"0.05 0 0.2\" "
         "quat=\"0.8692306142462891 0 -0.4944068559971826 0\"><joint name=\"rocker\" "
         "axis=\"0 -1 0\" damping=\"1e-4\" stiffness=\"0.02\"/><inertial pos=\"0.02 0.001 0\" "
         "mass=\"0.025\" diaginertia=\"1.5e-6 6e-6 6e-6\"/></body></worldbody><tendon>"
      << tendon
      << "</tendon><equality><connect body1=\"coupler\" body2=\"rocker\" anchor=\"0.055 0 0\"/>"
         "</equality><actuator>"
      << motor << "</actuator><keyframe><key name=\"on\" ctrl=\"" << control
      << "\"/></keyframe></mujoco>";
  RobotOptions options;
  options.keyframe = "on";
  const ImportedScene made = import_robot(folder / "robot.xml", folder / "scene.xml", options);
  EXPECT_THAT(made.lost, ::testing::IsEmpty());
  return parse_scene(made.text, "scene.xml").scene;
}

/// Of the loop in 0.3 s, in which the motor throws the linkage about [m].
double gap_in_motion(const Scene& scene) {
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model);
  const std::vector<double> u = std::get<ConstantControl>(*scene.control).values;
  double gap = 0;
  for (int step = 0; step < 300; ++step) {
    stepper.step(batch, u);
    gap = std::max(gap, loop_readings(model, batch, 0).at(0).gap);
  }
  return gap;
}

const std::string kFixed = "<fixed name=\"t\"><joint joint=\"crank\" coef=\"2\"/></fixed>";
const std::string kSpatial =
    "<spatial name=\"t\"><site site=\"post\"/><site site=\"end\"/></spatial>";

const std::string kRange = "range=\"-0.8 0.8\"";

std::string servo(const char* kp, const std::string& range = "") {
  return std::string("<position tendon=\"t\" kp=\"") + kp + "\" kv=\"0.02\" " + range + "/>";
}
double limit_of_crank(const Scene& scene) { return scene.links.at(0).joint.limit_stiffness; }

/// A motor on a tendon of twice the crank's angle pulls it from one limit to the other with 5 N m
/// 3.2 2, also where its own targets lie at one end.
TEST(JointLoads, LoopsHoldServosOfFixedTendons) {
  const Scene with_targets = linkage(kFixed, servo("5", "ctrlrange=\"-1.6 1.6\""), "1.4");
  const Scene with_limits = linkage(kFixed, servo("5"), "1.4", kRange),
              with_both = linkage(kFixed, servo("5", "ctrlrange=\"1 1.6\""), "1.4", kRange);
  EXPECT_EQ(with_limits.loops.at(0).stiffness, with_targets.loops.at(0).stiffness);
  EXPECT_EQ(with_both.loops.at(0).stiffness, with_targets.loops.at(0).stiffness);
  for (const Scene& scene : {with_targets, with_limits, with_both})
    EXPECT_LT(gap_in_motion(scene), 1e-6);
  EXPECT_LT(limit_of_crank(with_limits), 10) << "the targets are the limits";
}

/// A tendon from a post to the crank's end, 30 mm from its joint.
TEST(JointLoads, LoopsAndLimitsHoldMotorsOfSpatialTendons) {
  const Scene with_targets = linkage(kSpatial, servo("2000", "ctrlrange=\"0.03 0.06\""), "0.04"),
              with_limits = linkage(kSpatial, servo("2000"), "0.04", kRange),
              with_force =
                  linkage(kSpatial, "<motor tendon=\"t\" ctrlrange=\"-50 0\"/>", "-50", kRange),
              weak = linkage(kSpatial, "<motor tendon=\"t\" ctrlrange=\"-1e-3 0\"/>", "0", kRange);
  for (const Scene& scene : {with_targets, with_limits, with_force}) {
    EXPECT_GT(scene.loops.at(0).stiffness, 50 * weak.loops.at(0).stiffness);
    EXPECT_LT(gap_in_motion(scene), 1e-7);
  }
  EXPECT_DOUBLE_EQ(limit_of_crank(with_force), 50 * 0.03 / 0.01);
}

/// A servo presses against a limit with what its targets are beyond it: 20 N m/rad 1.7 rad.
TEST(JointLoads, LimitsHoldServosWhoseTargetsAreBeyondThem) {
  const auto limit = [](const char* targets) {
    return limit_of_crank(linkage(kFixed,
                                  std::string("<position joint=\"crank\" kp=\"20\" kv=\"0.05\" "
                                              "ctrlrange=\"") +
                                      targets + "\"/>",
                                  "0.5", kRange));
  };
  EXPECT_DOUBLE_EQ(limit("0.5 2.5"), 34 / 0.01);
  EXPECT_LT(limit("0.5 0.8"), 10);
}

}  // namespace
}  // namespace tangere
