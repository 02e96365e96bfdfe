// SPDX-License-Identifier: Apache-2.0
// One lane in doubles: bodies that turn so fast are few. Masses below a ball joint are left out,
// and so is the turning of what it hangs on.
#include "engine/step/rotation_defect.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/step/state_difference.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

using kernels::JointKind;
using kernels::kGroup;
using kernels::Link;
using kernels::Mat3;
using kernels::Row;
using kernels::Vec3;

namespace {

/// Turns of a step that are shorter are left to the scheme [rad].
double far_turn(const Scheme& scheme) { return scheme.order > 1 ? 0.1 : 0.02; }
/// The momentum by which a step may be off: a share of the body's per radian, and a share of what
/// its torque made. A ball that friction turns keeps no momentum of its own.
constexpr double kPerRadian = 3e-5, kOfTorque = 5e-3;

template <int L>
Vec3<double> column(const Row<L>* rows, int lane) {
  return {rows[0][lane], rows[1][lane], rows[2][lane]};
}

template <int L>
double fastest(const Link& link, const BasicWorkspace<L>& w, int lane) {
  const Vec3<double> before = column(w.v0 + link.v, lane), after = column(w.v1 + link.v, lane);
  return std::max(dot(before, before), dot(after, after));
}

/// Inertia of a link about the point around which it turns: its centre of mass where it is free,
/// else its joint.
template <int L>
Mat3<double> inertia_of(const CompiledModel& m, const Link& link, const BasicWorkspace<L>& w,
                        int lane) {
  const double* block =
      w.stage.block == nullptr ? nullptr : w.stage.block + w.stage.group * kGroup + lane;
  const auto [mass, c, J] = kernels::load_inertia<double>(link, block, 0);
  const bool free = link.parent >= 0 && !m.links[std::size_t(link.parent)].has_mass &&
                    m.links[std::size_t(link.parent)].kind == JointKind::translational;
  if (!free || !(mass > 0)) return J;
  Mat3<double> about = J;
  const double a[3] = {c.x, c.y, c.z}, square = dot(c, c);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) about.m[i][k] -= ((i == k ? square : 0) - a[i] * a[k]) / mass;
  return about;
}

/// The momentum of one body through the stages of a step, in its axes at the start.
template <int L>
struct TurningBody {
  const Scheme& scheme;
  const BasicWorkspace<L>& w;
  const Link& link;
  Mat3<double> J;
  double h;
  int lane, nv;

  /// Returns rotation vector and angular velocity at the end of stage k.
  [[nodiscard]] std::array<Vec3<double>, 2> stage(int k) const {
    if (k == scheme.inner_stages())
      return {column(w.stage.x + link.v, lane), column(w.v1 + link.v, lane)};
    return {column(w.x_inner + k * nv + link.v, lane), column(w.v_inner + k * nv + link.v, lane)};
  }

  [[nodiscard]] Vec3<double> before() const {
    const auto turn =
        rotation_log(conjugate(quat_at(w.q0 + link.q, lane)) * quat_at(w.q_before + link.q, lane));
    return turned(turn, J * column(w.v_before + link.v, lane));
  }

  static Vec3<double> turned(const Vec3<double>& x, const Vec3<double>& a) {
    return to_matrix(kernels::quaternion_exp(x)) * a;
  }

  /// Whether the momentum that the step made from nothing is too much, where the body turned by
  /// `turn` [rad].
  [[nodiscard]] bool is_off(double turn) const {
    const Vec3<double> w0 = column(w.v0 + link.v, lane), P0 = J * w0;
    std::array<Vec3<double>, kMostStages> rate{}, off{};  // ω - ω₀, and the momentum too much
    std::array<Vec3<double>, kMostStages> gained{};       // P - P₀
    double most = dot(P0, P0), pushed = 0;  // squares of momentum and of the torque's part in it
    for (int k = 0; k <= scheme.inner_stages(); ++k) {
      const SchemeStage& of = scheme.stages[std::size_t(k)];
      const auto [x, omega] = stage(k);
      const std::size_t at = std::size_t(k);
      const Vec3<double> momentum = J * omega;
      most = std::max(most, dot(momentum, momentum));
      rate[at] = omega - w0;
      gained[at] = turned(x, momentum) - P0;
      Vec3<double> a = of.c0 * rate[at], change = of.c0 * gained[at], owed = {0, 0, 0};
      const double by = 1 / of.s_divisor;
      if (of.s_before != 0) {
        a = a + (by * of.s_before) * (column(w.v_before + link.v, lane) - w0);
        change = change + (by * of.s_before) * (before() - P0);
      }
      for (std::size_t j = 0; j < at; ++j) {
        a = a + (by * of.inner[j].s) * rate[j];
        change = change + (by * of.inner[j].s) * gained[j];
        owed = owed + (by * of.inner[j].s) * off[j];
      }
      const Vec3<double> torque = J * a + h * cross(omega, momentum);
      pushed = std::max(pushed, dot(torque, torque));
      off[at] = (1 / of.c0) * (change - turned(x, torque) - owed);
    }
    const Vec3<double>& last = off[std::size_t(scheme.inner_stages())];
    const double made = dot(last, last);
    return made > kPerRadian * kPerRadian * turn * turn * most &&
           made > kOfTorque * kOfTorque * pushed;
  }
};

/// Whether some ball joint of one lane is off after a step of length h.
template <int L>
bool is_over_rotated(const CompiledModel& model, const Scheme& scheme, const BasicWorkspace<L>& w,
                     double h, int lane) {
  return std::ranges::any_of(model.links, [&](const Link& link) {
    if (link.kind != JointKind::spherical || !link.has_mass) return false;
    const double turn = std::sqrt(fastest(link, w, lane)) * h;
    if (!(turn > far_turn(scheme))) return false;
    return TurningBody<L>{scheme, w, link, inertia_of(model, link, w, lane), h, lane, model.nv}
        .is_off(turn);
  });
}

}  // namespace

template <int L>
LaneBits over_rotated(const CompiledModel& model, const Scheme& scheme, const BasicWorkspace<L>& w,
                      LaneBits lanes, const Row<L>& h) {
  Row<L> most{};  // squares of rates at the end: a step from fast to slow turning began as an end
  for (const Link& link : model.links) {
    if (link.kind != JointKind::spherical || !link.has_mass) continue;
    const Row<L>* v = w.v1 + link.v;
    for (int l = 0; l < L; ++l) {
      const double square = v[0][l] * v[0][l] + v[1][l] * v[1][l] + v[2][l] * v[2][l];
      most[l] = square > most[l] ? square : most[l];
    }
  }
  LaneBits found = 0;
  for (int l = 0; l < L; ++l) {
    const double far = far_turn(scheme) / h[l];
    if (has(lanes, l) && most[l] > far * far && is_over_rotated(model, scheme, w, h[l], l))
      found |= 1U << l;
  }
  return found;
}

template LaneBits over_rotated(const CompiledModel&, const Scheme&, const Workspace&, LaneBits,
                               const Row<kGroup>&);
template LaneBits over_rotated(const CompiledModel&, const Scheme&, const SingleWorkspace&,
                               LaneBits, const Row<1>&);

}  // namespace tangere
