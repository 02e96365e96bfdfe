// SPDX-License-Identifier: Apache-2.0
// Newton in lanes. All searching lanes are evaluated together; each lane accepts or halves its own step.
//
// Accepted when a trial x - αΔ passes the natural test ‖D^½ A⁻¹ g(x - αΔ)‖ ≤ (1 - α/4) ‖D^½ Δ‖ with the factor at
// hand (D = diag M at the first point), or when it already converges:
//   ‖D^-½ g‖ ≤ tol (‖D^½ v‖ c₀/h + ‖D^½‖ |gravity| + ‖D^-½ f‖),   f the magnitudes of contact, motor, damping forces
// Both are free of units. The v in the scale is the candidate's own. No residual can be smaller than what one rounding
// of a position does to it, so ‖D^-½ g‖ ≤ ‖D^-½ φ‖ also converges, φ_i = 4 ε |A_ii| (extent of the scene, or 1 rad):
// at contact stiffnesses where that floor lies above the tolerance, Newton would only spin on rounding.
#include "engine/newton.hpp"

#include <cmath>
#include <limits>

#include "engine/detection.hpp"

namespace tangere {

using kernels::kGroup;
using kernels::LaneRow;

namespace {

struct Search {
  const CompiledModel& model;
  const kernels::KernelTable& table;
  Workspace& w;
  const NewtonLimits& limits;
  NewtonReport& report;
  double gravity;
  LaneBits searching;
  LaneBits on_trial = 0;        ///< lanes whose x is a trial along delta
  LaneBits use_pivoted = 0;     ///< lanes whose factor at hand is the pivoted one
  std::array<double, kGroup> alpha{}, delta_norm{};
  std::array<int, kGroup> halvings{}, directions{};

  [[nodiscard]] int n() const { return model.nv; }

  void evaluate() {
    for (;;) {
      table.evaluate(model.view, w.stage);
      LaneBits stale = 0;
      for (int l = 0; l < kGroup; ++l)
        if (has(searching, l) && w.stage.excess[0][l] > 0) stale |= 1U << l;
      if (stale == 0) return;
      find_candidates(model, table, w, stale);  // at the present x, so the next evaluation is exact
    }
  }

  void set_weights(LaneBits lanes) {
    for (int i = 0; i < n(); ++i)
      for (int l = 0; l < kGroup; ++l)
        if (has(lanes, l)) w.weight[i][l] = std::sqrt(w.stage.mass_diagonal[i][l]);
  }

  /// Scaled residual of each lane: ‖D^-½ g‖ over what it is measured by; 0 where it is below the rounding floor.
  void scaled_residuals(std::array<double, kGroup>& out) const {
    std::array<double, kGroup> g{}, motion{}, mass{}, force{}, floor{};
    const kernels::Pattern& p = model.view.pattern;
    for (int i = 0; i < n(); ++i) {
      const LaneRow& diagonal = w.stage.A[p.slot[i * n() + i]];
      const double rounding = 4 * std::numeric_limits<double>::epsilon() * model.unknown_scale[std::size_t(i)];
      for (int l = 0; l < kGroup; ++l) {
        const double d = w.weight[i][l];
        const double r = w.stage.g[i][l] / d, m = d * w.stage.v[i][l], f = w.stage.force_scale[i][l] / d;
        const double e = rounding * diagonal[l] / d;
        g[l] += r * r;
        motion[l] += m * m;
        mass[l] += d * d;
        force[l] += f * f;
        floor[l] += e * e;
      }
    }
    for (int l = 0; l < kGroup; ++l) {
      const double scale = std::sqrt(motion[l]) * w.stage.c0_over_h[l] + gravity * std::sqrt(mass[l]) + std::sqrt(force[l]);
      out[l] = g[l] <= floor[l] ? 0 : std::sqrt(g[l]) / scale;
    }
  }

  void weighted_norms(const LaneRow* a, std::array<double, kGroup>& out) const {
    out.fill(0);
    for (int i = 0; i < n(); ++i)
      for (int l = 0; l < kGroup; ++l) {
        const double x = w.weight[i][l] * a[i][l];
        out[l] += x * x;
      }
    for (double& x : out) x = std::sqrt(x);
  }

  void stop(int l, StepStatus status) {
    report.status[l] = status;
    searching &= ~(1U << l);
    on_trial &= ~(1U << l);
  }

  /// Pivoted solve of one lane, for factors that plain elimination spoiled.
  void pivoted_solve(int l, const LaneRow* b, LaneRow* out) {
    for (int i = 0; i < n(); ++i) w.rhs[i] = b[i][l];
    w.rhs = w.pivoted[l].solve(w.rhs).eval();
    for (int i = 0; i < n(); ++i) out[i][l] = w.rhs[i];
  }
  void pivoted_factor(int l) {
    Eigen::MatrixXd& a = w.dense[0];
    const kernels::Pattern& p = model.view.pattern;
    for (int i = 0; i < n(); ++i)
      for (int j = 0; j < n(); ++j) a(i, j) = p.slot[i * n() + j] < 0 ? 0 : w.stage.A[p.slot[i * n() + j]][l];
    w.pivoted[l].compute(a);
  }

