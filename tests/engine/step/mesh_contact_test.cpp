// SPDX-License-Identifier: Apache-2.0
// Contact with meshes: like the same shapes as primitives, with the derivatives of itself, and with
// the same bits alone and in a group.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/model/compile.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/mesh_grid.hpp"
#include "engine/model/model.hpp"
#include "engine/sense/start_overlaps.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/numbers/so3.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/random_scene.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using testing::has_mesh;
using testing::q_of;
using testing::v_of;

Scene random_meshes(unsigned seed, int links, ContactLaw law) {
  return testing::with_meshes(testing::random_contacts(seed, links, law));
}

TEST(MeshContact, JacobiansMatchDualNumbers) {
  using Number = kernels::Dual<double>;
  constexpr double kLength = 0.004, kFirst = 1.5;
  int touched = 0, meshes = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Scene scene = random_meshes(seed, 2 + static_cast<int>(seed % 4), ContactLaw(seed % 3));
    if (!has_mesh(scene)) continue;
    ++meshes;
    const auto m = compile(scene);
    testing::StageBuffers<double> b(*m);
    testing::StageBuffers<Number> dual(*m);
    testing::Random random(seed);
    for (int k = 0; k < 3; ++k) {
      testing::randomise(b, *m, random, kLength);
      const auto copy = [](const std::vector<double>& a, std::vector<Number>& to) {
        for (std::size_t i = 0; i < a.size(); ++i) to[i] = Number(a[i]);
      };
      copy(b.centre, dual.centre), copy(b.x, dual.x), copy(b.r, dual.r), copy(b.s, dual.s);
      copy(b.tau, dual.tau), copy(b.target, dual.target), copy(b.faces, dual.faces);
      b.residual_and_jacobian(kFirst / kLength, 1 / kLength);
      for (const double f : b.force_scale) touched += f > 1e-3;
      for (int j = 0; j < m->nv; ++j) {
        dual.x[std::size_t(j)].epsilon = 1;
        dual.residual(kFirst / kLength, 1 / kLength);
        dual.x[std::size_t(j)].epsilon = 0;
        for (int i = 0; i < m->nv; ++i) {
          double scale = 0;
          for (int n = 0; n < m->nv; ++n) scale = std::max(scale, std::abs(b.entry(b.A, i, n)));
          EXPECT_NEAR(dual.g[std::size_t(i)].epsilon, b.entry(b.A, i, j), 1e-10 * scale)
              << "seed " << seed << " entry " << i << ", " << j;
        }
      }
    }
  }
  EXPECT_GT(meshes, 5);
  EXPECT_GT(touched, 50);
}

TEST(MeshContact, GradientsMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const Scene scene = random_meshes(seed, 2, ContactLaw(seed % 3));
    if (!has_mesh(scene) || testing::splits(scene, Integrator::bdf2, seed, 4)) continue;
    SCOPED_TRACE("seed " + std::to_string(seed));
    compared += testing::check_gradient(scene, Integrator::bdf2, seed, 4, 1e-5);
  }
  EXPECT_GT(compared, 20);
}

/// A pad of 400 contact points and 32 × 32 tactile points sinks onto a ball that dampers hold.
Scene pressed_ball(const Shape& ball, double ks = 0) {
  Scene s = testing::rolling_ball(false, 32);
  s.ground.reset();
  s.ground_contacts.clear();
  s.gravity = {0, 0, 0};
  s.links[1].joint = s.links[0].joint;
  s.links[1].joint.name = "ball_joint";
  s.links[1].joint.pose.position = {0.003, 0.002, 0.035};
  s.links[1].joint.damping = 2;
  s.links[1].body.shape = ball;
  for (auto& c : s.pair_contacts) c.coefficients.ks = ks;
  for (auto& t : s.sensors) t.coefficients.ks = ks;
  return s;
}

