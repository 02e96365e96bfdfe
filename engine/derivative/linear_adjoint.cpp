// SPDX-License-Identifier: Apache-2.0
// Goes through the environments one after the other, in dual numbers.
#include "engine/derivative/linear_adjoint.hpp"

#include "engine/derivative/dual_stage.hpp"
#include "kernels/numbers/rotation_vector.hpp"

namespace tangere {

using kernels::Mat3;
using kernels::Row;
using kernels::Vec3;
using D = DualNumber;

namespace {

/// Returns value - tangent: the derivatives Ĝ_z of linear_adjoint.hpp.
double hatted(const D& a) { return a.value - a.epsilon; }

template <class N>
Vec3<N> three(const std::vector<N>& a, int i) {
  const auto k = std::size_t(i);
  return {a[k], a[k + 1], a[k + 2]};
}

/// Returns exp(x) J⁻ᵀ (Aᵀ λ - V_xᵀ Cᵀ λ) of a spherical joint, by the tangent of q₀.
Vec3<D> by_turned_centre(const Vec3<D>& x, double h, const Vec3<D>& a_lambda,
                         const Vec3<D>& c_lambda) {
  const kernels::RotationSeries<D> k = kernels::rotation_series(x);
  const D inverse_h(1 / h);
  const Mat3<D> J = kernels::right_jacobian(x, k);
  const Mat3<D> rate = inverse_h * J + kernels::right_jacobian_derivative(x, k, inverse_h * x);
  const Vec3<D> by_q = a_lambda - transposed_times(rate, c_lambda);
  const kernels::RotationVector<D> inverse =
      kernels::rotation_vector<false>(kernels::quaternion_exp(x));
  return kernels::rotation_exp(x, k) *
         (transposed_times(kernels::inverse_right_jacobian(inverse), by_q));
}

}  // namespace

template <int L>
void linear_rhs(const CompiledModel& m, const LossRows<L>& o, double h, AdjointWorkspace<L>& a) {
  for (const kernels::Link& link : m.links) {
    for (int l = 0; l < L; ++l) {
      if (link.kind != kernels::JointKind::spherical) {
        for (int i = link.v; i < link.v + kernels::dofs(link.kind); ++i)
          a.rhs[i][l] = o.q[i][l] + o.v[i][l] / h;
        continue;
      }
      const Vec3<double> turn = {a.difference[link.v][l], a.difference[link.v + 1][l],
                                 a.difference[link.v + 2][l]};
      const Vec3<double> q =
          transposed_times(kernels::right_jacobian(turn, kernels::rotation_series(turn)),
                           Vec3<double>{o.q[link.v][l], o.q[link.v + 1][l], o.q[link.v + 2][l]});
      const double by_q[3] = {q.x, q.y, q.z};
      for (int i = 0; i < 3; ++i) a.rhs[link.v + i][l] = by_q[i] + o.v[link.v + i][l] / h;
    }
  }
}

template <int L>
void hand_on_linear(const CompiledModel& m, const LossRows<L>& o, double h, int lane,
                    const BasicWorkspace<L>& w, AdjointWorkspace<L>& a) {
  if (a.dual == nullptr) a.dual = std::make_unique<DualStage>(m);
  DualStage& dual = *a.dual;
  const int n = m.nv;
  std::vector<double> lambda(static_cast<std::size_t>(n)), x_bar(static_cast<std::size_t>(n)),
      x(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    const auto k = std::size_t(i);
    x[k] = a.difference[i][lane];
    lambda[k] = a.lambda[i][lane], x_bar[k] = a.rhs[i][lane];
    const double predicted = h * w.v0[i][lane];
    dual.x[k] = D(predicted, predicted - x[k]);
    dual.r[k] = D(0.0), dual.s[k] = D(-w.v0[i][lane]);
    dual.tau[k] = D(w.stage.tau[i][lane]), dual.target[k] = D(w.stage.target[i][lane]);
  }
  for (int i = 0; i < m.nq; ++i) dual.centre[std::size_t(i)] = D(w.q0[i][lane]);
  dual.c0_over_h = dual.inverse_h = 1 / h;
  dual.set_numbers(w.stage.block + lane);
  std::vector<D> A, c_lambda, m_lambda, targets, a_lambda(static_cast<std::size_t>(n), D(0.0));
  dual.jacobian(A);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      a_lambda[std::size_t(j)] += A[std::size_t(i * n + j)] * D(lambda[std::size_t(i)]);
  std::vector<D> numbers;
  if (o.parameters != nullptr)
    numbers.assign(std::size_t(kernels::parameter_numbers(m.view)), D(0.0));
  dual.products(lambda, c_lambda, m_lambda, targets, o.parameters == nullptr ? nullptr : &numbers);
  for (int i = 0; i < n; ++i) {
    const auto k = std::size_t(i);
    o.v_centre[i][lane] += h * (x_bar[k] - hatted(a_lambda[k])) + hatted(m_lambda[k]) / h;
    o.tau[i][lane] += lambda[k];
    o.target[i][lane] += hatted(targets[k]);
  }
  for (const kernels::Link& link : m.links) {
    if (link.kind != kernels::JointKind::spherical) {
      for (int i = link.v; i < link.v + kernels::dofs(link.kind); ++i) {
        const auto k = std::size_t(i);
        o.q_centre[i][lane] += o.q[i][lane] - (hatted(a_lambda[k]) - hatted(c_lambda[k]) / h);
      }
      continue;
    }
    const Vec3<D> by_q = by_turned_centre(three(dual.x, link.v), h, three(a_lambda, link.v),
                                          three(c_lambda, link.v));
    const Vec3<double> turn = three(x, link.v);
    const Vec3<double> kept =
        kernels::rotation_exp(turn, kernels::rotation_series(turn)) *
        Vec3<double>{o.q[link.v][lane], o.q[link.v + 1][lane], o.q[link.v + 2][lane]};
    const double to[3] = {kept.x - hatted(by_q.x), kept.y - hatted(by_q.y),
                          kept.z - hatted(by_q.z)};
    for (int i = 0; i < 3; ++i) o.q_centre[link.v + i][lane] += to[i];
  }
  for (std::size_t k = 0; k < numbers.size(); ++k) o.parameters[k][lane] += hatted(numbers[k]);
}

template void linear_rhs(const CompiledModel&, const LossRows<kernels::kGroup>&, double,
                         AdjointWorkspace<kernels::kGroup>&);
template void linear_rhs(const CompiledModel&, const LossRows<1>&, double, AdjointWorkspace<1>&);
template void hand_on_linear(const CompiledModel&, const LossRows<kernels::kGroup>&, double, int,
                             const Workspace&, AdjointWorkspace<kernels::kGroup>&);
template void hand_on_linear(const CompiledModel&, const LossRows<1>&, double, int,
                             const SingleWorkspace&, AdjointWorkspace<1>&);

}  // namespace tangere
