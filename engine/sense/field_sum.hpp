// SPDX-License-Identifier: Apache-2.0
// The sum of a field and the centre of its pressure, from the touched tiles alone.
#pragma once

#include <span>

#include "engine/scene/field_form.hpp"
#include "kernels/numbers/linalg.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere {

/// Adds up a field. `values`: (tiles, 3, 64), as kernels write them where `pad` is not skewed.
/// `in_body`: the pad's axes in the body. `pressure_sign`: of the third component under pressure.
/// The order of the sum is fixed: eight partial sums, then theirs.
template <class Real>
FieldSum field_sum(const kernels::PadTiles& pad, const kernels::Frame<double>& in_body,
                   int pressure_sign, std::span<const int> tiles, const Real* values);

extern template FieldSum field_sum(const kernels::PadTiles&, const kernels::Frame<double>&, int,
                                   std::span<const int>, const double*);
extern template FieldSum field_sum(const kernels::PadTiles&, const kernels::Frame<double>&, int,
                                   std::span<const int>, const float*);

}  // namespace tangere
