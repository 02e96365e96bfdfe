// SPDX-License-Identifier: Apache-2.0
// Tests sizes and places that vary by environment. Each environment moves, and is felt, as in a
// scene with its numbers, whatever its neighbours have, on every instruction set.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using testing::link;

Scene scene_named(const std::string& name) {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml").scene;
  scene.randomizations.clear();
  return scene;
}

RandomizationDescription varying(const SceneNumber& number, double low, double high) {
  RandomizationDescription d;
  d.number = number;
  d.distribution.a = low;
  d.distribution.b = high;
  return d;
}

SceneNumber size(const std::string& body, int which) { return size_of_body(body, which); }
SceneNumber place(const std::string& joint, int axis) {
  return {NumberOwner::joint, NumberField::pos, joint, axis};
}
SceneNumber density(const std::string& body) {
  return {NumberOwner::body, NumberField::density, body};
}

/// A pad driven onto a shape on springs, whose joint stands on an arm that turns. Varies numbers of
/// the shape, of its place and of its density.
Scene pad_on(const Shape& shape, const std::vector<RandomizationDescription>& numbers) {
  Scene s;
  s.integrator = Integrator::bdf2;
  s.links = {link("pad", JointType::translational, {0, 0, 0.0555},
                  CuboidShape{{0.08, 0.08, 0.01}, {14, 14, 2}}, 500),
             link("arm", JointType::revolute, {0.01, 0, -0.03}, SphereShape{0.01}, 2000),
             link("anvil", JointType::spherical, {0.02, 0.005, 0.05}, shape, 800)};
  s.links[0].joint.damping = 2;
  s.links[1].joint.pose.orientation = {std::sqrt(0.5), 0, std::sqrt(0.5), 0};  // its x points down
  s.links[1].joint.stiffness = 5, s.links[1].joint.damping = 0.05;
  s.links[2].parent = 1;
  s.links[2].joint.pose.position = {-0.05, 0.005, 0.012};
  s.links[2].joint.stiffness = 0.5, s.links[2].joint.damping = 0.002;
  s.motors.push_back({"pad_joint", -2, 2, {}});
  s.pair_contacts.push_back({"pad", "anvil", {300, 2, 0.8, 50}, ContactLaw::clamped, 1e-5, {}});
  TactileDescription t;
  t.name = t.body = "pad";
  t.coefficients = {1, 0.01, 2, 0.003};
  t.array = {{-0.03, 0.03, -0.005},
             {0.03, -0.03, -0.005},
             {0, -1, 0},
             {1, 0, 0},
             12,
             12};  // small pads are read in lanes otherwise
  s.sensors.push_back(t);
  s.control = PiecewiseControl{{0, 0.1}, {{0, 0, 0.05}, {0.1, 0.05, 0.05}}, 0};
  s.randomizations = numbers;
  return s;
}

/// The scene with the numbers of one environment in place of those that vary.
Scene written(const Scene& scene, const Batch& batch, int environment) {
  Scene own = scene;
  own.randomizations.clear();
  for (std::size_t k = 0; k < scene.randomizations.size(); ++k) {
    const RandomizationDescription& d = scene.randomizations[k];
    number_in(own, d.number) = batch.randomized_value(environment, static_cast<int>(k));
  }
  return own;
}

struct Result {
  std::vector<std::vector<double>> q, v;
  std::vector<std::vector<double>> fields;  ///< of all sensors, environment by environment
  std::vector<std::vector<float>> mixed;
  double touch = 0;  ///< the largest force on any point
};

