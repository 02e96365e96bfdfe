// SPDX-License-Identifier: Apache-2.0
// Runs every file in scenes/ for all of its controls with four environments. None fails, and each
// does what it says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

constexpr int kEnvironments = 4;

/// The field of one sensor, summed.
struct Touch {
  int points = 0;       ///< with any component that is not exactly zero
  double pressure = 0;  ///< sum of the third components, positive under pressure [N]
  double shear = 0;     ///< largest length of the first two components [N]
  double along = 0;     ///< sum of the first components: force on the pad along axis0 [N]
};

/// The states of a scene after each step of its controls. Everything is found by name.
class SceneRun {
 public:
  explicit SceneRun(const std::string& name)
      : model_(read_scene(std::string(TANGERE_SOURCE_DIR) + "/scenes/" + name + ".xml").scene) {
    Batch batch(model_, kEnvironments, 1);
    Stepper stepper(model_);
    Readout readout(model_);
    const ControlProgram control(model_, model_.timestep(), 1);
    steps = int(control.steps());
    std::vector<double> u(std::size_t(kEnvironments * model_.nu()));
    for (int k = 0; k < steps; ++k) {
      for (int e = 0; e < kEnvironments; ++e)
        control.evaluate(
            k, e, std::span(u).subspan(std::size_t(e * model_.nu()), std::size_t(model_.nu())));
      stepper.step(batch, u);
      for (int e = 0; e < kEnvironments; ++e) record(batch, readout, e);
    }
    failed = batch.failed_count();
  }

  /// Coordinate `name` after `step`.
  [[nodiscard]] double q(int step, int e, const std::string& name) const {
    const auto names = model_.q_names();
    const auto at = std::find(names.begin(), names.end(), name);
    if (at == names.end()) throw std::runtime_error("no coordinate " + name);
    return frames_[std::size_t(step * kEnvironments + e)].q[std::size_t(at - names.begin())];
  }
  /// World position of a body after `step` [m], component 0, 1, 2; 3 … 6: its quaternion.
  [[nodiscard]] double body(int step, int e, const std::string& name, int component) const {
    const auto names = model_.body_names();
    const auto at = std::find(names.begin(), names.end(), name);
    if (at == names.end()) throw std::runtime_error("no body " + name);
    return frames_[std::size_t(step * kEnvironments + e)]
        .pose[std::size_t(7 * (at - names.begin()) + component)];
  }
  [[nodiscard]] const Touch& touch(int step, int e, int sensor) const {
    return frames_[std::size_t(step * kEnvironments + e)].touch[std::size_t(sensor)];
  }
  [[nodiscard]] int at(double time) const { return int(std::lround(time / model_.timestep())) - 1; }
  [[nodiscard]] int sensors() const { return int(model_.sensors().size()); }

  int steps = 0, failed = 0;

 private:
  struct Frame {
    std::vector<double> q, pose;
    std::vector<Touch> touch;
  };
  void record(const Batch& batch, Readout& readout, int e) {
    Frame f;
    f.q.resize(std::size_t(model_.nq()));
    f.pose.resize(std::size_t(7 * model_.nb()));
    std::vector<double> twist(std::size_t(6 * model_.nb()));
    batch.get_q(e, f.q);
    readout.bodies(batch, e, f.pose, twist);
    for (int s = 0; s < sensors(); ++s) {
      const SensorInfo& info = model_.sensors()[std::size_t(s)];
      std::vector<double> force(std::size_t(3 * info.points));
      readout.tactile(batch, e, s, force);
      Touch t;
      for (std::size_t p = 0; p < force.size(); p += 3) {
        t.points += force[p] != 0 || force[p + 1] != 0 || force[p + 2] != 0;
        t.pressure += info.pressure_sign * force[p + 2];
        t.along += force[p];
        t.shear = std::max(t.shear, std::hypot(force[p], force[p + 1]));
      }
      f.touch.push_back(t);
    }
    frames_.push_back(std::move(f));
  }

  Model model_;
  std::vector<Frame> frames_;  // [step][environment]
};

