// SPDX-License-Identifier: Apache-2.0
// Differentiates every solve of a step by the implicit function theorem: A ẋ = -ġ. The columns of A
// also come from dual numbers.
#include "engine/derivative/tangent.hpp"

#include <Eigen/LU>
#include <algorithm>

#include "engine/derivative/dual_stage.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "engine/sense/imperfect_field.hpp"
#include "engine/sense/past_states.hpp"
#include "engine/step/group_step.hpp"
#include "engine/step/motor_force.hpp"
#include "engine/step/rotation_log.hpp"
#include "engine/step/step_settings.hpp"
#include "kernels/numbers/rotation_vector.hpp"

namespace tangere {

using kernels::JointKind;
using kernels::kBlock;
using kernels::Link;
using kernels::Quat;
using kernels::Vec3;
using D = DualNumber;
using Duals = std::vector<D>;

namespace {

struct DualState {
  Duals q, v;
};

Quat<D> quat_at(const Duals& q, int i) {
  const auto k = std::size_t(i);
  return {q[k], q[k + 1], q[k + 2], q[k + 3]};
}
Vec3<D> vec_at(const Duals& x, int i) {
  const auto k = std::size_t(i);
  return {x[k], x[k + 1], x[k + 2]};
}
void put(Duals& to, int i, const Vec3<D>& x) {
  const auto k = std::size_t(i);
  to[k] = x.x, to[k + 1] = x.y, to[k + 2] = x.z;
}
D scaled(double a, const D& x) { return {a * x.value, a * x.epsilon}; }

/// Returns q with its tangent along the dofs of v.
Duals with_tangent(const CompiledModel& m, const double* q, int stride,
                   const std::vector<double>& dot) {
  Duals out(std::size_t(m.nq));
  for (int i = 0; i < m.nq; ++i) out[std::size_t(i)] = D(q[i * stride]);
  for (const Link& link : m.links) {
    const auto v = std::size_t(link.v);
    if (link.kind != JointKind::spherical) {
      for (int k = 0; k < kernels::dofs(link.kind); ++k)
        out[std::size_t(link.q + k)].epsilon = dot[v + std::size_t(k)];
      continue;
    }
    const double* a = q + link.q * stride;  // q̇ = q ⊗ (0, θ)/2
    const Quat<double> rate = Quat<double>{a[0], a[stride], a[2 * stride], a[3 * stride]} *
                              Quat<double>{0, 0.5 * dot[v], 0.5 * dot[v + 1], 0.5 * dot[v + 2]};
    const double e[4] = {rate.w, rate.x, rate.y, rate.z};
    for (int k = 0; k < 4; ++k) out[std::size_t(link.q + k)].epsilon = e[k];
  }
  return out;
}

Duals with_tangent(const double* x, int stride, const std::vector<double>& dot) {
  Duals out(dot.size());
  for (std::size_t i = 0; i < dot.size(); ++i) out[i] = D(x[i * std::size_t(stride)], dot[i]);
  return out;
}

/// Returns the tangents of q along the dofs of v.
std::vector<double> tangent_of(const CompiledModel& m, const Duals& q) {
  std::vector<double> out(static_cast<std::size_t>(m.nv));
  for (const Link& link : m.links) {
    const auto v = std::size_t(link.v);
    if (link.kind != JointKind::spherical) {
      for (int k = 0; k < kernels::dofs(link.kind); ++k)
        out[v + std::size_t(k)] = q[std::size_t(link.q + k)].epsilon;
      continue;
    }
    const Quat<D> a = quat_at(q, link.q);  // θ = 2 q̄ ⊗ q̇
    const Quat<double> turn = Quat<double>{a.w.value, -a.x.value, -a.y.value, -a.z.value} *
                              Quat<double>{a.w.epsilon, a.x.epsilon, a.y.epsilon, a.z.epsilon};
    out[v] = 2 * turn.x, out[v + 1] = 2 * turn.y, out[v + 2] = 2 * turn.z;
  }
  return out;
}

/// Returns to ⊖ from.
Duals difference(const CompiledModel& m, const Duals& to, const Duals& from) {
  Duals out(std::size_t(m.nv));
  for (const Link& link : m.links) {
    if (link.kind == JointKind::spherical) {
      put(out, link.v,
          kernels::rotation_vector<false>(conjugate(quat_at(from, link.q)) * quat_at(to, link.q))
              .phi);
    } else {
      for (int k = 0; k < kernels::dofs(link.kind); ++k)
        out[std::size_t(link.v + k)] = to[std::size_t(link.q + k)] - from[std::size_t(link.q + k)];
    }
  }
  return out;
}

/// Returns from ⊕ x.
Duals moved(const CompiledModel& m, const Duals& from, const Duals& x) {
  Duals out(from.size());
  for (const Link& link : m.links) {
    const auto q = std::size_t(link.q);
    if (link.kind == JointKind::spherical) {
      const Quat<D> r = quat_at(from, link.q) * kernels::quaternion_exp(vec_at(x, link.v));
      out[q] = r.w, out[q + 1] = r.x, out[q + 2] = r.y, out[q + 3] = r.z;
    } else {
      for (int k = 0; k < kernels::dofs(link.kind); ++k)
        out[q + std::size_t(k)] = from[q + std::size_t(k)] + x[std::size_t(link.v + k)];
    }
  }
  return out;
}

}  // namespace

struct Tangent::Impl {
  Model model;
  StepSettings settings;
  DualStage stage;
  ImperfectField imperfections;

