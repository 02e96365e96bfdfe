// SPDX-License-Identifier: Apache-2.0
// Labels links by the first link that they are connected with.
#include "engine/model/components.hpp"

#include <algorithm>

namespace tangere {

Components find_components(const std::vector<kernels::Link>& links,
                           const std::vector<std::pair<int, int>>& touching) {
  std::vector<int> of(links.size());
  for (std::size_t i = 0; i < of.size(); ++i) {
    const int parent = links[i].parent;
    of[i] = parent < 0 ? static_cast<int>(i) : of[std::size_t(parent)];
  }
  for (const auto& [a, b] : touching) {
    if (a < 0 || b < 0) continue;
    const int first = of[std::size_t(a)], second = of[std::size_t(b)];
    for (int& component : of)
      if (component == std::max(first, second)) component = std::min(first, second);
  }
  Components all{{}, {0}};
  for (int c = 0; c < static_cast<int>(of.size()); ++c) {
    for (std::size_t i = 0; i < of.size(); ++i)
      for (int k = 0; of[i] == c && k < kernels::dofs(links[i].kind); ++k)
        all.dofs.push_back(links[i].v + k);
    const int end = static_cast<int>(all.dofs.size());
    if (end > all.begin.back()) all.begin.push_back(end);
  }
  return all;
}

}  // namespace tangere