  /// Judges the trials at the present x. Returns the lanes that hold an accepted, unconverged point.
  LaneBits judge() {
    std::array<double, kGroup> residual{}, test_norm{};
    scaled_residuals(residual);
    if (on_trial != 0) {
      table.solve(model.view, w.stage, w.stage.g, w.test);
      for (int l = 0; l < kGroup; ++l)
        if (has(on_trial & use_pivoted, l)) pivoted_solve(l, w.stage.g, w.test);
      weighted_norms(w.test, test_norm);
    }
    LaneBits accepted = 0;
    for (int l = 0; l < kGroup; ++l) {
      if (!has(searching, l)) continue;
      ++report.iterations[l];
      if (residual[l] <= limits.tolerance) {
        report.residual[l] = residual[l];
        stop(l, StepStatus::converged);
      } else if (!has(on_trial, l)) {
        if (std::isfinite(residual[l])) {
          accepted |= 1U << l;
        } else {
          stop(l, StepStatus::non_finite);
        }
      } else if (test_norm[l] <= (1 - 0.25 * alpha[l]) * delta_norm[l]) {
        accepted |= 1U << l;
        report.residual[l] = residual[l];
      } else if (++halvings[l] > limits.max_halvings) {
        stop(l, StepStatus::not_converged);
      } else {
        alpha[l] *= 0.5;
        for (int i = 0; i < n(); ++i) w.stage.x[i][l] = w.base[i][l] - alpha[l] * w.delta[i][l];
      }
    }
    return accepted;
  }

  /// New directions at the accepted points, and the full step along each as the next trial.
  void new_directions(LaneBits accepted) {
    LaneRow accept;
    for (int l = 0; l < kGroup; ++l) accept[l] = has(accepted, l) ? 1 : 0;
    table.factor(model.view, w.stage, accept);
    table.solve_watched(model.view, w.stage, w.stage.g, w.test, &w.sound);
    for (int l = 0; l < kGroup; ++l) {
      if (!has(accepted, l)) continue;
      use_pivoted &= ~(1U << l);
      if (w.sound[l] > 0) continue;
      use_pivoted |= 1U << l;
      pivoted_factor(l);
      pivoted_solve(l, w.stage.g, w.test);
    }
    std::array<double, kGroup> norm{};
    weighted_norms(w.test, norm);
    for (int l = 0; l < kGroup; ++l) {
      if (!has(accepted, l)) continue;
      if (!std::isfinite(norm[l])) {
        stop(l, StepStatus::singular);
        continue;
      }
      if (++directions[l] > limits.max_iterations) {
        stop(l, StepStatus::not_converged);
        continue;
      }
      delta_norm[l] = norm[l];
      alpha[l] = 1;
      halvings[l] = 0;
      on_trial |= 1U << l;
      for (int i = 0; i < n(); ++i) {
        w.base[i][l] = w.stage.x[i][l];
        w.delta[i][l] = w.test[i][l];
        w.stage.x[i][l] -= w.test[i][l];
      }
    }
  }
};

double magnitude(const kernels::Vec3<double>& a) { return std::sqrt(dot(a, a)); }

}  // namespace

LaneBits solve_stage(const CompiledModel& model, const kernels::KernelTable& table, Workspace& w, LaneBits lanes,
                     const NewtonLimits& limits, NewtonReport& report) {
  Search s{model, table, w, limits, report, magnitude(model.view.gravity), lanes};
  find_candidates(model, table, w, lanes);
  bool first = true;
  while (s.searching != 0) {
    s.evaluate();
    if (first) s.set_weights(lanes);
    first = false;
    const LaneBits accepted = s.judge();
    if (accepted != 0) s.new_directions(accepted);
  }
  LaneBits converged = 0;
  for (int l = 0; l < kGroup; ++l)
    if (has(lanes, l) && report.status[l] == StepStatus::converged) converged |= 1U << l;
  return converged;
}

LaneBits linear_step(const CompiledModel& model, const kernels::KernelTable& table, Workspace& w, LaneBits lanes,
                     NewtonReport& report) {
  static constexpr NewtonLimits kOnce{0, 1, 0};
  Search s{model, table, w, kOnce, report, magnitude(model.view.gravity), lanes};
  find_candidates(model, table, w, lanes);
  s.evaluate();
  s.set_weights(lanes);
  std::array<double, kGroup> residual{};
  s.scaled_residuals(residual);
  for (int l = 0; l < kGroup; ++l) {
    if (!has(lanes, l)) continue;
    ++report.iterations[l];
    report.residual[l] = residual[l];
    if (!std::isfinite(residual[l])) s.stop(l, StepStatus::non_finite);
  }
  s.new_directions(s.searching);
  for (int l = 0; l < kGroup; ++l)
    if (has(s.searching, l)) report.status[l] = StepStatus::converged;
  return s.searching;
}

}  // namespace tangere
