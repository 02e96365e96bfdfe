// SPDX-License-Identifier: Apache-2.0
// Tests what scene files are read as: the published dialect, our extensions, units.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/model.hpp"
#include "engine/scene/scene_number.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using testing::kScene;
using testing::with;

const std::string kFolder = std::string(TANGERE_TEST_DATA) + "/scenes/";

TEST(SceneReader, PublishedDialectLoadsUnmodified) {
  const SceneFile file = read_scene(kFolder + "published_dialect_pad.xml");
  const Scene& s = file.scene;
  EXPECT_EQ(s.name, "dialect pad");
  EXPECT_EQ(s.integrator, Integrator::bdf2);
  EXPECT_EQ(s.solver.tolerance, 1e-8);
  EXPECT_EQ(s.solver.max_iterations, 100);
  ASSERT_TRUE(s.ground);
  EXPECT_EQ(s.ground->normal[2], 1);  // normalised
  ASSERT_EQ(s.links.size(), 3U);
  EXPECT_EQ(s.links[2].joint.type, JointType::free);
  EXPECT_EQ(s.links[0].joint.pose.orientation[0], 1);
  EXPECT_EQ(std::get<SphereShape>(s.links[2].body.shape).radius,
            0.0199999996);  // double, not rounded through float
  EXPECT_EQ(s.ground_contacts[0].coefficients.mu, 0.800000012);
  EXPECT_EQ(s.ground_contacts[0].law, ContactLaw::linear);
  EXPECT_EQ(s.pair_contacts[0].law, ContactLaw::clamped);
  EXPECT_EQ(s.sensors[0].coefficients.kt, 0.01);
  ASSERT_EQ(s.end_effectors.size(), 1U);
  EXPECT_EQ(s.end_effectors[0].name, "endeffector0");
  EXPECT_EQ(s.end_effectors[0].position[0], 0.001);
  std::string warnings;
  for (const std::string& w : file.warnings) warnings += w + "\n";
  for (const char* part : {"max_ls", "design_params", "'axis' has no effect", "'lim' has no effect",
                           "stray text", "pictures only", "'P' has no effect"})
    EXPECT_THAT(warnings, HasSubstr(part));
  const Model model(s);
  EXPECT_EQ(model.nq(), 10);
  EXPECT_EQ(model.nv(), 9);
  EXPECT_EQ(model.nb(), 3);  // the folded rim is listed
  EXPECT_EQ(model.contacts()[0].points, 2168);
  EXPECT_NEAR(model.mass(0), 0.025, 1e-17);
  EXPECT_NEAR(model.mass(2), 3.35103e-5, 1e-9);
}

TEST(SceneReader, EveryShippedSceneCompiles) {
  for (const char* name : {"/scenes/rolling_ball.xml", "/scenes/rolling_ball_small.xml"}) {
    const SceneFile file = read_scene(std::string(TANGERE_SOURCE_DIR) + name);
    EXPECT_TRUE(file.warnings.empty()) << file.warnings[0];
    const Model model(file.scene);
    EXPECT_EQ(model.sensors()[0].pressure_sign, -1);
    EXPECT_EQ(model.sensors()[0].every, 5);
  }
  EXPECT_EQ(Model(read_scene(kFolder + "two_balls.xml").scene).sensors()[0].points, 63);
  const Model shapes(read_scene(kFolder + "shapes.xml").scene);
  EXPECT_EQ(shapes.contacts()[0].points, 2 * (1 + 24));
  EXPECT_EQ(shapes.contacts()[1].points, 2 + 4 * 24);
  EXPECT_EQ(shapes.contacts()[2].points, 6);
  EXPECT_EQ(shapes.contacts()[3].points, 3);
  EXPECT_EQ(shapes.contacts()[4].points, 60);
  EXPECT_NEAR(shapes.mass(5), 600 * 0.5 * 0.04 * 0.06 * 0.02, 1e-15);
}

