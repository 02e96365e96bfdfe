// SPDX-License-Identifier: Apache-2.0
// Each number of the state after the step is treated as a loss of its own.
#include "engine/derivative/step_jacobian.hpp"

#include "kernels/numbers/linalg.hpp"

namespace tangere {

using kernels::kBlock;

StepJacobians::StepJacobians(const Model& model, const StepperOptions& options)
    : nv_(model.nv()), nu_(model.nu()), adjoint_(model, options, {2 * model.nv(), false}) {}

void StepJacobians::evaluate(const Batch& batch, int block, const BlockTape& tape,
                             std::int64_t step, std::span<const double> controls) {
  adjoint_.clear();
  for (int i = 0; i < nv_; ++i)
    for (int l = 0; l < kBlock; ++l) {
      adjoint_.loss(i).q[std::size_t(i * kBlock + l)] = 1;
      adjoint_.loss(nv_ + i).v[std::size_t(i * kBlock + l)] = 1;
    }
  adjoint_.reverse_step(batch, block, tape, step, controls);
}

void StepJacobians::get(int lane, StepJacobian& out) const {
  const auto n = std::size_t(nv_), width = 2 * n, controls = std::size_t(nu_);
  out.state.resize(width * width);
  out.previous.resize(width * width);
  out.u.resize(width * controls);
  for (std::size_t row = 0; row < width; ++row) {
    const BlockCotangent& c = adjoint_.loss(static_cast<int>(row));
    const auto at = [&](const AlignedVector<double>& x, std::size_t i) {
      return x[i * kBlock + std::size_t(lane)];
    };
    for (std::size_t i = 0; i < n; ++i) {
      out.state[row * width + i] = at(c.q, i);
      out.state[row * width + n + i] = at(c.v, i);
      out.previous[row * width + i] = at(c.previous_q, i);
      out.previous[row * width + n + i] = at(c.previous_v, i);
    }
    for (std::size_t k = 0; k < controls; ++k) out.u[row * controls + k] = at(c.u, k);
  }
}

}  // namespace tangere
