// SPDX-License-Identifier: Apache-2.0
// Tests joints in motion against known answers: folded bodies, static bodies, limits.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/scene/frames.hpp"
#include "engine/step/rotation_log.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;
using testing::v_of;

const CuboidShape kBox{{0.2, 0.1, 0.06}, {2, 2, 2}};

void run(const Model& model, Batch& batch, Integrator scheme, double timestep, int steps,
         const std::vector<double>& u) {
  Stepper stepper(model, testing::options(scheme, timestep));
  for (int k = 0; k < steps; ++k) testing::step_all(stepper, batch, u);
  EXPECT_EQ(batch.failed_count(), 0);
}

// --- fixed joints ---

/// A box with a weightless ball under it. With `parts` it is two halves on turned fixed joints,
/// with the ball on the second.
Scene thrown_box(bool parts) {
  Scene s;
  s.ground = GroundDescription{};
  const Vector3 start = {0, 0, 0.1};
  if (parts) {
    CuboidShape half = kBox;
    half.size[0] = 0.1;
    s.links = {link("box", JointType::free, start, half, 700),
               link("half", JointType::fixed, {0.03, 0.04, 0.1}, half, 700),
               link("ball", JointType::fixed, {-0.03, -0.04, -0.1}, SphereShape{0.02}, 0)};
    s.links[0].body.pose.position = {-0.05, 0, 0};
    s.links[1].parent = 0;
    s.links[1].joint.pose.orientation = {0.8, 0.6, 0, 0};
    // Back from the turned joint to the box's axes: the inverse of the offset
    // (0.03, 0.04, 0.1) and of the rotation.
    s.links[1].body.pose.orientation = {0.8, -0.6, 0, 0};
    const auto R = to_frame(s.links[1].joint.pose).R;
    const auto at = kernels::transposed_times(R, kernels::Vec3<double>{0.05 - 0.03, -0.04, -0.1});
    s.links[1].body.pose.position = {at.x, at.y, at.z};
    s.links[2].parent = 1;
    const auto back =
        kernels::transposed_times(R, kernels::Vec3<double>{-0.03, -0.04, -0.1 - 0.05});
    s.links[2].joint.pose.position = {back.x, back.y, back.z};
  } else {
    s.links = {link("box", JointType::free, start, kBox, 700),
               link("ball", JointType::fixed, {0, 0, -0.05}, SphereShape{0.02}, 0)};
    s.links[1].parent = 0;
  }
  TactileDescription t;
  t.name = "skin";
  t.body = parts ? "half" : "box";
  t.coefficients = {50, 0.1, 1, 0.1};
  t.array = {{-0.04, -0.04, -0.03}, {0.04, 0.04, -0.03}, {1, 0, 0}, {0, 1, 0}, 5, 5};
  if (!parts)  // the half's middle is 5 cm along x
    for (Vector3* corner : {&t.array.corner0, &t.array.corner1}) (*corner)[0] += 0.05;
  s.sensors.push_back(t);
  s.links.push_back(link("post", JointType::fixed, {0.05, 0, 0.03}, SphereShape{0.041}, 1000));
  s.ground_contacts.push_back({"ball", {800, 2, 0.6, 0.5}, ContactLaw::linear, 1e-5, {}});
  s.initial.push_back({"box_joint", {}, {0.3, 0, -0.5, 0.4, 0.3, 2}, {}});
  return s;
}

