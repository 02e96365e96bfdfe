// SPDX-License-Identifier: Apache-2.0
// What most of a few measured numbers do not exceed, and what most of all others do not.
#pragma once

#include <vector>

namespace tangere {

/// Returns the value that `share` of the numbers do not exceed. NaN entries do not count; NaN where
/// there is nothing else.
double quantile(std::vector<double> numbers, double share);

/// Returns the value below which `share` of the population lies with that confidence, from which
/// the numbers were drawn. Of n numbers k are larger, the most for which P(Binomial(n, 1 - share) ≤
/// k) is at most 1 - share. The largest number where there is no such k. NaN entries do not count.
double sure_quantile(std::vector<double> numbers, double share);

}  // namespace tangere
