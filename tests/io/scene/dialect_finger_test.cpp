// SPDX-License-Identifier: Apache-2.0
// Tests what published scenes leave behind (attributes that their reader ignores), leave out
// (names), and mean (axes in the world, one range for forces and torques, the ground law that
// pulls).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kFinger = std::string(TANGERE_TEST_DATA) + "/scenes/dialect_finger.xml";

std::string refusal(const std::string& text, const SceneReadOptions& options = {}) {
  try {
    parse_scene(text, kFinger, options);
  } catch (const std::exception& e) {
    return e.what();
  }
  return "accepted";
}

/// Returns a scene in metres with this inside <robot>, and the rest behind it.
std::string scene(const std::string& robot, const std::string& rest = "") {
  return "<redmax><option unit=\"m-kg\" gravity=\"0 0 0\" timestep=\"5e-3\"/><ground/>\n<robot>" +
         robot + "</robot>\n" + rest + "</redmax>";
}
std::string link(const std::string& joint, const std::string& body) {
  return "<link name=\"a\"><joint name=\"a\" " + joint + "/>\n<body " + body + "/></link>";
}

TEST(DialectFinger, LoadsAndListsEveryAttributeThatIsLeftOver) {
  const SceneFile file = read_scene(kFinger);
  const auto line = [](int n, const std::string& text) {
    return HasSubstr("dialect_finger.xml:" + std::to_string(n) + ": <" + text);
  };
  EXPECT_THAT(file.warnings,
              ElementsAre(line(8, "body>: attribute 'mu' has no effect here"),
                          line(9, "joint>: attribute 'format' has no effect here"),
                          line(19, "body>: attribute 'damping' has no effect here"),
                          line(23, "body>: attribute 'contacts' has no effect here"),
                          line(23, "body>: attribute 'mu' has no effect here"),
                          line(30, "joint>: attribute 'format' has no effect here"),
                          line(31, "body>: attribute 'mu' has no effect here"),
                          line(23, "body>: mesh 'tip_2' touches with all its 6 vertices"),
                          line(42, "general_primitive_contact>: contact points of 'tip_2'"),
                          line(44, "virtual>: shapes for pictures only")));
  EXPECT_THAT(file.warnings[7], HasSubstr("general_contact_resolution=\"1\""));
}

TEST(DialectFinger, BodiesWithoutANameHaveTheirLinks) {
  const Scene s = read_scene(kFinger).scene;
  EXPECT_EQ(s.links[1].body.name, "middle");
  EXPECT_EQ(s.links[2].body.name, "tip_2") << "another body is called 'tip'";
  EXPECT_THAT(refusal(scene(link("type=\"fixed\"", "name=\"\" type=\"sphere\" radius=\"1\""))),
              HasSubstr(":3: <body>: attribute 'name' is empty"));
}

TEST(DialectFinger, AbstractBodiesTakeContactsAsAttribute) {
  const Scene s = read_scene(kFinger).scene;
  const auto& palm = std::get<AbstractShape>(s.links[0].body.shape);
  ASSERT_EQ(palm.contact_points.size(), 9U);
  EXPECT_NEAR(palm.contact_points[0], 2e-4, 1e-18) << "0.02 cm, in the frame of the body";
  EXPECT_NEAR(palm.contact_points[4], 1.7e-4, 1e-18);
  const std::string both = R"(type="abstract" mass="1" inertia="1 1 1" contacts="tripod.txt">)"
                           R"(<collision radius="1" count="4"/></body></link>)";
  EXPECT_THAT(refusal(scene("<link name=\"a\"><joint name=\"a\" type=\"fixed\"/>\n<body " + both)),
              HasSubstr("<collision>: the body has the attribute 'contacts' too; expected one"));
  EXPECT_THAT(
      refusal(scene(link("type=\"fixed\"",
                         "type=\"abstract\" mass=\"1\" inertia=\"1 1 1\" contacts=\"n.txt\""))),
      AllOf(HasSubstr(":3: <body>: "), HasSubstr("n.txt")));
}