TEST(ShippedScenes, AreAllRunHere) {
  std::set<std::string> found;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(TANGERE_SOURCE_DIR) + "/scenes"))
    if (entry.path().extension() == ".xml") found.insert(entry.path().stem().string());
  const std::set<std::string> run = {"box_pushing",       "box_pushing_elastic",
                                     "cap_opening",       "cap_opening_elastic",
                                     "identify_ball",     "insertion",
                                     "in_hand",           "mug",
                                     "insertion_elastic", "insertion_gel",
                                     "rolling_ball",      "rolling_ball_small",
                                     "stable_grasp",      "stable_grasp_elastic",
                                     "stable_grasp_gel",  "ten_boxes",
                                     "grip_rod",          "gel_press",
                                     "gel_grasp"};
  EXPECT_EQ(found, run) << "a scene without a test of what it does, or a test without a scene";
}

/// Two strokes turn the egg by 0.3 rad or more each, and it stays in the hand.
TEST(ShippedScenes, FourFingersTurnAnEgg) {
  const SceneRun r("in_hand");
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    const auto yaw = [&](int step) {
      return 2 * std::atan2(r.q(step, e, "object.qz"), r.q(step, e, "object.qw"));
    };
    EXPECT_GT(r.q(r.steps - 1, e, "object.z"), -0.025) << e;
    EXPECT_GT(yaw(r.steps - 1) - yaw(r.at(1.3)), 0.6) << e;
    for (int tip = 0; tip < 4; ++tip) EXPECT_GT(r.touch(r.at(1.3), e, tip).pressure, 0.5) << e;
  }
}

TEST(ShippedScenes, RollingBallRolls) {
  for (const char* name : {"rolling_ball", "rolling_ball_small"}) {
    const SceneRun r(name);
    EXPECT_EQ(r.steps, 350);
    EXPECT_EQ(r.failed, 0);
    for (int e = 0; e < kEnvironments; ++e) {
      for (int k = 0; k < 60; ++k)
        EXPECT_EQ(r.touch(k, e, 0).points, 0) << "the pad is above the ball";
      for (int k = 90; k < 310; ++k)
        EXPECT_GT(r.touch(k, e, 0).pressure, 1e-3) << name << " step " << k;
      EXPECT_GT(r.q(r.at(0.8), e, "ball_joint.x") - r.q(0, e, "ball_joint.x"), 2e-3);
    }
  }
}

TEST(ShippedScenes, AGelPressesABallAndRollsIt) {
  const SceneRun r("gel_press");
  EXPECT_EQ(r.steps, 300);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    EXPECT_EQ(r.touch(0, e, 0).points, 0);
    EXPECT_GT(r.touch(r.at(0.12), e, 0).pressure, 1);
    EXPECT_GT(r.touch(r.at(0.12), e, 0).points, 100);
    EXPECT_GT(r.q(r.at(0.48), e, "ball.x") - r.q(0, e, "ball.x"), 1e-3);
  }
}

/// The gels are the only contact of the fingers.
TEST(ShippedScenes, GelsGripARodAndHoldIt) {
  const SceneRun r("gel_grasp");
  EXPECT_EQ(r.steps, 500);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    EXPECT_GT(r.touch(r.at(0.9), e, 0).pressure, 3);
    const auto height = [&](double time) { return r.body(r.at(time), e, "rod", 2); };
    EXPECT_NEAR(height(0.98) - r.body(0, e, "rod", 2), 0.04, 1e-3);
    EXPECT_NEAR(height(0.98), height(0.8), 1e-6) << "it slides out of the fingers";
  }
}

TEST(ShippedScenes, TheFingerPushesOneBoxOfTen) {
  const SceneRun r("ten_boxes");
  EXPECT_EQ(r.steps, 400);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e)
    for (const char* row : {"a", "b"})
      for (int k = 0; k < 5; ++k) {
        const std::string box = row + std::to_string(k) + ".";
        const auto moved = [&](int step) {
          return std::hypot(r.q(step, e, box + "x") - r.q(0, e, box + "x"),
                            r.q(step, e, box + "y") - r.q(0, e, box + "y"));
        };
        EXPECT_LT(moved(r.at(1.6)), 1e-4) << box;
        if (box == "a4.") {
          EXPECT_GT(moved(r.steps - 1), 0.02);
        } else {
          EXPECT_LT(moved(r.steps - 1), 1e-4) << box;
        }
      }
}