  Impl(const Model& m, const StepSettings& s)
      : model(m), settings(s), stage(compiled(model)), imperfections(m) {}
  [[nodiscard]] const CompiledModel& m() const { return compiled(model); }

  /// Turns Gᵀ A, whose rows of followers are 0, into Gᵀ A G with ones on their diagonal. Columns of
  /// leaders by a polynomial are whole already, because the stage sets their followers' x.
  void fold_followers(Eigen::MatrixXd& A) const {
    for (const kernels::FollowerTie& t : m().ties) A.col(t.leader_v) += t.ratio * A.col(t.v);
    for (const kernels::Follower& f : m().followers) {
      A.col(f.v).setZero();
      A(f.v, f.v) = 1;
    }
    for (const kernels::PolynomialFollower& f : m().polynomials) A(f.v, f.v) = 1;
    for (const kernels::Transmission& t : m().transmissions) A(t.v, t.v) = 1;
  }

  /// Computes the tangent of x with g(x) = 0 at the value of x. Leaves the v of that x in the
  /// stage.
  Duals solve(const std::vector<double>& x) {
    const std::size_t n = x.size();
    const auto size = static_cast<Eigen::Index>(n);
    for (std::size_t i = 0; i < n; ++i) stage.x[i] = D(x[i]);
    stage.residual();
    Eigen::VectorXd rhs(size);
    for (std::size_t i = 0; i < n; ++i) rhs[Eigen::Index(i)] = -stage.g[i].epsilon;
    Eigen::MatrixXd A(size, size);
    DualStage& s = stage;
    const Duals centre = s.centre, r = s.r, acceleration = s.s, tau = s.tau, target = s.target;
    for (Duals* inputs : {&s.centre, &s.r, &s.s, &s.tau, &s.target})
      for (D& a : *inputs) a.epsilon = 0;
    s.freeze_numbers(true);
    for (std::size_t j = 0; j < n; ++j) {
      s.x[j].epsilon = 1;
      s.residual();
      s.x[j].epsilon = 0;
      for (std::size_t i = 0; i < n; ++i) A(Eigen::Index(i), Eigen::Index(j)) = s.g[i].epsilon;
    }
    s.freeze_numbers(false);
    fold_followers(A);
    s.centre = centre, s.r = r, s.s = acceleration, s.tau = tau, s.target = target;
    const Eigen::VectorXd dot = A.partialPivLu().solve(rhs);
    for (std::size_t i = 0; i < n; ++i) s.x[i].epsilon = dot[Eigen::Index(i)];
    for (const kernels::FollowerTie& t : m().ties)  // dot of a follower is 0
      s.x[std::size_t(t.v)].epsilon += t.ratio * s.x[std::size_t(t.leader_v)].epsilon;
    s.rates();
    return s.x;
  }