Result run(const Model& model, Batch& batch, int steps) {
  Stepper stepper(model);
  const ControlProgram control(model, model.timestep(), batch.seed());
  const std::size_t nu = std::size_t(model.nu());
  std::vector<double> u(std::size_t(batch.environments()) * nu);
  for (int t = 0; t < steps; ++t) {
    for (int e = 0; e < batch.environments(); ++e)
      control.evaluate(t, e, std::span(u).subspan(std::size_t(e) * nu, nu));
    stepper.step(batch, u);
  }
  Result r;
  Readout wide(model), mixed(model, Precision::mixed);
  const auto n = std::size_t(batch.environments());
  r.q.assign(n, std::vector<double>(std::size_t(model.nq())));
  r.v.assign(n, std::vector<double>(std::size_t(model.nv())));
  r.fields.resize(n), r.mixed.resize(n);
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    const std::size_t numbers = 3 * std::size_t(model.sensors()[s].points);
    for (int b = 0; b < batch.blocks(); ++b) {
      const std::size_t first = std::size_t(b) * kernels::kBlock,
                        count = std::min(n - first, std::size_t(kernels::kBlock));
      std::vector<std::vector<double>> fields(count, std::vector<double>(numbers));
      std::vector<std::vector<float>> singles(count, std::vector<float>(numbers));
      std::vector<std::span<double>> to(fields.begin(), fields.end());
      std::vector<std::span<float>> to_f(singles.begin(), singles.end());
      wide.read_block(batch, b, {static_cast<int>(s)}, to);
      mixed.read_block(batch, b, {static_cast<int>(s)}, to_f);
      for (std::size_t e = 0; e < count; ++e) {
        r.fields[first + e].insert(r.fields[first + e].end(), fields[e].begin(), fields[e].end());
        r.mixed[first + e].insert(r.mixed[first + e].end(), singles[e].begin(), singles[e].end());
        for (const double f : fields[e]) r.touch = std::max(r.touch, std::abs(f));
      }
    }
  }
  for (int e = 0; e < batch.environments(); ++e) {
    batch.get_q(e, r.q[std::size_t(e)]);
    batch.get_v(e, r.v[std::size_t(e)]);
  }
  return r;
}

/// Runs `body` on every instruction set that this machine has.
template <class Body>
void on_every_table(const Body& body) {
  const kernels::KernelTable& before = kernels::active_kernels();
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    kernels::use_kernels(*table);
    body();
  }
  kernels::use_kernels(before);
}

struct Case {
  const char* name;
  Scene scene;
  int steps;
};

std::vector<Case> cases() {
  Scene cap = scene_named("cap_opening");
  cap.randomizations = {varying(size("cap", 0), 0.03, 0.045),
                        varying(place("cap", 0), -0.004, 0.004),
                        varying(place("cap", 1), -0.004, 0.004),
                        varying(density("cap"), 300, 900),
                        varying({NumberOwner::joint, NumberField::damping, "cap"}, 0.01, 0.7),
                        varying(size("cap", 1), 0.02, 0.03)};
  Scene ball = scene_named("rolling_ball_small");
  ball.randomizations = {varying(size("ball", 0), 0.018, 0.0205)};
  const auto on = [&](const Shape& shape, std::vector<RandomizationDescription> numbers) {
    numbers.push_back(varying(place("anvil_joint", 0), -0.051, -0.05));
    numbers.push_back(varying(place("anvil_joint", 2), 0.01, 0.014));
    numbers.push_back(varying(density("anvil"), 500, 900));
    return pad_on(shape, numbers);
  };
  MeshShape mesh = testing::ellipsoid_mesh(2, {0.03, 0.025, 0.03});
  for (std::size_t k = 0; k < mesh.vertices.size(); k += 3) mesh.vertices[k] += 0.002;
  mesh.resolution = 16;
  return {{"cap_opening", cap, 160},
          {"mesh", on(mesh, {varying(size("anvil", kScaleIndex), 0.9, 1.1)}), 60},
          {"rolling_ball_small", ball, 160},
          {"sphere", on(SphereShape{0.03}, {varying(size("anvil", 0), 0.028, 0.032)}), 60},
          {"cuboid",
           on(CuboidShape{{0.06, 0.05, 0.06}, {}},
              {varying(size("anvil", 2), 0.055, 0.06), varying(size("anvil", 4), 0.05, 0.06)}),
           60},
          {"cylinder",
           on(CylinderShape{0.06, 0.03, 8, 3},
              {varying(size("anvil", 0), 0.028, 0.032), varying(size("anvil", 1), 0.05, 0.06)}),
           60},
          {"capsule",
           on(CapsuleShape{0.03, 0.03, 5, 4},
              {varying(size("anvil", 0), 0.028, 0.032), varying(size("anvil", 1), 0.02, 0.03)}),
           60},
          {"ellipsoid",
           on(EllipsoidShape{{0.06, 0.05, 0.06}, 40},
              {varying(size("anvil", 2), 0.055, 0.07), varying(size("anvil", 4), 0.055, 0.06)}),
           60}};
}

