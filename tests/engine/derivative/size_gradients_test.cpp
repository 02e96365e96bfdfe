// SPDX-License-Identifier: Apache-2.0
// Tests derivatives by the sizes of bodies through contact alone: bodies that are touched, that
// touch with their own points, or that lie on the ground. The bodies have no mass, so no size acts
// through mass. Abstract bodies at the same joints have the mass.
#include <gtest/gtest.h>

#include <map>

#include "engine/scene/scene_number.hpp"
#include "tests/engine/gradient_run.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::Random;
using testing::RunInput;

constexpr int kSteps = 2, kTrials = 12;

Shape cuboid() { return CuboidShape{{0.05, 0.04, 0.03}, {4, 3, 3}}; }
Shape cylinder() { return CylinderShape{0.05, 0.02, 7, 2}; }
Shape capsule() { return CapsuleShape{0.04, 0.015, 3, 5}; }
Shape one_ring() { return CapsuleShape{0.03, 0.018, 1, 6}; }
Shape ellipsoid() { return EllipsoidShape{{0.06, 0.05, 0.036}, 30}; }
Shape ball() { return SphereShape{0.025}; }
Shape mesh() {
  MeshShape mesh = testing::ellipsoid_mesh(1, {0.03, 0.025, 0.018});
  mesh.resolution = 12;
  mesh.scale = 1.1;
  return mesh;
}

/// Adds a free body of 100 g that carries a massless shape.
void add_carried(Scene& s, const std::string& name, const Vector3& at, const Shape& shape,
                 Random& random) {
  AbstractShape weight;
  weight.mass = 0.1;
  weight.inertia = {4e-5, 0, 0, 5e-5, 0, 6e-5};
  s.links.push_back(testing::link(name + "_weight", JointType::free, at, weight, 0));
  const kernels::Quat<double> q = random.quaternion();
  s.links.back().joint.pose.orientation = {q.w, q.x, q.y, q.z};
  s.links.push_back(testing::link(name, JointType::fixed, {0.002, -0.001, 0.003}, shape, 0));
  s.links.back().parent = static_cast<int>(s.links.size()) - 2;
}

ContactCoefficients coefficients(ContactLaw law) {
  return {300, 1.5, 0.5, law == ContactLaw::linear ? 0.1 : 5};
}

RunInput input_of(const Model& model, Random& random) {
  const Batch batch(model, 1);
  RunInput in{testing::q_of(batch), testing::v_of(batch), std::vector<std::vector<double>>(kSteps)};
  for (double& v : in.v) v = 0.2 * random.normal();
  return in;
}

/// Adds to `seen` in how many trials a size had an effect. Only contact can give it one.
void compare(const Scene& scene, Random& random, std::map<std::string, int>& seen) {
  const Model model(scene);
  const StepperOptions options = testing::options(Integrator::bdf1, scene.timestep, 1e-13);
  const RunInput in = input_of(model, random);
  const testing::StateLoss loss(model, kSteps, 3);
  if (!std::isfinite(testing::loss_of_run(model, options, in, loss))) return;
  const testing::RunGradient adjoint = testing::adjoint_of_run(model, options, {in}, loss, 0);
  const NumberGradients parameters(model);
  double scale = 1e-4;  // of the loss, about 1: below, differences are noise
  std::vector<std::array<double, 2>> both;
  std::vector<std::string> names;
  for (int k = 0; k < parameters.count(); ++k) {
    const NumberInfo& info = parameters.infos()[std::size_t(k)];
    const bool of_size = info.unit == "m" && info.number.owner == NumberOwner::body;
    if (!of_size && info.number.field != NumberField::scale) continue;
    const double difference = testing::best_difference(
        [&](double e) {
          Scene other = scene;
          number_in(other, info.number) += e * info.value;
          return testing::loss_of_run(Model(other), options, in, loss);
        },
        1e-3);
    names.push_back(info.name);
    both.push_back({adjoint.parameters[std::size_t(k)] * info.value, difference});
    scale = std::max(scale, std::abs(difference));
    seen[info.name] += adjoint.parameters[std::size_t(k)] != 0;
  }
  for (std::size_t i = 0; i < both.size(); ++i)
    EXPECT_NEAR(both[i][0], both[i][1], 1e-6 * scale) << names[i];
}

class Touching : public ::testing::TestWithParam<std::tuple<int, int, ContactLaw>> {};

TEST_P(Touching, SizesActThroughContactAlone) {
  const auto [general, primitive, law] = GetParam();
  const Shape generals[] = {cuboid(),    cylinder(), capsule(), one_ring(),
                            ellipsoid(), mesh(),     ball()};
  const Shape primitives[] = {ball(), cuboid(), cylinder(), capsule(), ellipsoid(), mesh()};
  std::map<std::string, int> seen;
  for (int trial = 0; trial < kTrials; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    Random random(std::uint32_t(100 * general + 10 * primitive + trial + 7));
    Scene s;
    s.timestep = 2e-3;
    const kernels::Vec3<double> away = random.uniform(0.028, 0.04) * random.direction();
    add_carried(s, "general", {0, 0, 0}, generals[general], random);
    add_carried(s, "primitive", {away.x, away.y, away.z}, primitives[primitive], random);
    s.pair_contacts.push_back({"general", "primitive", coefficients(law), law, 1e-5, {}});
    compare(s, random, seen);
  }
  EXPECT_GE(seen.size(), general >= 5 ? 2U : 3U) << "a mesh and a ball have one size";
  for (const auto& [name, count] : seen) EXPECT_GT(count, 0) << name;
}

/// A ball touches with its surface, but no mesh.
INSTANTIATE_TEST_SUITE_P(Balls, Touching,
                         ::testing::Combine(::testing::Values(6), ::testing::Range(0, 5),
                                            ::testing::Values(ContactLaw::clamped,
                                                              ContactLaw::paper,
                                                              ContactLaw::linear)));
INSTANTIATE_TEST_SUITE_P(All, Touching,
                         ::testing::Combine(::testing::Range(0, 6), ::testing::Range(0, 6),
                                            ::testing::Values(ContactLaw::clamped,
                                                              ContactLaw::paper,
                                                              ContactLaw::linear)));

class OnTheGround : public ::testing::TestWithParam<std::tuple<int, ContactLaw>> {};

TEST_P(OnTheGround, SizesActThroughContactAlone) {
  const auto [which, law] = GetParam();
  const Shape shapes[] = {ball(), cuboid(), cylinder(), capsule(), one_ring(), ellipsoid(), mesh()};
  std::map<std::string, int> seen;
  for (int trial = 0; trial < kTrials; ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    Random random(std::uint32_t(10 * which + trial + 400));
    Scene s;
    s.timestep = 2e-3;
    const kernels::Vec3<double> normal = random.direction();
    s.ground = GroundDescription{{0, 0, 0}, {normal.x, normal.y, normal.z}};
    const kernels::Vec3<double> at = random.uniform(0.012, 0.022) * normal;
    add_carried(s, "body", {at.x, at.y, at.z}, shapes[which], random);
    s.ground_contacts.push_back({"body", coefficients(law), law, 1e-5, {}});
    compare(s, random, seen);
  }
  EXPECT_GE(seen.size(), 1U);
  for (const auto& [name, count] : seen) EXPECT_GT(count, 0) << name;
}

INSTANTIATE_TEST_SUITE_P(All, OnTheGround,
                         ::testing::Combine(::testing::Range(0, 7),
                                            ::testing::Values(ContactLaw::clamped,
                                                              ContactLaw::paper,
                                                              ContactLaw::linear)));

}  // namespace
}  // namespace tangere
