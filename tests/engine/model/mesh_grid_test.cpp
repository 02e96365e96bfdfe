// SPDX-License-Identifier: Apache-2.0
// The distance to meshes of shapes whose distance is known, and that value, gradient and Hessian
// are those of one function.
#include "engine/model/mesh_grid.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/base/error.hpp"
#include "engine/model/random.hpp"
#include "kernels/contact/distance.hpp"
#include "kernels/numbers/dual.hpp"
#include "tests/engine/meshes.hpp"

namespace tangere::testing {
namespace {

using kernels::Dual;
using kernels::Mat3;
using kernels::Vec3;
using Spline = kernels::MeshDistance<double>;

/// Draws numbers from 0 to 1, the same ones in every run.
class Draw {
 public:
  double operator()(double low, double high) {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return low + (high - low) * double(state_ >> 11) * 0x1p-53;
  }
  Vec3<double> direction() {
    for (;;) {
      const Vec3<double> v = {(*this)(-1, 1), (*this)(-1, 1), (*this)(-1, 1)};
      if (const double square = dot(v, v); square > 0.01 && square < 1)
        return (1 / std::sqrt(square)) * v;
    }
  }

 private:
  std::uint64_t state_ = 12345;
};

std::shared_ptr<const MeshGrid> grid_of(MeshShape mesh, int resolution) {
  mesh.resolution = resolution;
  return make_mesh_grid(mesh);
}

/// Returns the largest error of distance and of normal against another shape, at places within
/// `reach` of its surface that `at` draws.
template <class Shape, class At>
std::array<double, 2> errors(const MeshGrid& grid, const Shape& shape, const At& at) {
  std::array<double, 2> most{};
  const Spline spline = Spline::of({1, 1, 1}, &grid.view);
  for (int k = 0; k < 2000; ++k) {
    const Vec3<double> y = at();
    const auto is = spline.evaluate(y), was = distance_at(shape, y);
    const Vec3<double> turned = is.n - was.n;
    most[0] = std::max(most[0], std::abs(is.d - was.d));
    most[1] = std::max(most[1], std::sqrt(dot(turned, turned)));
  }
  return most;
}

/// Triangles and cells are halved together.
TEST(MeshGrid, ErrorsFallWithTheSquareOfTheCell) {
  const double r = 0.02;
  double before = 1;
  for (int times = 2; times <= 4; ++times) {
    Draw draw;
    const auto grid = grid_of(ellipsoid_mesh(times, {r, r, r}), 2 << times);
    const auto e = errors(*grid, kernels::SphereDistance<double>{r},
                          [&] { return draw(0.85 * r, 1.05 * r) * draw.direction(); });
    EXPECT_LT(e[0], times > 2 ? before / 3.5 : 0.1 * r) << (2 << times) << " cells";
    EXPECT_LT(e[1], 0.45 / (1 << times));  // triangles are flat, so normals err by their size
    before = e[0];
  }
  EXPECT_LT(before, 0.0016 * r);
}

TEST(MeshGrid, IsTheDistanceToTheSameShapeAsAPrimitive) {
  Draw draw;
  {
    const Vec3<double> s = {0.02, 0.015, 0.01};
    const auto grid = grid_of(cuboid_mesh({s.x, s.y, s.z}), 64);
    // Beside the edges: there the gradient of a spline turns within a few cells.
    const auto e = errors(*grid, kernels::CuboidDistance<double>::of(s), [&] {
      return Vec3<double>{draw(-0.7, 0.7) * s.x, draw(-0.7, 0.7) * s.y, draw(0.9, 1.1) * s.z};
    });
    EXPECT_LT(e[0], 1e-6);
    EXPECT_LT(e[1], 2e-3);
  }
  {
    const double r = 0.012, half = 0.01;
    const auto grid = grid_of(capsule_mesh(r, half, 96), 64);
    const auto e = errors(*grid, kernels::CapsuleDistance<double>{r, half}, [&] {
      const Vec3<double> n = draw.direction();
      return draw(0.9, 1.05) * r * n + Vec3<double>{0, 0, std::copysign(draw(0, 1) * half, n.z)};
    });
    EXPECT_LT(e[0], 2e-3 * r);
    EXPECT_LT(e[1], 0.06);
  }
  {
    const Vec3<double> a = {0.02, 0.015, 0.01};
    const auto grid = grid_of(ellipsoid_mesh(5, {a.x, a.y, a.z}), 64);
    const auto e = errors(*grid, kernels::EllipsoidDistance<double>{a}, [&] {
      const Vec3<double> n = draw.direction();
      return draw(0.95, 1.05) * Vec3<double>{a.x * n.x, a.y * n.y, a.z * n.z};
    });
    EXPECT_LT(e[0], 1e-3 * a.z);
    EXPECT_LT(e[1], 0.04);
  }
}

/// In the tube and in the hole, the nearest place never jumps within half a tube of the surface.
TEST(MeshGrid, NonConvexNormalsDoNotJump) {
  const double ring = 0.02, tube = 0.006;
  const auto grid = grid_of(torus_mesh(ring, tube, 160, 80), 64);
  const Spline spline = Spline::of({1, 1, 1}, &grid->view);
  Draw draw;
  for (int path = 0; path < 200; ++path) {
    const double u = draw(0, 2 * M_PI), v = draw(0, 2 * M_PI), turn = draw(-1, 1);
    Vec3<double> before{};
    for (int k = 0; k <= 200; ++k) {
      const double way = 0.01 * k, rho = tube * (0.6 + 0.006 * k / 2), w = v + turn * way;
      const double out = ring + rho * std::cos(w);
      const Vec3<double> y = {out * std::cos(u + way), out * std::sin(u + way), rho * std::sin(w)};
      const auto at = spline.evaluate(y);
      EXPECT_NEAR(at.d, rho - tube, 0.006 * tube);
      EXPECT_NEAR(dot(at.n, at.n), 1, 0.1);
      if (k > 0) {
        const Vec3<double> change = at.n - before;
        EXPECT_LT(std::sqrt(dot(change, change)), 0.05) << path << " " << k;
      }
      before = at.n;
    }
  }
}

TEST(MeshGrid, GradientAndHessianAreTheDerivatives) {
  const auto grid = grid_of(torus_mesh(0.02, 0.006, 40, 20), 24);
  const Spline spline = Spline::of({1, 1, 1}, &grid->view);
  const double cell = grid->view.cell, step = 1e-4 * cell;
  Draw draw;
  for (int k = 0; k < 500; ++k) {
    const Vec3<double> y = {draw(-0.03, 0.03), draw(-0.03, 0.03), draw(-0.008, 0.008)};
    Mat3<double> H;
    const auto at = spline.evaluate(y, H);
    for (int c = 0; c < 3; ++c) {
      Vec3<double> up = y, down = y;
      (&up.x)[c] += step, (&down.x)[c] -= step;
      const auto high = spline.evaluate(up), low = spline.evaluate(down);
      EXPECT_NEAR((&at.n.x)[c], (high.d - low.d) / (2 * step), 1e-6);
      const Vec3<Dual<double>> moved = {
          {y.x, c == 0 ? 1.0 : 0.0}, {y.y, c == 1 ? 1.0 : 0.0}, {y.z, c == 2 ? 1.0 : 0.0}};
      const auto dual =
          kernels::MeshDistance<Dual<double>>::of({1, 1, 1}, &grid->view).evaluate(moved);
      EXPECT_NEAR((&at.n.x)[c], dual.d.epsilon, 1e-12);
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(cell * H.m[i][c], cell * ((&high.n.x)[i] - (&low.n.x)[i]) / (2 * step), 1e-6);
        EXPECT_NEAR(cell * H.m[i][c], cell * (&dual.n.x)[i].epsilon, 1e-12);
      }
    }
  }
}

/// The scale of a mesh scales its distance, and the tile search with it.
TEST(MeshGrid, ScalesLikeTheMesh) {
  const MeshShape mesh = torus_mesh(0.02, 0.006, 24, 12);
  MeshShape large = mesh;
  for (double& x : large.vertices) x *= 1.7;
  const auto grid = grid_of(mesh, 20), own = grid_of(large, 20);
  const Spline scaled = Spline::of({1.7, 0, 0}, &grid->view),
               direct = Spline::of({1, 0, 0}, &own->view);
  Draw draw;
  int near = 0;
  for (int k = 0; k < 2000; ++k) {
    const Vec3<double> y = {draw(-0.05, 0.05), draw(-0.05, 0.05), draw(-0.014, 0.014)};
    Mat3<double> H, G;
    const auto is = scaled.evaluate(y, H), was = direct.evaluate(y, G);
    EXPECT_NEAR(is.d, was.d, 1e-8);  // coefficients are rounded to single precision
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR((&is.n.x)[i], (&was.n.x)[i], 1e-5);
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(0.001 * H.m[i][j], 0.001 * G.m[i][j], 1e-5);
    }
    EXPECT_EQ(nearer_than(scaled, y, 0.002), nearer_than(direct, y, 0.002));
    near += nearer_than(scaled, y, 0.002);
    using D = Dual<double>;
    const auto dual = kernels::MeshDistance<D>::of({D(1.7, 1), D(0.0), D(0.0)}, &grid->view)
                          .evaluate({D(y.x), D(y.y), D(y.z)});
    EXPECT_NEAR(dual.d.epsilon, (is.d - dot(is.n, y)) / 1.7, 1e-12);
    const Vec3<double> turn = (-1 / 1.7) * (H * y);
    EXPECT_NEAR(dual.n.x.epsilon, turn.x, 1e-10);
    EXPECT_NEAR(dual.n.y.epsilon, turn.y, 1e-10);
    EXPECT_NEAR(dual.n.z.epsilon, turn.z, 1e-10);
    // Cotangents of d and n: ρ̄ = -d̄ n - H n̄.
    const double d_bar = draw(-1, 1);
    const Vec3<double> n_bar = draw.direction(), rho = -d_bar * is.n - H * n_bar;
    EXPECT_NEAR(scaled.size_share(y, is.d, rho, d_bar).x,
                d_bar * dual.d.epsilon + n_bar.x * dual.n.x.epsilon + n_bar.y * dual.n.y.epsilon +
                    n_bar.z * dual.n.z.epsilon,
                1e-10);
  }
  EXPECT_GT(near, 100);
}