/// With the paper's friction and with shear springs.
class PapersScenes : public ::testing::TestWithParam<const char*> {
 protected:
  static std::string suffix() { return GetParam(); }
};

TEST_P(PapersScenes, BoxIsPushedAndLeftBehind) {
  const SceneRun r("box_pushing" + suffix());
  EXPECT_EQ(r.steps, 500);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    for (int k = 0; k <= r.at(0.1); ++k)
      ASSERT_EQ(r.touch(k, e, 0).points, 0) << "out of touch for 0.1 s";
    for (int k = r.at(0.3); k < r.at(2.2); ++k)
      ASSERT_GT(r.touch(k, e, 0).pressure, 0.1) << "step " << k;
    EXPECT_GT(r.q(r.at(2.2), e, "box_slide.x"), 0.1);
    EXPECT_GT(std::abs(r.q(r.at(2.2), e, "box_turn.angle")), 0.01);
    for (int k = r.at(2.3); k < r.steps; ++k) ASSERT_EQ(r.touch(k, e, 0).points, 0) << "step " << k;
    EXPECT_NEAR(r.q(r.steps - 1, e, "box_slide.x"), r.q(r.at(2.4), e, "box_slide.x"), 1e-4)
        << "it stays";
  }
}

TEST_P(PapersScenes, BarIsLiftedAndPutDown) {
  const SceneRun r("stable_grasp" + suffix());
  EXPECT_EQ(r.steps, 180);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    for (int s = 0; s < 2; ++s) {
      EXPECT_EQ(r.touch(1, e, s).points, 0) << "open";
      for (int k = r.at(0.15); k < r.at(0.75); ++k) {
        ASSERT_EQ(r.touch(k, e, s).points, 130) << "step " << k << ": flat pads on flat blocks";
        ASSERT_GT(r.touch(k, e, s).pressure, 0.05);
      }
      EXPECT_GT(r.touch(r.at(0.5), e, s).shear, 1e-5) << "what is lifted hangs on shear";
      EXPECT_EQ(r.touch(r.steps - 1, e, s).points, 0) << "open again: exactly zero";
    }
    const double start = r.body(0, e, "block_5", 2);
    EXPECT_GT(r.body(r.at(0.5), e, "block_5", 2) - start, 0.02);
    EXPECT_LT(std::abs(r.body(r.steps - 1, e, "block_5", 2) - start), 1e-3);
    EXPECT_LT(std::abs(r.body(r.at(0.5), e, "block_5", 4)), 0.1)
        << "held near its centre of mass: nearly level";
  }
}

TEST(ShippedScenes, TheMugIsFeltAndLifted) {
  const SceneRun r("mug");
  EXPECT_EQ(r.steps, 200);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    for (int s = 0; s < 2; ++s) {
      EXPECT_EQ(r.touch(1, e, s).points, 0) << "open";
      for (int k = r.at(0.3); k < r.steps; ++k) {
        ASSERT_GT(r.touch(k, e, s).points, 24) << "step " << k << ": a line on a round wall";
        ASSERT_GT(r.touch(k, e, s).pressure, 0.05);
      }
    }
    EXPECT_GT(r.body(r.steps - 1, e, "mug", 2) - r.body(0, e, "mug", 2), 0.02);
  }
}

TEST(ShippedScenes, TheRodIsFeltAndLifted) {
  const SceneRun r("grip_rod");
  EXPECT_EQ(r.steps, 500);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    for (int s = 0; s < 2; ++s) {
      EXPECT_EQ(r.touch(1, e, s).points, 0) << "open";
      // The fingers press with 4 N, and the skins have the material of the contact.
      EXPECT_NEAR(r.touch(r.steps - 1, e, s).pressure, 4, 0.2);
    }
    EXPECT_NEAR(r.body(r.steps - 1, e, "rod", 2) - r.body(0, e, "rod", 2), 0.04, 1e-3);
    const int before = r.steps - 51;
    EXPECT_NEAR(r.body(r.steps - 1, e, "rod", 2), r.body(before, e, "rod", 2), 1e-6)
        << "it slides out of the fingers";
  }
}

