// SPDX-License-Identifier: Apache-2.0
// Tests the table of effects over scenes that have them all: an effect that is removed leaves what
// its coefficient at zero leaves, and takes its bytes with it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "engine/scene/surface_contact.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "engine/step/tape.hpp"
#include "tasks/effects/ablation.hpp"
#include "tests/engine/effect_scenes.hpp"
#include "tests/engine/runs.hpp"

namespace tangere {
namespace {

using testing::scenes_of_all_effects;

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
      if (!scene.sensors[s].markers) continue;
      DenseFrame<double> frame(model, int(s), FieldForm::markers);
      readout.read(batch, e, frame);
      std::vector<double>& moved =
          result.fields[output_name(model.sensors()[s].name, frame.form())];
      moved.insert(moved.end(), frame.values().begin(), frame.values().end());
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
/// Markers of zero compliance have a huge stiffness.
double allowed(EffectKind kind) {
  if (kind == EffectKind::markers) return 1e-290;
  return kind == EffectKind::pair_contact || kind == EffectKind::feedback ? 1e-10 : 0;
}

TEST(Effects, TheScenesOfThisTestHaveEveryKind) {
  std::set<EffectKind> acting;
  for (const Scene& scene : scenes_of_all_effects()) {
    const Result all = play(scene);
    int kinds = 0;
    for (const EffectInfo& info : effects_of(scene)) {
      const EffectKind kind = info.effect.kind;
      if (info.effect.element >= 0) continue;
      EXPECT_EQ(kind, static_cast<EffectKind>(kinds++));
      EXPECT_EQ(info.name, to_string(kind));
      if (!info.on) continue;
      acting.insert(kind);
      if (kind == EffectKind::sleeping) {
        EXPECT_EQ(info.reason, "sleep 0.001");
        EXPECT_EQ(distance(all, play(without(scene, info.effect))), 0) << "all bodies move";
      } else if (kind == EffectKind::transmissions) {
        continue;  // its coordinate goes: ATransmissionTakesItsJointWithIt
      } else if (has_way(kind, Ablation::removed)) {
        EXPECT_GT(distance(all, play(without(scene, info.effect))), 1e-9) << info.name;
      }
    }
    EXPECT_EQ(kinds, kEffectKinds);
  }
  EXPECT_EQ(acting.size(), std::size_t(kEffectKinds));
}

TEST(Effects, RemovedEqualsZeroCoefficients) {
  for (const Scene& scene : scenes_of_all_effects())
    for (const EffectInfo& info : effects_of(scene)) {
      SCOPED_TRACE(info.name);
      if (!info.on || !has_way(info.effect.kind, Ablation::removed)) continue;
      const Result removed = play(without(scene, info.effect));
      for (const Ablation way : {Ablation::zero, Ablation::idle})
        if (has_way(info.effect.kind, way)) {
          EXPECT_LE(distance(removed, play(without(scene, info.effect, way))),
                    allowed(info.effect.kind))
              << "way " << int(way);
        }
    }
}

/// Steps leave out what never pushes, so they have the bits of a scene that does not name it.
TEST(Effects, ContactsThatNeverPushAreLeftOut) {
  const Scene scene = without(testing::scene_that_sleeps(), {EffectKind::sleeping});
  int contacts = 0;
  for (const EffectInfo& info : effects_of(scene)) {
    const EffectKind kind = info.effect.kind;
    if (kind != EffectKind::pair_contact && kind != EffectKind::ground_contact) continue;
    SCOPED_TRACE(info.name);
    ++contacts;
    EXPECT_EQ(distance(play(without(scene, info.effect)),
                       play(without(scene, info.effect, Ablation::zero))),
              0);
  }
  EXPECT_EQ(contacts, 7);
  const std::vector<EffectInfo> all =
      effects_of(without(scene, {EffectKind::pair_contact}, Ablation::zero));
  EXPECT_EQ(find(all, "contact box ball")->reason,
            "declared, kn 0 N/m, no damping: it never pushes");
}

/// Runs with gradients step with and without a tape, and their bits must not differ.
TEST(Effects, StepsForGradientsTakeAllContacts) {
  const Scene scene = without(without(testing::scene_that_sleeps(), {EffectKind::sleeping}),
                              {EffectKind::pair_contact}, Ablation::zero);
  const Model model(scene);
  const StepperOptions options{.differentiable = true};
  constexpr int kTaken = 40;
  Batch stepped(model, 3), taped(model, 3);
  Stepper a(model, options), b(model, options);
  BlockTape tape(model, b.integrator(), kTaken);
  tape.start(taped, 0);
  const std::vector<double> u(std::size_t(3 * model.nu()));
  for (int t = 0; t < kTaken; ++t) {
    a.step_block(stepped, 0, u);
    b.step_block(taped, 0, u, &tape);
  }
  for (int e = 0; e < 3; ++e) {
    EXPECT_EQ(testing::q_of(stepped, e), testing::q_of(taped, e));
    EXPECT_EQ(testing::v_of(stepped, e), testing::v_of(taped, e));
  }
}

TEST(Effects, PartsGoWithoutTheirElements) {
  const auto elements = [](const Scene& s) {
    return s.pair_contacts.size() + s.ground_contacts.size() + s.sensors.size();
  };
  const Scene& scene = scenes_of_all_effects().front();
  for (const EffectInfo& info : effects_of(scene)) {
    SCOPED_TRACE(info.name);
    const EffectKind kind = info.effect.kind;
    if (info.effect.element < 0) continue;
    EXPECT_TRUE(element_owner(kind).has_value());
    // What a sensor's feedback does is a contact.
    const bool takes_one = kind == EffectKind::feedback ? info.on : !is_part(kind);
    EXPECT_EQ(elements(without(scene, info.effect)), elements(scene) - (takes_one ? 1U : 0U));
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
    if (info.effect.kind != EffectKind::tactile_shear &&
        info.effect.kind != EffectKind::tactile_memory)
      continue;
    for (const Ablation way : {Ablation::removed, Ablation::zero}) {
      const Scene rest = without(scene, info.effect, way);
      EXPECT_EQ(rest.sensors.front().coefficients.ks, 0);
      EXPECT_EQ(rest.sensors.front().markers->stiffness, 0.5);
      EXPECT_NO_THROW(Model{rest});
    }
  }
}

/// Whether an effect may end another: an element takes its parts along, friction its memory, both
/// contacts and sensors the numbers of theirs that vary, and contacts those that feedback makes.
/// A transmission takes what acts on its joint; here other joints have the same effects.
bool may_end(const EffectInfo& removed, const EffectInfo& other) {
  const EffectKind kind = removed.effect.kind, ended = other.effect.kind;
  const bool same = removed.effect.element < 0 || removed.effect.element == other.effect.element ||
                    other.effect.element < 0;
  if (ended == EffectKind::varying_parameters) return true;
  if (kind == EffectKind::pair_contact && ended == EffectKind::feedback) return true;
  if (kind == EffectKind::feedback && element_owner(ended) == NumberOwner::contact) return true;
  if (!same || element_owner(kind) != element_owner(ended)) return false;
  if (!is_part(kind)) return true;
  const bool memory = ended == EffectKind::pair_memory || ended == EffectKind::ground_memory ||
                      ended == EffectKind::tactile_memory;
  const bool friction = kind == EffectKind::pair_friction || kind == EffectKind::ground_friction ||
                        kind == EffectKind::tactile_shear;
  return kind == ended || (friction && memory);
}

TEST(Effects, MarkersThatGoAreNoOutputs) {
  Scene scene = scenes_of_all_effects().front();
  scene.outputs = OutputsDescription{{"pad.markers/5", "pad", "second.markers"}, {}};
  const auto left = [&](int element) {
    return without(scene, {EffectKind::markers, element}).outputs->record;
  };
  EXPECT_EQ(left(0), (std::vector<std::string>{"pad", "second.markers"}));
  EXPECT_EQ(left(-1), std::vector<std::string>{"pad"});
  EXPECT_NO_THROW(Model{without(scene, {EffectKind::markers})});
}

TEST(Effects, PartsOfSensorsSayWhatTheyAre) {
  const std::vector<EffectInfo> all = effects_of(scenes_of_all_effects().back());
  const auto reason = [&](const char* name) { return find(all, name)->reason; };
  EXPECT_EQ(reason("tactile pad markers"), "stiffness 100 N/m, thickness 0.002 m");
  EXPECT_EQ(reason("tactile pad feedback"), "feedback is false");
  EXPECT_EQ(reason("tactile second feedback"), "its points touch 1 body");
  EXPECT_EQ(reason("feedback"), "1 of 2 sensors declared");
  EXPECT_EQ(reason("tactile pad memory"), "ks 0.5 N/m");
  EXPECT_EQ(reason("ground memory"), "2 of 2 bodies declared");
}

TEST(Effects, RemovedIsOffAndLeavesTheOthersOn) {
  for (const Scene& scene : scenes_of_all_effects()) {
    const std::vector<EffectInfo> all = effects_of(scene);
    for (const EffectInfo& info : all) {
      SCOPED_TRACE(info.name);
      if (!has_way(info.effect.kind, Ablation::removed)) continue;
      const std::vector<EffectInfo> left = effects_of(without(scene, info.effect));
      const EffectInfo* const same = find(left, info.name);
      EXPECT_TRUE(same == nullptr || !same->on);
      for (const EffectInfo& other : left) {
        const EffectInfo* const before = find(all, other.name);
        ASSERT_NE(before, nullptr) << other.name;
        EXPECT_LE(other.on, before->on) << other.name;
        if (before->on && !may_end(info, *before)) {
          EXPECT_TRUE(other.on) << other.name;
        }
      }
    }
  }
}

TEST(Effects, VelocityProductsFollowFromTheJoints) {
  const Scene& scene = scenes_of_all_effects().front();
  const Effect products{EffectKind::velocity_products};
  for (const Ablation way : {Ablation::removed, Ablation::zero, Ablation::idle})
    EXPECT_FALSE(has_way(products.kind, way));
  EXPECT_THROW(without(scene, products), InputError);
  EXPECT_THROW(without(scene, {EffectKind::tactile, 2}), InputError);
}

TEST(Effects, BothHalvesOfAContactOfSurfacesGoTogether) {
  Scene scene = scenes_of_all_effects().front();
  const auto before = static_cast<int>(scene.pair_contacts.size());
  add_surface_contact(scene, {"box", "slider", {1e6, 1, 0.5, 1}, ContactLaw::clamped, {}, {}});
  add_surface_contact(scene, {"pad", "box", {2e6, 1, 0.5, 1}, ContactLaw::clamped, {}, {}});
  ASSERT_EQ(scene.pair_contacts.size(), std::size_t(before + 4));
  for (const int element : {before, before + 1}) {
    const Scene less = without(scene, {EffectKind::pair_contact, element});
    ASSERT_EQ(less.pair_contacts.size(), std::size_t(before + 2));
    EXPECT_FALSE(less.pair_contacts[std::size_t(before)].second_half);
    EXPECT_EQ(less.pair_contacts[std::size_t(before)].coefficients.kn, 2e6);
    EXPECT_TRUE(less.pair_contacts[std::size_t(before) + 1].second_half);
    const Scene frictionless = without(scene, {EffectKind::pair_friction, element});
    for (const int half : {before, before + 1})
      EXPECT_EQ(frictionless.pair_contacts[std::size_t(half)].coefficients.kt, 0);
  }
}

/// State and workspace of a scene [bytes].
std::pair<std::size_t, std::size_t> bytes_of(const Scene& scene) {
  const Model model(scene);
  return {model.state_bytes_per_environment(), Stepper::workspace_bytes(model)};
}

TEST(Effects, ASceneAllocatesNothingForWhatItDoesNotName) {
  for (const Scene& scene : scenes_of_all_effects()) {
    const auto [state, workspace] = bytes_of(scene);
    for (int k = 0; k < kEffectKinds; ++k) {
      const Effect effect{static_cast<EffectKind>(k)};
      if (!has_way(effect.kind, Ablation::removed)) continue;
      const auto [less_state, less_workspace] = bytes_of(without(scene, effect));
      EXPECT_LE(less_state, state) << k;
      EXPECT_LE(less_workspace, workspace) << k;
    }
  }
}

TEST(Effects, BytesGoWithTheEffect) {
  const Scene& scene = scenes_of_all_effects().front();
  const auto [state, workspace] = bytes_of(scene);
  const auto state_without = [&](EffectKind kind) {
    return bytes_of(without(scene, {kind})).first;
  };
  // Three numbers vary: that of a contact, of a sensor and of a joint.
  EXPECT_EQ(state_without(EffectKind::varying_parameters), state - 3 * sizeof(double));
  EXPECT_EQ(state_without(EffectKind::pair_contact), state - sizeof(double));
  EXPECT_EQ(state_without(EffectKind::tactile), state - sizeof(double));
  EXPECT_EQ(state_without(EffectKind::joint_damping), state - sizeof(double));
  EXPECT_LT(bytes_of(without(scene, {EffectKind::pair_contact})).second, workspace);
  EXPECT_LT(bytes_of(without(scene, {EffectKind::feedback})).second, workspace);
  // The shear state takes nothing where none does.
  Scene forgetful = scenes_of_all_effects().back(), plain = scene;
  for (const EffectKind kind : {EffectKind::pair_memory, EffectKind::ground_memory,
                                EffectKind::tactile_memory, EffectKind::joint_friction}) {
    const std::size_t before = bytes_of(forgetful).first;
    forgetful = without(forgetful, {kind});
    EXPECT_LT(bytes_of(forgetful).first, before) << to_string(kind);
  }
  plain = without(plain, {EffectKind::sleeping});
  for (const EffectKind kind : {EffectKind::loops, EffectKind::transmissions}) {
    const auto before = bytes_of(forgetful);
    forgetful = without(forgetful, {kind});
    EXPECT_LE(bytes_of(forgetful).first, before.first) << to_string(kind);
    EXPECT_LT(bytes_of(forgetful).second, before.second) << to_string(kind);
  }
  EXPECT_EQ(bytes_of(forgetful), bytes_of(plain));
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
  Scene scene = scenes_of_all_effects().front();
  scene.control = PiecewiseControl{{0, 0.1}, {{1, 2, 3, 4}, {5, 6, 7, 8}}, 1};
  const Scene no_force = without(scene, {EffectKind::force_motors});
  EXPECT_EQ(std::get<PiecewiseControl>(*no_force.control).values,
            (std::vector<std::vector<double>>{{4}, {8}}));
  const Scene no_position = without(scene, {EffectKind::position_motors});
  EXPECT_EQ(std::get<PiecewiseControl>(*no_position.control).values,
            (std::vector<std::vector<double>>{{1, 2, 3}, {5, 6, 7}}));
}

/// What is left has the bits of a scene that never had the transmission, and moves otherwise than
/// with it.
TEST(Effects, ATransmissionTakesItsJointWithIt) {
  const Scene plain = without(testing::scene_that_remembers(), {EffectKind::transmissions});
  Scene scene = testing::scene_that_remembers();
  ASSERT_EQ(scene.links.front().joint.name, "cord_joint");
  scene.links.front().joint.damping = 0.1;
  scene.motors.insert(scene.motors.begin(), {"cord_joint", -1, 1, {}});
  scene.initial.push_back(
      {"cord_joint", {testing::q_of(Batch(Model(scene), 1), 0).front()}, {}, {}});
  EndEffectorDescription knot;
  knot.name = "knot", knot.joint = "cord_joint";
  scene.end_effectors.push_back(knot);
  scene.control = ConstantControl{{0.5, 0.1, -0.05, 0.1, 0.004}};
  for (const NumberField field : {NumberField::damping, NumberField::stiffness})
    scene.randomizations.push_back(
        testing::varied({NumberOwner::joint, field, "cord_joint"}, 0.1, 0.2));
  const Scene left = without(scene, {EffectKind::transmissions});
  EXPECT_EQ(left.links.size(), scene.links.size() - 1);
  EXPECT_EQ(left.motors.size(), scene.motors.size() - 1);
  EXPECT_EQ(left.randomizations.size(), scene.randomizations.size() - 2);
  EXPECT_EQ(left.end_effectors.size(), scene.end_effectors.size() - 1);
  EXPECT_EQ(std::get<ConstantControl>(*left.control).values,
            (std::vector<double>{0.1, -0.05, 0.1, 0.004}));
  const Result there = play(left);
  EXPECT_EQ(distance(there, play(plain)), 0);
  const Result with = play(scene);
  const std::size_t places = with.states.size() - there.states.size();
  EXPECT_EQ(places, 6) << "a coordinate and a rate of three environments";
  double most = 0;  // the cord is the first coordinate
  for (std::size_t k = 0; k + 1 < std::size_t(Model(left).nq()); ++k)
    most = std::max(most, std::abs(with.states[k + 1] - there.states[k]));
  EXPECT_GT(most, 1e-5);
}

TEST(Effects, LinesNameTheFileOnce) {
  EffectInfo info;
  EXPECT_EQ(lines_of(info), "");
  info.sources = {{"a.xml", 3}, {"a.xml", 3}, {"a.xml", 7}, {"b.xml", 7}};
  EXPECT_EQ(lines_of(info), "a.xml:3, 7, b.xml:7");
}

}  // namespace
}  // namespace tangere