/// What is left out of a search, because it is not nearer than m, does not touch after a way of m.
TEST(MeshGrid, WhatIsNotNearCannotTouchAfterAsFarAWay) {
  const auto grid = grid_of(torus_mesh(0.02, 0.006, 24, 12), 20);
  const Spline spline = Spline::of({1, 1, 1}, &grid->view);
  Draw draw;
  int far = 0;
  for (int k = 0; k < 20000; ++k) {
    const Vec3<double> y = {draw(-0.04, 0.04), draw(-0.04, 0.04), draw(-0.02, 0.02)};
    const double m = draw(1e-4, 0.01);
    if (nearer_than(spline, y, m)) continue;
    ++far;
    EXPECT_GE(spline.evaluate(y).d, 0);
    EXPECT_GE(spline.evaluate(y + draw(0, m) * draw.direction()).d, 0);
  }
  EXPECT_GT(far, 2000);
}

/// The floor of a cell is below the spline everywhere in it, and not far below.
TEST(MeshGrid, NoCellReachesBelowItsFloor) {
  const auto grid = grid_of(torus_mesh(0.02, 0.006, 24, 12), 20);
  const Spline spline = Spline::of({1, 1, 1}, &grid->view);
  Draw draw;
  int skipped = 0;
  for (int k = 0; k < 20000; ++k) {
    const Vec3<double> y = {draw(-0.03, 0.03), draw(-0.03, 0.03), draw(-0.01, 0.01)};
    Vec3<double> clamped;
    const auto place = place_in_grid(grid->view, in_cells(grid->view, y), clamped);
    const double floor = floor_at(grid->view, place), d = spline.evaluate(y).d;
    EXPECT_LT(floor, d);
    EXPECT_GT(floor, d - 3 * grid->view.cell);
    skipped += floor > 0;
  }
  EXPECT_GT(skipped, 5000);
}