  std::vector<double> chart(const Duals& from, const double* q1, int stride) const {
    std::vector<double> x(static_cast<std::size_t>(m().nv));
    for (const Link& link : m().links) {
      const auto v = std::size_t(link.v), q = std::size_t(link.q);
      const double* to = q1 + link.q * stride;
      if (link.kind == JointKind::spherical) {
        const Quat<double> c = {from[q].value, from[q + 1].value, from[q + 2].value,
                                from[q + 3].value};
        const Vec3<double> turn = rotation_log(
            conjugate(c) * Quat<double>{to[0], to[stride], to[2 * stride], to[3 * stride]});
        x[v] = turn.x, x[v + 1] = turn.y, x[v + 2] = turn.z;
      } else {
        for (std::size_t k = 0; k < std::size_t(kernels::dofs(link.kind)); ++k)
          x[v + k] = to[k * std::size_t(stride)] - from[q + k].value;
      }
    }
    return x;
  }

  /// Sets r and s of a stage from the states and the earlier stages that it depends on.
  void set_history(const SchemeStage& row, const DualState& at, const DualState& before,
                   const std::vector<DualState>& inner) {
    const Duals way = row.r_before == 0 ? Duals() : difference(m(), before.q, at.q);
    for (std::size_t i = 0; i < at.v.size(); ++i) {
      D x_sum = way.empty() ? D(0.0) : scaled(row.r_before, way[i]);
      D v_sum = scaled(row.s_centre, at.v[i]);
      if (row.s_before != 0) v_sum += scaled(row.s_before, before.v[i]);
      for (std::size_t j = 0; j < inner.size(); ++j) {
        x_sum += scaled(row.inner[j].r, inner[j].q[i]);
        v_sum += scaled(row.inner[j].s, inner[j].v[i] - at.v[i]);
      }
      stage.r[i] = x_sum;
      stage.s[i] = scaled(1 / row.s_divisor, v_sum);
    }
  }

  /// Differentiates one solve of `scheme` from `at`. `before`: the state one step earlier. q1: the
  /// solve's result. x_inner: its inner stages, `stride` apart.
  DualState solve_step(const Scheme& scheme, double h, const DualState& at, const DualState& before,
                       const double* q1, const double* x_inner, int stride) {
    stage.centre = at.q;
    stage.inverse_h = 1 / h;
    stage.choose_faces();
    stage.recall();
    std::vector<DualState> found;  // (x, v) of the stages so far
    for (const SchemeStage& row : scheme.stages) {
      stage.c0_over_h = row.c0 / h;
      set_history(row, at, before, found);
      const bool last = found.size() + 1 == scheme.stages.size();
      std::vector<double> x = last ? chart(at.q, q1, stride) : std::vector<double>(at.v.size());
      if (!last)
        for (double& component : x) component = *x_inner, x_inner += stride;
      Duals changing = solve(x);
      found.push_back({std::move(changing), stage.v});
    }
    DualState end = {moved(m(), at.q, found.back().q), found.back().v};
    stage.advance(end.q, end.v);
    return end;
  }

  /// Sets the shear state and its tangents: three numbers for each entry; empty: zeros.
  void set_memory(std::span<const ShearEntry> memory, const std::vector<double>& dot) {
    std::fill(stage.s_start.begin(), stage.s_start.end(), D(0.0));
    for (std::size_t k = 0; k < memory.size(); ++k)
      for (std::size_t c = 0; c < 3; ++c)
        stage.s_start[3 * std::size_t(memory[k].point) + c] =
            D(memory[k].s[c], dot.empty() ? 0 : dot[3 * k + c]);
  }

  /// The tangent of an earlier state. States before the first one are constants.
  [[nodiscard]] StateTangent past_of(const StateTangent& now, std::int64_t ago) const {
    if (ago == 0) return now;
    const auto nv = std::ptrdiff_t(m().nv);
    std::vector<double> then(2 * std::size_t(nv));
    if (std::size_t(ago) <= now.past.size()) then = now.past[std::size_t(ago) - 1];
    return {{then.begin(), then.begin() + nv}, {then.begin() + nv, then.end()}, {}, {}};
  }

  /// Places the stage at a state of the tape.
  void stand(const double* row, const StateTangent& state) {
    stage.centre = with_tangent(m(), row, kBlock, state.q);
    const Duals v = with_tangent(row + m().nq * kBlock, kBlock, state.v);
    for (std::size_t k = 0; k < v.size(); ++k) stage.x[k] = stage.s[k] = D(0.0), stage.r[k] = v[k];
    stage.c0_over_h = 0;
    stage.inverse_h = 1;
  }

