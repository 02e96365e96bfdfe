// SPDX-License-Identifier: Apache-2.0
// Tests numbers that are drawn together, and numbers that a program sets: the same bits as drawn
// ones, and what is refused changes nothing.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "engine/scene/scene_number.hpp"
#include "engine/scene/variable_numbers.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using Kind = Distribution::Kind;
using Field = NumberField;
using Numbers = std::vector<double>;

const SceneNumber kContactMu{NumberOwner::contact, Field::mu, "pad", 0, "ball"},
    kGroundMu{NumberOwner::ground, Field::mu, "ball"},
    kSkinMu{NumberOwner::tactile, Field::mu, "pad"},
    kDensity{NumberOwner::body, Field::density, "ball"};

Scene rolling_ball() {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball_small.xml").scene;
  scene.randomizations.clear();
  return scene;
}

RandomizationDescription drawn(const SceneNumber& number, const Distribution& from,
                               const std::string& tie = "") {
  return {number, from, {}, tie};
}

// --- ties ---

TEST(Tie, EqualBoundsGiveEqualNumbersAndOthersTheSamePlaceBetweenTheirs) {
  for (const auto& [kind, low, high] :
       {std::tuple{Kind::uniform, 2.0, 6.0}, {Kind::log_uniform, 2.0, 8.0}}) {
    Scene scene = rolling_ball();
    const Distribution same{kind, 0.4, 0.8, {}}, other{kind, low, high, {}};
    scene.randomizations = {drawn(kContactMu, same, "rubber"), drawn(kGroundMu, same),
                            drawn(kSkinMu, same, "rubber"), drawn(kDensity, other, "rubber")};
    Scene alone = scene;
    for (RandomizationDescription& d : alone.randomizations) d.tie.clear();
    const Batch batch(Model(scene), 40, 3), untied(Model(alone), 40, 3);
    for (int e = 0; e < 40; ++e) {
      const double first = batch.randomized_value(e, 0);
      EXPECT_EQ(first, untied.randomized_value(e, 0)) << "the first draws as without a tie";
      EXPECT_EQ(batch.randomized_value(e, 1), untied.randomized_value(e, 1));
      EXPECT_EQ(batch.randomized_value(e, 2), first);
      EXPECT_NE(batch.randomized_value(e, 2), untied.randomized_value(e, 2));
      const double share = kind == Kind::uniform ? (first - 0.4) / 0.4 : std::log2(first / 0.4),
                   expected = kind == Kind::uniform ? 2 + 4 * share : 2 * std::pow(4, share);
      EXPECT_NEAR(batch.randomized_value(e, 3), expected, 1e-12);
      EXPECT_EQ(Batch(Model(scene), 1, 3, e).randomized_value(0, 3), batch.randomized_value(e, 3));
    }
  }
}

TEST(Tie, ListsHaveTheSameEntryAndNormalsTheSameDeviation) {
  Scene scene = rolling_ball();
  const SceneNumber q{NumberOwner::joint, Field::q, "ball_joint", 0},
      place{NumberOwner::joint, Field::pos, "ball_joint", 1};
  scene.randomizations = {drawn(kContactMu, {Kind::list, 0, 0, {0.2, 0.4, 0.9}}, "l"),
                          drawn(q, {Kind::normal, 0, 1e-3, {}}, "n"),
                          drawn(kSkinMu, {Kind::list, 0, 0, {3, 1, 2}}, "l"),
                          drawn(place, {Kind::normal, 1, 2e-3, {}}, "n")};
  Batch batch(Model(scene), 40, 3);
  std::set<double> seen;
  for (int e = 0; e < 40; ++e) {
    const double first = batch.randomized_value(e, 0);
    seen.insert(first);
    EXPECT_EQ(batch.randomized_value(e, 2), first == 0.2 ? 3 : first == 0.4 ? 1 : 2);
    EXPECT_NEAR(batch.randomized_value(e, 3) - 1, 2 * batch.randomized_value(e, 1), 1e-15);
  }
  EXPECT_EQ(seen.size(), 3U);
  const double before = batch.randomized_value(7, 3);
  batch.reset(7, 90);
  EXPECT_NE(batch.randomized_value(7, 3), before);
  EXPECT_NEAR(batch.randomized_value(7, 3) - 1, 2 * batch.randomized_value(7, 1), 1e-15);
}

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Tie, OtherKindsAndLengthsAreRefused) {
  Scene scene = rolling_ball();
  const auto refusal_of = [&](const Distribution& first, const Distribution& second) {
    scene.randomizations = {drawn(kContactMu, first, "rubber"), drawn(kSkinMu, second, "rubber")};
    return refusal([&] { const Model model(scene); });
  };
  EXPECT_THAT(refusal_of({Kind::uniform, 1, 2, {}}, {Kind::log_uniform, 1, 2, {}}),
              HasSubstr("'tactile pad mu' varies, but tie=\"rubber\" has log_uniform; expected "
                        "uniform as 'contact pad ball mu' with the same tie"));
  EXPECT_THAT(refusal_of({Kind::list, 0, 0, {1, 2}}, {Kind::list, 0, 0, {1, 2, 3}}),
              HasSubstr("tie=\"rubber\" has a list of 3; expected a list of 2 as"));
  EXPECT_EQ(refusal_of({Kind::list, 0, 0, {1, 2}}, {Kind::list, 0, 0, {3, 3}}), "accepted");
}