/// Each environment equals its own scene bit for bit.
TEST(VaryingGeometry, EachEnvironmentIsASceneOfItsOwn) {
  constexpr int kEnvironments = 21;  // two blocks, three groups
  on_every_table([&] {
    for (const Case& c : cases()) {
      SCOPED_TRACE(c.name);
      const Model model(c.scene);
      Batch batch(model, kEnvironments, 3);
      const Result all = run(model, batch, c.steps);
      EXPECT_EQ(batch.failed_count(), 0);
      EXPECT_GT(all.touch, 1e-4);
      for (const int e : {0, 5, 11, 20}) {
        const Model alone(written(c.scene, batch, e));
        Batch one(alone, 1, 3);
        const Result expected = run(alone, one, c.steps);
        const auto i = std::size_t(e);
        EXPECT_EQ(all.q[i], expected.q[0]) << "environment " << e;
        EXPECT_EQ(all.v[i], expected.v[0]) << "environment " << e;
        EXPECT_EQ(all.fields[i], expected.fields[0]) << "environment " << e;
        EXPECT_EQ(all.mixed[i], expected.mixed[0]) << "environment " << e;
      }
      EXPECT_NE(all.q[0], all.q[5]) << "the numbers matter";
    }
  });
}

TEST(VaryingGeometry, NeighboursDoNotMatterWhateverTheyHave) {
  on_every_table([&] {
    for (const Case& c : cases()) {
      SCOPED_TRACE(c.name);
      const Model model(c.scene);
      Batch clean(model, 10, 3), poisoned(model, 10, 3);
      for (int e = 0; e < 10; ++e)
        for (int k = 0; k < static_cast<int>(c.scene.randomizations.size()) && e != 4 && e != 9;
             ++k)
          poisoned.set_randomized_value(
              e, k, e % 2 == 0 ? std::numeric_limits<double>::quiet_NaN() : 1e30);
      const Result expected = run(model, clean, c.steps / 2),
                   found = run(model, poisoned, c.steps / 2);
      for (const std::size_t e : {4U, 9U}) {
        EXPECT_EQ(found.q[e], expected.q[e]) << e;
        EXPECT_EQ(found.fields[e], expected.fields[e]) << e;
        EXPECT_EQ(found.mixed[e], expected.mixed[e]) << e;
      }
    }
  });
}

TEST(VaryingGeometry, NumbersCanBeSetAndAResetDrawsThemAgain) {
  const Case c = cases()[0];
  const Model model(c.scene);
  Batch batch(model, 2, 7);
  const std::vector<double> before(batch.block(0),
                                   batch.block(0) + compiled(model).layout.rows * kernels::kBlock);
  for (int k = 0; k < 3; ++k) batch.set_randomized_value(1, k, 0.035 - k);
  EXPECT_EQ(batch.randomized_value(1, 0), 0.035);
  const int size_row = compiled(model).pairs[0].size_row;
  ASSERT_GE(size_row, 0);
  EXPECT_EQ(batch.block(0)[size_row * kernels::kBlock + 1], 0.035);
  batch.reset(1, 1);
  EXPECT_EQ(std::vector<double>(batch.block(0), batch.block(0) + before.size()), before);
}

/// A number that varies within a single point is the scene's own: the bits are those without
/// variation.
TEST(VaryingGeometry, AScenesOwnNumbersAsWhatVariesChangeNothing) {
  for (Case c : cases()) {
    SCOPED_TRACE(c.name);
    for (RandomizationDescription& d : c.scene.randomizations) {
      d.distribution.a = d.distribution.b = number_in(c.scene, d.number);
    }
    Scene plain = c.scene;
    plain.randomizations.clear();
    const Model varied(c.scene), constant(plain);
    Batch a(varied, 3, 1), b(constant, 3, 1);
    const Result found = run(varied, a, c.steps / 2), expected = run(constant, b, c.steps / 2);
    EXPECT_EQ(found.q, expected.q);
    EXPECT_EQ(found.fields, expected.fields);
  }
}