TEST(SceneReader, ExtensionsComeThrough) {
  const Scene s = parse_scene(kScene, "s.xml").scene;
  ASSERT_EQ(s.initial.size(), 1U);
  EXPECT_EQ(s.initial[0].q[0], 0.001);
  EXPECT_EQ(s.initial[0].v[4], 2);
  const auto& control = std::get<PiecewiseControl>(*s.control);
  EXPECT_EQ(control.end, 1);
  EXPECT_EQ(control.times[1], 0.5);
  EXPECT_EQ(control.values[1][0], 0.1);
  ASSERT_EQ(s.randomizations.size(), 2U);
  EXPECT_EQ(s.randomizations[0].number.field, NumberField::q);
  EXPECT_EQ(s.randomizations[1].distribution.kind, Distribution::Kind::log_uniform);
  EXPECT_EQ(s.text, kScene);
}

TEST(SceneReader, NumbersWithOneTieAreDrawnTogether) {
  const auto tied = [](const std::string& one, const std::string& other) {
    const std::string text = with("q=\"0\" uniform", "q=\"0\" tie=\"" + one + "\" uniform",
                                  with("log_uniform", "tie=\"" + other + "\" uniform"));
    return parse_scene(text, "s.xml");
  };
  const SceneFile grip = tied("grip", "grip"), apart = tied("grip", "grips");
  EXPECT_EQ(grip.scene.randomizations[1].tie, "grip");
  EXPECT_EQ(drawn_with(grip.scene, 1), 0U);
  EXPECT_EQ(drawn_with(apart.scene, 1), 1U);
  EXPECT_EQ(drawn_with(parse_scene(kScene, "s.xml").scene, 1), 1U);
  EXPECT_THAT(grip.warnings, ::testing::IsEmpty());
  ASSERT_EQ(apart.warnings.size(), 2U);
  EXPECT_EQ(
      apart.warnings[0],
      "s.xml:36: <joint>: tie=\"grip\" of 'joint ball_joint q[0]' alone ties nothing; expected "
      "another number with it; did you mean 'grips'?");
}

TEST(SceneReader, DefaultsOfTheDialect) {
  const std::string text = R"(<redmax><robot><link name="a"><joint name="a" type="free3d"/>
<body name="a" type="sphere" radius="1"/></link></robot></redmax>)";
  const Scene s = parse_scene(text, "s.xml").scene;
  EXPECT_EQ(s.timestep, 0.02);
  EXPECT_EQ(s.integrator, Integrator::bdf1);
  EXPECT_NEAR(s.gravity[2], -9.8, 1e-14);                                // -980 cm/s²
  EXPECT_EQ(std::get<SphereShape>(s.links[0].body.shape).radius, 0.01);  // 1 cm
  EXPECT_EQ(s.links[0].body.density, 1000);                              // 1 g/cm³
  EXPECT_FALSE(s.solver.tolerance) << "it follows scheme and step";
}

/// Scales the numbers of an attribute in the text.
std::string in_centimetres() {
  std::string t = kScene;
  const auto change = [&](const std::string& a, const std::string& b) { t = with(a, b, t); };
  change("unit=\"m-kg\" gravity=\"0 0 -9.8\"", "unit=\"cm-g\" gravity=\"0 0 -980\"");
  change("<tactile kn=\"1\" kt=\"0.01\"", "<tactile kn=\"1000\" kt=\"10\"");
  change("pos=\"0 0 0.06\" damping=\"1\"", "pos=\"0 0 6\" damping=\"1000\"");
  change("size=\"0.05 0.05 0.01\" density=\"1000\"", "size=\"5 5 1\" density=\"1\"");
  change("pos=\"0 0 0.02\"", "pos=\"0 0 2\"");
  change("radius=\"0.02\" density=\"100\"", "radius=\"2\" density=\"0.1\"");
  change("ctrl_range=\"-1 1\"", "ctrl_range=\"-1e5 1e5\"");
  change("kn=\"5e3\" kt=\"1\" mu=\"0.8\" damping=\"0.03\"",
         "kn=\"5e6\" kt=\"1000\" mu=\"0.8\" damping=\"30\"");
  change("kn=\"5\" kt=\"1\" mu=\"1\" damping=\"1\"",
         "kn=\"5000\" kt=\"1000\" mu=\"1\" damping=\"10\"");
  change("rect_pos0=\"-0.02 0.02 -0.005\" rect_pos1=\"0.02 -0.02 -0.005\"",
         "rect_pos0=\"-2 2 -0.5\" rect_pos1=\"2 -2 -0.5\"");
  change("damping=\"0.003\"", "damping=\"0.03\"");
  change("q=\"0.001 0 0 1 0 0 0\" v=\"0.1 0 0 0 2 0\"", "q=\"0.1 0 0 1 0 0 0\" v=\"10 0 0 0 2 0\"");
  change("uniform=\"-0.003 0.003\"", "uniform=\"-0.3 0.3\"");
  change("log_uniform=\"0.005 0.02\"", "log_uniform=\"5 20\"");
  return t;
}