// --- numbers that are set ---

/// Coefficients, density, size, place and damping that touch everything that depends on numbers.
const std::vector<SceneNumber> kNumbers = {{NumberOwner::contact, Field::kn, "pad", 0, "ball"},
                                           kGroundMu,
                                           {NumberOwner::tactile, Field::kt, "pad"},
                                           kDensity,
                                           {NumberOwner::body, Field::radius, "ball"},
                                           {NumberOwner::joint, Field::pos, "pad_joint", 0},
                                           {NumberOwner::joint, Field::damping, "pad_joint"}};

Scene with_draws() {
  Scene scene = rolling_ball();
  for (const SceneNumber& number : kNumbers) {
    const double value = number_in(scene, number);
    scene.randomizations.push_back(
        drawn(number, {Kind::uniform, 0.95 * value, 1.05 * value + 1e-4, {}}));
  }
  return scene;
}

Scene with_free_numbers() {
  Scene scene = rolling_ball();
  for (const SceneNumber& number : kNumbers) let_vary(scene, number);
  return scene;
}

std::vector<int> upto(int n) {
  std::vector<int> all;
  for (int k = 0; k < n; ++k) all.push_back(k);
  return all;
}

/// Coordinates and forces of the skin, environment by environment, after some steps.
std::vector<Numbers> run(Batch& batch) {
  const Model& model = batch.model();
  Stepper stepper(model);
  Readout readout(model, Precision::f64);
  const ControlProgram control(model, model.timestep(), batch.seed());
  const std::size_t nu = std::size_t(model.nu());
  Numbers u(std::size_t(batch.environments()) * nu);
  for (int t = 0; t < 120; ++t) {
    for (int e = 0; e < batch.environments(); ++e)
      control.evaluate(t, e, std::span(u).subspan(std::size_t(e) * nu, nu));
    stepper.step(batch, u);
  }
  std::vector<Numbers> all;
  for (int e = 0; e < batch.environments(); ++e) {
    Numbers q(std::size_t(model.nq())), field(std::size_t(model.sensors()[0].points) * 3);
    batch.get_q(e, q);
    readout.tactile(batch, e, 0, field);
    q.insert(q.end(), field.begin(), field.end());
    all.push_back(q);
  }
  return all;
}

TEST(SetNumbers, HaveTheBitsOfDrawnOnesAloneAndInLanes) {
  constexpr int kCount = 20;
  const Model drawing(with_draws()), free(with_free_numbers());
  const std::vector<int> numbers = upto(int(kNumbers.size()));
  Batch expected(drawing, kCount, 5), found(free, kCount, 5);
  Numbers values;
  for (int e = 0; e < kCount; ++e)
    for (const int k : numbers) {
      EXPECT_EQ(found.randomized_value(e, k), number_in(free.scene(), kNumbers[std::size_t(k)]));
      values.push_back(expected.randomized_value(e, k));
    }
  found.set_randomized_values(upto(kCount), numbers, values);
  Batch alone(free, 1, 5);
  alone.set_randomized_values(upto(1), numbers, std::span(values).subspan(17 * 7, 7));
  const auto all = run(expected), set = run(found);
  EXPECT_EQ(set, all);
  EXPECT_EQ(run(alone)[0], all[17]);
  EXPECT_NE(all[17], all[16]);
  double felt = 0;
  for (const double x : all[17]) felt = std::max(felt, std::abs(x));
  EXPECT_GT(felt, 0);
  EXPECT_EQ(found.randomized_value(17, 0), values[17 * 7]);
  found.reset(17, 17);
  EXPECT_EQ(found.randomized_value(17, 0), 5) << "the scene's again";
}

