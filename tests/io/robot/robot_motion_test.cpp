// SPDX-License-Identifier: Apache-2.0
// Imported mechanisms move as their closed forms say (tests/data/README.md).
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <utility>

#include "engine/sense/loop_readings.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "io/robot/robot_import.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::IsEmpty;
const std::string kFolder = TANGERE_TEST_DATA "/robots/";

/// Rows of a table of numbers below one line of names.
struct MotionTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;
};

MotionTable read_table(const std::string& path) {
  MotionTable out;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::vector<double> row;
    for (std::string word; std::getline(words, word, ',');)
      if (out.rows.empty() && line.starts_with("time"))
        out.names.push_back(word);
      else
        row.push_back(std::stod(word));
    if (!row.empty()) out.rows.push_back(row);
  }
  return out;
}

/// Largest difference of a body's place from the table, up to 0.5 s [m].
double largest_error(Scene scene, const MotionTable& truth) {
  scene.integrator = Integrator::sdirk2;
  scene.timestep = 2.5e-4;
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model);
  const auto bodies = std::size_t(model.nb());
  std::vector<double> pose(7 * bodies), twist(6 * bodies);
  double worst = 0, time = 0;
  std::size_t compared = 0;
  for (const std::vector<double>& row : truth.rows) {
    if (row[0] > 0.5) break;
    for (; time < row[0] - 1e-9; time += scene.timestep) stepper.step(batch, {});
    Readout(model).bodies(batch, 0, pose, twist);
    for (std::size_t b = 0; b < bodies; ++b)
      for (std::size_t c = 0; c < truth.names.size(); ++c)
        if (truth.names[c] == model.body_names()[b] + ".x") {
          for (std::size_t k = 0; k < 3; ++k)
            worst = std::max(worst, std::abs(pose[7 * b + k] - row[c + k]));
          ++compared;
        }
  }
  EXPECT_GT(compared, 10U);
  return worst;
}

/// <replicate>, and <attach> of a body of another file in a frame.
TEST(RobotMotion, CopiesMoveWhereMujocoPutsThem) {
  const ImportedScene made = import_robot(kFolder + "copies.xml", "scene.xml", {});
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_LT(
      largest_error(parse_scene(made.text, "scene.xml").scene, read_table(kFolder + "copies.csv")),
      5e-5);
}

/// Moments that no solid has, and a point of mass on a fixed joint.
TEST(RobotMotion, OddInertiasMoveAsTheyAreWritten) {
  const ImportedScene made = import_robot(kFolder + "odd_inertia.urdf", "scene.xml", {});
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_LT(largest_error(parse_scene(made.text, "scene.xml").scene,
                          read_table(kFolder + "odd_inertia.csv")),
            5e-5);
}

/// Largest difference of joints' coordinates from the first columns of the table, up to 0.5 s, with
/// the scene's constant controls. Columns are those of MJCF, where no joint has ref.
double largest_joint_error(Scene scene, const MotionTable& truth, std::size_t joints) {
  scene.integrator = Integrator::sdirk2;
  scene.timestep = 2.5e-4;
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model);
  std::vector<double> u(std::size_t(model.nu())), q(std::size_t(model.nq()));
  if (scene.control) u = std::get<ConstantControl>(*scene.control).values;
  double worst = 0, time = 0;
  for (const std::vector<double>& row : truth.rows) {
    if (row[0] > 0.5) break;
    for (; time < row[0] - 1e-9; time += scene.timestep) stepper.step(batch, u);
    batch.get_q(0, q);
    for (std::size_t k = 0; k < joints; ++k) {
      const auto at = std::ranges::find_if(model.q_names(), [&](const std::string& name) {
        return name.starts_with(truth.names[1 + k] + ".");
      });
      worst =
          std::max(worst, std::abs(q.at(std::size_t(at - model.q_names().begin())) - row[1 + k]));
    }
  }
  EXPECT_GT(time, 0.4);
  return worst;
}

