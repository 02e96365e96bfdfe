// SPDX-License-Identifier: Apache-2.0
// Tests displacements of markers against closed forms: an even shear, the sum of all forces, the
// slope of a pressed hill; the transposed map; and that every way of reading gives the same bits.
#include "engine/sense/marker_map.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tests/engine/pad_scene.hpp"

namespace tangere {
namespace {

using testing::Pad;
using Numbers = std::vector<double>;

constexpr double kGelStiffness = 25, kGelThickness = 3e-3;

Scene marked_scene(double thickness = 0, double spread = 0, Pad pad = Pad::flat) {
  Scene s = testing::pad_scene(PrimitiveShape::sphere, ContactLaw::clamped, pad);
  s.sensors[0].markers = MarkersDescription{kGelStiffness, thickness, spread, {"x.xml", 7}};
  return s;
}

/// A field from f(row, column) of a pad's grid.
template <class F>
Numbers grid_field(const SensorInfo& info, const F& f) {
  Numbers all;
  for (int i = 0; i < info.rows; ++i)
    for (int j = 0; j < info.cols; ++j) {
      const std::array<double, 3> x = f(i, j);
      all.insert(all.end(), x.begin(), x.end());
    }
  return all;
}

Numbers displaced(const Model& model, const Numbers& forces) {
  Numbers u(forces.size() / 3 * 2);
  MarkerMap(model, 0).displace(forces, u);
  return u;
}

TEST(MarkerMap, AnEvenShearMovesEveryMarkerAlike) {
  const Model model(marked_scene(kGelThickness));
  const Numbers u = displaced(model, grid_field(model.sensors()[0], [](int, int) {
                                return std::array{0.5, -0.25, 3.0};
                              }));
  for (std::size_t k = 0; k < u.size(); k += 2) {
    EXPECT_DOUBLE_EQ(u[k], 0.5 / kGelStiffness) << "an even pressure has no slope";
    EXPECT_DOUBLE_EQ(u[k + 1], -0.25 / kGelStiffness);
  }
}

/// Σ u k_s = Σ f: what the spread takes from one place it gives to another, at edges too.
TEST(MarkerMap, DisplacementsAddUpToTheForce) {
  const Model model(marked_scene(0, 2e-3));
  Numbers total(2), sum(2);
  const Numbers forces = grid_field(model.sensors()[0], [&](int i, int j) {
    return std::array{std::sin(i + 0.3 * j), 0.1 * i * j, 1.0 * i};
  });
  for (std::size_t k = 0; k < forces.size(); ++k)
    if (k % 3 < 2) total[k % 3] += forces[k];
  const Numbers u = displaced(model, forces);
  for (std::size_t k = 0; k < u.size(); ++k) sum[k % 2] += kGelStiffness * u[k];
  for (std::size_t c = 0; c < 2; ++c) EXPECT_NEAR(sum[c], total[c], 1e-12 * std::abs(total[c]));
  const Numbers plain = displaced(Model(marked_scene()), forces);
  EXPECT_NE(u, plain);
}

/// Under p = p₀ - a x² - b y² the slopes are -2 a x and -2 b y; central differences are exact.
TEST(MarkerMap, APressedHillPushesMarkersOutwards) {
  const Model model(marked_scene(kGelThickness));
  const SensorInfo& info = model.sensors()[0];
  const RectArray& array = model.scene().sensors[0].array;
  const auto pitch = [&](const Vector3& axis, int points) {
    double along = 0;
    for (std::size_t k = 0; k < 3; ++k) along += (array.corner1[k] - array.corner0[k]) * axis[k];
    return along / (points - 1);
  };
  const double dx = pitch(array.axis0, info.rows), dy = pitch(array.axis1, info.cols);
  const auto x = [&](int i) { return (i - 0.5 * (info.rows - 1)) * dx; };
  const auto y = [&](int j) { return (j - 0.5 * (info.cols - 1)) * dy; };
  const double a = 200, b = 500;
  const Numbers u = displaced(model, grid_field(info, [&](int i, int j) {
                                const double p = 1 - a * x(i) * x(i) - b * y(j) * y(j);
                                return std::array{0.0, 0.0, info.pressure_sign * p};
                              }));
  for (int i = 1; i + 1 < info.rows; ++i)
    for (int j = 1; j + 1 < info.cols; ++j) {
      const auto k = std::size_t(2 * (i * info.cols + j));
      EXPECT_NEAR(u[k], kGelThickness / kGelStiffness * a * x(i), 1e-15);
      EXPECT_NEAR(u[k + 1], kGelThickness / kGelStiffness * b * y(j), 1e-15);
    }
}

/// uᵀ (M f) = (Mᵀ u)ᵀ f.
TEST(MarkerMap, PullsBackByItsTranspose) {
  const Model model(marked_scene(kGelThickness, 1.5e-3));
  const auto points = std::size_t(model.sensors()[0].points);
  testing::Random random(5);
  Numbers f(3 * points), u(2 * points), back(3 * points);
  for (double& x : f) x = random.uniform(-1, 1);
  for (double& x : u) x = random.uniform(-1, 1);
  const Numbers of_f = displaced(model, f);
  MarkerMap(model, 0).pull_back(f, u, back);
  double one = 0, two = 0, size = 0;
  for (std::size_t k = 0; k < u.size(); ++k) one += u[k] * of_f[k];
  for (std::size_t k = 0; k < f.size(); ++k)
    two += back[k] * f[k], size += std::abs(back[k] * f[k]);
  EXPECT_NEAR(one, two, 1e-13 * size);
}

struct MarkerReadings {
  Numbers markers, ideal;
};
MarkerReadings read_both(const Scene& scene, int environments, int environment, bool block) {
  const Model model(scene);
  Batch batch(model, environments, 3);
  testing::Random random(7);
  for (int e = 0; e < environments; ++e) {
    const testing::PadState s = testing::random_pad_state(model, random);
    batch.set_state(e, s.q, s.v);
  }
  MarkerReadings out;
  const auto points = std::size_t(model.sensors()[0].points);
  out.ideal.resize(3 * points);
  DenseFrame<double> ideal(model, 0, FieldForm::ideal), markers(model, 0, FieldForm::markers);
  Readout readout(model);
  readout.read(batch, environment, ideal);
  out.ideal.assign(ideal.values().begin(), ideal.values().end());
  if (!block) {
    readout.read(batch, environment, markers);
    out.markers.assign(markers.values().begin(), markers.values().end());
    return out;
  }
  std::vector<Numbers> all(std::size_t(environments % 16 == 0 ? 16 : environments % 16),
                           Numbers(2 * points));
  std::vector<std::span<double>> places(all.begin(), all.end());
  readout.read_block(batch, environment / 16, {0, FieldForm::markers},
                     std::span<const std::span<double>>(places));
  out.markers = all[std::size_t(environment % 16)];
  return out;
}

TEST(Markers, AreTheMapOfTheIdealFieldHoweverTheyAreRead) {
  for (const bool imperfect : {false, true}) {
    Scene scene = marked_scene(kGelThickness, 1e-3);
    if (imperfect) scene.sensors[0].imperfections.noise = {0.01, 0.01};
    for (const int e : {16, 17}) {
      const MarkerReadings alone = read_both(scene, 18, e, false),
                           together = read_both(scene, 18, e, true);
      EXPECT_EQ(alone.markers, together.markers);
      EXPECT_EQ(alone.markers, displaced(Model(scene), alone.ideal));
      EXPECT_EQ(alone.markers, read_both(marked_scene(kGelThickness, 1e-3), 18, e, true).markers);
    }
  }
}

TEST(Markers, CostNothingWhereNobodyAsks) {
  Scene plain = marked_scene();
  plain.sensors[0].markers.reset();
  EXPECT_EQ(Model(plain).state_bytes_per_environment(),
            Model(marked_scene()).state_bytes_per_environment());
  EXPECT_EQ(Stepper::workspace_bytes(Model(plain)),
            Stepper::workspace_bytes(Model(marked_scene())));
}

TEST(Markers, WhatCannotBeIsRefusedWithItsLine) {
  const auto refused = [](const Scene& scene, const std::string& text) {
    try {
      const Model model(scene);
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr("x.xml:7: markers of 'skin': " + text));
    }
  };
  Scene none = marked_scene();
  none.sensors[0].markers->stiffness = 0;
  refused(none, "no stiffness, and the sensor has no ks");
  none.sensors[0].coefficients.ks = 40;
  EXPECT_NO_THROW(Model{none});
  refused(marked_scene(-1), "thickness=\"-1\"; expected a positive number");
  refused(marked_scene(0, NAN), "spread");
  refused(marked_scene(0, 1e-3, Pad::curved), "spread on a list of points");
  refused(marked_scene(1e-3, 0, Pad::curved), "thickness on a list of points");
  EXPECT_NO_THROW(Model{marked_scene(0, 0, Pad::curved)});
  Scene without = marked_scene();
  without.sensors[0].markers.reset();
  EXPECT_THROW(MarkerMap(Model(without), 0), InputError);
}

}  // namespace
}  // namespace tangere