/// Where a disc or a ball is left out, φ > 0 in all of it; where a bound is positive, so is φ.
TEST(MeshGrid, WhereABoundOfTheFallIsPositiveNothingTouches) {
  Draw draw;
  for (const MeshShape& mesh :
       {torus_mesh(0.02, 0.006, 24, 12), testing::frame_mesh(0.02, 0.01, 0.006),
        cuboid_mesh({0.02, 0.01, 0.015})}) {
    const auto grid = grid_of(mesh, 32);
    const kernels::DistanceGrid& g = grid->view;
    const auto value = [&](const Vec3<double>& U) {
      Vec3<double> clamped;
      kernels::SplineValue<double, 0> phi;
      kernels::spline_at(g, place_in_grid(g, U, clamped), phi);
      return phi.value;
    };
    const auto inside = [&](const Vec3<double>& U) {
      const double* u = &U.x;
      return u[0] > 0 && u[1] > 0 && u[2] > 0 && u[0] < g.cells[0] && u[1] < g.cells[1] &&
             u[2] < g.cells[2];
    };
    int left_out = 0, bounded = 0, sharper = 0;
    for (int k = 0; k < 20000; ++k) {
      const Vec3<double> U = {draw(0, g.cells[0]), draw(0, g.cells[1]), draw(0, g.cells[2])};
      const double m = draw(0.1, kernels::kSagBlock);
      const bool flat = draw(-1, 1) > 0;
      const Vec3<double> normal = flat ? draw.direction() : Vec3<double>{0, 0, 0};
      kernels::FallBound<double> bound;
      const bool near = disc_near_mesh(g, U, m, normal, bound);
      left_out += near ? 0 : 1;
      sharper += !near && value(U) < g.slope * g.cell * m ? 1 : 0;
      for (int way = 0; way < 10; ++way) {
        Vec3<double> along = draw.direction();
        along = along - dot(normal, along) * normal;
        const Vec3<double> s = draw(0, m) * along;
        if (!inside(U + s)) continue;
        if (!near) {
          EXPECT_GT(value(U + s), 0);
        } else if (bound.value + dot(bound.gradient, s) - 0.5 * bound.sag * dot(s, s) > 0) {
          ++bounded;
          EXPECT_GT(value(U + s), 0);
        }
      }
    }
    EXPECT_GT(left_out, 2000);
    EXPECT_GT(sharper, 200);
    EXPECT_GT(bounded, 1000);
  }
}

