// SPDX-License-Identifier: Apache-2.0
// δq = q ⊗ (0, θ)/2 for quaternions. Other coordinates are dofs.
#include "engine/step/displacement.hpp"

#include "engine/model/compile_followers.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/model/transmission_state.hpp"

namespace tangere {

/// Computes q ⊕ e along one dof.
static void displace_alone(const CompiledModel& m, std::span<double> q, int dof, double e) {
  for (const kernels::Link& link : m.links) {
    if (dof < link.v || dof >= link.v + kernels::dofs(link.kind)) continue;
    if (link.kind != kernels::JointKind::spherical) {
      q[std::size_t(link.q + dof - link.v)] += e;
      return;
    }
    kernels::Vec3<double> turn = {0, 0, 0};
    (dof == link.v ? turn.x : dof == link.v + 1 ? turn.y : turn.z) = e;
    double* a = &q[std::size_t(link.q)];
    const kernels::Quat<double> r = rotate_by(kernels::Quat<double>{a[0], a[1], a[2], a[3]}, turn);
    a[0] = r.w, a[1] = r.x, a[2] = r.y, a[3] = r.z;
    return;
  }
}

/// Sets the changes of joints that follow others by ratios.
static void complete_ratios(const CompiledModel& m, std::span<double> along) {
  for (const kernels::Follower& f : m.followers) along[std::size_t(f.v)] = 0;
  for (const kernels::FollowerTie& t : m.ties)
    along[std::size_t(t.v)] += t.ratio * along[std::size_t(t.leader_v)];
}

void displace(const Model& model, std::span<double> q, int dof, double e) {
  const CompiledModel& m = compiled(model);
  displace_alone(m, q, dof, e);
  double unused = 0;
  place_followers(
      m, [&](int i) -> double& { return q[std::size_t(i)]; },
      [&](int) -> double& { return unused; });
}

void complete_velocities(const Model& model, std::span<const double> q, std::span<double> v) {
  const CompiledModel& m = compiled(model);
  complete_ratios(m, v);
  for (const kernels::PolynomialFollower& f : m.polynomials)
    v[std::size_t(f.v)] = kernels::polynomial_at(f.coefficients, q[std::size_t(f.leader_q)]).slope *
                          v[std::size_t(f.leader_v)];
}

void complete_changes(const Model& model, const StateAt& at, std::span<const double> numbers_dot,
                      std::span<double> q_dot, std::span<double> v_dot) {
  const CompiledModel& m = compiled(model);
  complete_ratios(m, q_dot);
  complete_ratios(m, v_dot);
  for (const kernels::PolynomialFollower& f : m.polynomials) {
    const auto leader = std::size_t(f.leader_v), own = std::size_t(f.v);
    const auto p = kernels::polynomial_at(f.coefficients, at.q[f.leader_q * at.stride]);
    q_dot[own] = p.slope * q_dot[leader];
    v_dot[own] = p.slope * v_dot[leader] + p.second * at.v[f.leader_v * at.stride] * q_dot[leader];
  }
  if (!m.transmissions.empty())
    TransmissionState(m).complete(at.q, at.v, at.stride, at.column, numbers_dot, q_dot, v_dot);
}

void add_along_dofs(const Model& model, std::span<const double> q, std::span<const double> q_bar,
                    std::span<double> out) {
  for (const kernels::Link& link : compiled(model).links) {
    const double *a = &q[std::size_t(link.q)], *p = &q_bar[std::size_t(link.q)];
    double* to = &out[std::size_t(link.v)];
    if (link.kind != kernels::JointKind::spherical) {
      for (int k = 0; k < kernels::dofs(link.kind); ++k) to[k] += p[k];
      continue;
    }
    to[0] += 0.5 * (-a[1] * p[0] + a[0] * p[1] + a[3] * p[2] - a[2] * p[3]);
    to[1] += 0.5 * (-a[2] * p[0] - a[3] * p[1] + a[0] * p[2] + a[1] * p[3]);
    to[2] += 0.5 * (-a[3] * p[0] + a[2] * p[1] - a[1] * p[2] + a[0] * p[3]);
  }
}

void add_along_coordinates(const Model& model, std::span<const double> q,
                           std::span<const double> dof_bar, std::span<double> out) {
  for (const kernels::Link& link : compiled(model).links) {
    const double *a = &q[std::size_t(link.q)], *w = &dof_bar[std::size_t(link.v)];
    double* to = &out[std::size_t(link.q)];
    if (link.kind != kernels::JointKind::spherical) {
      for (int k = 0; k < kernels::dofs(link.kind); ++k) to[k] += w[k];
      continue;
    }
    to[0] += 2 * (-a[1] * w[0] - a[2] * w[1] - a[3] * w[2]);
    to[1] += 2 * (a[0] * w[0] - a[3] * w[1] + a[2] * w[2]);
    to[2] += 2 * (a[3] * w[0] + a[0] * w[1] - a[1] * w[2]);
    to[3] += 2 * (-a[2] * w[0] + a[1] * w[1] + a[0] * w[2]);
  }
}

}  // namespace tangere
