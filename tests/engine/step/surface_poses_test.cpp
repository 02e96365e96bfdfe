// SPDX-License-Identifier: Apache-2.0
// Bodies of all shapes that are pressed onto each other in crossed, skew, edge, rim and end-on
// poses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/engine/surface_scenes.hpp"

namespace tangere {
namespace {

using testing::above;
using testing::kPi;
using testing::lift;
using testing::PosedPair;
using testing::poses;
using testing::q_of;
using testing::touching_height;
using testing::v_of;

TEST(SurfacePoses, HoldsBodiesOfAllShapesInAllPoses) {
  for (const PosedPair& p : poses()) {
    SCOPED_TRACE(p.name);
    const double touch = touching_height(p);
    Scene scene = above(p.lower, p.lower_turn, p.upper, p.upper_turn,
                        {p.beside[0], p.beside[1], touch + 0.005}, {1e9, 1e6, 0.5, 3e9});
    const Model model(scene);
    Stepper stepper(model, testing::options(Integrator::bdf2, 1e-3, 1e-9));
    Batch batch(model, 1);
    double lowest = 1;
    for (int k = 0; k < 800; ++k) {
      stepper.step(batch, {});
      lowest = std::min(lowest, q_of(batch)[0]);
      ASSERT_FALSE(failed(batch.status(0)));
      ASSERT_NE(batch.status(0), StepStatus::tunnelled);
    }
    const double sunk = -q_of(batch)[0] - 0.005;
    RecordProperty(p.name, std::to_string(sunk));
    const bool mesh =
        std::holds_alternative<MeshShape>(p.lower) || std::holds_alternative<MeshShape>(p.upper);
    EXPECT_GT(sunk, mesh ? -3e-4 : -1e-5) << "it rests on the other body, not above it";
    EXPECT_LT(sunk, 0.003);
    EXPECT_LT(-lowest - 0.005, 0.005) << "while it lands";
    EXPECT_LT(std::abs(v_of(batch)[0]), 1e-3);
  }
}

TEST(SurfacePoses, ConvergesWhereEdgesAndRodsCross) {
  const std::vector<PosedPair> all = poses();
  for (const char* const name : {"edge across edge", "crossed rods", "corner on a face"}) {
    SCOPED_TRACE(name);
    const PosedPair& p =
        *std::ranges::find_if(all, [&](const PosedPair& x) { return std::string(x.name) == name; });
    const double depth = 0.002, touch = touching_height(p);
    std::vector<double> force;
    for (const double pitch : {2e-3, 1e-3, 5e-4})
      force.push_back(
          lift(above(p.lower, p.lower_turn, p.upper, p.upper_turn,
                     {p.beside[0], p.beside[1], touch - depth}, {1e9, 0, 0, 0}, pitch)));
    EXPECT_GT(force[2], 0);
    EXPECT_LT(std::abs(force[1] - force[2]), 0.1 * force[2]);
    EXPECT_LT(std::abs(force[0] - force[2]), 0.3 * force[2]);
  }
}

TEST(SurfacePoses, CrossedRodsAndEdgesPushAsTheClosedFormsSay) {
  // Rods: the gap is x²/2R + y²/2R, so the force is K π R δ². Edges of 90°: the depth of a point on
  // a face is (δ - |x| - |y|)/√2, so the force is K √2/3 δ³.
  const std::vector<PosedPair> all = poses();
  const double K = 1e9, depth = 1e-3;
  struct Case {
    const char* name;
    double touching, force;
  };
  for (const auto& [name, touching, force] :
       {Case{"crossed rods", 0.024, K * kPi * 0.012 * depth * depth},
        Case{"edge across edge", 0.03 * std::sqrt(2.0),
             K * std::sqrt(2.0) / 3 * std::pow(depth, 3)}}) {
    SCOPED_TRACE(name);
    const PosedPair& p = *std::ranges::find_if(
        all, [&, wanted = std::string(name)](const PosedPair& x) { return x.name == wanted; });
    const double found = lift(above(p.lower, p.lower_turn, p.upper, p.upper_turn,
                                    {0, 0, touching - depth}, {K, 0, 0, 0}, 3e-4));
    EXPECT_NEAR(found, force, 0.05 * force);
  }
}

}  // namespace
}  // namespace tangere
