// SPDX-License-Identifier: Apache-2.0
// The linearly implicit step in reverse. x = x_p - s, s = A(x_p)⁻¹ g(x_p): A itself hangs on what
// the step begins with, so every derivative G_z of g enters as Ĝ_z = G_z - (dG_z/dx) s, the value
// less the tangent at x_p + ε s:
//   x̄ = Jᵀ(x) q̄ + v̄/h,  Aᵀ λ = x̄,  x̄_p = x̄ - Ĝ_xᵀ λ
//   v̄₀ += h x̄_p - Ĝ_v₀ᵀ λ,  q̄₀ += exp(x) q̄ - Ĝ_q₀ᵀ λ,  ū -= Ĝ_uᵀ λ,  p̄ -= Ĝ_pᵀ λ
//       (x_p = h v₀, v = x/h)
// One environment after the other, in dual numbers.
#include "engine/derivative/dual_stage.hpp"
#include "engine/derivative/group_adjoint.hpp"
#include "engine/step/scheme_stage.hpp"
#include "kernels/numbers/rotation_vector.hpp"

namespace tangere {

using kernels::Mat3;
using kernels::Row;
using kernels::Vec3;
using D = DualNumber;

namespace {

/// What value - tangent leaves.
double hatted(const D& a) { return a.value - a.epsilon; }

template <class N>
Vec3<N> three(const std::vector<N>& a, int i) {
  const auto k = std::size_t(i);
  return {a[k], a[k + 1], a[k + 2]};
}

/// exp(x) J⁻ᵀ (Aᵀ λ - V_xᵀ Cᵀ λ) of a spherical joint, by the tangent of q₀.
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

/// Cotangents of the predictor's neighbours for one lane; λ stands in a.lambda.
template <int L>
void GroupAdjoint::hand_on_linear(const StageInHand<L>& in, const LossRows<L>& o,
                                  const std::vector<double>& x, double h, int lane) const {
  AdjointWorkspace<L>& a = in.a;
  BasicWorkspace<L>& w = in.w;
  DualStage& dual = *a.dual;
  const int n = model_.nv;
  std::vector<double> lambda(static_cast<std::size_t>(n)), x_bar(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    const auto k = std::size_t(i);
    lambda[k] = a.lambda[i][lane], x_bar[k] = a.rhs[i][lane];
    const double predicted = h * w.v0[i][lane];
    dual.x[k] = D(predicted, predicted - x[k]);
    dual.r[k] = D(0.0), dual.s[k] = D(-w.v0[i][lane]);
    dual.tau[k] = D(w.stage.tau[i][lane]), dual.target[k] = D(w.stage.target[i][lane]);
  }
  for (int i = 0; i < model_.nq; ++i) dual.centre[std::size_t(i)] = D(w.q0[i][lane]);
  dual.c0_over_h = dual.inverse_h = 1 / h;
  dual.set_numbers(w.stage.block + lane);
  std::vector<D> A, c_lambda, m_lambda, targets, a_lambda(static_cast<std::size_t>(n), D(0.0));
  dual.jacobian(A);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      a_lambda[std::size_t(j)] += A[std::size_t(i * n + j)] * D(lambda[std::size_t(i)]);
  std::vector<D> numbers;
  if (o.parameters != nullptr)
    numbers.assign(std::size_t(kernels::parameter_numbers(model_.view)), D(0.0));
  dual.products(lambda, c_lambda, m_lambda, targets, o.parameters == nullptr ? nullptr : &numbers);
  for (int i = 0; i < n; ++i) {
    const auto k = std::size_t(i);
    o.v_centre[i][lane] += h * (x_bar[k] - hatted(a_lambda[k])) + hatted(m_lambda[k]) / h;
    o.tau[i][lane] += lambda[k];
    o.target[i][lane] += hatted(targets[k]);
  }
  for (const kernels::Link& link : model_.links) {
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

template <int L>
void GroupAdjoint::reverse_linear(const StageInHand<L>& in, const Scheme& scheme, double h) const {
  BasicWorkspace<L>& w = in.w;
  AdjointWorkspace<L>& a = in.a;
  const int n = model_.nv;
  if (a.dual == nullptr) a.dual = std::make_unique<DualStage>(model_);
  state_difference(model_, w.q1, w.q0, a.difference);
  set_stage(model_, scheme, 0, h, w);
  guess_stage(model_, scheme, 0, h, w);
  assemble(in);
  for (const LossRows<L>& o : a.losses) {
    for (const kernels::Link& link : model_.links) {
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
    solve(in);
    std::vector<double> x(static_cast<std::size_t>(n));
    for (int l = 0; l < L; ++l) {
      if (!has(in.lanes, l)) continue;
      for (int i = 0; i < n; ++i) x[std::size_t(i)] = a.difference[i][l];
      hand_on_linear(in, o, x, h, l);
    }
  }
}

template void GroupAdjoint::reverse_linear(const StageInHand<kernels::kGroup>&, const Scheme&,
                                           double) const;
template void GroupAdjoint::reverse_linear(const StageInHand<1>&, const Scheme&, double) const;

}  // namespace tangere
