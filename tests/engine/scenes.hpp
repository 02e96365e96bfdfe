// SPDX-License-Identifier: Apache-2.0
// Scenes of the engine tests, built in code.
#pragma once

#include <utility>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere::testing {

inline LinkDescription link(const std::string& name, JointType type, Vector3 at, Shape shape,
                            double density) {
  LinkDescription l;
  l.name = name;
  l.joint.name = name + "_joint";
  l.joint.type = type;
  l.joint.pose.position = at;
  l.body.name = name;
  l.body.shape = std::move(shape);
  l.body.density = density;
  return l;
}

/// A pad above a light ball on the ground. `published`: uses laws and single-precision numbers of
/// the published simulator.
inline Scene rolling_ball(bool published = false, int resolution = 200) {
  const auto number = [published](double x) { return published ? double(float(x)) : x; };
  Scene s;
  s.name = "rolling_ball";
  s.integrator = Integrator::bdf2;
  s.timestep = number(5e-3);
  s.ground = GroundDescription{};
  s.links = {link("pad", JointType::translational, {0, 0, 0.06},
                  CuboidShape{{0.05, 0.05, 0.01}, {20, 20, 20}}, 1000),
             link("ball", JointType::free, {0, 0, 0.02}, SphereShape{number(0.02)}, 1)};
  s.links[0].joint.damping = 1;
  s.motors.push_back({"pad_joint", -1, 1, {}});
  const ContactLaw law = published ? ContactLaw::paper : ContactLaw::clamped;
  s.pair_contacts.push_back({"pad", "ball", {5, 1, 1, 1}, law, 1e-5, {}});
  s.ground_contacts.push_back(
      {"ball", {5e3, 1, number(0.8), number(0.03)}, ContactLaw::linear, published ? 0 : 1e-5, {}});
  TactileDescription t;
  t.name = "pad";
  t.body = "pad";
  t.coefficients = {1, number(0.01), 2, number(0.003)};
  t.law = law;
  t.array = {{-0.025, 0.025, -0.005},
             {0.025, -0.025, -0.005},
             {0, -1, 0},
             {1, 0, 0},
             resolution,
             resolution};
  s.sensors.push_back(t);
  return s;
}

/// Controls of the rolling ball, in five phases.
inline std::vector<double> rolling_ball_control(int step) {
  if (step < 100) return {0, 0, 0.2};
  if (step < 150) return {0.1, 0, 0.2};
  if (step < 200) return {-0.2, 0, 0.2};
  if (step < 250) return {0, 0.1, 0.2};
  return {0, -0.2, 0.2};
}

/// Another scene: two balls of different radius under a yawed pad, other points, laws, step and
/// scheme.
inline Scene two_balls() {
  Scene s;
  s.name = "two_balls";
  s.integrator = Integrator::sdirk2;
  s.timestep = 2e-3;
  s.ground = GroundDescription{{0, 0, -0.01}, {0, 0, 1}};
  s.links = {link("plate", JointType::translational, {0.01, 0, 0.06},
                  CuboidShape{{0.1, 0.06, 0.012}, {9, 7, 3}}, 400),
             link("large", JointType::free, {-0.02, 0.004, 0.02}, SphereShape{0.03}, 300),
             link("small", JointType::free, {0.035, -0.003, 0.0193}, SphereShape{0.0293}, 350)};
  s.links[0].joint.damping = 2;
  s.links[0].body.pose = {{0, 0, 0.002}, {0.9238795325112867, 0, 0, 0.3826834323650898}};
  s.motors.push_back({"plate_joint", -2, 2, {}});
  s.pair_contacts.push_back({"plate", "large", {300, 4, 0.7, 20}, ContactLaw::clamped, 1e-5, {}});
  s.pair_contacts.push_back({"plate", "small", {200, 3, 0.5, 10}, ContactLaw::paper, 1e-5, {}});
  for (const char* ball : {"large", "small"})
    s.ground_contacts.push_back({ball, {2e3, 5, 0.6, 0.5}, ContactLaw::linear, 1e-5, {}});
  TactileDescription t;
  t.name = "skin";
  t.body = "plate";
  t.coefficients = {20, 0.3, 0.8, 0.5};
  t.array = {{-0.045, -0.025, -0.006}, {0.045, 0.025, -0.006}, {1, 0, 0}, {0, -1, 0}, 7, 9};
  t.array.corner0 = {-0.045, 0.025, -0.006};
  t.array.corner1 = {0.045, -0.025, -0.006};
  s.sensors.push_back(t);
  return s;
}

}  // namespace tangere::testing
