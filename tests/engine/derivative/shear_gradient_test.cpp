// SPDX-License-Identifier: Apache-2.0
// Tests gradients through shear springs: the adjoint against differences of whole runs,
// for every scheme, with points that stick, slip, leave and touch again.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/scene/scene_number.hpp"
#include "tests/engine/field_loss.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/gradient_tangent.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/random_scene.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::adjoint_of_fields;
using testing::field_loss_of_run;
using testing::FieldLoss;
using testing::random_input;
using testing::RunGradient;
using testing::RunInput;
using testing::StateLoss;

constexpr int kShearSteps = 6;

/// Random bodies that touch each other, a wall and the ground, with springs in all contacts.
Scene elastic_contacts(unsigned seed, int links, ContactLaw law) {
  Scene s = testing::random_contacts(seed, links, law);
  testing::Random random(seed + 5000);
  for (auto& c : s.pair_contacts) {
    const auto general = std::ranges::find(s.links, c.general_body,
                                           [](const LinkDescription& l) { return l.body.name; });
    if (!is_ball(general->body.shape)) c.coefficients.ks = random.uniform(10, 200);
  }
  for (auto& c : s.ground_contacts) c.coefficients.ks = random.uniform(10, 200);
  return s;
}

/// A plate with a skin on two balls, all of which remember.
Scene elastic_skin() {
  Scene s = testing::two_balls();
  for (auto& c : s.pair_contacts) c.coefficients.ks = 60;
  for (auto& c : s.ground_contacts) c.coefficients.ks = 200;
  for (auto& t : s.sensors) t.coefficients.ks = 0.5 * t.coefficients.kn;
  return s;
}

class ShearGradient : public ::testing::TestWithParam<Integrator> {};

/// Schemes share out the random scenes: differences of each take seconds.
TEST_P(ShearGradient, ContactsMatchDifferences) {
  const Scheme& scheme = GetParam().scheme();
  const unsigned first = scheme.needs_history() || scheme.stages.size() == 2 ? 3 : 1;
  int compared = 0;
  for (unsigned seed = first; seed <= first + 1; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene =
        elastic_contacts(seed, 2 + static_cast<int>(seed % 2), ContactLaw(seed % 3));
    if (!testing::splits(scene, GetParam(), seed, kShearSteps))
      compared += testing::check_gradient(scene, GetParam(), seed, kShearSteps, 1e-6);
  }
  EXPECT_GT(compared, 30);
}

/// Steps that are cut to keep an accuracy hand memory from part to part.
TEST_P(ShearGradient, CutStepsMatchDifferences) {
  const Integrator scheme = GetParam();
  if (scheme.scheme().estimate.empty()) GTEST_SKIP() << "has no estimate of its error";
  int compared = 0;
  for (unsigned seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene = elastic_contacts(seed, 2, ContactLaw::clamped);
    if (testing::splits(scene, scheme, seed, kShearSteps)) continue;
    compared += testing::check_gradient(scene, scheme, seed, kShearSteps, 1e-6,
                                        scheme.scheme().order > 1 ? 0.01 : 0.1);
  }
  EXPECT_GT(compared, 30);
}

TEST_P(ShearGradient, ContactsMatchTangents) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Model model(elastic_contacts(seed, 2 + static_cast<int>(seed % 2), ContactLaw(seed % 3)));
    const StepperOptions options = testing::options(GetParam(), model.timestep(), 1e-13);
    compared +=
        testing::check_tangent(model, options, random_input(model, seed, kShearSteps), seed);
  }
  EXPECT_GE(compared, 3);
}

/// The plate of elastic_skin() is pressed about a millimetre into both balls, and moves.
RunInput pressed_input(const Model& model) {
  RunInput in;
  in.q = testing::q_of(Batch(model, 1));
  testing::Random random(3);
  for (int i = 0; i < model.nv(); ++i) in.v.push_back(0.02 * random.normal());
  for (int t = 0; t < kShearSteps; ++t) in.u.push_back({0.3, -0.2, 0.4});
  in.q[2] -= 7.7e-3;
  // Exactly on the ground, where they start, there is a kink.
  in.q[5] -= 2e-4, in.q[12] -= 3e-4;
  return in;
}