TEST(SceneReader, CentimetresAndGramsGiveTheSameScene) {
  const Scene a = parse_scene(kScene, "s.xml").scene,
              b = parse_scene(in_centimetres(), "s.xml").scene;
  const auto same = [](double x, double y) { EXPECT_NEAR(x, y, 1e-14 * std::abs(x)); };
  const auto all = [&](const Vector3& x, const Vector3& y) {
    for (int i = 0; i < 3; ++i) same(x[i], y[i]);
  };
  all(a.gravity, b.gravity);
  for (std::size_t i = 0; i < 2; ++i) {
    all(a.links[i].joint.pose.position, b.links[i].joint.pose.position);
    same(a.links[i].joint.damping, b.links[i].joint.damping);
    same(a.links[i].body.density, b.links[i].body.density);
  }
  all(std::get<CuboidShape>(a.links[0].body.shape).size,
      std::get<CuboidShape>(b.links[0].body.shape).size);
  same(a.motors[0].high, b.motors[0].high);
  const auto coefficients = [&](const ContactCoefficients& x, const ContactCoefficients& y) {
    same(x.kn, y.kn), same(x.kt, y.kt), same(x.mu, y.mu), same(x.damping, y.damping);
  };
  coefficients(a.ground_contacts[0].coefficients, b.ground_contacts[0].coefficients);
  coefficients(a.pair_contacts[0].coefficients, b.pair_contacts[0].coefficients);
  coefficients(a.sensors[0].coefficients, b.sensors[0].coefficients);
  all(a.sensors[0].array.corner0, b.sensors[0].array.corner0);
  for (std::size_t i = 0; i < 7; ++i) same(a.initial[0].q[i], b.initial[0].q[i]);
  for (std::size_t i = 0; i < 6; ++i) same(a.initial[0].v[i], b.initial[0].v[i]);
  same(a.randomizations[0].distribution.b, b.randomizations[0].distribution.b);
  same(a.randomizations[1].distribution.b, b.randomizations[1].distribution.b);
}

TEST(SceneReader, RodsAndPlanesInEitherUnit) {
  const auto read = [](const char* unit, const std::string& bodies) {
    return parse_scene("<redmax><option unit=\"" + std::string(unit) + "\"/><robot>" + bodies +
                           "</robot></redmax>",
                       "s.xml");
  };
  const std::string link = R"(<link name="$"><joint name="$" type="free3d"/><body name="$" type=)";
  const auto body = [&](const std::string& name, const std::string& rest) {
    std::string text = link + rest + "/></link>";
    for (std::size_t at = 0; (at = text.find('$')) != std::string::npos;) text.replace(at, 1, name);
    return text;
  };
  const SceneFile cm =
      read("cm-g",
           body("a", R"("cylinder" length="4" radius="1.5" density="2")") +
               body("b", R"("capsule" length="6" radius="0.5" general_contact_resolution="3 7")"));
  EXPECT_TRUE(cm.warnings.empty());
  const auto& cylinder = std::get<CylinderShape>(cm.scene.links[0].body.shape);
  EXPECT_DOUBLE_EQ(cylinder.length, 0.04);
  EXPECT_DOUBLE_EQ(cylinder.radius, 0.015);
  EXPECT_EQ(cylinder.contact_angles, 8);
  EXPECT_EQ(cylinder.contact_rings, 3);
  const auto& capsule = std::get<CapsuleShape>(cm.scene.links[1].body.shape);
  EXPECT_DOUBLE_EQ(capsule.length, 0.06);
  EXPECT_EQ(capsule.contact_rings, 3);
  EXPECT_EQ(capsule.contact_angles, 7);
  EXPECT_NEAR(Model(cm.scene).mass(0), 2000 * M_PI * 0.015 * 0.015 * 0.04, 1e-15);

  const std::string floor = R"(<link name="f"><joint name="f" type="fixed" quat="1 0 1 0"/>)"
                            R"(<body name="f" type="plane" radius="3"/></link>)";
  const std::string rings =
      R"( general_contact_angle_resolution="12" general_contact_radius_resolution="1")";
  const std::string file = body("a", R"("cylinder" length="0.04" radius="0.015")" + rings) + floor;
  const SceneFile si = read("m-kg", file);
  ASSERT_EQ(si.warnings.size(), 1U);
  EXPECT_THAT(si.warnings[0], HasSubstr("'radius' has no effect"));
  EXPECT_EQ(std::get<CylinderShape>(si.scene.links[0].body.shape).contact_angles, 12);
  EXPECT_EQ(std::get<CylinderShape>(si.scene.links[0].body.shape).contact_rings, 1);
  EXPECT_STREQ(shape_name(si.scene.links[1].body.shape), "plane");
  EXPECT_EQ(Model(si.scene).mass(1), 0);
}