TEST(DialectFinger, UnknownNamesSayHowTheyAreAllowed) {
  const std::string odd = scene(
                        link("type=\"fixed\" colour=\"red\"", "type=\"sphere\" radius=\"1\"")),
                    element =
                        scene(link("type=\"fixed\"", "type=\"sphere\" radius=\"1\""), "<odd/>");
  EXPECT_THAT(refusal(odd), AllOf(HasSubstr("unknown attribute 'colour'"),
                                  HasSubstr("(--allow-unknown ignores it)")));
  EXPECT_THAT(refusal(element), AllOf(HasSubstr("unknown element inside <redmax>"),
                                      HasSubstr("(--allow-unknown ignores it)")));
  EXPECT_EQ(refusal(odd, {true}), "accepted");
  EXPECT_EQ(refusal(element, {true}), "accepted");
}

/// World position of the first body at coordinates q.
Vector3 place(const Scene& s, const std::vector<double>& q, int body) {
  const Model model(s);
  Batch batch(model, 1);
  batch.set_state(0, q, std::vector<double>(std::size_t(model.nv()), 0));
  std::vector<double> pose(std::size_t(7 * model.nb())), twist(std::size_t(6 * model.nb()));
  Readout(model).bodies(batch, 0, pose, twist);
  const double* const p = &pose[std::size_t(7 * body)];
  return {p[0], p[1], p[2]};
}

void expect_at(const Vector3& p, const Vector3& expected) {
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(p[i], expected[i], 1e-15) << "coordinate " << i;
}

/// However the joint's own frame is turned, and its parent's too.
TEST(DialectFinger, AxesOfAJointInTheWorldAreInTheWorld) {
  const std::string turned = "pos=\"1 2 3\" quat=\"0.3 -0.5 0.7 0.2\" ";
  const auto child = [&](const std::string& joint) {
    return parse_scene(
               scene("<link name=\"p\"><joint name=\"p\" type=\"fixed\" pos=\"0 1 0\" "
                     "quat=\"0.9 0.1 -0.4 0.3\"/><body type=\"sphere\" radius=\"1\"/>\n" +
                     link(joint + " frame=\"WORLD\" " + turned, "type=\"sphere\" radius=\"0.1\"") +
                     "</link>"),
               "s.xml")
        .scene;
  };
  expect_at(place(child("type=\"prismatic\" axis=\"0 0 2\""), {0.5}, 1), {1, 2, 3.5});
  expect_at(place(child("type=\"planar\" axis0=\"1 0 0\" axis1=\"0 1 0\""), {0.5, 0.25}, 1),
            {1.5, 2.25, 3});
  const Scene root =
      parse_scene(scene(link("type=\"prismatic\" axis=\"0 1 0\" frame=\"WORLD\" " + turned,
                             "type=\"sphere\" radius=\"0.1\"")),
                  "s.xml")
          .scene;
  expect_at(place(root, {0.5}, 0), {1, 2.5, 3});
  const Scene own = parse_scene(scene(link("type=\"prismatic\" axis=\"1 0 0\" quat=\"1 0 0 1\"",
                                           "type=\"sphere\" radius=\"0.1\"")),
                                "s.xml")
                        .scene;
  expect_at(place(own, {0.5}, 0), {0, 0.5, 0});  // frame LOCAL: its own axes
}

TEST(DialectFinger, AJointInTheWorldTurnsAboutAnAxisOfTheWorld) {
  const Scene s = read_scene(kFinger).scene;
  expect_at(s.links[1].joint.axis0, {0, -1, 0});
  expect_at(s.links[2].joint.axis0, {0, -1, 0});
  expect_at(s.links[2].joint.axis1, {0, 0, 1});
  std::vector<double> q(std::size_t(Model(s).nq()), 0);
  q.end()[-4] = 1;  // the box stays as it is
  // `middle` is 1 cm from the axis, which is -z through (4, 0, 0) cm.
  expect_at(place(s, q, 1), {0.05, 0, 0});
  q[3] = 0.3;
  expect_at(place(s, q, 1), {0.04 + 0.01 * std::cos(0.3), -0.01 * std::sin(0.3), 0});
}

