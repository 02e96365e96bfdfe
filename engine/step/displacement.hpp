// SPDX-License-Identifier: Apache-2.0
// Positions changed along the dofs of v, and derivatives by coordinates turned into derivatives
// along them.
#pragma once

#include <span>

#include "engine/model/model.hpp"

namespace tangere {

/// q ⊕ e along one dof, in place; rotations on the right.
void displace(const Model& model, std::span<double> q, int dof, double e);

/// Adds to `out`, (nv), the derivatives along the dofs of what has the derivatives `by_q`, (nq), by
/// coordinates at q. The four of a quaternion are as if each were free.
void add_along_dofs(const Model& model, std::span<const double> q, std::span<const double> by_q,
                    std::span<double> out);

}  // namespace tangere