struct PressedRun {
  std::vector<std::vector<double>> states, fields;
};
PressedRun press(const Shape& ball, int environments, int wanted, double ks = 0) {
  const Model model(pressed_ball(ball, ks));
  Batch batch(model, environments);
  Stepper stepper(model);
  Readout readout(model);
  PressedRun run;
  for (int e = 0; e < environments; ++e) {
    std::vector<double> q = q_of(batch, e);
    q[0] += e == wanted ? 0 : 0.0005 * (e - wanted);
    batch.set_state(e, q, v_of(batch, e));
  }
  for (int t = 0; t < 60; ++t) {
    testing::step_all(stepper, batch, {0.05, 0.1, -0.2});
    run.states.push_back(q_of(batch, wanted));
    std::vector<double> field(std::size_t(3 * model.sensors()[0].points));
    readout.tactile(batch, wanted, 0, field);
    std::vector<float> mixed(field.size());
    readout.tactile(batch, wanted, 0, mixed);
    for (std::size_t k = 0; k < field.size(); ++k) EXPECT_NEAR(mixed[k], field[k], 1e-8);
    run.fields.push_back(field);
  }
  return run;
}

/// The fine ball, whose grid takes long, so that it is made once.
const MeshShape& fine_ball() {
  static const MeshShape mesh = testing::ellipsoid_mesh(5, {0.02, 0.02, 0.02});
  static const std::shared_ptr<const MeshGrid> grid = shared_mesh_grid(mesh);
  return mesh;
}

void expect_felt_like_a_ball(double ks) {
  const MeshShape& mesh = fine_ball();
  const PressedRun is = press(mesh, 1, 0, ks), was = press(SphereShape{0.02}, 1, 0, ks);
  double peak = 0, error = 0, way = 0, apart = 0;
  for (std::size_t t = 0; t < is.fields.size(); ++t) {
    for (std::size_t k = 0; k < is.fields[t].size(); ++k) {
      peak = std::max(peak, std::abs(was.fields[t][k]));
      error = std::max(error, std::abs(is.fields[t][k] - was.fields[t][k]));
    }
    for (std::size_t k = 0; k < is.states[t].size(); ++k) {
      way = std::max(way, std::abs(was.states[t][k] - was.states[0][k]));
      apart = std::max(apart, std::abs(is.states[t][k] - was.states[t][k]));
    }
  }
  EXPECT_GT(peak, 1e-5);
  EXPECT_GT(way, 1e-3);
  EXPECT_LT(error, 0.01 * peak) << error / peak;
  EXPECT_LT(apart, 0.01 * way) << apart / way;
}
TEST(MeshContact, ABallOfTrianglesIsPressedAndFeltLikeABall) { expect_felt_like_a_ball(0); }
TEST(MeshContact, ABallOfTrianglesIsFeltLikeABallByFrictionThatRemembers) {
  expect_felt_like_a_ball(0.5);
}

/// The scalar build is the reference.
TEST(MeshContact, InstructionSetsAgree) {
  const kernels::KernelTable& before = kernels::active_kernels();
  const MeshShape mesh = testing::torus_mesh(0.014, 0.006, 24, 12);
  std::vector<PressedRun> runs;
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    kernels::use_kernels(*table);
    runs.push_back(press(mesh, 3, 1));
  }
  kernels::use_kernels(before);
  double peak = 0;
  for (std::size_t t = 0; t < runs[0].fields.size(); ++t)
    for (std::size_t k = 0; k < runs[0].fields[t].size(); ++k) {
      peak = std::max(peak, std::abs(runs[0].fields[t][k]));
      for (const PressedRun& run : runs) {
        EXPECT_NEAR(run.fields[t][k], runs[0].fields[t][k], 1e-9);
      }
    }
  EXPECT_GT(peak, 1e-5);
  for (const PressedRun& run : runs)
    for (std::size_t k = 0; k < run.states.back().size(); ++k)
      EXPECT_NEAR(run.states.back()[k], runs[0].states.back()[k], 1e-9);
}

TEST(MeshContact, NeighboursChangeNoBit) {
  const MeshShape mesh = testing::torus_mesh(0.014, 0.006, 24, 12);
  const PressedRun alone = press(mesh, 1, 0);
  for (const auto& [environments, wanted] : {std::pair{8, 5}, std::pair{17, 16}}) {
    const PressedRun crowded = press(mesh, environments, wanted);
    EXPECT_EQ(alone.states, crowded.states);
    EXPECT_EQ(alone.fields, crowded.fields);
  }
}

