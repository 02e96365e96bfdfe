// SPDX-License-Identifier: Apache-2.0
// Tests fields of pads on meshes: what the search of tiles and points leaves out does not touch.
// The readings have the bits of those whose tiles seem too large for any of these bounds, and the
// tiles that touch are those of which a point does.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "engine/model/mesh_grid.hpp"
#include "engine/model/model.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/contact/distance.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/pad_scene.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::KernelTable;
using kernels::kTactileTile;
using kernels::PadTiles;
using kernels::Touch;
using kernels::TouchShape;
using kernels::Vec3;
using testing::Random;

struct NamedGrid {
  std::string name;
  std::shared_ptr<const MeshGrid> grid;
};

NamedGrid named(const std::string& name, MeshShape mesh, int resolution) {
  mesh.resolution = resolution;
  return {name, make_mesh_grid(mesh)};
}

MeshShape mug_mesh() {
  const Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/mug.xml").scene;
  for (const LinkDescription& link : scene.links)
    if (const auto* mesh = std::get_if<MeshShape>(&link.body.shape)) return *mesh;
  throw InputError("the mug has no mesh");
}

/// Hollow, sharp and round ones, of cells that are small and large beside a tile.
const std::vector<NamedGrid>& meshes_on_pads() {
  static const std::vector<NamedGrid> all = {
      named("torus", testing::torus_mesh(0.02, 0.006, 48, 24), 64),
      named("coarse torus", testing::torus_mesh(0.02, 0.006, 48, 24), 12),
      named("frame", testing::frame_mesh(0.02, 0.01, 0.006), 48),
      named("cuboid", testing::cuboid_mesh({0.012, 0.016, 0.02}), 32),
      named("mug", mug_mesh(), 64)};
  return all;
}

/// A mesh that cuts the plane of a pad somewhere, at rest.
Touch<double> pose_of_mesh(Random& random) {
  Touch<double> t{};
  t.Q = random.rotation();
  t.c = {random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.uniform(-0.022, 0.022)};
  t.law = {30, 0, 0, 0};
  return t;
}

int run_field(const KernelTable& table, const kernels::TactileArgs<double>& a) {
  return table.tactile(a);
}
int run_field(const KernelTable& table, const kernels::TactileArgs<float>& a) {
  return table.tactile_mixed(a);
}

template <class Real>
struct FieldOfTiles {
  std::vector<Real> dense;
  std::vector<int> active;
};

template <class Real>
FieldOfTiles<Real> field_on_mesh(const KernelTable& table, const PadTiles& pad,
                                 const kernels::DistanceGrid& grid, const Touch<double>& touch) {
  FieldOfTiles<Real> out;
  const TouchShape shape{PrimitiveShape::mesh, {1, 0, 0}, &grid};
  out.dense.assign(std::size_t(3 * pad.rows * pad.cols), Real(0));
  out.active.resize(std::size_t(pad.tiles()));
  const int count = run_field(table, {&pad, ContactLaw::clamped, 1, &shape, &touch,
                                      out.active.data(), nullptr, out.dense.data()});
  out.active.resize(std::size_t(count));
  return out;
}

/// The pad with spheres so large that nothing is left out.
struct WholePad {
  PadTiles tiles;
  AlignedVector<double> radius, eight_radius, parts;

  explicit WholePad(const CompiledSensor& sensor) : tiles(sensor.tiles()) {
    radius.assign(sensor.tile_radius.size(), 1e9);
    eight_radius.assign(sensor.eight_radius.size(), 1e9);
    parts = sensor.parts;
    std::fill_n(parts.begin() + 3 * kernels::kGroup, kernels::kGroup, 1e9);
    tiles.radius = radius.data(), tiles.eight_radius = eight_radius.data();
    tiles.parts = parts.data();
    tiles.reach = 1e9;
  }
};

Vec3<double> point_of_tile(const PadTiles& pad, int tile, int k) {
  const bool curved = pad.curved();
  const double* at = pad.offsets + (curved ? 3 * tile : 2 * pad.kind[tile]) * kTactileTile + k;
  return {pad.x[tile] + at[0], pad.y[tile] + at[kTactileTile],
          pad.z[tile] + (curved ? at[2 * kTactileTile] : 0)};
}

/// Counts the tiles that touch, one point after the other.
int touched_tiles(const PadTiles& pad, const kernels::DistanceGrid& grid,
                  const Touch<double>& touch) {
  const auto mesh = kernels::MeshDistance<double>::of({1, 0, 0}, &grid);
  int count = 0;
  for (int tile = 0; tile < pad.tiles(); ++tile) {
    bool touched = false;
    for (int k = 0; k < kTactileTile && !touched; ++k) {
      const Vec3<double> xi = point_of_tile(pad, tile, k);
      touched = mesh.evaluate(transposed_times(touch.Q, xi - touch.c)).d < 0;
    }
    count += touched ? 1 : 0;
  }
  return count;
}

template <class Real>
void expect_nothing_is_left_out(const CompiledSensor& sensor) {
  const PadTiles pad = sensor.tiles();
  const WholePad whole(sensor);
  Random random(5);
  for (const NamedGrid& mesh : meshes_on_pads()) {
    int touched = 0;
    for (int n = 0; n < 25; ++n) {
      const Touch<double> touch = pose_of_mesh(random);
      const int expected = touched_tiles(pad, mesh.grid->view, touch);
      touched += expected;
      for (const KernelTable* table : kernels::available_kernels()) {
        SCOPED_TRACE(mesh.name + ", " + std::string(table->name) + ", pose " + std::to_string(n));
        const auto got = field_on_mesh<Real>(*table, pad, mesh.grid->view, touch);
        const auto all = field_on_mesh<Real>(*table, whole.tiles, mesh.grid->view, touch);
        EXPECT_EQ(got.active, all.active);
        EXPECT_EQ(got.dense, all.dense);
        if (sizeof(Real) == sizeof(double)) {
          EXPECT_EQ(static_cast<int>(got.active.size()), expected);
        }
      }
    }
    EXPECT_GT(touched, 50) << mesh.name;
  }
}

const CompiledSensor& fine_flat_pad() {
  static const Model model = [] {
    Scene scene = testing::rolling_ball();
    scene.sensors[0].array.rows = 150, scene.sensors[0].array.cols = 130;
    return Model(scene);
  }();
  return compiled(model).sensors[0];
}
const CompiledSensor& curved_pad_on_meshes() {
  static const Model model = [] {
    Scene scene =
        testing::pad_scene(PrimitiveShape::sphere, ContactLaw::clamped, testing::Pad::curved);
    auto& points = scene.sensors[0].points;
    const auto first = points;
    for (int i = 1; i < 40; ++i)
      for (TactilePoint p : first) {
        p.position[0] += 1e-4 * i, p.position[1] -= 7e-5 * i;
        points.push_back(p);
      }
    return Model(scene);
  }();
  return compiled(model).sensors[0];
}

TEST(MeshField, NothingThatTouchesAFlatPadIsLeftOut) {
  expect_nothing_is_left_out<double>(fine_flat_pad());
}
TEST(MeshField, NothingThatTouchesAFlatPadIsLeftOutInSinglePrecision) {
  expect_nothing_is_left_out<float>(fine_flat_pad());
}
TEST(MeshField, NothingThatTouchesACurvedPadIsLeftOut) {
  expect_nothing_is_left_out<double>(curved_pad_on_meshes());
}
TEST(MeshField, NothingThatTouchesACurvedPadIsLeftOutInSinglePrecision) {
  expect_nothing_is_left_out<float>(curved_pad_on_meshes());
}

}  // namespace
}  // namespace tangere