TEST(SceneReader, AnEllipsoidHasASizeLikeACuboids) {
  const auto read = [](const std::string& rest) {
    return parse_scene(R"(<redmax><option unit="cm-g"/><robot><link name="e"><joint name="e" )"
                       R"(type="free3d"/><body name="e" type="ellipsoid" )" +
                           rest + "/></link></robot></redmax>",
                       "s.xml");
  };
  const SceneFile file = read(R"(size="4 3 2" density="2")");
  EXPECT_TRUE(file.warnings.empty());
  const auto& egg = std::get<EllipsoidShape>(file.scene.links[0].body.shape);
  EXPECT_DOUBLE_EQ(egg.size[0], 0.04);
  EXPECT_DOUBLE_EQ(egg.size[2], 0.02);
  EXPECT_EQ(egg.contact_count, 100);
  EXPECT_NEAR(Model(file.scene).mass(0), 2000 * M_PI / 6 * 0.04 * 0.03 * 0.02, 1e-15);
  const SceneFile counted = read(R"(size="4 3 2" general_contact_resolution="30")");
  EXPECT_EQ(std::get<EllipsoidShape>(counted.scene.links[0].body.shape).contact_count, 30);
  const auto refusal = [&](const std::string& rest) -> std::string {
    try {
      read(rest);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal(R"(size="4 3 0.03")"), HasSubstr("expected at most 100 times"));
  EXPECT_THAT(refusal(R"(size="4 -3 2")"), HasSubstr("size=\"-3\"; expected a positive number"));
  EXPECT_THAT(refusal(R"(sice="4 3 2")"), HasSubstr("'size'"));
}

TEST(SceneReader, APlaneAloneCannotMove) {
  const std::string text = R"(<redmax><robot><link name="a"><joint name="a" type="free3d"/>
<body name="a" type="plane"/></link></robot></redmax>)";
  EXPECT_THROW(Model(parse_scene(text, "s.xml").scene), InputError);
}

TEST(SceneReader, WorldFramesAreResolvedAgainstTheParent) {
  const std::string text = R"(<tangere><option unit="m-kg"/><robot>
<link name="a"><joint name="a" type="free3d" pos="1 2 3" quat="1 0 0 1"/>)"
                           R"(<body name="a" type="sphere" radius="0.1"/>
<link name="b"><joint name="b" type="revolute" axis="0 0 2" pos="1 3 3" quat="1 0 0 1" )"
                           R"(frame="WORLD"/>
<body name="b" type="sphere" radius="0.1"/></link></link></robot></tangere>)";
  const Scene s = parse_scene(text, "s.xml").scene;
  // The parent is turned by 90° about z, so the world's +y is its +x.
  EXPECT_NEAR(s.links[1].joint.pose.position[0], 1, 1e-15);
  EXPECT_NEAR(s.links[1].joint.pose.position[1], 0, 1e-15);
  EXPECT_NEAR(s.links[1].joint.pose.orientation[0], 1, 1e-15);
  EXPECT_EQ(s.links[1].joint.axis0[2], 1);
}

}  // namespace
}  // namespace tangere