void expect_insertion_hits_the_rim(const std::string& scene) {
  const SceneRun r(scene);
  EXPECT_EQ(r.steps, 45);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    const int last = r.steps - 1;
    for (int s = 0; s < 2; ++s) EXPECT_GT(r.touch(last, e, s).pressure, 0.1) << "still held";
    const double bottom = r.body(last, e, "box", 2) - 0.03;
    EXPECT_GT(bottom, 0.022) << "stopped by the rim, at 25 mm";
    EXPECT_LT(bottom, 0.0251);
    // axis0 is up on the left pad and down on the right one. A hanging box pulls the pads down; the
    // rim pushes them up.
    const int hanging = r.at(0.05);
    EXPECT_LT(r.touch(hanging, e, 0).along - r.touch(hanging, e, 1).along, 0)
        << "before it touches";
    EXPECT_GT(r.touch(last, e, 0).along - r.touch(last, e, 1).along, 0) << "pressed onto the rim";
  }
}
TEST_P(PapersScenes, InsertionHitsTheRim) { expect_insertion_hits_the_rim("insertion" + suffix()); }
TEST(ShippedScenes, InsertionWithGelsHitsTheRim) { expect_insertion_hits_the_rim("insertion_gel"); }

TEST_P(PapersScenes, CapIsTurnedByTwoStrokes) {
  const SceneRun r("cap_opening" + suffix());
  EXPECT_EQ(r.steps, 720);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    const double once = r.q(r.at(1.8), e, "cap.angle"), twice = r.q(r.steps - 1, e, "cap.angle");
    EXPECT_GT(once, 0.2);
    EXPECT_GT(twice, once + 0.2);
    EXPECT_LT(twice, 2 * 1.3) << "a cap without damping rolls along, 1.3 rad a stroke";
    for (int s = 0; s < 3; ++s) {
      for (int k = 0; k < r.at(0.1); ++k)
        ASSERT_EQ(r.touch(k, e, s).points, 0) << "before they close";
      for (double time : {0.6, 1.0, 1.4, 2.4, 2.8, 3.2}) {
        // Tips that stick are pressed harder than those that creep along.
        EXPECT_NEAR(r.touch(r.at(time), e, s).pressure, suffix().empty() ? 10 : 14.5,
                    suffix().empty() ? 1 : 4.5)
            << "finger " << s + 1 << " at " << time << " s";
        EXPECT_GT(r.touch(r.at(time), e, s).points, 15);
        EXPECT_GT(r.touch(r.at(time), e, s).shear, 1e-4);
      }
      EXPECT_EQ(r.touch(r.at(1.8), e, s).points, 0) << "between the strokes";
      EXPECT_EQ(r.touch(r.steps - 1, e, s).points, 0) << "let go";
    }
  }
}

TEST(ShippedScenes, BallToIdentifyIsPressedRolledAndSlidOver) {
  const SceneRun r("identify_ball");
  EXPECT_EQ(r.steps, 500);
  EXPECT_EQ(r.failed, 0);
  for (int e = 0; e < kEnvironments; ++e) {
    for (int k = r.at(0.01); k < r.steps; ++k)
      ASSERT_GT(r.touch(k, e, 0).pressure, 0.1) << "step " << k;
    EXPECT_NEAR(r.touch(r.at(0.24), e, 0).pressure, 0.6 + 0.245, 0.1) << "motor and weight";
    // A ball rolls half as far as the pad that it carries. When sliding, the shear is at the limit
    // of friction, 0.5.
    EXPECT_NEAR(r.q(r.at(0.4), e, "ball_joint.x"), 0.5 * r.q(r.at(0.4), e, "pad_joint.x"), 1e-3);
    EXPECT_GT(r.q(r.at(0.4), e, "ball_joint.x"), 4e-3);
    for (double time : {0.3, 0.4})
      EXPECT_LT(std::abs(r.touch(r.at(time), e, 0).along),
                0.2 * r.touch(r.at(time), e, 0).pressure);
    for (double time : {0.735, 0.765})
      EXPECT_GT(std::abs(r.touch(r.at(time), e, 0).along),
                0.45 * r.touch(r.at(time), e, 0).pressure)
          << time << " s";
  }
}

INSTANTIATE_TEST_SUITE_P(Friction, PapersScenes, ::testing::Values("", "_elastic"),
                         [](const auto& given) {
                           return std::string(*given.param == 0 ? "viscous" : "elastic");
                         });

}  // namespace
}  // namespace tangere