TEST(VaryingGeometry, IsReadFromAScene) {
  const std::string path = TANGERE_SOURCE_DIR "/scenes/box_pushing.xml";
  const std::string text = read_scene(path).scene.text;
  const std::size_t at = text.find("<randomize>") + 11;
  const auto with = [&](const std::string& line) {
    return parse_scene(text.substr(0, at) + line + text.substr(at), path).scene.randomizations[0];
  };
  const RandomizationDescription edge =
      with("<body name=\"box\" size=\"2\" uniform=\"0.04 0.05\"/>");
  EXPECT_EQ(name_of(edge.number), "body box size[2]");
  EXPECT_EQ(edge.distribution.b, 0.05);
  const RandomizationDescription y =
      with("<joint name=\"box_slide\" pos=\"1\" normal=\"-0.1 0.2\"/>");
  EXPECT_EQ(name_of(y.number), "joint box_slide pos[1]");
  EXPECT_EQ(y.distribution.a, -0.1);
  const auto error = [&](const std::string& line) {
    try {
      with(line);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(error("<body name=\"box\" field=\"radius\" uniform=\"1 2\"/>"),
              HasSubstr("'body box radius' varies, but a cuboid has none"));
  EXPECT_THAT(error("<body name=\"box\" field=\"raduis\" uniform=\"1 2\"/>"),
              HasSubstr("did you mean 'radius'"));
  EXPECT_THAT(error("<body name=\"box\" size=\"3\" uniform=\"1 2\"/>"), HasSubstr("size=\"3\""));
  EXPECT_THAT(error("<body name=\"box\" size=\"0\" uniform=\"0 2\"/>"),
              HasSubstr("'body box size[0]' varies, but size=\"0\"; expected a positive number"));
  EXPECT_THAT(error("<body name=\"box\" size=\"0\" normal=\"1 2\"/>"),
              HasSubstr("'body box size[0]' varies, but normal can draw a negative value"));
  EXPECT_THAT(error("<body name=\"box\" size=\"0\" field=\"density\" uniform=\"1 2\"/>"),
              HasSubstr("exactly one of field and size"));
  EXPECT_THAT(error("<joint name=\"box_slide\" pos=\"3\" uniform=\"1 2\"/>"),
              HasSubstr("pos=\"3\""));
  EXPECT_THAT(error("<joint name=\"box_slide\" pos=\"0\" q=\"0\" uniform=\"1 2\"/>"),
              HasSubstr("exactly one of q, v, pos"));
}

std::string refusal(Scene scene, const RandomizationDescription& d) {
  scene.randomizations = {d};
  try {
    const Model model(scene);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(VaryingGeometry, WhatCannotVaryIsAnError) {
  const Scene cap = scene_named("cap_opening"), box = scene_named("box_pushing");
  EXPECT_THAT(refusal(box, varying(size("box", 2), 0.1, 0.2)),
              HasSubstr("the points that touch the ground do not"));
  EXPECT_THAT(refusal(cap, varying(size("tip_1", 0), 0.1, 0.2)),
              HasSubstr("'body tip_1 radius' varies, but a"));
  EXPECT_THAT(refusal(cap, varying(size("cap", 3), 0.1, 0.2)),
              HasSubstr("'body cap size[1]' varies, but a cylinder has none"));
  EXPECT_THAT(refusal(cap, varying(size("cap", 0), 0, 0.2)),
              HasSubstr("radius=\"0\"; expected a positive number"));
  EXPECT_THAT(
      refusal(pad_on(EllipsoidShape{{0.06, 0.05, 0.06}}, {}), varying(size("anvil", 3), 0.01, 6.1)),
      HasSubstr("'body anvil size[1]' varies, but that allows an ellipsoid with a longest"));
  EXPECT_THAT(refusal(pad_on(SphereShape{0.03}, {}), varying(size("pad", 2), 0.1, 0.2)),
              HasSubstr("its contact points do not"));
  EXPECT_THAT(refusal(cap, varying(place("bottle", 0), 0, 0.2)),
              HasSubstr("'joint bottle pos[0]' varies, but the joint is fixed"));
  EXPECT_THAT(refusal(cap, varying(place("cap", 3), 0, 0.2)), HasSubstr("index 3"));
  EXPECT_THAT(refusal(cap, varying(size("cop", 0), 0.1, 0.2)), HasSubstr("no body is named 'cop'"));
  Scene felt = pad_on(SphereShape{0.03}, {});
  felt.pair_contacts.clear();
  EXPECT_THAT(refusal(felt, varying(size("pad", 2), 0.1, 0.2)), HasSubstr("tactile sensor 'pad'"));
}

}  // namespace
}  // namespace tangere
