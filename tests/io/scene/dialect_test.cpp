// SPDX-License-Identifier: Apache-2.0
// Tests files in the published dialect that together use its elements and oddities. They load,
// report what they leave out, and run. Files with features that are not simulated are refused by
// name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

const std::string kFolder = std::string(TANGERE_TEST_DATA) + "/scenes/";

std::string text_of(const std::string& name) {
  std::ifstream file(kFolder + name);
  EXPECT_TRUE(file) << name << " is missing";
  std::stringstream all;
  all << file.rdbuf();
  return all.str();
}

std::string warnings_of(const SceneFile& file) {
  std::string all;
  for (const std::string& w : file.warnings) all += w + "\n";
  return all;
}

/// Steps with constant controls. Returns the last q.
std::vector<double> run(const Model& model, const std::vector<double>& u, int steps) {
  Batch batch(model, 1);
  Stepper stepper(model);
  for (int k = 0; k < steps && batch.failed_count() == 0; ++k) stepper.step(batch, u);
  EXPECT_EQ(batch.failed_count(), 0) << to_string(batch.status(0));
  std::vector<double> q(std::size_t(model.nq()));
  batch.get_q(0, q);
  for (const double x : q) EXPECT_TRUE(std::isfinite(x));
  return q;
}

double coordinate(const Model& model, const std::vector<double>& q, const std::string& name) {
  for (std::size_t i = 0; i < q.size(); ++i)
    if (model.q_names()[i] == name) return q[i];
  ADD_FAILURE() << "no coordinate " << name;
  return NAN;
}

/// World position and quaternion of a body.
std::vector<double> pose_of(const Model& model, const std::vector<double>& q, int body) {
  Batch batch(model, 1);
  batch.set_state(0, q, std::vector<double>(std::size_t(model.nv()), 0));
  std::vector<double> pose(std::size_t(7 * model.nb())), twist(std::size_t(6 * model.nb()));
  Readout(model).bodies(batch, 0, pose, twist);
  return {pose.begin() + 7 * body, pose.begin() + 7 * body + 7};
}

TEST(Dialect, HandLoadsAndSaysWhatItLeavesOut) {
  const SceneFile file = read_scene(kFolder + "dialect_hand.xml");
  const std::string warnings = warnings_of(file);
  for (const char* part : {"max_ls", "design_params", "'lim' has no effect", "'axis' has no effect",
                           "stray text", "pictures only"})
    EXPECT_THAT(warnings, HasSubstr(part));
  const Scene& s = file.scene;
  EXPECT_EQ(s.name, "hand");
  const Model model(s);
  EXPECT_EQ(model.nq(), 2 + 4 + 4 + 7 + 7);
  EXPECT_EQ(model.nv(), 2 + 3 + 3 + 6 + 6);
  EXPECT_EQ(model.nu(), 2 + 3);
  EXPECT_EQ(model.nb(), 8);
  EXPECT_EQ(s.links[1].joint.axis0[1], 1) << "normalised";
  // A joint placed in the world, under a parent at z = 11.5 cm.
  EXPECT_NEAR(s.links[2].joint.pose.position[2], -0.0605, 1e-15);
  EXPECT_NEAR(model.mass(0), 36 * 0.5e-3, 1e-15) << "the default density";
  EXPECT_NEAR(model.mass(1), 0.01, 1e-17);
  EXPECT_NEAR(model.mass(5), 0.5e-3 * 4, 1e-15) << "half of a cube of 2 cm, placed in the world";
  EXPECT_NEAR(s.links[1].joint.limit_stiffness, 0.1, 1e-15) << "1e6 of cm-g, of a joint that turns";
  EXPECT_NEAR(s.motors[0].P, 0.1, 1e-15);
  EXPECT_NEAR(s.motors[0].high, 0.1, 1e-15);
  EXPECT_NEAR(s.motors[1].P, 0.2, 1e-15);
  EXPECT_NEAR(s.ground_contacts[1].coefficients.kn, 2e3, 1e-12) << "the element's own";
  EXPECT_NEAR(s.ground_contacts[1].coefficients.kt, 3, 1e-12) << "the default";
  ASSERT_EQ(model.sensors().size(), 2U);
  EXPECT_EQ(model.sensors()[0].name, "tip") << "a sensor without a name has its body's";
  EXPECT_EQ(model.sensors()[0].pressure_sign, 1);
  EXPECT_EQ(model.sensors()[1].rows, 1);
  EXPECT_EQ(model.contacts()[4].points, 3);  // tripod.txt
  EXPECT_EQ(model.contacts()[5].points, 6);  // wedge.obj
  EXPECT_EQ(model.contacts()[1].points, 4);  // tetrahedron.obj
}