void expect_fields_match(const Scene& scene, Integrator scheme) {
  const Model model(scene);
  const StepperOptions options = testing::options(scheme, scene.timestep, 1e-13);
  const RunInput in = pressed_input(model);
  const FieldLoss loss(model, kShearSteps, 7);
  EXPECT_GT(std::abs(field_loss_of_run(model, options, in, loss)), 1e-3) << "the skin touches";
  const RunGradient adjoint = adjoint_of_fields(model, options, in, loss);
  const auto along = [&](const std::function<void(RunInput&, double)>& change) {
    return testing::best_difference(
        [&](double e) {
          RunInput other = in;
          change(other, e);
          return field_loss_of_run(model, options, other, loss);
        },
        1e-6);
  };
  RunGradient difference;
  for (int i = 0; i < model.nv(); ++i) {
    difference.q.push_back(
        along([&](RunInput& x, double e) { x.q = testing::moved(model, x.q, i, e); }));
    difference.v.push_back(along([&](RunInput& x, double e) { x.v[std::size_t(i)] += 100 * e; }) /
                           100);
  }
  for (std::size_t t = 0; t < in.u.size(); ++t)
    for (int k = 0; k < model.nu(); ++k)
      difference.u.push_back(
          along([&](RunInput& x, double e) { x.u[t][std::size_t(k)] += 1e3 * e; }) / 1e3);
  int compared = testing::compare(adjoint.q, difference.q, testing::norm(difference.q), 1e-5, "q");
  compared += testing::compare(adjoint.v, difference.v, testing::norm(difference.v), 1e-5, "v");
  compared += testing::compare(adjoint.u, difference.u, testing::norm(difference.u), 1e-5, "u");
  const NumberGradients parameters(model);
  for (int k = 0; k < parameters.count(); ++k) {
    const NumberInfo& of = parameters.infos()[std::size_t(k)];
    const double size = testing::size_of(of);
    if (size == 0) continue;
    const double numeric = testing::best_difference(
        [&](double e) {
          Scene other = model.scene();
          number_in(other, of.number) += e * size;
          return field_loss_of_run(Model(other), options, in, loss);
        },
        1e-4);
    if (!std::isfinite(numeric)) continue;
    ++compared;
    EXPECT_NEAR(adjoint.parameters[std::size_t(k)] * size, numeric, 1e-5 * (1 + std::abs(numeric)))
        << of.name;
  }
  EXPECT_GT(compared, 60);
}

TEST_P(ShearGradient, FieldsMatchDifferences) { expect_fields_match(elastic_skin(), GetParam()); }

/// The same skin, whose memory advances after two, four and six steps. The loss reads it after
/// every step.
Scene skin_that_waits() {
  Scene s = elastic_skin();
  for (auto& t : s.sensors) {
    t.array.rows = 13, t.array.cols = 21;
    t.every = 2, t.shear_at_readings = true;
  }
  return s;
}

TEST_P(ShearGradient, WaitingSkinsMatchDifferences) {
  expect_fields_match(skin_that_waits(), GetParam());
}

/// The change of all fields along random directions is that by the adjoint.
TEST_P(ShearGradient, WaitingSkinsMatchTangents) {
  const Model model(skin_that_waits());
  const StepperOptions options = testing::options(GetParam(), model.timestep(), 1e-13);
  const RunInput in = pressed_input(model);
  const FieldLoss loss(model, kShearSteps, 7);
  const RunGradient adjoint = adjoint_of_fields(model, options, in, loss);
  testing::Random random(11);
  std::size_t s_start = 0;
  const testing::LossChange of_fields = testing::change_of_fields(loss);
  const auto loss_change = [&](Tangent& tangent, const Batch& batch, const BlockTape& tape, int t,
                               const std::vector<double>& rows, const StateTangent& state) {
    s_start += tape.memory(t, 0).size() / 2;
    return of_fields(tangent, batch, tape, t, rows, state);
  };
  testing::expect_tangent(model, options, in, adjoint, random, loss_change);
  EXPECT_GT(s_start, 30U);
}

