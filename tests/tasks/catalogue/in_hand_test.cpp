// SPDX-License-Identifier: Apache-2.0
// Tests the task in_hand: its draws, rewards, gait, other objects, and a long hold. The tests of
// all tasks cover its derivatives and script.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "engine/step/stepper.hpp"
#include "tasks/catalogue/in_hand_gait.hpp"
#include "tests/tasks/task_check.hpp"
#include "tests/tasks/task_starts.hpp"

namespace tangere {
namespace {

using testing::column;
using testing::kUnlikely;
using testing::OwnView;
using testing::play_episodes;
using testing::Start;
using testing::starts;
using testing::task_named;
using testing::uniform_distance;

constexpr double kOneDegree = std::numbers::pi / 180;
constexpr std::size_t kObject =
    13;  // first coordinate of the object, behind those of fingers and stand

Scene in_hand_scene() { return read_scene(TANGERE_SOURCE_DIR "/scenes/in_hand.xml").scene; }

TEST(InHand, StartsAndGoalsFollowTheirDistributions) {
  const auto task = task_named("in_hand");
  const auto all = starts(*task);
  const auto yaw = [](const Start& s) {
    return 2 * std::atan2(s.q[kObject + 6], s.q[kObject + 3]);
  };
  EXPECT_LT(uniform_distance(column(all, yaw), -45 * kOneDegree, 45 * kOneDegree), kUnlikely);
  const auto goal = [](const Start& s) { return s.memory.at(0); };
  EXPECT_LT(uniform_distance(column(all, goal), -60 * kOneDegree, 60 * kOneDegree), kUnlikely);
  EXPECT_LT(
      uniform_distance(column(all, [](const Start& s) { return s.varying.at(0); }), 0.0522, 0.0638),
      kUnlikely);
}

TEST(InHand, PaysForTheAngleToTheGoal) {
  const auto task = task_named("in_hand");
  OwnView own(*task);
  const double half = 100 * kOneDegree / 2;
  own.q[0][kObject + 3] = std::cos(half), own.q[0][kObject + 6] = std::sin(half);
  own.memory[0] = -50 * kOneDegree;  // an axis has no sense: 30° away
  StepOutcome verdict = task->evaluate(own.view());
  EXPECT_NEAR(verdict.reward, -1, 1e-12);
  EXPECT_FALSE(verdict.terminated || verdict.success);
  own.memory[0] = -71 * kOneDegree;
  TaskView last = own.view();
  last.actions = task->spec().horizon;
  verdict = task->evaluate(last);
  EXPECT_NEAR(verdict.reward, 10 - 0.09, 1e-12);
  EXPECT_TRUE(verdict.success);
  EXPECT_FALSE(verdict.terminated);
  own.q[0][kObject + 2] = -0.03;
  verdict = task->evaluate(own.view());
  EXPECT_EQ(verdict.reward, -10);
  EXPECT_TRUE(verdict.terminated);
  EXPECT_FALSE(verdict.success);
}

/// The place of a fingertip's middle from the angles of its finger, in the finger's frame.
std::array<double, 3> tip_of(const double* q) {
  const double x = 0.023 - 0.054 * (std::sin(q[1]) + std::sin(q[1] + q[2])),
               d = 0.054 * (std::cos(q[1]) + std::cos(q[1] + q[2]));
  return {x, d * std::sin(q[0]), 0.087 - d * std::cos(q[0])};
}

TEST(InHand, TipsGoAroundTheAxisOnePairAtATime) {
  const InHandGait gait(in_hand_scene(), "object");
  const std::array<double, 4> action{0.8, 0.5, 0.2, -0.4};
  std::array<double, 12> u{};
  // When fingers 2 and 4 are back, they are away from the object, at their own height and side, and
  // fingers 1 and 3 are still turned.
  gait.targets(action, 85 + 45, u);
  for (const std::size_t finger : {1U, 3U}) {
    const auto at = tip_of(&u[3 * finger]);
    EXPECT_NEAR(at[0], 0.043, 1e-12);
    EXPECT_NEAR(at[1], 0, 1e-12);
    EXPECT_NEAR(at[2], 0, 1e-12);
  }
  // When they let go, their tips are turned and lifted.
  gait.targets(action, 85 + 20, u);
  const auto off = tip_of(&u[3]);
  EXPECT_NEAR(std::atan2(off[1], off[0]), 0.8 * 0.35, 1e-12);
  EXPECT_NEAR(std::hypot(off[0], off[1]), 0.043, 1e-12);
  EXPECT_NEAR(off[2], 2e-3, 1e-12);
  // A pressing finger holds this force with its tip 35 mm from the axis: P (target - q) = -Jᵀ F.
  gait.targets(action, 249, u);
  std::array<double, 12> open{}, grip{};
  gait.closing(0, open);
  gait.closing(1, grip);
  EXPECT_NEAR(tip_of(open.data())[0], 0.047, 1e-12);
  const std::array<double, 3> hold{0, u[1], u[2]}, nominal{0, grip[1], grip[2]};
  EXPECT_LT(tip_of(hold.data())[0], tip_of(nominal.data())[0]) << "more force, a deeper target";
  const double slope = (u[1] - grip[1]) / (0.2 * 1.5);  // angle by force
  EXPECT_NEAR(slope, 0.087 / 1.5, 1e-12) << "a tip 87 mm below its hip has that lever";
}

TEST(InHand, AnObjectThatIsHeldForAMinuteStays) {
  const Scene scene = in_hand_scene();
  const auto task = task_named("in_hand");
  Batch batch(Model(scene), 4, 5);
  Stepper stepper(batch.model());
  const auto nu = std::size_t(batch.model().nu());
  std::vector<double> u(4 * nu), q(std::size_t(batch.model().nq()));
  const InHandGait gait(scene, "object");
  for (int e = 0; e < 4; ++e) {
    std::vector<double> v(std::size_t(batch.model().nv()));
    batch.get_q(e, q);
    gait.closing(0, std::span(q).first(12));
    batch.set_state(e, q, v);
  }
  std::array<std::vector<double>, 4> early;
  for (int step = 0; step < 12000; ++step) {
    const double closed = std::clamp((step - 60) / 60.0, 0.0, 1.0);
    for (std::size_t e = 0; e < 4; ++e) {
      gait.closing(closed, std::span(u).subspan(e * nu, 12));
      u[e * nu + 12] = -0.08 * std::clamp((step - 150) / 50.0, 0.0, 1.0);
    }
    stepper.step(batch, u);
    for (int e = 0; e < 4 && step == 399; ++e) {
      early[std::size_t(e)].resize(q.size());
      batch.get_q(e, early[std::size_t(e)]);
    }
  }
  for (int e = 0; e < 4; ++e) {
    batch.get_q(e, q);
    double moved = 0;
    for (std::size_t c = 0; c < 3; ++c)
      moved = std::max(moved, std::abs(q[kObject + c] - early[std::size_t(e)][kObject + c]));
    EXPECT_GT(q[kObject + 2], -6e-3) << "environment " << e << " lets it fall";
    EXPECT_LT(moved, 1e-4) << "environment " << e << ", from 2 to 60 s [m]";
  }
}

/// The script turns a capsule and a mesh as well: the task has no shape of its own.
TEST(InHand, TurnsOtherObjects) {
  const double quarter = std::sqrt(0.5);
  for (const char* const shape : {"capsule", "mesh"}) {
    Scene scene = in_hand_scene();
    for (LinkDescription& link : scene.links) {
      if (link.body.name != "object") continue;
      if (std::string(shape) == "mesh") {
        const Scene pebble = parse_scene(
                                 "<tangere><option unit='m-kg'/><robot><link name='p'><joint "
                                 "name='p' type='free3d'/>"
                                 "<body name='p' type='mesh' transform_type='OBJ_TO_JOINT' "
                                 "density='800' filename='" TANGERE_SOURCE_DIR
                                 "/scenes/meshes/pebble.obj'/></link></robot></tangere>",
                                 "pebble")
                                 .scene;
        const std::string name = link.body.name;
        link.body = pebble.links[0].body;
        link.body.name = name;
      } else {
        link.body.shape = CapsuleShape{0.014, 0.021};
        link.body.pose.orientation = {quarter, 0, quarter, 0};
      }
    }
    std::erase_if(scene.randomizations, [](const RandomizationDescription& d) {
      return d.number.owner == NumberOwner::body;
    });
    const auto task = make_task("in_hand", scene);
    EXPECT_GT(play_episodes(*task, PolicyKind::scripted, 16).rate(), 0.6) << shape;
  }
}

TEST(InHand, RefusesOtherHands) {
  Scene scene = in_hand_scene();
  scene.motors.pop_back();
  EXPECT_THROW(static_cast<void>(make_task("in_hand", scene)), InputError);
  scene = in_hand_scene();
  for (LinkDescription& link : scene.links)
    if (link.joint.name == "lower_1") link.joint.name = "elbow";
  EXPECT_THROW(InHandGait(scene, "object"), InputError);
  for (const char* const name : {"object", "swing_3", "stand"}) {
    scene = in_hand_scene();
    for (LinkDescription& link : scene.links)
      if (link.joint.name == name) link.joint.type = JointType::spherical;
    EXPECT_THROW(static_cast<void>(make_task("in_hand", scene)), InputError) << name;
  }
  scene = in_hand_scene();
  std::swap(scene.motors[1], scene.motors[2]);
  EXPECT_THROW(static_cast<void>(make_task("in_hand", scene)), InputError);
  scene = in_hand_scene();
  scene.sensors[2].points.pop_back();
  EXPECT_THROW(static_cast<void>(make_task("in_hand", scene)), InputError);
}

TEST(InHand, ObservesTouchOrNot) {
  const auto task = task_named("in_hand"), blind = task_named("in_hand_blind");
  EXPECT_EQ(blind->spec().observation_size(), 13U);
  EXPECT_EQ(task->spec().observation_size(), 13U + 4 * 64 * 3);
  VectorTask seeing(*task, 2), unseeing(*blind, 2);
  for (std::size_t k = 0; k < 13; ++k)
    EXPECT_EQ(seeing.observation(1)[k], unseeing.observation(1)[k]);
  for (std::size_t finger = 0; finger < 4; ++finger) {
    double force = 0;
    for (std::size_t p = 0; p < 64; ++p)
      force += seeing.observation(1)[13 + (finger * 64 + p) * 3 + 2];
    EXPECT_GT(std::abs(force), 0.5) << "finger " << finger + 1 << " holds the egg [N]";
  }
}

}  // namespace
}  // namespace tangere
