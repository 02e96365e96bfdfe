// SPDX-License-Identifier: Apache-2.0
// Tests densities that vary by environment: each environment moves as in a scene with its density,
// and resets keep to their keys.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/scene/scene_number.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

Scene scene_named(const std::string& name) {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml").scene;
  scene.randomizations.clear();
  return scene;
}

BodyDescription& body_of(Scene& scene, const std::string& name) {
  for (LinkDescription& link : scene.links)
    if (link.body.name == name) return link.body;
  throw std::runtime_error("no body " + name);
}

RandomizationDescription density_of(const std::string& body, double low, double high) {
  RandomizationDescription d;
  d.number = {NumberOwner::body, NumberField::density, body};
  d.distribution.a = low;
  d.distribution.b = high;
  return d;
}

/// States after `steps` steps of the scene's controls.
std::vector<std::vector<double>> run(const Model& model, Batch& batch, int steps) {
  Stepper stepper(model);
  const ControlProgram control(model, model.timestep(), batch.seed());
  const std::size_t nu = std::size_t(model.nu());
  std::vector<double> u(std::size_t(batch.environments()) * nu);
  for (int t = 0; t < steps; ++t) {
    for (int e = 0; e < batch.environments(); ++e)
      control.evaluate(t, e, std::span(u).subspan(std::size_t(e) * nu, nu));
    stepper.step(batch, u);
  }
  std::vector<std::vector<double>> q;
  for (int e = 0; e < batch.environments(); ++e) {
    q.emplace_back(std::size_t(model.nq()));
    batch.get_q(e, q.back());
  }
  return q;
}

TEST(Density, EachEnvironmentMovesAsInASceneOfItsOwn) {
  struct Case {
    const char *scene, *body;
    int steps;
  };
  // A block folded into a free bar; a box on two joints; the hand itself.
  for (const Case& c : {Case{"stable_grasp", "block_8", 90}, Case{"box_pushing", "box", 120},
                        Case{"box_pushing", "hand", 120}}) {
    Scene varied = scene_named(c.scene);
    varied.randomizations.push_back(density_of(c.body, 200, 900));
    const Model model(varied);
    Batch batch(model, 9, 2);
    std::vector<double> densities;
    for (int e = 0; e < 9; ++e) densities.push_back(batch.randomized_value(e, 0));
    const auto q = run(model, batch, c.steps);
    for (const int e : {0, 8}) {
      Scene own = scene_named(c.scene);
      body_of(own, c.body).density = densities[std::size_t(e)];
      const Model alone(own);
      Batch one(alone, 1, 2);
      const auto expected = run(alone, one, c.steps)[0];
      double moved = 0;
      for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_NEAR(q[std::size_t(e)][i], expected[i], 1e-7)
            << c.scene << " " << c.body << " coordinate " << i;
        moved = std::max(moved, std::abs(q[0][i] - q[8][i]));
      }
      EXPECT_GT(moved, 1e-5) << "density matters";
    }
  }
}

TEST(Density, CanBeSetAndAResetDrawsItAgain) {
  Scene scene = scene_named("box_pushing");
  scene.randomizations.push_back(density_of("box", 200, 900));
  const Model model(scene);
  Batch batch(model, 3, 7);
  const double drawn = batch.randomized_value(1, 0);
  EXPECT_TRUE(batch.is_parameter(0));
  batch.set_randomized_value(1, 0, 555);
  EXPECT_EQ(batch.randomized_value(1, 0), 555);
  batch.reset(1, 1);
  EXPECT_EQ(batch.randomized_value(1, 0), drawn);
  batch.reset(1, 40);
  EXPECT_EQ(batch.randomized_value(1, 0), Batch(model, 1, 7, 40).randomized_value(0, 0));
  EXPECT_EQ(batch.episode(1), 40);
}

TEST(Batch, AHeldEnvironmentIsNotStepped) {
  const Model model(scene_named("box_pushing"));
  Batch batch(model, 3);
  batch.hold(1);
  const auto q = run(model, batch, 5);
  Batch start(model, 1);
  std::vector<double> rest(std::size_t(model.nq()));
  start.get_q(0, rest);
  EXPECT_EQ(q[1], rest);
  EXPECT_EQ(q[0], q[2]);
  EXPECT_NE(q[0], q[1]);
  batch.reset(1, 1);
  EXPECT_FALSE(batch.held(1));
}

TEST(Density, WhatCannotVaryIsAnError) {
  const auto fails = [](const std::string& body) {
    Scene scene = scene_named("box_pushing");
    scene.randomizations.push_back(density_of(body, 200, 900));
    EXPECT_THROW(Model{scene}, InputError) << body;
  };
  fails("turntable");  // massless
  fails("nobody");
  Scene bottle = scene_named("cap_opening");
  bottle.randomizations.push_back(density_of("bottle", 200, 900));
  EXPECT_THROW(Model{bottle}, InputError) << "fixed in the world";
}

TEST(Density, IsReadFromAScene) {
  const std::string path = TANGERE_SOURCE_DIR "/scenes/box_pushing.xml";
  std::string text = read_scene(path).scene.text;
  const std::size_t at = text.find("<randomize>") + 11;
  const auto with = [&](const std::string& line) {
    return parse_scene(text.substr(0, at) + line + text.substr(at), path).scene;
  };
  const Scene scene = with("<body name=\"box\" field=\"density\" uniform=\"400 800\"/>");
  EXPECT_EQ(name_of(scene.randomizations[0].number), "body box density");
  EXPECT_EQ(scene.randomizations[0].distribution.b, 800);
  for (const char* wrong : {"<body name=\"bx\" field=\"density\" uniform=\"4 8\"/>",
                            "<body name=\"box\" field=\"densty\" uniform=\"4 8\"/>",
                            "<body name=\"box\" field=\"density\" uniform=\"0 8\"/>",
                            "<body name=\"turntable\" field=\"density\" uniform=\"4 8\"/>"})
    EXPECT_THROW(with(wrong), InputError) << wrong;
}

}  // namespace
}  // namespace tangere
