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

/// Adds the armature of a tendon, cᵀ I_a c. `first`: of each link, its first dof.
void add_armature(const Scene& scene, const JointDescription& tendon, const std::vector<int>& first,
                  Matrix& M) {
  std::vector<std::pair<std::size_t, double>> row;
  for (std::size_t k = 0; k < tendon.follows.size(); ++k)
    for (std::size_t i = 0; i < scene.links.size(); ++i)
      if (scene.links[i].joint.name == tendon.follows[k])
        row.emplace_back(std::size_t(first[i]), tendon.ratio[k]);
  for (const auto& [i, c] : row)
    for (const auto& [j, d] : row) M[i][j] += c * tendon.armature * d;
}

}  // namespace

std::vector<double> effective_inertias(Scene scene, const std::vector<int>& dofs,
                                       const std::set<std::string>& tendons) {
  scene.motors.clear();
  scene.transmissions.clear();
  std::vector<JointDescription> with_armature;
  std::vector<int> first;
  int dof = 0;
  for (LinkDescription& link : scene.links) {
    first.push_back(dof);
    if (tendons.contains(link.joint.name)) {
      with_armature.push_back(link.joint);
      link.joint.type = JointType::fixed;
      link.joint.rest.clear();
    }
    link.joint.follows.clear();
    dof += dof_count(link.joint.type);
  }
  Matrix M = mass_matrix(Model(scene));
  for (const JointDescription& tendon : with_armature) add_armature(scene, tendon, first, M);
  std::vector<double> out;
  for (const int j : dofs) out.push_back(last_pivot(M, std::size_t(j)));
  return out;
}

}  // namespace tangere