TEST(Dialect, HandPressesTheBall) {
  const Model model(read_scene(kFolder + "dialect_hand.xml").scene);
  const std::vector<double> u = {0, 0, 0, 0, 0};
  const std::vector<double> q = run(model, u, 200);
  Batch batch(model, 1);
  std::vector<double> v(std::size_t(model.nv()), 0), force(300), line(30);
  batch.set_state(0, q, v);
  Readout readout(model);
  readout.tactile(batch, 0, 0, force);
  readout.tactile(batch, 0, 1, line);
  EXPECT_LT(coordinate(model, q, "can.z"), 0) << "stands in the springs of the ground";
  EXPECT_GT(coordinate(model, q, "can.z"), -1e-4);
  double pressure = 0, along = 0;
  for (std::size_t k = 2; k < force.size(); k += 3) pressure += force[k];
  for (std::size_t k = 2; k < line.size(); k += 3) along += line[k];
  EXPECT_GT(pressure, 1e-4);
  EXPECT_LT(along, -1e-4) << "its axes point into the tip: pressure reads negative";
  EXPECT_EQ(model.sensors()[1].pressure_sign, -1);
  EXPECT_NEAR(pose_of(model, q, 3)[2], 0.042, 1e-3) << "the tip, on the ball";
}

TEST(Dialect, YardLoadsAndRuns) {
  const SceneFile file = read_scene(kFolder + "dialect_yard.xml");
  EXPECT_EQ(warnings_of(file), "");
  const Model model(file.scene);
  EXPECT_EQ(model.integrator(), Integrator::sdirk2);
  EXPECT_EQ(model.nq(), 1 + 2 + 3 + 3 + 7 + 4);
  EXPECT_EQ(model.nu(), 1 + 2 + 3);
  EXPECT_EQ(model.scene().links[0].joint.axis0[0], 1);
  EXPECT_EQ(model.mass(0), 100 * 0.1 * 0.1 * 0.02);
  EXPECT_EQ(model.scene().ground->normal[2], 1) << "the default";
  const double weight = model.mass(3) * 9.8;
  // Force motors: u = 0 is the middle of the range.
  const std::vector<double> q = run(model, {-1.0 / 3, 0.02, -0.01, -1, -1, weight - 1}, 100);
  EXPECT_NEAR(coordinate(model, q, "cart.position"), 0, 1e-12) << "u = -1/3 of -1 … 2 N is none";
  EXPECT_NEAR(coordinate(model, q, "table.axis0"), 0.02, 0.01);
  EXPECT_NEAR(coordinate(model, q, "lift.x"), 0, 1e-15) << "u = -1 of 0 … 2 N is none";
  EXPECT_NEAR(coordinate(model, q, "lift.z"), 0, 1e-12) << "carried by 1 + u N";
  // The die's joint is tilted, and so are its coordinates; in the world it lies on a face.
  EXPECT_NEAR(pose_of(model, q, 4)[2], 0.025 - model.mass(4) * 9.8 / 4e3, 1e-4);
}

/// If a file needs something that is not simulated, it is refused at that line before anything
/// runs.
TEST(Dialect, WhatIsNotSimulatedIsRefusedByName) {
  const auto refusal = [](const std::string& from, const std::string& to) {
    std::string text = text_of("dialect_hand.xml");
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    try {
      parse_scene(text, kFolder + "hand.xml");
    } catch (const std::exception& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refusal("OBJ_TO_JOINT", "BODY_TO_JOINT"),
              HasSubstr("supported: OBJ_TO_JOINT, OBJ_TO_WORLD"));
  EXPECT_THAT(
      refusal("<virtual>",
              "<variable><endeffector joint=\"lowre\" pos=\"0 0 -1\"/></variable>\n<virtual>"),
      HasSubstr("lower"));
  EXPECT_THAT(refusal("<tactile body=\"tip\" type=\"rect_array\"",
                      "<tactile body=\"tip\" type=\"abstract\" spec=\"gone.txt\""),
              AllOf(HasSubstr("hand.xml:"), HasSubstr("<tactile>: "), HasSubstr("gone.txt")));
  EXPECT_THAT(refusal("scale=\"1 1 1\"", "scale=\"1 1 0\""),
              HasSubstr("expected factors other than 0"));
  EXPECT_THAT(refusal("meshes/tetrahedron.obj", "meshes/tetraeder.obj"),
              AllOf(HasSubstr("hand.xml:29: <body>: "), HasSubstr("meshes/tetraeder.obj")));
  EXPECT_THAT(refusal("./tripod.txt", "./tripot.txt"), HasSubstr("hand.xml:25: <collision>: "));
  EXPECT_THAT(refusal("ctrl=\"position\"/>", "ctrl=\"velocity\"/>"), HasSubstr("velocity"));
  EXPECT_THAT(refusal("integrator=\"BDF1\"", "integrator=\"RK4\""), HasSubstr("BDF1"));
}

}  // namespace
}  // namespace tangere
