// SPDX-License-Identifier: Apache-2.0
// Displaces positions along the dofs of v, and turns derivatives by coordinates into derivatives
// along dofs.
#pragma once

#include <span>

#include "engine/model/model.hpp"

namespace tangere {

/// Computes q ⊕ e along one dof, in place. Rotations are on the right. Joints that follow others go
/// along; alone they stay. Batch::set_state() places those that are transmissions.
void displace(const Model& model, std::span<double> q, int dof, double e);

/// Sets velocities, (nv), of joints that follow others from their leaders', at q (nq).
void complete_velocities(const Model& model, std::span<const double> q, std::span<double> v);

/// A state of an environment and its numbers.
struct StateAt {
  const double *q, *v;  ///< (nq), (nv), `stride` apart
  int stride;
  const double* column;  ///< row r of the environment's block is column[16 r]; null: the scene's
};

/// Sets the changes of a state, (nv) each, of joints that follow others, transmissions included.
/// `numbers_dot`: changes of the scene's numbers (parameter_rows()), or empty.
void complete_changes(const Model& model, const StateAt& at, std::span<const double> numbers_dot,
                      std::span<double> q_dot, std::span<double> v_dot);

/// Turns `q_bar`, (nq) derivatives by coordinates at q, into derivatives along the dofs of v and
/// adds them to `out`, (nv). `q_bar` treats the four coordinates of a quaternion as free.
void add_along_dofs(const Model& model, std::span<const double> q, std::span<const double> q_bar,
                    std::span<double> out);

/// Turns derivatives along the dofs of v, (nv), into derivatives by coordinates at q and adds them
/// to `out`, (nq). Those by the four coordinates of a quaternion have no part along the quaternion,
/// which would change its length.
void add_along_coordinates(const Model& model, std::span<const double> q,
                           std::span<const double> dof_bar, std::span<double> out);

}  // namespace tangere