/// Random changes of one number of all points of a sensor: positions by parts of a millimetre,
/// coefficients by parts of the sensor's.
std::vector<double> point_change(const Scene& scene, std::size_t sensor, int number,
                                 std::size_t points, testing::Random& random) {
  std::vector<double> own(points * kPointNumbers);
  const double size =
      number < 3 ? 1e-3 : scene.sensors[sensor].coefficients[std::size_t(number - 3)];
  for (std::size_t i = 0; i < points; ++i)
    own[kPointNumbers * i + std::size_t(number)] = size * random.normal();
  return own;
}

/// Derivatives by the places and coefficients of a skin's points, which also act through the shear
/// state: by the adjoint, by differences and in dual numbers.
void expect_points_match(const Scene& scene, Integrator scheme) {
  const Model model(scene);
  const StepperOptions options = testing::options(scheme, scene.timestep, 1e-13);
  const RunInput in = pressed_input(model);
  const FieldLoss loss(model, kShearSteps, 7);
  std::vector<double> by_points;
  const RunGradient adjoint = adjoint_of_fields(model, options, in, loss, &by_points);
  testing::Random random(13);
  std::vector<std::vector<double>> points_dot;
  double reverse = 0;
  std::size_t first = 0;
  int compared = 0;
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    const auto points = std::size_t(model.sensors()[s].points);
    std::vector<double>& along = points_dot.emplace_back(points * kPointNumbers);
    for (int number = 0; number < kPointNumbers; ++number) {
      const std::vector<double> own = point_change(scene, s, number, points, random);
      double product = 0;
      for (std::size_t i = 0; i < own.size(); ++i) {
        product += own[i] * by_points[first + i];
        along[i] += own[i];
      }
      reverse += product;
      const double numeric = testing::best_difference(
          [&](double e) {
            Scene other = scene;
            std::vector<double> moved = own;
            for (double& x : moved) x *= e;
            add_to_points(other.sensors[s], moved);
            return field_loss_of_run(Model(other), options, in, loss);
          },
          1e-4);
      if (!std::isfinite(numeric)) continue;
      ++compared;
      EXPECT_NEAR(product, numeric, 1e-5 * std::abs(numeric))
          << s << " " << point_number_name(number);
    }
    first += points * kPointNumbers;
  }
  EXPECT_GT(compared, 5 * static_cast<int>(model.sensors().size()));
  testing::expect_tangent(model, options, in, adjoint, random,
                          testing::change_of_fields(loss, points_dot), points_dot, reverse);
}

TEST_P(ShearGradient, PointsMatchDifferencesAndTangents) {
  expect_points_match(elastic_skin(), GetParam());
}

TEST_P(ShearGradient, PointsOfWaitingSkinsMatchDifferencesAndTangents) {
  expect_points_match(skin_that_waits(), GetParam());
}

INSTANTIATE_TEST_SUITE_P(Schemes, ShearGradient, ::testing::ValuesIn(testing::all_integrators()),
                         [](const auto& scheme) { return std::string(to_string(scheme.param)); });

/// Points with shear springs touch meshes.
TEST(ShearOnMeshes, ContactsMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene = testing::with_meshes(elastic_contacts(seed, 2, ContactLaw(seed % 3)));
    const Integrator scheme = seed % 2 == 0 ? Integrator::bdf1 : Integrator::sdirk2;
    if (testing::has_mesh(scene) && !testing::splits(scene, scheme, seed, kShearSteps))
      compared += testing::check_gradient(scene, scheme, seed, kShearSteps, 1e-5);
  }
  EXPECT_GT(compared, 20);
}

TEST(ShearOnMeshes, ContactsMatchTangents) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Scene scene = testing::with_meshes(elastic_contacts(seed, 2, ContactLaw(seed % 3)));
    if (!testing::has_mesh(scene)) continue;
    const Model model(scene);
    const StepperOptions options = testing::options(Integrator::sdirk2, model.timestep(), 1e-13);
    compared +=
        testing::check_tangent(model, options, random_input(model, seed, kShearSteps), seed);
  }
  EXPECT_GE(compared, 2);
}

TEST(ShearOnMeshes, FieldsMatchDifferences) {
  expect_fields_match(testing::with_meshes(elastic_skin()), Integrator::sdirk2);
}

}  // namespace
}  // namespace tangere
