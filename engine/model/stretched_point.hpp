// SPDX-License-Identifier: Apache-2.0
// How a contact point moves with the size of its body.
#pragma once

#include "kernels/contact/distance.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/step/model_view.hpp"

namespace tangere {

/// Returns the tangent of a contact point at `at`, link axes, where the size of its body changes by
/// `by`, (3).
inline kernels::Vec3<double> stretched_point(const kernels::Solid& s, const double* by,
                                             const kernels::Vec3<double>& at) {
  using D = kernels::Dual<double>;
  if (!s.stretches) return kernels::zero3<double>();
  const kernels::Vec3<double> y = transposed_times(s.frame.R, at - s.frame.p);
  const kernels::Vec3<D> size = {{s.size.x, by[0]}, {s.size.y, by[1]}, {s.size.z, by[2]}};
  return s.frame.R * kernels::with_distance<D>(s.shape, size, [&]<class Shape>(const Shape&) {
           if constexpr (requires { Shape::stretched(size, s.size, y); }) {
             const kernels::Vec3<D> moved = Shape::stretched(size, s.size, y);
             return kernels::Vec3<double>{moved.x.epsilon, moved.y.epsilon, moved.z.epsilon};
           } else {
             return kernels::zero3<double>();
           }
         });
}

}  // namespace tangere