TEST(DialectFinger, OneRangeOfAPlaneJointIsForcesAndTorques) {
  const Scene s = read_scene(kFinger).scene;
  EXPECT_DOUBLE_EQ(s.motors[0].high, 3);
  ASSERT_TRUE(s.motors[0].turning);
  EXPECT_DOUBLE_EQ((*s.motors[0].turning)[0], -0.03);
  EXPECT_FALSE(s.motors[1].turning);
  // Alone, a cube of 600 g with 1 cm edges: a = F/m, α = T/I.
  const std::string cube = R"(<redmax><option gravity="0 0 0" timestep="1e-3"/><robot>
<link name="a"><joint name="a" type="free2d"/><body type="cuboid" size="1 1 1" density="600"/>)"
                           R"(</link>
</robot><actuator><motor joint="a" ctrl="force" ctrl_range="-1e5 2e5"/></actuator></redmax>)";
  const Model model(parse_scene(cube, "s.xml").scene);
  EXPECT_EQ(model.u_names()[2], "a.rate");
  Batch batch(model, 1);
  Stepper stepper(model);
  const std::vector<double> u = {1, -1, 0.5};
  stepper.step(batch, u);
  std::vector<double> v(3);
  batch.get_v(0, v);
  EXPECT_NEAR(v[0], 1e-3 * 2 / 0.6, 1e-12);
  EXPECT_NEAR(v[1], 1e-3 * -1 / 0.6, 1e-12);
  EXPECT_NEAR(v[2], 1e-3 * 0.0125 / (0.6 * 1e-4 / 6), 1e-9);
  std::string driven = cube;
  driven.replace(driven.find("ctrl=\"force\""), 12, "ctrl=\"position\" P=\"1\"");
  EXPECT_THAT(refusal(driven), HasSubstr("joint 'a' slides and turns"));
}

/// One step of a ball that leaves the ground, against the equation that it solves:
///   m (v - v₀)/h = -k_n (d₀ + h v) - c v
TEST(DialectFinger, ThePublishedGroundLawPulls) {
  const double h = 5e-3, kn = 100, c = 10, d0 = -1e-3, v0 = 0.05, mass = 0.5;
  const auto speed_after = [&](const std::string& law) {
    const std::string ball = R"(name="b" type="sphere" radius="0.1" density=")" +
                             std::to_string(mass / (4.0 / 3.0 * M_PI * 1e-3)) + "\"";
    const SceneFile file =
        parse_scene(scene(link("type=\"prismatic\" axis=\"0 0 1\" pos=\"0 0 0.099\"", ball),
                          "<contact><ground_contact body=\"b\" kn=\"100\" damping=\"10\" " + law +
                              "/></contact>\n<initial><joint name=\"a\" v=\"0.05\"/></initial>"),
                    "s.xml");
    const Model model(file.scene);
    Batch batch(model, 1);
    Stepper stepper(model);
    stepper.step(batch, {});
    std::vector<double> v(1);
    batch.get_v(0, v);
    EXPECT_EQ(batch.failed_count(), 0) << law;
    return v[0];
  };
  const double pulled = (mass * v0 - h * kn * d0) / (mass + h * h * kn + h * c);
  EXPECT_LT(pulled, v0);
  EXPECT_NEAR(speed_after("law=\"published\""), pulled, 1e-7);
  EXPECT_NEAR(speed_after("ramp=\"0\""), pulled, 1e-7);
  EXPECT_NEAR(speed_after(""), v0, 1e-7) << "the default never pulls";
}

TEST(DialectFinger, LawsSayTheirNamesAndWhatTheyDoNotUse) {
  const std::string ball = link("type=\"free3d\"", "name=\"b\" type=\"sphere\" radius=\"0.1\"");
  const auto read = [&](const std::string& law) {
    return parse_scene(
        scene(ball, "<contact>\n<ground_contact body=\"b\" kn=\"1\" " + law + "/></contact>"),
        "s.xml");
  };
  EXPECT_EQ(Model(read("law=\"published\"").scene).contacts()[0].law, "published");
  EXPECT_EQ(Model(read("ramp=\"0\"").scene).contacts()[0].law, "published");
  EXPECT_EQ(Model(read("").scene).contacts()[0].law, "linear");
  for (const char* law : {"published", "clamped", "paper"})
    EXPECT_THAT(read(std::string("ramp=\"1e-4\" law=\"") + law + "\"").warnings,
                ElementsAre(HasSubstr(std::string("s.xml:5: <ground_contact>: 'ramp' has no effect "
                                                  "with law=\"") +
                                      law + "\"")));
}

}  // namespace
}  // namespace tangere
