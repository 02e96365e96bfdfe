// SPDX-License-Identifier: Apache-2.0
// The kinetic energy is T(v) = vᵀ M v / 2, so M_ij = T(e_i + e_j) - T(e_i) - T(e_j). With j last,
// 1/(M⁻¹)_jj is the last pivot when M is eliminated.
#include "io/robot/effective_inertia.hpp"

#include <utility>

#include "engine/model/model.hpp"
#include "engine/sense/energy_balance.hpp"
#include "engine/step/batch.hpp"

namespace tangere {
namespace {

using Matrix = std::vector<std::vector<double>>;

Matrix mass_matrix(const Model& model) {
  const auto n = std::size_t(model.nv());
  Batch batch(model, 1);
  EnergyBalanceReader reader(model);
  std::vector<double> v(n);
  const std::vector<double> u(std::size_t(model.nu()));
  const auto energy = [&](std::size_t i, std::size_t j) {
    v[i] = v[j] = 1;
    batch.set_state(0, model.initial_q(), v);
    v[i] = v[j] = 0;
    return reader.read(batch, 0, u).kinetic;
  };
  Matrix M(n, std::vector<double>(n));
  for (std::size_t i = 0; i < n; ++i) M[i][i] = 2 * energy(i, i);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j)
      M[i][j] = M[j][i] = energy(i, j) - 0.5 * (M[i][i] + M[j][j]);
  return M;
}

double last_pivot(Matrix M, std::size_t dof) {
  const std::size_t n = M.size();
  std::swap(M[dof], M[n - 1]);
  for (std::vector<double>& row : M) std::swap(row[dof], row[n - 1]);
  for (std::size_t k = 0; k + 1 < n; ++k)
    for (std::size_t i = k + 1; i < n; ++i) {
      const double factor = M[i][k] / M[k][k];
      for (std::size_t j = k + 1; factor != 0 && j < n; ++j) M[i][j] -= factor * M[k][j];
    }
  return M[n - 1][n - 1];
}

}  // namespace

std::vector<double> effective_inertias(Scene scene, const std::vector<int>& dofs) {
  scene.motors.clear();
  for (LinkDescription& link : scene.links) {  // as in the file's mass matrix
    const bool weightless = link.joint.follows.size() > 0 &&
                            std::holds_alternative<AbstractShape>(link.body.shape) &&
                            std::get<AbstractShape>(link.body.shape).mass == 0;
    if (weightless) link.joint.type = JointType::fixed;  // tendons come last
    link.joint.follows.clear();
  }
  const Matrix M = mass_matrix(Model(scene));
  std::vector<double> out;
  for (const int dof : dofs) out.push_back(last_pivot(M, std::size_t(dof)));
  return out;
}

}  // namespace tangere