/// A joint that slides by half of another, and one that turns 1.3 times as far.
TEST(RobotMotion, MimicJointsFollowTheirLeaders) {
  const ImportedScene made = import_robot(kFolder + "mimic_gripper.urdf", "scene.xml", {});
  EXPECT_THAT(made.lost, IsEmpty());
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  const MotionTable truth = read_table(kFolder + "mimic_gripper.csv");
  EXPECT_LT(largest_error(scene, truth), 5e-5);
  EXPECT_LT(largest_joint_error(scene, truth, 4), 5e-5);
}

/// A joint with ref that follows another by five coefficients.
TEST(RobotMotion, AJointFollowsByAPolynomial) {
  const ImportedScene made = import_robot(kFolder + "poly_joint.xml", "scene.xml", {});
  EXPECT_THAT(made.lost, IsEmpty());
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  const MotionTable truth = read_table(kFolder + "poly_joint.csv");
  EXPECT_LT(largest_error(scene, truth), 1e-6);
  EXPECT_LT(largest_joint_error(scene, truth, 2), 1e-5);
}

/// A tendon along three joints, with a spring, damping and an affine actuator that is clipped.
TEST(RobotMotion, ATendonPullsItsJoints) {
  RobotOptions options;
  options.keyframe = "on";
  const ImportedScene made = import_robot(kFolder + "tendon_finger.xml", "scene.xml", options);
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_LT(largest_joint_error(parse_scene(made.text, "scene.xml").scene,
                                read_table(kFolder + "tendon_finger.csv"), 3),
            5e-5);
}

/// Two actuators of a joint, gain and bias with a gear, a damping ratio, and a force at a site.
TEST(RobotMotion, ActuatorsPushJointsAndSites) {
  RobotOptions options;
  options.keyframe = "on";
  const ImportedScene made = import_robot(kFolder + "actuators.xml", "scene.xml", options);
  EXPECT_THAT(made.lost, IsEmpty());
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  ASSERT_EQ(scene.transmissions.size(), 1U);
  EXPECT_LT(largest_joint_error(scene, read_table(kFolder + "actuators.csv"), 3), 1e-4);
}

/// A tendon around a drum, by the side that a site says, and one straight across a joint.
TEST(RobotMotion, TendonsGoAroundADrum) {
  const ImportedScene made = import_robot(kFolder + "spatial_tendon.xml", "scene.xml", {});
  EXPECT_THAT(made.lost, IsEmpty());
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  ASSERT_EQ(scene.transmissions.size(), 2U);
  const MotionTable truth = read_table(kFolder + "spatial_tendon.csv");
  EXPECT_LT(largest_joint_error(scene, truth, 2), 5e-5);
  EXPECT_LT(largest_error(scene, truth), 5e-5);
}

/// Dry friction: a swing loses 2 τ/k in each half swing, a wheel stops, a pendulum is held.
TEST(RobotMotion, DryJointsMoveByCoulombsLaw) {
  RobotOptions options;
  options.keyframe = "start";
  const ImportedScene made = import_robot(kFolder + "dry_joints.xml", "scene.xml", options);
  EXPECT_THAT(made.lost, IsEmpty());
  Scene scene = parse_scene(made.text, "scene.xml").scene;
  scene.integrator = Integrator::sdirk2;
  scene.timestep = 2.5e-4;
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model);
  std::vector<double> q(std::size_t(model.nq()));
  double time = 0, settled = 0;
  for (const std::vector<double>& row : read_table(kFolder + "dry_joints.csv").rows) {
    for (; time < row[0] - 1e-9; time += scene.timestep) stepper.step(batch, {});
    batch.get_q(0, q);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(q[k], row[1 + k], 2e-2) << time << " s";
    if (std::abs(time - 0.5) < 1e-9) settled = q[2];
  }
  EXPECT_GT(time, 0.9);
  EXPECT_NEAR(q[2], settled, 1e-8) << "the held joint does not creep";
}

/// The scene with damped loops, as SDIRK2 needs them (docs/dynamics.md).
Scene damped_loops(Scene scene) {
  constexpr double kTime = 0.02;  // [s]
  for (LoopDescription& loop : scene.loops) {
    loop.damping = kTime * loop.stiffness;
    loop.turning_damping = kTime * loop.turning_stiffness;
  }
  return scene;
}