TEST(MeshGrid, BeyondTheGridNothingTouches) {
  const auto grid = grid_of(cuboid_mesh({0.02, 0.02, 0.02}), 16);
  const Spline spline = Spline::of({1, 1, 1}, &grid->view);
  for (const double x : {0.04, 0.1, 3.0, 1e6}) {
    const auto at = spline.evaluate(Vec3<double>{x, 0.001, 0.002});
    EXPECT_GT(at.d, 0.015);
    EXPECT_NEAR(at.d, x - 0.02, x < 1 ? 1e-4 : 0.1);
  }
  const auto lost = spline.evaluate(Vec3<double>{NAN, NAN, NAN});
  EXPECT_GT(lost.d, 0);
}

TEST(MeshGrid, RefusesASurfaceThatOverlapsItself) {
  MeshShape two = cuboid_mesh({0.02, 0.02, 0.02});
  const MeshShape other = cuboid_mesh({0.02, 0.01, 0.01});
  for (std::size_t k = 0; k < other.vertices.size(); ++k)
    two.vertices.push_back(other.vertices[k] + (k % 3 == 0 ? 0.03 : 0.0));
  for (const std::array<int, 3>& t : other.triangles)
    two.triangles.push_back({t[0] + 8, t[1] + 8, t[2] + 8});
  try {
    grid_of(two, 32);
    ADD_FAILURE() << "no error";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("2 times"));
  }
}