TEST(FixedJoints, PartsMoveAndFeelLikeOneBody) {
  const Model whole(thrown_box(false)), parts(thrown_box(true));
  ASSERT_EQ(whole.nv(), 6);
  ASSERT_EQ(parts.nv(), 6);
  EXPECT_EQ(parts.nb(), 4);
  Batch a(whole, 1), b(parts, 1);
  Readout feel_a(whole), feel_b(parts);
  std::vector<double> field_a(75), field_b(75);
  double touched = 0, pressed = 0;
  for (int k = 0; k < 60; ++k) {
    run(whole, a, Integrator::bdf2, 2e-3, 1, {});
    run(parts, b, Integrator::bdf2, 2e-3, 1, {});
    for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(q_of(a)[i], q_of(b)[i], 1e-10) << "step " << k;
    for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(v_of(a)[i], v_of(b)[i], 1e-8) << "step " << k;
    feel_a.tactile(a, 0, 0, field_a);
    feel_b.tactile(b, 0, 0, field_b);
    for (std::size_t i = 0; i < 75; ++i) EXPECT_NEAR(field_a[i], field_b[i], 1e-7) << "step " << k;
    for (double f : field_b) pressed = std::max(pressed, std::abs(f));
    touched = std::max(touched, v_of(b)[2]);
  }
  EXPECT_GT(touched, -0.1) << "the ball never met the ground";
  EXPECT_GT(pressed, 1e-3) << "the sensor never met the post";
}

TEST(FixedJoints, MotorsFollow) {
  // A hinge on a bracket that is fixed to the world, and a hinge placed there directly.
  Scene s;
  s.links = {link("bracket", JointType::fixed, {0.1, 0.2, 0.3}, kBox, 500),
             link("arm", JointType::revolute, {0, 0.1, 0}, kBox, 500)};
  s.links[0].joint.pose.orientation = {0.6, 0, 0, 0.8};
  s.links[1].parent = 0;
  s.links[1].joint.axis0 = {0, 1, 0};
  s.links[1].body.pose.position = {0.1, 0, 0};
  s.motors = {{"arm_joint", -2, 2, {}}};
  Scene direct = s;
  direct.links.erase(direct.links.begin());
  const kernels::Frame<double> at =
      compose(to_frame(s.links[0].joint.pose), to_frame(s.links[1].joint.pose));
  const kernels::Quat<double> q = quaternion_of(at.R);
  direct.links[0].parent = -1;
  direct.links[0].joint.pose = {{at.p.x, at.p.y, at.p.z}, {q.w, q.x, q.y, q.z}};
  const Model one(s), two(direct);
  ASSERT_EQ(one.nu(), 1);
  Batch a(one, 1), b(two, 1);
  run(one, a, Integrator::bdf2, 2e-3, 100, {0.7});
  run(two, b, Integrator::bdf2, 2e-3, 100, {0.7});
  EXPECT_NEAR(q_of(a)[0], q_of(b)[0], 1e-12);
  EXPECT_GT(std::abs(q_of(a)[0]), 0.1);
}

TEST(FixedJoints, BodiesOfTheWorldAreTouched) {
  // A box stands on a fixed table by its corners; a ball hangs on one contact point of a fixed
  // grid.
  Scene s;
  s.links = {link("table", JointType::fixed, {0, 0, 0}, CuboidShape{{1, 1, 0.1}, {3, 3, 2}}, 100),
             link("box", JointType::free, {0.2, 0.2, 0.08}, kBox, 700),
             link("ball", JointType::translational, {0, 0, 0.1}, SphereShape{0.05}, 700)};
  s.pair_contacts.push_back({"box", "table", {2000, 5, 0.5, 20}, ContactLaw::clamped, 1e-5, {}});
  s.pair_contacts.push_back({"table", "ball", {2000, 5, 0.5, 2000}, ContactLaw::clamped, 1e-5, {}});
  const Model model(s);
  Batch batch(model, 1);
  run(model, batch, Integrator::bdf1, 5e-3, 2000, {});
  EXPECT_NEAR(q_of(batch)[2], -model.mass(1) * 9.8 / (4 * 2000), 1e-8);
  EXPECT_NEAR(q_of(batch)[9], -model.mass(2) * 9.8 / 2000, 1e-7);
  Scene nothing = s;
  nothing.links[1].joint.type = nothing.links[2].joint.type = JointType::fixed;
  EXPECT_THROW(Model{nothing}, InputError);
}

// --- limits ---

