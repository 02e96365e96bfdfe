// SPDX-License-Identifier: Apache-2.0
// Scenes that a program builds meet the same checks as those of files.
#include "engine/scene/scene_faults.hpp"

#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "engine/model/model.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

/// A ball over the ground and a box, with a sensor on the box.
Scene built() {
  Scene s;
  s.ground = GroundDescription{};
  for (const char* const name : {"ball", "box"}) {
    LinkDescription link;
    link.name = link.joint.name = link.body.name = name;
    link.joint.type = JointType::prismatic;
    s.links.push_back(link);
  }
  s.links[0].body.shape = SphereShape{0.1};
  s.links[1].body.shape = CuboidShape{{0.1, 0.1, 0.1}};
  s.ground_contacts.resize(1);
  s.ground_contacts[0].body = "ball";
  s.pair_contacts.resize(1);
  s.pair_contacts[0].general_body = "box";
  s.pair_contacts[0].primitive_body = "ball";
  s.motors.resize(1);
  s.motors[0].joint = "ball";
  return s;
}

std::string refusal(const std::function<void(Scene&)>& change) {
  Scene scene = built();
  change(scene);
  try {
    const Model model(scene);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(SceneFaults, HoldForScenesThatAProgramBuilds) {
  EXPECT_EQ(refusal([](Scene&) {}), "");
  EXPECT_THAT(refusal([](Scene& s) { s.timestep = 0; }),
              HasSubstr("timestep=\"0\"; expected a positive number"));
  EXPECT_THAT(refusal([](Scene& s) { s.ground_contacts[0].coefficients.kn = -1; }),
              HasSubstr("kn=\"-1\"; expected zero or more"));
  EXPECT_THAT(refusal([](Scene& s) {
                s.pair_contacts[0].coefficients.mu = std::numeric_limits<double>::infinity();
              }),
              HasSubstr("mu=\"inf\"; expected a finite number"));
  EXPECT_THAT(refusal([](Scene& s) { s.pair_contacts[0].primitive_body = "box"; }),
              HasSubstr("body 'box' against itself"));
  EXPECT_THAT(refusal([](Scene& s) { s.links[1].body.shape = PlaneShape{}; }),
              HasSubstr("'box' is a plane body, which has no contact points; swap the two bodies"));
  EXPECT_THAT(refusal([](Scene& s) { s.ground.reset(); }), HasSubstr("no <ground>"));
  EXPECT_THAT(refusal([](Scene& s) { s.links[1].joint.armature = -2; }),
              HasSubstr("joint 'box': armature=\"-2\"; expected zero or more"));
  EXPECT_THAT(refusal([](Scene& s) { s.motors.push_back(s.motors[0]); }),
              HasSubstr("another motor has the name 'ball' already"));
  EXPECT_THAT(refusal([](Scene& s) { s.solver.accuracy = 1; }),
              HasSubstr("accuracy=\"1\"; expected a positive number below 1"));
}

}  // namespace
}  // namespace tangere
