// SPDX-License-Identifier: Apache-2.0
// Which dofs are connected with each other, by joints and contacts.
#pragma once

#include <utility>
#include <vector>

#include "kernels/step/model_view.hpp"

namespace tangere {

/// Dofs sorted by component: those of component c are dofs[begin[c]] … dofs[begin[c + 1] - 1].
struct Components {
  std::vector<int> dofs, begin;
};

/// Finds what joints and contacts connect. The world connects nothing. `touching`: the links of
/// each contact.
Components find_components(const std::vector<kernels::Link>& links,
                           const std::vector<std::pair<int, int>>& touching);

}  // namespace tangere