MeshFit fit_of(const MeshShape& mesh, int resolution) { return grid_of(mesh, resolution)->fit; }

/// A plate of so many cells. The nodes of a thin one miss what is inside.
TEST(MeshGrid, ThinWallsAreNotLostInSilence) {
  constexpr int kCells = 48;
  const auto plate = [&](double cells) {
    return fit_of(cuboid_mesh({0.05, 0.05, 0.05 * cells / kCells}), kCells).unresolved;
  };
  for (double cells : {0.2, 0.4, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.3})
    EXPECT_GT(plate(cells), 0.4) << cells;
  for (double cells : {2.0, 3.0, 4.3, 6.0, 48.0}) EXPECT_LT(plate(cells), 0.05) << cells;
}

/// Edges between triangles are kinks, which no grid follows: the error falls with the triangles.
TEST(MeshGrid, TheFitOfARoundBodyIsItsError) {
  double before = 1;
  for (int times = 2; times <= 4; ++times) {
    const MeshFit fit = fit_of(ellipsoid_mesh(times, {0.02, 0.02, 0.02}), 4 << times);
    EXPECT_EQ(fit.unresolved, 0) << times;
    EXPECT_LT(fit.error, before / 3) << times;
    before = fit.error;
  }
  EXPECT_LT(before, 4e-4 * 0.02);
}

/// An error counts at the scale of the mesh.
TEST(MeshGrid, AnErrorChoosesTheCells) {
  MeshShape mesh = ellipsoid_mesh(3, {0.02, 0.02, 0.02});
  mesh.resolution = 16;
  const auto first = shared_mesh_grid(mesh);
  const double coarse = first->fit.error;
  const int cells = first->view.cells[0];
  mesh.error = 0.5 * coarse;
  const auto chosen = fitting_mesh_grid(mesh);
  EXPECT_LE(chosen->fit.error, mesh.error);
  EXPECT_GT(chosen->view.cells[0], cells);
  mesh.error = coarse;
  EXPECT_EQ(fitting_mesh_grid(mesh)->view.cells[0], cells);
  mesh.scale = 2;
  EXPECT_LT(fitting_mesh_grid(mesh)->fit.error, coarse);
  mesh.scale = 1;
  mesh.error = 0;
  EXPECT_EQ(fitting_mesh_grid(mesh), shared_mesh_grid(mesh));
  mesh = cuboid_mesh({0.001, 0.02, 0.001});  // slender: most cells along it are few in all
  mesh.error = 1e-12;
  const auto fault = [&] {
    try {
      static_cast<void>(fitting_mesh_grid(mesh));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(fault(), ::testing::HasSubstr("with 128 cells along its longest side, the most"));
}

TEST(MeshGrid, EqualMeshesShareAGrid) {
  MeshShape mesh = cuboid_mesh({0.01, 0.02, 0.01});
  mesh.resolution = 8;
  auto first = shared_mesh_grid(mesh);
  EXPECT_EQ(shared_mesh_grid(MeshShape(mesh)), first);
  MeshShape other = mesh;
  other.vertices[0] -= 0.001;
  EXPECT_NE(shared_mesh_grid(other), first);
  other = mesh;
  other.resolution = 9;
  EXPECT_NE(shared_mesh_grid(other), first);
  const std::weak_ptr<const MeshGrid> lives = first;
  first.reset();
  EXPECT_TRUE(lives.expired());
}

}  // namespace
}  // namespace tangere::testing
