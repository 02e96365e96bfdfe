// SPDX-License-Identifier: Apache-2.0
// The order that steps really have on a scene, and the laws that are of first order whatever the
// scheme is.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// The error of a run with step h, from its distances to runs with 2 h and 4 h. If the error is
/// C h^q, they are C h^q (2^q - 1) and C h^q (4^q - 1), so their ratio is 2^q + 1.
struct RichardsonEstimate {
  double order = 0;  ///< q, between kLeastOrder and kMostOrder
  double error = 0;  ///< C h^q; infinite where the distance to 2 h is

  static constexpr double kLeastOrder = 0.5, kMostOrder = 6;
};
/// An order below kLeastOrder counts as that: so small an order means that steps do not yet come
/// nearer to a limit, and the error is then 2.4 times the distance to 2 h.
RichardsonEstimate richardson(double to_twice, double to_four_times);

/// Returns descriptions of the laws in the scene that are first order in the step length with every
/// scheme: friction with ks, whose shear state is updated once per step (where points slip or
/// land), and motors with timing="start", whose force is constant over a step.
std::vector<std::string> first_order_laws(const Scene& scene);

}  // namespace tangere