  /// Returns the tangents of the shear state.
  [[nodiscard]] std::vector<double> memory_dot(std::span<const ShearEntry> memory) const {
    std::vector<double> out;
    for (const ShearEntry& e : memory)
      for (std::size_t c = 0; c < 3; ++c)
        out.push_back(stage.s_start[3 * std::size_t(e.point) + c].epsilon);
    return out;
  }

  /// Sets the motors as set_motors() does.
  void set_motors(const DualState& at, std::span<const double> u, std::span<const double> u_dot,
                  std::span<const double> numbers_dot, const double* column) {
    for (std::size_t i = 0; i < stage.tau.size(); ++i) stage.tau[i] = stage.target[i] = D(0.0);
    for (std::size_t k = 0; k < std::size_t(m().nu); ++k) {
      const CompiledMotor& motor = m().motors[k];
      const auto dof = std::size_t(motor.dof);
      const auto clipped = [&](const D& force) {
        return force.value < motor.low    ? D(motor.low)
               : force.value > motor.high ? D(motor.high)
                                          : force;
      };
      if (motor.at_end) {
        stage.target[dof] = input_of(motor, u[k], u_dot[k]);
        continue;
      }
      if (motor.control == MotorControl::force) {
        const double half = 0.5 * (motor.high - motor.low);
        stage.tau[dof] += motor.maps ? clipped(input_of(motor, u[k], u_dot[k]))
                                     : D(motor.low + (std::clamp(u[k], -1.0, 1.0) + 1) * half,
                                         std::abs(u[k]) <= 1 ? half * u_dot[k] : 0);
        continue;
      }
      const auto gain = [&](const kernels::Parameter& p, kernels::DofNumber which) {
        const double value = p.row < 0 ? p.value : column[p.row * kBlock];
        const int row = m().view.rows.dof(motor.dof, which);
        return D(value, numbers_dot.empty() ? 0 : numbers_dot[std::size_t(row)]);
      };
      stage.tau[dof] += clipped(gain(motor.P, kernels::kDofP) * error_of(motor, k, at, u, u_dot) -
                                gain(motor.D, kernels::kDofD) * at.v[dof]);
    }
  }