TEST(SetNumbers, KeepTheStateAndActFromTheNextStep) {
  const Model model(with_free_numbers());
  Batch batch(model, 2, 5);
  const auto same = run(batch);
  EXPECT_EQ(same[0], same[1]);
  Numbers before(std::size_t(model.nq())), after = before;
  batch.get_q(1, before);
  batch.set_randomized_values(std::vector{1}, std::vector{0, 3}, Numbers{6, 2});
  batch.get_q(1, after);
  EXPECT_EQ(after, before);
  EXPECT_TRUE(batch.has_history(1));
  EXPECT_EQ(batch.randomized_value(0, 3), 1);
  EXPECT_EQ(batch.randomized_value(1, 3), 2);
  const auto all = run(batch);
  EXPECT_NE(all[0], all[1]);
}

TEST(SetNumbers, WhatIsRefusedChangesNothing) {
  Scene scene = with_free_numbers();
  const SceneNumber q{NumberOwner::joint, Field::q, "ball_joint", 0};
  scene.randomizations.push_back(drawn(q, {Kind::uniform, 0, 1e-3, {}}));
  Batch batch(Model(scene), 3, 5);
  const auto rows = batch.save_block(0).rows;
  const auto refusal_of = [&](const std::vector<int>& environments, const std::vector<int>& numbers,
                              const Numbers& values) {
    return refusal([&] { batch.set_randomized_values(environments, numbers, values); });
  };
  EXPECT_THAT(refusal_of({0, 3}, {0}, {5, 5}), HasSubstr("environment 3"));
  EXPECT_THAT(refusal_of({0}, {8}, {5}), HasSubstr("randomized number 8"));
  EXPECT_THAT(refusal_of({0, 1}, {0, 1}, {5, 5, 5}), HasSubstr("values"));
  EXPECT_THAT(refusal_of({0}, {7}, {0}), HasSubstr("'joint ball_joint q[0]' is of the starting"));
  EXPECT_THAT(refusal_of({0, 2}, {0}, {6, -1}),
              HasSubstr("environment 2: 'contact pad ball kn' cannot be kn=\"-1\"; expected zero"));
  EXPECT_THAT(refusal_of({0}, {4}, {0}), HasSubstr("radius=\"0\"; expected a positive number"));
  for (const double wrong : {double(NAN), double(INFINITY)})
    for (const int k : {0, 3, 4, 5, 6})
      EXPECT_THAT(refusal_of({0}, {k}, {wrong}), HasSubstr("expected a finite number")) << k;
  EXPECT_EQ(batch.save_block(0).rows, rows);
}

TEST(SetNumbers, SizesThatAreTooUnlikeAreRefused) {
  Scene scene;
  scene.links = {testing::link("egg", JointType::free, {0, 0, 1}, EllipsoidShape{{1, 2, 3}}, 10)};
  for (const int which : {2, 3}) let_vary(scene, size_of_body("egg", which));
  Batch batch(Model(scene), 2);
  const std::vector<int> one = {1}, x = {0}, both = {0, 1};
  batch.set_randomized_values(one, x, Numbers{0.04});
  EXPECT_THAT(refusal([&] { batch.set_randomized_values(one, x, Numbers{0.02}); }),
              HasSubstr("environment 1: body 'egg' would be an ellipsoid with a longest"));
  EXPECT_THAT(refusal([&] {
                batch.set_randomized_values(one, both, Numbers{1, 150});
              }),
              HasSubstr("expected at most 100 times"));
  EXPECT_EQ(batch.randomized_value(1, 0), 0.04);
}

TEST(VariableNumbers, AreThoseOfTheSceneThatMayVary) {
  const Scene scene = rolling_ball();
  std::vector<std::string> names;
  for (const SceneNumber& number : variable_numbers(scene)) names.push_back(name_of(number));
  EXPECT_THAT(names, ::testing::IsSupersetOf(
                         {"contact pad ball ks", "ground ball damping", "tactile pad mu",
                          "body pad size[2]", "body ball radius", "body ball density",
                          "joint pad_joint armature", "joint ball_joint pos[2]"}));
  for (const std::string& name : names) {
    EXPECT_THAT(name, ::testing::Not(HasSubstr("q["))) << "not of the starting state";
    EXPECT_EQ(std::ranges::count(names, name), 1) << name;
  }
  Scene drawing = with_draws();
  let_vary(drawing, kGroundMu);
  EXPECT_EQ(drawing.randomizations.size(), kNumbers.size()) << "what is drawn stays drawn";
}

}  // namespace
}  // namespace tangere