/// The field of a pad that presses on a shape of this scale, by one instruction set.
template <class Real, class Run>
std::vector<Real> pressed_field(const kernels::TouchShape& shape, double scale, const Run& run) {
  static const Model model(pressed_ball(SphereShape{0.02}));
  const kernels::PadTiles pad = compiled(model).sensors[0].tiles();
  kernels::Touch<double> touch;
  touch.Q = kernels::to_matrix(kernels::quaternion_exp(kernels::Vec3<double>{0.36, 0.48, 0.8}));
  touch.c = {0.001, -0.002, 0.019 * scale};
  touch.omega = {0.3, -0.2, 0.1};
  touch.v = {0.01, 0.02, -0.005};
  touch.law = {1, 0.01, 2, 0.003};
  std::vector<int> active(std::size_t(pad.tiles()));
  std::vector<Real> field(std::size_t(3 * pad.rows * pad.cols));
  run({&pad, ContactLaw::clamped, 1, &shape, &touch, active.data(), nullptr, field.data()});
  return field;
}

kernels::TouchShape scaled(const kernels::DistanceGrid& grid, double scale) {
  return {PrimitiveShape::mesh, {scale, 0, 0}, &grid};
}

/// Triangles and cells are halved together.
TEST(MeshContact, FieldErrorsFallWithTheSquareOfTheCell) {
  const auto run = kernels::active_kernels().tactile;
  const auto was = pressed_field<double>({PrimitiveShape::sphere, {0.02, 0, 0}}, 1, run);
  double peak = 0;
  for (const double f : was) peak = std::max(peak, std::abs(f));
  std::vector<double> errors;  // at 16, 32 and 64 cells
  for (int times = 3; times <= 5; ++times) {
    MeshShape mesh = times == 5 ? fine_ball() : testing::ellipsoid_mesh(times, {0.02, 0.02, 0.02});
    mesh.resolution = 2 << times;
    const auto grid = shared_mesh_grid(mesh);
    const auto is = pressed_field<double>(scaled(grid->view, 1), 1, run);
    errors.push_back(0);
    for (std::size_t k = 0; k < is.size(); ++k)
      errors.back() = std::max(errors.back(), std::abs(is[k] - was[k]) / peak);
  }
  EXPECT_LT(errors[1], errors[0] / 3) << errors[0];
  EXPECT_LT(errors[2], errors[0] / 15) << errors[0];
  EXPECT_LT(errors[2], 0.01);
}

/// With floors that are nowhere above zero, every point is evaluated.
TEST(MeshContact, CellsThatPadsSkipChangeNoBit) {
  const auto grid = make_mesh_grid(testing::ellipsoid_mesh(3, {0.02, 0.02, 0.02}));
  kernels::DistanceGrid all = grid->view;
  const std::vector<float> low(grid->floors.size(), -1.0F);
  all.floors = low.data();
  for (const kernels::KernelTable* table : kernels::available_kernels())
    for (const double scale : {0.7, 1.0}) {
      SCOPED_TRACE(table->name);
      const auto is = pressed_field<double>(scaled(grid->view, scale), scale, table->tactile),
                 was = pressed_field<double>(scaled(all, scale), scale, table->tactile);
      EXPECT_EQ(is, was);
      EXPECT_GT(std::count_if(is.begin(), is.end(), [](double f) { return f != 0; }), 30);
      EXPECT_EQ(pressed_field<float>(scaled(grid->view, scale), scale, table->tactile_mixed),
                pressed_field<float>(scaled(all, scale), scale, table->tactile_mixed));
    }
}

TEST(MeshContact, BodiesThatStartInsideOneAnotherAreNamed) {
  EXPECT_TRUE(start_overlaps(Model(pressed_ball(SphereShape{0.02}))).empty());
  Scene s = pressed_ball(testing::ellipsoid_mesh(2, {0.02, 0.02, 0.02}));
  s.links[1].joint.pose.position[2] = 0.045;
  const std::vector<std::string> found = start_overlaps(Model(s));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NE(found[0].find("'pad' starts 0.009"), std::string::npos) << found[0];
  EXPECT_NE(found[0].find("inside 'ball'"), std::string::npos) << found[0];
}

}  // namespace
}  // namespace tangere
