// SPDX-License-Identifier: Apache-2.0
// A peg with contact points in a hole: a mesh is not convex, and its hole must hold like walls do.
#include <gtest/gtest.h>

#include "engine/model/mesh_grid.hpp"
#include "kernels/contact/distance.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/gradient_tangent.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::q_of;
using testing::v_of;

constexpr double kHoleWidth = 0.021, kBlockWidth = 0.05,
                 kHoleHeight = 0.02;  // of the hole, the block [m]
constexpr double kPlay = 0.0005;      // on each side of the peg [m]
constexpr Vector3 kPegStart = {0.0002, -0.0003, 0.0255};

MeshShape hole_mesh() {
  MeshShape mesh = testing::frame_mesh(kBlockWidth / 2, kHoleWidth / 2, kHoleHeight / 2);
  mesh.resolution = 64;
  return mesh;
}

/// A peg over a hole with half a millimetre to spare and a floor: a mesh, or four cuboids.
Scene peg_over_hole(bool mesh, const Vector3& gravity = {0, 0, -9.8}) {
  constexpr double kSideWall = (kBlockWidth - kHoleWidth) / 2;
  Scene s;
  s.gravity = gravity;
  s.timestep = 2e-3;
  s.links = {testing::link("peg", JointType::free, kPegStart,
                           CuboidShape{{0.02, 0.02, 0.03}, {6, 6, 9}}, 2000)};
  s.links[0].joint.damping = 0.2;
  s.links[0].joint.turning.emplace().damping = 1e-4;
  const auto touch = [&](const std::string& wall, const Vector3& at, const Shape& shape) {
    s.links.push_back(testing::link(wall, JointType::fixed, at, shape, 1000));
    s.pair_contacts.push_back({"peg", wall, {500, 2, 0.2, 200}, ContactLaw::clamped, 1e-5, {}});
  };
  touch("floor", {0, 0, -0.02}, CuboidShape{{kBlockWidth, kBlockWidth, 0.02}, {2, 2, 2}});
  if (mesh) {
    touch("hole", {0, 0, 0}, hole_mesh());
  } else {
    const double off = (kHoleWidth + kSideWall) / 2;
    const CuboidShape along_y{{kSideWall, kBlockWidth, kHoleHeight}, {2, 2, 2}},
        along_x{{kHoleWidth, kSideWall, kHoleHeight}, {2, 2, 2}};
    touch("right", {off, 0, 0}, along_y), touch("left", {-off, 0, 0}, along_y);
    touch("back", {0, off, 0}, along_x), touch("front", {0, -off, 0}, along_x);
  }
  return s;
}

/// State of the peg after so many steps from another.
testing::RunInput after(const Scene& scene, int steps, const testing::RunInput& start) {
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model);
  batch.set_state(0, start.q, start.v);
  for (int t = 0; t < steps; ++t) stepper.step(batch, {});
  EXPECT_FALSE(failed(batch.status(0)));
  return {q_of(batch), v_of(batch), {}};
}
/// The peg falls, towards a wall and turning about the hole's axis.
testing::RunInput dropped(bool mesh) {
  const Scene scene = peg_over_hole(mesh);
  return after(scene, 400, {q_of(Batch(Model(scene), 1)), {0.02, 0, 0, 0, 0, 0.3}, {}});
}

TEST(PegInHole, SlidesIntoAMeshAsBetweenCuboids) {
  std::vector<std::vector<double>> ends;
  for (const bool mesh : {true, false}) ends.push_back(dropped(mesh).q);
  for (const std::vector<double>& q : ends) {
    EXPECT_NEAR(q[2], 0.005 - kPegStart[2], 1e-4) << "the peg stands on the floor";
    EXPECT_LT(std::abs(q[0] + kPegStart[0]), 1.2 * kPlay);
    EXPECT_LT(std::abs(q[1] + kPegStart[1]), 1.2 * kPlay);
    EXPECT_GT(std::abs(q[3]), 0.999) << "upright";
  }
  for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(ends[0][i], ends[1][i], 2e-3 * (i < 3 ? 0.1 : 1));
}

/// Weight that acts sideways, too, presses the peg against the wall, and the wall holds it.
constexpr Vector3 kSideways = {4, 0, -9.8};
TEST(PegInHole, IsHeldSideways) {
  for (const bool mesh : {true, false}) {
    SCOPED_TRACE(mesh ? "mesh" : "cuboids");
    const testing::RunInput end = after(peg_over_hole(mesh, kSideways), 400, dropped(mesh));
    EXPECT_NEAR(end.q[0] + kPegStart[0], kPlay, 0.1 * kPlay);
    EXPECT_NEAR(end.q[2], 0.005 - kPegStart[2], 1e-4);
    EXPECT_GT(std::abs(end.q[3]), 0.999) << "upright";
    for (const double v : end.v) EXPECT_LT(std::abs(v), 1e-3);
  }
}

/// Largest change of the force on a peg of 242 points between `count` + 1 places of a way from
/// beside the hole over its rim to its bottom, where the peg presses into a wall and leaves it.
double largest_change(const kernels::DistanceGrid& grid, int count) {
  using kernels::Vec3;
  const auto spline = kernels::MeshDistance<double>::of({1, 1, 1}, &grid);
  std::vector<Vec3<double>> points;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j)
      for (int k = 0; k < 9; ++k)
        if (i % 5 == 0 || j % 5 == 0 || k % 8 == 0)
          points.push_back({0.004 * i - 0.01, 0.004 * j - 0.01, 0.00375 * k - 0.015});
  double most = 0;
  Vec3<double> before{};
  for (int n = 0; n <= count; ++n) {
    const double s = double(n) / count;
    const Vec3<double> place = {0.002 * std::sin(9 * s), 0.0011 * std::cos(7 * s),
                                0.026 - 0.022 * s};
    Vec3<double> force{};
    for (const Vec3<double>& p : points) {
      const auto at = spline.evaluate(p + place);
      if (at.d < 0) force = force - 500 * at.d * at.n;
    }
    const Vec3<double> change = force - before;
    if (n > 0) most = std::max(most, std::sqrt(dot(change, change)));
    before = force;
  }
  return most;
}

TEST(PegInHole, ItsForceDoesNotJump) {
  const auto grid = make_mesh_grid(hole_mesh());
  const double coarse = largest_change(grid->view, 4000), fine = largest_change(grid->view, 16000);
  EXPECT_GT(coarse, 1e-4) << "it touches";
  EXPECT_LT(fine, 0.3 * coarse) << "a jump would stay as large";
}

/// From a peg that leans on the wall and moves a little: by adjoint, differences and dual numbers.
TEST(PegInHole, GradientsAgree) {
  const Scene scene = peg_over_hole(true, kSideways);
  testing::RunInput in = after(scene, 200, dropped(true));
  const Model model = testing::without_second_looks(scene);
  testing::Random random(3);
  for (double& v : in.v) v += 0.01 * random.normal();
  in.u.resize(6);
  const StepperOptions options = testing::options(Integrator::sdirk2, scene.timestep, 1e-13);
  EXPECT_GT(testing::check_gradient(model, options, in, 4, 1e-5), 12);
  EXPECT_EQ(testing::check_tangent(model, options, in, 5), 1);
}

}  // namespace
}  // namespace tangere
