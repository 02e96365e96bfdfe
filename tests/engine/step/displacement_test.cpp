// SPDX-License-Identifier: Apache-2.0
// Derivatives by coordinates and along dofs are each other's inverse.
#include "engine/step/displacement.hpp"

#include <gtest/gtest.h>

#include "engine/model/model.hpp"
#include "engine/step/batch.hpp"
#include "tests/engine/random_scene.hpp"

namespace tangere {
namespace {

TEST(Displacement, DerivativesAlongDofsComeBackFromCoordinates) {
  const Model model(testing::random_tree(3, 8));
  testing::Random random(1);
  std::vector<double> q(std::size_t(model.nq())), along(std::size_t(model.nv())), by_q(q.size()),
      back(along.size());
  for (double& x : along) x = random.normal();
  Batch batch(model, 1);
  batch.get_q(0, q);
  for (int dof = 0; dof < model.nv(); ++dof) displace(model, q, dof, random.normal());
  add_along_coordinates(model, q, along, by_q);
  add_along_dofs(model, q, by_q, back);
  for (std::size_t k = 0; k < along.size(); ++k) EXPECT_NEAR(back[k], along[k], 1e-13) << k;
  // Along a displacement, both give the same derivative.
  for (int dof = 0; dof < model.nv(); ++dof) {
    std::vector<double> up = q, down = q;
    displace(model, up, dof, 1e-6);
    displace(model, down, dof, -1e-6);
    double slope = 0;
    for (std::size_t k = 0; k < q.size(); ++k) slope += by_q[k] * (up[k] - down[k]) / 2e-6;
    EXPECT_NEAR(slope, along[std::size_t(dof)], 1e-8) << dof;
  }
}

}  // namespace
}  // namespace tangere
