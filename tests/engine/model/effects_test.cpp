// SPDX-License-Identifier: Apache-2.0
// Tests the table of effects over a scene that has them all: an effect that is removed leaves what
// its coefficient at zero leaves, and takes its bytes with it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/model/effects.hpp"
#include "engine/step/control.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;

RandomizationDescription varied(const SceneNumber& number, double low, double high) {
  return {number, {Distribution::Kind::uniform, low, high, {}}, {}};
}

/// A pad that presses a ball onto the ground beside a box, and an arm with all that joints can
/// have. Every kind of effect is on and acts within 40 steps.
Scene scene_of_all_effects() {
  Scene s = testing::rolling_ball(false, 12);
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
  for (TactileDescription& d : s.sensors) d.imperfections.noise = {1e-4, 1e-4};
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

/// States, then fields by sensor name, after steps of a batch with the scene's own controls.
struct Result {
  std::vector<double> states;
  std::map<std::string, std::vector<double>> fields;
};

Result play(const Scene& scene, int steps = 40) {
  constexpr int kEnvironments = 3;
  const Model model(scene);
  Batch batch(model, kEnvironments, 5);
  Stepper stepper(model, testing::options(scene.integrator, scene.timestep));
  const ControlProgram controls(model, scene.timestep, 0);
  std::vector<double> u(std::size_t(model.nu()));
  controls.evaluate(0, 0, u);
  for (int k = 0; k < steps; ++k) testing::step_all(stepper, batch, u);
  EXPECT_EQ(batch.failed_count(), 0);
  Result result;
  Readout readout(model);
  for (int e = 0; e < kEnvironments; ++e) {
    for (const std::vector<double>& x : {testing::q_of(batch, e), testing::v_of(batch, e)})
      result.states.insert(result.states.end(), x.begin(), x.end());
    for (std::size_t s = 0; s < model.sensors().size(); ++s) {
      std::vector<double> field(3 * std::size_t(model.sensors()[s].points));
      readout.tactile(batch, e, int(s), field);
      std::vector<double>& all = result.fields[model.sensors()[s].name];
      all.insert(all.end(), field.begin(), field.end());
    }
  }
  return result;
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  EXPECT_EQ(a.size(), b.size());
  double most = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

/// A field that one of the two does not have counts as zeros.
double distance(const Result& a, const Result& b) {
  double most = distance(a.states, b.states);
  for (const auto& [x, y] : {std::pair(&a, &b), std::pair(&b, &a)})
    for (const auto& [name, field] : x->fields) {
      const auto other = y->fields.find(name);
      most = std::max(
          most, distance(field, other != y->fields.end() ? other->second
                                                         : std::vector<double>(field.size(), 0)));
    }
  return most;
}

const EffectInfo* find(const std::vector<EffectInfo>& effects, const std::string& name) {
  const auto found = std::find_if(effects.begin(), effects.end(),
                                  [&](const EffectInfo& e) { return e.name == name; });
  return found != effects.end() ? &*found : nullptr;
}

/// Adding zeros changes no bit, so most ways agree to the bit. A contact that is gone leaves a
/// sparser matrix, whose elimination rounds otherwise, and bodies that no longer share a norm, so
/// that Newton's method stops elsewhere.
double allowed(EffectKind kind) { return kind == EffectKind::pair_contact ? 1e-11 : 0; }

TEST(Effects, TheSceneOfThisTestHasEveryKind) {
  const Scene scene = scene_of_all_effects();
  const Result all = play(scene);
  int kinds = 0;
  for (const EffectInfo& info : effects_of(scene)) {
    if (info.effect.element >= 0) continue;
    EXPECT_EQ(info.effect.kind, static_cast<EffectKind>(kinds++));
    EXPECT_EQ(info.name, to_string(info.effect.kind));
    EXPECT_TRUE(info.on) << info.name << ": " << info.reason;
    if (info.effect.kind == EffectKind::sleeping) {
      EXPECT_EQ(info.reason, "sleep 0.001");
      EXPECT_EQ(distance(all, play(without(scene, info.effect))), 0) << "all bodies move";
    } else if (has_way(info.effect.kind, Way::removed)) {
      EXPECT_GT(distance(all, play(without(scene, info.effect))), 1e-9) << info.name;
    }
  }
  EXPECT_EQ(kinds, kEffectKinds);
}

TEST(Effects, RemovedEqualsZeroCoefficients) {
  const Scene scene = scene_of_all_effects();
  for (const EffectInfo& info : effects_of(scene)) {
    SCOPED_TRACE(info.name);
    if (!has_way(info.effect.kind, Way::removed)) continue;
    const Result removed = play(without(scene, info.effect));
    for (const Way way : {Way::zero, Way::idle})
      if (has_way(info.effect.kind, way)) {
        EXPECT_LE(distance(removed, play(without(scene, info.effect, way))),
                  allowed(info.effect.kind))
            << "way " << int(way);
      }
  }
}

TEST(Effects, PartsGoWithoutTheirElements) {
  const auto elements = [](const Scene& s) {
    return s.pair_contacts.size() + s.ground_contacts.size() + s.sensors.size();
  };
  const Scene scene = scene_of_all_effects();
  for (const EffectInfo& info : effects_of(scene)) {
    SCOPED_TRACE(info.name);
    const EffectKind kind = info.effect.kind;
    if (info.effect.element < 0) continue;
    EXPECT_TRUE(element_owner(kind).has_value());
    EXPECT_EQ(elements(without(scene, info.effect)), elements(scene) - (is_part(kind) ? 0U : 1U));
  }
  EXPECT_EQ(element_owner(EffectKind::ground_damping), NumberOwner::ground);
  EXPECT_EQ(element_owner(EffectKind::sensor_imperfections), NumberOwner::tactile);
  EXPECT_FALSE(element_owner(EffectKind::gravity).has_value());
  EXPECT_FALSE(is_part(EffectKind::varying_parameters));
}

/// Markers whose gel is as stiff as what remembers stay where that is taken away.
TEST(Effects, MarkersKeepTheirStiffness) {
  Scene scene = testing::rolling_ball(false, 12);
  TactileDescription& pad = scene.sensors.front();
  pad.coefficients.ks = 0.5;
  pad.markers = MarkersDescription{};
  for (const EffectInfo& info : effects_of(scene)) {
    if (info.effect.kind != EffectKind::tactile_shear) continue;
    for (const Way way : {Way::removed, Way::zero}) {
      const Scene rest = without(scene, info.effect, way);
      EXPECT_EQ(rest.sensors.front().coefficients.ks, 0);
      EXPECT_EQ(rest.sensors.front().markers->stiffness, 0.5);
      EXPECT_NO_THROW(Model{rest});
    }
  }
}

TEST(Effects, RemovedIsOffAndLeavesTheOthersOn) {
  const Scene scene = scene_of_all_effects();
  for (const EffectInfo& info : effects_of(scene)) {
    SCOPED_TRACE(info.name);
    if (!has_way(info.effect.kind, Way::removed)) continue;
    const std::vector<EffectInfo> left = effects_of(without(scene, info.effect));
    const EffectInfo* const same = find(left, info.name);
    EXPECT_TRUE(same == nullptr || !same->on);
    for (const EffectInfo& other : left) {
      const EffectInfo* const before = find(effects_of(scene), other.name);
      ASSERT_NE(before, nullptr) << other.name;
      EXPECT_LE(other.on, before->on) << other.name;
      // Its own friction and damping, and numbers of it that vary, may go with an effect.
      const bool own = other.name.find(info.name) == 0 ||
                       other.effect.kind == EffectKind::varying_parameters ||
                       (info.effect.kind == EffectKind::tactile &&
                        other.effect.kind == EffectKind::sensor_imperfections) ||
                       (int(other.effect.kind) - int(info.effect.kind) <= 2 &&
                        int(other.effect.kind) >= int(info.effect.kind));
      if (before->on && !own) {
        EXPECT_TRUE(other.on) << other.name;
      }
    }
  }
}

TEST(Effects, VelocityProductsFollowFromTheJoints) {
  const Scene scene = scene_of_all_effects();
  const Effect products{EffectKind::velocity_products};
  for (const Way way : {Way::removed, Way::zero, Way::idle})
    EXPECT_FALSE(has_way(products.kind, way));
  EXPECT_THROW(without(scene, products), InputError);
  EXPECT_THROW(without(scene, {EffectKind::tactile, 2}), InputError);
}

TEST(Effects, ASceneAllocatesNothingForWhatItDoesNotName) {
  const Scene scene = scene_of_all_effects();
  const Model all(scene);
  const auto bytes = [&](EffectKind kind) {
    const Model model(without(scene, {kind}));
    return std::pair(model.state_bytes_per_environment(), Stepper::workspace_bytes(model));
  };
  const auto [state, workspace] =
      std::pair(all.state_bytes_per_environment(), Stepper::workspace_bytes(all));
  // Three numbers vary: that of a contact, of a sensor and of a joint.
  EXPECT_EQ(bytes(EffectKind::varying_parameters).first, state - 3 * sizeof(double));
  EXPECT_EQ(bytes(EffectKind::pair_contact).first, state - sizeof(double));
  EXPECT_EQ(bytes(EffectKind::tactile).first, state - sizeof(double));
  EXPECT_EQ(bytes(EffectKind::joint_damping).first, state - sizeof(double));
  EXPECT_LT(bytes(EffectKind::pair_contact).second, workspace);
  for (int k = 0; k < kEffectKinds; ++k) {
    if (!has_way(static_cast<EffectKind>(k), Way::removed)) continue;
    EXPECT_LE(bytes(static_cast<EffectKind>(k)).first, state) << k;
    EXPECT_LE(bytes(static_cast<EffectKind>(k)).second, workspace) << k;
  }
}

TEST(Effects, RemovedEqualsASceneThatNeverNamedIt) {
  Scene bare = testing::rolling_ball(false, 12);
  bare.pair_contacts.clear();
  bare.ground_contacts.clear();
  bare.sensors.clear();
  bare.links[0].joint.damping = 0;
  Scene trimmed = testing::rolling_ball(false, 12);
  for (const EffectKind kind :
       {EffectKind::pair_contact, EffectKind::ground_contact, EffectKind::tactile,
        EffectKind::joint_damping, EffectKind::joint_limits, EffectKind::joint_springs})
    trimmed = without(trimmed, {kind});
  EXPECT_EQ(distance(play(bare), play(trimmed)), 0);
  const Model a(bare), b(trimmed);
  EXPECT_EQ(a.state_bytes_per_environment(), b.state_bytes_per_environment());
  EXPECT_EQ(Stepper::workspace_bytes(a), Stepper::workspace_bytes(b));
  EXPECT_EQ(a.stages().size(), b.stages().size());
}

TEST(Effects, MotorsTakeTheirControlsWithThem) {
  Scene scene = scene_of_all_effects();
  scene.control = PiecewiseControl{{0, 0.1}, {{1, 2, 3, 4}, {5, 6, 7, 8}}, 1};
  const Scene no_force = without(scene, {EffectKind::force_motors});
  EXPECT_EQ(std::get<PiecewiseControl>(*no_force.control).values,
            (std::vector<std::vector<double>>{{4}, {8}}));
  const Scene no_position = without(scene, {EffectKind::position_motors});
  EXPECT_EQ(std::get<PiecewiseControl>(*no_position.control).values,
            (std::vector<std::vector<double>>{{1, 2, 3}, {5, 6, 7}}));
}

TEST(Effects, LinesNameTheFileOnce) {
  EffectInfo info;
  EXPECT_EQ(lines_of(info), "");
  info.sources = {{"a.xml", 3}, {"a.xml", 3}, {"a.xml", 7}, {"b.xml", 7}};
  EXPECT_EQ(lines_of(info), "a.xml:3, 7, b.xml:7");
}

}  // namespace
}  // namespace tangere
