// SPDX-License-Identifier: Apache-2.0
// How the q and v of a joint that does not turn freely go by its x: with J = ∂q/∂x and
// V_x = ∂v/∂x at fixed r, of a dof with a chart those of its scratch, of others J = 1, V_x = c₀/h.
#pragma once

#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Whether a joint of this kind is one dof whose q and v go by its chart (Link::has_chart).
template <JointKind K>
[[gnu::always_inline]] constexpr bool has_dof_chart(const Link& link) {
  return dofs(K) == 1 && link.has_chart;
}

/// Returns J d_dq + V_x d_dv of a dof with a chart. T is a number or a wrench.
template <class T, class N>
T along_dof_chart(const LinkScratch<N>& o, const T& d_dq, const T& d_dv) {
  return mul_add(o.chart_rate.m[0][0], d_dv, o.chart.m[0][0] * d_dq);
}

/// Returns V_x of a joint that does not turn freely.
template <JointKind K, class N>
const N& rate_by_x(const Link& link, const LinkScratch<N>& o, const N& c0_over_h) {
  return has_dof_chart<K>(link) ? o.chart_rate.m[0][0] : c0_over_h;
}

/// Turns what a unit of such a joint's q does into what a unit of its x does.
template <JointKind K, class T, class N>
T along_x(const Link& link, const LinkScratch<N>& o, const T& d_dq) {
  if (has_dof_chart<K>(link)) return o.chart.m[0][0] * d_dq;
  return d_dq;
}

}  // namespace tangere::kernels