/// Largest gap and turn of loops in a run of 0.5 s by the scheme of the file.
std::pair<double, double> largest_gap(const Scene& scene) {
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model);
  double gap = 0, turn = 0;
  for (double time = 0; time < 0.5; time += model.timestep()) {
    stepper.step(batch, {});
    for (const LoopReading& loop : loop_readings(model, batch, 0))
      gap = std::max(gap, loop.gap), turn = std::max(turn, loop.turn);
  }
  return {gap, turn};
}

/// A crank, a coupler and a rocker that a <connect> closes.
TEST(RobotMotion, AFourBarLinkageStaysClosed) {
  const ImportedScene made = import_robot(kFolder + "four_bar.xml", "scene.xml", {});
  EXPECT_THAT(made.lost, IsEmpty());
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  ASSERT_EQ(scene.loops.size(), 1U);
  const MotionTable truth = read_table(kFolder + "four_bar.csv");
  EXPECT_LT(largest_error(damped_loops(scene), truth), 2e-5);
  EXPECT_LT(largest_joint_error(damped_loops(scene), truth, 3), 5e-4);
  EXPECT_LT(largest_gap(scene).first, 1e-5);
  Scene stiffer = scene;
  stiffer.loops[0].stiffness *= 10;
  EXPECT_LT(largest_joint_error(damped_loops(stiffer), truth, 3), 1e-4);
}

/// A position motor without a range of its force pulls at most across its targets.
TEST(RobotMotion, LoopsHoldTheForceAcrossTargets) {
  const auto stiffness = [](const std::string& motor) {
    const testing::Folder folder;
    std::ofstream(folder / "robot.xml")
        << "<mujoco><worldbody><body name=\"a\"><joint name=\"j\" axis=\"0 1 0\" "
           "range=\"-14.3239448783 14.3239448783\"/>"
           "<geom size=\"0.01\" pos=\"0.1 0 0\"/></body></worldbody><equality><connect body1=\"a\" "
           "anchor=\"0.5 0 0\"/></equality><actuator>" +
               motor + "</actuator></mujoco>";
    const ImportedScene made = import_robot(folder / "robot.xml", folder / "scene.xml", {});
    return parse_scene(made.text, "scene.xml").scene.loops.at(0).stiffness;
  };
  // 200 N m over 0.5 m, for 1 um.
  EXPECT_DOUBLE_EQ(
      stiffness("<position joint=\"j\" kp=\"100\" ctrllimited=\"true\" ctrlrange=\"-1 1\"/>"), 4e8);
  EXPECT_DOUBLE_EQ(stiffness("<position joint=\"j\" kp=\"100\" ctrllimited=\"true\" "
                             "ctrlrange=\"-1 1\" forcelimited=\"true\" forcerange=\"-50 50\"/>"),
                   1e8);
  EXPECT_DOUBLE_EQ(stiffness("<position joint=\"j\" kp=\"100\"/>"), 1e8);  // limits: +-0.25 rad
  EXPECT_LT(stiffness("<motor joint=\"j\" ctrllimited=\"true\" ctrlrange=\"-0.01 0.01\"/>"), 1e6);
}

/// An object that a <weld> holds in the hand of an arm.
TEST(RobotMotion, AWeldHoldsAnObject) {
  const ImportedScene made = import_robot(kFolder + "weld_arm.xml", "scene.xml", {});
  EXPECT_THAT(made.lost, IsEmpty());
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  ASSERT_EQ(scene.loops.size(), 1U);
  EXPECT_TRUE(scene.loops[0].weld);
  const MotionTable truth = read_table(kFolder + "weld_arm.csv");
  EXPECT_LT(largest_error(damped_loops(scene), truth), 3e-4);
  EXPECT_LT(largest_joint_error(damped_loops(scene), truth, 2), 3e-4);
  EXPECT_LT(largest_gap(scene).first, 1e-5);
}

}  // namespace
}  // namespace tangere