  static D input_of(const CompiledMotor& motor, double u, double u_dot) {
    return D(motor_input(motor, u), motor_input_slope(motor, u) * u_dot);
  }
  [[nodiscard]] D error_of(const CompiledMotor& motor, std::size_t k, const DualState& at,
                           std::span<const double> u, std::span<const double> u_dot) const {
    const Link& link = m().links[std::size_t(motor.link)];
    if (link.kind != JointKind::spherical)
      return input_of(motor, u[k], u_dot[k]) - at.q[std::size_t(link.q + motor.component)];
    const auto input = [&](int i) {
      const std::size_t at_u = k - std::size_t(motor.component) + std::size_t(i);
      return input_of(motor, u[at_u], u_dot[at_u]);
    };
    const Vec3<D> goal = {input(0), input(1), input(2)};
    const Vec3<D> way = kernels::rotation_vector<false>(conjugate(quat_at(at.q, link.q)) *
                                                        kernels::quaternion_exp(goal))
                            .phi;
    return motor.component == 0 ? way.x : motor.component == 1 ? way.y : way.z;
  }
};

Tangent::Tangent(const Model& model, const StepperOptions& options)
    : impl_(std::make_unique<Impl>(model, step_settings(model, options))) {
  refuse_sleep(model, impl_->settings);
}
Tangent::~Tangent() = default;

void Tangent::step(const Batch& batch, int block, int lane, const BlockTape& tape,
                   std::int64_t step, std::span<const double> u, std::span<const double> u_dot,
                   std::span<const double> numbers_dot, StateTangent& state,
                   std::span<const std::vector<double>> points_dot) {
  Impl& i = *impl_;
  const CompiledModel& m = i.m();
  const auto rows = [&](std::int64_t t) { return tape.state(t) + lane; };
  const auto dual = [&](std::int64_t t, const std::vector<double>& q,
                        const std::vector<double>& v) {
    return DualState{with_tangent(m, rows(t), kBlock, q),
                     with_tangent(rows(t) + m.nq * kBlock, kBlock, v)};
  };
  const DualState start = dual(step, state.q, state.v),
                  before = dual(step - 1, state.previous_q, state.previous_v);
  const double* column = batch.block(block) + lane;
  i.stage.set_numbers(column, numbers_dot);
  for (std::size_t s = 0; s < m.sensors.size(); ++s)
    i.stage.set_points(static_cast<int>(s),
                       points_dot.empty() ? std::span<const double>() : points_dot[s]);
  i.set_motors(start, u, u_dot, numbers_dot, column);
  i.set_memory(tape.memory(step, lane), state.shear);
  DualState end = start;
  if (const TapedStep* special = tape.special(step, lane); special != nullptr) {
    for (const TapedSolve& s : special->solves)
      end = i.solve_step(s.integrator.scheme(), s.h, end, before, s.q.data(), s.inner.data(), 1);
  } else {
    end = i.solve_step(i.settings.integrator.scheme(), i.settings.timestep, start, before,
                       rows(step + 1), tape.inner(step) + lane, kBlock);
  }
  if (m.kept_points > 0 && tape.took(step, lane))
    i.stage.update_sensor_shear_state(end.q, end.v, tape.episode_step(step + 1, lane));
  state.shear = i.memory_dot(tape.memory(step + 1, lane));
  if (const auto past = std::size_t(m.layout.past_states); past > 0) {
    std::vector<double> earlier = state.q;
    earlier.insert(earlier.end(), state.v.begin(), state.v.end());
    state.past.insert(state.past.begin(), std::move(earlier));
    if (state.past.size() > past) state.past.pop_back();
  }
  state.previous_q = std::move(state.q);
  state.previous_v = std::move(state.v);
  state.q = tangent_of(m, end.q);
  state.v.resize(end.v.size());
  for (std::size_t k = 0; k < end.v.size(); ++k) state.v[k] = end.v[k].epsilon;
}

void Tangent::field(const Batch& batch, int block, int lane, const BlockTape& tape,
                    std::int64_t step, int sensor, std::span<const double> numbers_dot,
                    std::span<const double> points_dot, const StateTangent& state,
                    std::span<double> field_dot) {
  Impl& i = *impl_;
  const CompiledSensor& s = i.m().sensors[std::size_t(sensor)];
  std::vector<double> field(s.imperfect ? field_dot.size() : 0);
  const double* const column = batch.block(block) + lane;
  i.stage.set_numbers(column, numbers_dot);
  const auto read = [&](const double* row, const StateTangent& at, std::span<double> ideal,
                        std::span<double> dot) {
    i.stand(row, at);
    i.stage.field(sensor, column, numbers_dot, points_dot, ideal, dot);
  };
  if (s.past_states() == 0) {
    i.set_memory(tape.memory(step, lane), state.shear);
    read(tape.state(step) + lane, state, field, field_dot);
  } else {
    std::fill(field_dot.begin(), field_dot.end(), 0.0);
    std::vector<double> ideal(field.size()), dot(field.size());
    PastStates past(i.model);
    const int environment = block * kBlock + lane;
    for (std::size_t k = 0; k < s.weights.size(); ++k) {
      const int ago = s.delay + static_cast<int>(k);
      past.recall(batch, environment, ago, 1);
      read(past.lanes().block(0) + i.m().layout.q * kBlock,
           i.past_of(state, std::min<std::int64_t>(ago, batch.steps(environment))), ideal, dot);
      for (std::size_t n = 0; n < field.size(); ++n) {
        field[n] += s.weights[k] * ideal[n];
        field_dot[n] += s.weights[k] * dot[n];
      }
    }
  }
  const ReadingKey key = {batch.seed(), batch.episode(block * kBlock + lane),
                          tape.episode_step(step, lane)};
  i.imperfections.push_forward(s, key, field, field_dot);
}

void Tangent::end_effectors(const Batch& batch, int block, int lane, const BlockTape& tape,
                            std::int64_t step, std::span<const double> numbers_dot,
                            const StateTangent& state, std::span<double> change) {
  Impl& i = *impl_;
  i.stand(tape.state(step) + lane, state);
  i.stage.set_numbers(batch.block(block) + lane, numbers_dot);
  i.stage.rates();
  double* to = change.data();
  for (const CompiledEndEffector& of : i.m().end_effectors) {
    const Vec3<D> x = i.stage.in_world(of.link, of.point);
    *to++ = x.x.epsilon, *to++ = x.y.epsilon, *to++ = x.z.epsilon;
  }
}

}  // namespace tangere
