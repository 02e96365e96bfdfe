// SPDX-License-Identifier: Apache-2.0
// Three scenes that have every effect between them: tests of effects go through all.
#pragma once

#include <utility>
#include <vector>

#include "tests/engine/scenes.hpp"

namespace tangere::testing {

inline RandomizationDescription varied(const SceneNumber& number, double low, double high) {
  return {number, {Distribution::Kind::uniform, low, high, {}}, {}};
}

/// Makes the points of a sensor of the pad touch the ball.
inline void add_feedback(Scene& s, const TactileDescription& sensor) {
  PairContactDescription pair{"pad", "ball", {2, 0.1, 0.5, 1}, ContactLaw::clamped, 1e-5, {}};
  pair.sensor = sensor.name;
  for (const TactilePoint& point : tactile_points(sensor))
    pair.points.insert(pair.points.end(), point.position.begin(), point.position.end());
  s.pair_contacts.push_back(std::move(pair));
}

/// A pad that presses a ball onto the ground beside a box, and an arm with all that joints can
/// have. Every kind of effect but those of memory is on and acts within 40 steps.
inline Scene scene_that_sleeps() {
  Scene s = rolling_ball(false, 12);
  s.links.push_back(link("box", JointType::free, {0.2, 0, 0.0149},
                         CuboidShape{{0.03, 0.03, 0.03}, {2, 2, 2}}, 300));
  s.links.push_back(link("arm", JointType::revolute, {0.5, 0, 0.3},
                         CuboidShape{{0.02, 0.02, 0.1}, {2, 2, 2}}, 500));
  s.links.push_back(link("slider", JointType::prismatic, {0, 0, 0.05},
                         CuboidShape{{0.02, 0.02, 0.02}, {2, 2, 2}}, 800));
  JointDescription& arm = s.links[3].joint;
  arm.axis0 = {0, 1, 0};
  arm.damping = 1e-3;
  arm.armature = 1e-4;
  arm.stiffness = 0.3;
  arm.rest = {0.4};
  arm.limits = {-0.02, 0.02};
  arm.limit_stiffness = 50;
  s.links[4].parent = 3;
  s.motors.push_back({"slider_joint", -20, 20, {}, MotorControl::position, 30, 0.2});
  s.pair_contacts.push_back({"box", "ball", {100, 1, 0.5, 1}, ContactLaw::clamped, 1e-5, {}});
  s.ground_contacts.push_back({"box", {500, 2, 0.5, 0.2}, ContactLaw::linear, 1e-5, {}});
  s.sensors.push_back(s.sensors.front());
  s.sensors.back().name = "second";
  for (TactileDescription& d : s.sensors) {
    d.imperfections.noise = {1e-4, 1e-4};
    d.markers = MarkersDescription{100, 0.002, 0, {}};
  }
  add_feedback(s, s.sensors.back());
  s.initial.push_back({"pad_joint", {0.002, 0.001, -0.0152}, {0.05, -0.02, -0.01}, {}});
  s.initial.push_back({"box_joint", {}, {0.3, 0.1, 0, 1, 0, 2}, {}});
  s.initial.push_back({"arm_joint", {0.01}, {1}, {}});
  s.randomizations.push_back(
      varied({NumberOwner::contact, NumberField::kn, "pad", 0, "ball"}, 4, 6));
  s.randomizations.push_back(varied({NumberOwner::tactile, NumberField::kt, "pad"}, 0.008, 0.02));
  s.randomizations.push_back(
      varied({NumberOwner::joint, NumberField::damping, "arm_joint"}, 1e-3, 2e-3));
  s.control = ConstantControl{{0.1, -0.05, 0.1, 0.004}};
  s.solver.sleep = kUsualSleep;
  return s;
}

/// Ties the slider to the world by a soft loop, and spans a cord with a spring between the two.
inline void add_loop_and_transmission(Scene& s) {
  LoopDescription tie;
  tie.name = "tie", tie.body1 = "slider";
  tie.position2 = Vector3{0.51, 0, 0.35};
  tie.stiffness = 40, tie.damping = 0.2;
  s.loops.push_back(tie);
  LinkDescription cord;
  cord.name = cord.body.name = "cord";
  cord.joint.name = "cord_joint";
  cord.joint.type = JointType::prismatic;
  cord.joint.stiffness = 30, cord.joint.rest = {0.02};
  cord.body.shape = AbstractShape{};
  s.links.insert(s.links.begin(), cord);
  for (LinkDescription& other : s.links)
    if (other.parent >= 0) ++other.parent;
  TransmissionDescription path;
  path.joint = "cord_joint";
  path.path = {{PathPart::Kind::point, "", {0.5, 0.05, 0.3}},
               {PathPart::Kind::point, "slider", {0.01, 0, 0}}};
  s.transmissions.push_back(path);
}

/// The same with shear springs, dry friction of a joint and a transmission, which are not to be had
/// together with sleep, and a loop.
inline Scene scene_that_remembers() {
  Scene s = scene_that_sleeps();
  s.solver.sleep = 0;
  for (PairContactDescription& d : s.pair_contacts) d.coefficients.ks = 20;
  for (GroundContactDescription& d : s.ground_contacts) d.coefficients.ks = 500;
  for (TactileDescription& d : s.sensors) d.coefficients.ks = 0.5;
  s.links[3].joint.friction = 0.02;
  add_loop_and_transmission(s);
  return s;
}

/// A pad whose points a layer couples, on a ball.
inline Scene scene_with_layer() {
  Scene s = rolling_ball(false, 12);
  s.sensors[0].material = SkinMaterial{1e4, 0.02, 1e-3};
  s.sensors[0].layer.emplace();
  s.initial.push_back({"pad_joint", {0.002, 0.001, -0.0162}, {0.05, -0.02, -0.01}, {}});
  s.control = ConstantControl{{0.1, -0.05, 0.1}};
  return s;
}

/// Every kind of effect is on in one of them.
inline const std::vector<Scene>& scenes_of_all_effects() {
  static const std::vector<Scene> all = {scene_that_sleeps(), scene_with_layer(),
                                         scene_that_remembers()};
  return all;
}

}  // namespace tangere::testing