TEST(Limits, StopAFallWhereTheSpringCarriesIt) {
  Scene s;
  s.links = {link("car", JointType::prismatic, {0, 0, 0}, kBox, 500),
             link("plate", JointType::planar, {1, 0, 0}, kBox, 500)};
  s.links[0].joint.limits = {-0.02, 0.5};
  s.links[0].joint.limit_stiffness = 5000;
  s.links[1].joint.axis0 = {0, 0, -1};  // falls towards its upper limit
  s.links[1].joint.axis1 = {0, 1, 0};
  s.links[1].joint.limits = {-0.5, 0.03};
  s.links[1].joint.limit_stiffness = 4000;
  for (LinkDescription& l : s.links) l.joint.damping = 10;
  const Model model(s);
  Batch batch(model, 1);
  run(model, batch, Integrator::bdf2, 2e-3, 3000, {});
  EXPECT_NEAR(q_of(batch)[0], -0.02 - 0.6 * 9.8 / 5000, 1e-9);
  EXPECT_NEAR(q_of(batch)[1], 0.03 + 0.6 * 9.8 / 4000, 1e-9);
  EXPECT_NEAR(q_of(batch)[2], 0, 1e-12);
}

/// The energy of a turning body determines how deep it goes beyond its limit. It comes back equally
/// fast.
TEST(Limits, GiveTheEnergyBack) {
  for (JointType type : {JointType::revolute, JointType::spherical}) {
    Scene s;
    s.gravity = {0, 0, 0};
    s.links = {link("ball", type, {0, 0, 0}, SphereShape{0.1}, 500)};
    s.links[0].joint.axis0 = {0, 0, 1};
    s.links[0].joint.limits = {-0.5, 0.4};
    s.links[0].joint.limit_stiffness = 20;
    s.initial.push_back(
        {"ball_joint",
         {},
         type == JointType::revolute ? std::vector<double>{3} : std::vector<double>{0, 0, 3},
         {}});
    const Model model(s);
    Batch batch(model, 1);
    Stepper stepper(model, testing::options(Integrator::sdirk2, 5e-4));
    double most = 0;
    for (int k = 0; k < 800; ++k) {
      stepper.step(batch, {});
      const std::vector<double> q = q_of(batch);
      most = std::max(
          most, type == JointType::revolute ? q[0] : rotation_log({q[0], q[1], q[2], q[3]}).z);
    }
    const double inertia = 0.4 * model.mass(0) * 0.01;
    EXPECT_NEAR(most, 0.4 + 3 * std::sqrt(inertia / 20), 2e-4) << to_string(type);
    EXPECT_NEAR(v_of(batch).back(), -3, 1e-3) << to_string(type);
  }
}

TEST(Limits, MistakesInScenesBuiltInCodeAreErrors) {
  const auto message = [](auto change) {
    Scene s;
    s.links = {link("car", JointType::prismatic, {0, 0, 0}, kBox, 500)};
    s.motors = {{"car_joint", -1, 1, {}}};
    change(s);
    try {
      const Model model(s);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(message([](Scene&) {}), "");
  EXPECT_NE(message([](Scene& s) {
              s.links[0].joint.limits = {1, -1};
            }).find("low, then high"),
            std::string::npos);
  EXPECT_NE(message([](Scene& s) { s.links[0].joint.stiffness = -1; }).find("stiffness"),
            std::string::npos);
  EXPECT_NE(message([](Scene& s) {
              s.links[0].joint.rest = {1, 2};
            }).find("rest has 2"),
            std::string::npos);
  EXPECT_NE(message([](Scene& s) { s.motors[0].high = HUGE_VAL; }).find("finite range"),
            std::string::npos);
  EXPECT_NE(message([](Scene& s) {
              s.motors[0].control = MotorControl::position;
              s.motors[0].low = 2;
            }).find("low, then high"),
            std::string::npos);
  EXPECT_NE(message([](Scene& s) { s.links[0].body.density = 0; }).find("nothing that has mass"),
            std::string::npos);
}

}  // namespace
}  // namespace tangere
