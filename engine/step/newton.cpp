// SPDX-License-Identifier: Apache-2.0
// Newton in lanes. All searching lanes are evaluated together; each lane accepts or halves its own
// step.
//
// A trial x - αΔ is accepted when one of three tests passes:
//   natural test: ‖D^½ A⁻¹ g(x - αΔ)‖ ≤ (1 - α/4) ‖D^½ Δ‖ with the present factor,
//       D = diag M at the first point
//   residual test: the scaled residual r (kernels/step/norms.hpp) is at most (1 - α/4) of the last
//       point's
//   tolerance test: r is at most the tolerance
// One test alone stalls at first touches. The natural test stalls where a factor from before the
// touch does not describe the forces after it, the residual test where the residual must first
// rise for a long way. The rounding floor in r comes from the last point at which a direction was
// computed.
//
// Where a direction brings no new lowest residual, the search alternates between sticking and
// slipping: the slope of one side leads far into the other. The next directions then take friction
// by its secant, -s v_t with fixed s. That converges slowly from anywhere, so any decrease is
// accepted, and a few such directions reach the side of the root. A lane that finds no new lowest
// residual for `patience` directions gives up.
//
// The natural test already computes A⁻¹ g at the new point. That is the next step if the present
// factor is used again (a chord step). Chord steps leave a fixed share ρ of the residual, about
// twice what the preceding Newton step left of its own, and cost a third of a Newton step. They are
// taken where three of them should meet the tolerance. A chord step that fails the natural test is
// undone, and a Newton step follows.
//
// The stages of a step have the same c₀. A later one takes chord steps by the factor of the stage
// before from its start, under the same condition, with kNextStage times the share.
//
// With NewtonLimits::skip_final_evaluation, a chord step that is predicted to meet the tolerance
// ends the search.
//
// Whether an evaluation includes the Jacobian is a guess that affects cost, never results. g alone
// is evaluated where every lane should be done or take a chord step, and the Jacobian afterwards if
// one was not. The Jacobian of one lane costs its contacts a third of a group's. Where a single
// lane needs one, it therefore also comes after g.
//
// A Jacobian of the group costs as much as six residuals. A lane that turns out to need one after g
// alone therefore stays at its point. The next evaluation includes the Jacobian if another lane
// needs or should need one, too. Else the lane stays there until no other lane searches.
#include "engine/step/newton.hpp"

#include <cmath>
#include <utility>

#include "engine/step/component_norms.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/factors.hpp"
#include "engine/step/layer_sums.hpp"
#include "engine/step/shear_anchors.hpp"

namespace tangere {

template <int L>
void scaled_residual(const CompiledModel& model, const kernels::KernelTable& table,
                     const BasicWorkspace<L>& w, kernels::Row<L>& out) {
  const double gravity = std::sqrt(dot(model.view.gravity, model.view.gravity));
  if (model.components() > 1) return worst_scaled_residuals(model, w, gravity, out);
  table.stage<L>().scaled_residual(model.view, w.stage, gravity, out);
}

namespace {

// Decrease that a trial must bring, per α: for Newton's directions, and for those by the secant, of
// which `kSecants` follow in a row.
constexpr double kDecrease = 0.25, kSecantDecrease = 0.01;
constexpr int kSecants = 3;
/// The factor of the stage before may leave this many times the share that it left there.
constexpr double kNextStage = 4;

template <int L>
struct Search {
  using LaneRow = kernels::Row<L>;
  const CompiledModel& model;
  const kernels::KernelTable& table;
  BasicWorkspace<L>& w;
  const NewtonLimits& limits;
  StageFactors<L>& factors;
  NewtonReport& report;
  LaneBits searching;
  LaneBits on_trial = 0;       ///< lanes whose x is a trial along delta
  LaneBits need_jacobian = 0;  ///< lanes whose x is accepted and that need a Jacobian
  LaneBits spared = 0;         ///< lanes that ended without the last evaluation
  LaneBits unsolved = 0;       ///< lanes in which a layer has no pressures at the present x
  LaneBits secant_lanes = 0;   ///< lanes whose factor takes friction by its secant
  std::array<double, L> alpha{}, delta_norm{};
  std::array<double, L> last{};    ///< scaled residual of the last accepted point
  std::array<double, L> lowest{};  ///< lowest scaled residual of all accepted points
  /// Residual to expect once the next point has had its chord step.
  std::array<double, L> expected{};
  LaneBits chord = 0;         ///< lanes whose trial is a chord step
  LaneBits no_chord = 0;      ///< lanes in which a chord step failed
  bool with_jacobian = true;  ///< whether the last evaluation included it
  std::array<int, L> halvings{}, directions{};
  std::array<int, L> idle{};     ///< directions since the lowest residual
  std::array<int, L> secants{};  ///< directions left that take friction by its secant

  [[nodiscard]] int n() const { return model.nv; }
  [[nodiscard]] const kernels::StageKernels<L>& kernel() const { return table.stage<L>(); }

  /// Returns the lane if there is exactly one in `lanes`, else -1. `lanes` must not be empty.
  static int lone(LaneBits lanes) { return (lanes & (lanes - 1)) == 0 ? __builtin_ctz(lanes) : -1; }

  /// Computes poses at x. Finds candidates for lanes that have no list yet or outran theirs.
  void locate(bool first) {
    kernel().kinematics(model.view, w.stage);
    LaneBits stale = first && !keeps_lists(model) ? searching : searching & ~w.candidates->searched;
    for (int l = 0; l < L; ++l)
      if (has(searching, l) && w.stage.excess[0][l] > 0) stale |= 1U << l;
    if (stale != 0) find_candidates(model, table, w, stale);
    set_list_anchors(model, table, w, searching);
    if constexpr (L > 1)
      if (lone(searching) < 0) lists_to_rows(model, table, w, searching);
  }

  /// Lanes that have a factor of the stage before take chord steps by it from the start.
  void take_over() {
    for (int l = 0; l < L; ++l) {
      const double share = kNextStage * factors.share[l];
      expected[l] = has(factors.lanes, l) ? factors.start[l] * share * share * share : HUGE_VAL;
    }
    alpha.fill(1);
  }

  /// Makes the evaluation that is due: g alone where all lanes but one should be done, else
  /// everything.
  void evaluate(bool first) {
    locate(first);
    LaneBits open = 0;
    for (int l = 0; l < L; ++l)
      if (has(searching, l) && (has(need_jacobian, l) || !(expected[l] <= limits.tolerance)))
        open |= 1U << l;
    with_jacobian = !factors.weighted || !factors.floored ||
                    (open != 0 && (lone(open) < 0 || open == searching));
    unsolved = set_layer_sums(model, table, w, searching, with_jacobian);
    (with_jacobian ? kernel().evaluate : kernel().residual)(model.view, w.stage, lone(searching));
    if (!std::exchange(factors.weighted, true)) kernel().set_weights(model.view, w.stage);
    if (!std::exchange(factors.floored, true)) set_floor(searching);
  }

  void set_floor(LaneBits lanes) {
    if (model.components() > 1) return set_floors(model, w, lanes);
    kernel().set_floor(model.view, w.stage, model.unknown_scale.data(), row_of(lanes));
  }

  static LaneRow row_of(LaneBits lanes) {
    LaneRow row;
    for (int l = 0; l < L; ++l) row[l] = has(lanes, l) ? 1 : 0;
    return row;
  }

  void weighted_norms(const LaneRow* a, LaneRow& out) const {
    kernel().weighted_norm(model.view, w.stage, a, out);
  }

  void stop(int l, StepStatus status) {
    report.status[l] = status;
    searching &= ~(1U << l);
    on_trial &= ~(1U << l);
  }

  /// Tests the trials at the present x. Lanes with an accepted, unconverged point then need a
  /// direction.
  void test_trials() {
    LaneRow residual, test_norm{};
    scaled_residual(model, table, w, residual);
    if ((factors.lanes & searching) != 0) {
      solve(model, table, w, factors.lanes & searching, w.stage.g, w.test);
      for (int l = 0; l < L; ++l)
        if (has(factors.pivoted & searching, l)) solve_pivoted(model, w, l, w.stage.g, w.test);
      weighted_norms(w.test, test_norm);
    }
    for (int l = 0; l < L; ++l) {
      if (!has(searching & ~need_jacobian, l)) continue;
      ++report.iterations[l];
      const double ratio = residual[l] / last[l];
      if (has(on_trial, l) && alpha[l] == 1) factors.share[l] = has(chord, l) ? ratio : 2 * ratio;
      if (residual[l] <= limits.tolerance) {
        report.residual[l] = residual[l];
        stop(l, StepStatus::converged);
      } else if (!has(on_trial, l)) {
        if (!std::isfinite(residual[l])) {
          stop(l, has(unsolved, l) ? StepStatus::unsolved_layer : StepStatus::non_finite);
          continue;
        }
        last[l] = lowest[l] = factors.start[l] = residual[l];
        if (has(factors.lanes, l) && chord_suffices(l, residual[l], kNextStage)) {
          on_trial |= 1U << l;
          take_chord(l, test_norm[l]);
        } else {
          need_jacobian |= 1U << l;
          expected[l] = 0;
        }
      } else if (descends(l, test_norm[l], residual[l])) {
        report.residual[l] = residual[l];
        if (chord_suffices(l, residual[l], 1)) {
          take_chord(l, test_norm[l]);
          if (limits.skip_final_evaluation && residual[l] * factors.share[l] <= limits.tolerance)
            spare(l);
        } else if (stalls(l, residual[l])) {
          stop(l, StepStatus::not_converged);
        } else {
          need_jacobian |= 1U << l;
          const double next = ratio * ratio, share = 2 * next;  // a Newton step squares the ratio
          expected[l] = residual[l] * next * share * share * share;
        }
        last[l] = residual[l];
      } else if (has(chord, l)) {
        take_back(l);
      } else if (++halvings[l] > limits.max_halvings) {
        stop(l, StepStatus::not_converged);
      } else {
        alpha[l] *= 0.5;
        expected[l] = HUGE_VAL;
        for (int i = 0; i < n(); ++i) w.stage.x[i][l] = w.base[i][l] - alpha[l] * w.delta[i][l];
      }
    }
  }

  /// Chord steps need the natural test alone: their contraction rate determines the next step.
  [[nodiscard]] bool descends(int l, double test_norm, double residual) const {
    const double share = 1 - (secants[l] > 0 ? kSecantDecrease : kDecrease) * alpha[l];
    return test_norm <= share * delta_norm[l] || (!has(chord, l) && residual <= share * last[l]);
  }
  /// Chooses how the next direction takes friction. Returns true where the lane should give up.
  [[nodiscard]] bool stalls(int l, double residual) {
    if (residual < lowest[l]) {
      lowest[l] = residual;
      idle[l] = 0;
      if (secants[l] > 0) use_secant(l, secants[l] - 1);
      return false;
    }
    use_secant(l, kSecants);
    return ++idle[l] > limits.patience;
  }
  void use_secant(int l, int directions_left) {
    if ((secants[l] > 0) != (directions_left > 0))
      with_jacobian = false;  // the present one takes friction the other way
    secants[l] = directions_left;
    w.stage.friction_tangent[l] = directions_left > 0 ? 0 : 1;
  }

  /// `caution`: how much more than the last step a chord step may leave.
  [[nodiscard]] bool chord_suffices(int l, double residual, double caution) const {
    const double share = caution * factors.share[l];
    return alpha[l] == 1 && !has(no_chord, l) &&
           residual * share * share * share <= limits.tolerance;
  }
  /// Takes the natural test's vector as the next step.
  void take_chord(int l, double norm) {
    chord |= 1U << l;
    expected[l] = 0;
    delta_norm[l] = norm;
    for (int i = 0; i < n(); ++i) {
      w.base[i][l] = w.stage.x[i][l];
      w.delta[i][l] = w.test[i][l];
      w.stage.x[i][l] -= w.test[i][l];
    }
  }
  /// Ends a lane where the chord step just taken leads.
  void spare(int l) {
    report.residual[l] *= factors.share[l];
    spared |= 1U << l;
    stop(l, StepStatus::converged);
  }
  /// Returns to where the chord step began, for a Newton direction from there.
  void take_back(int l) {
    chord &= ~(1U << l);
    no_chord |= 1U << l;
    on_trial &= ~(1U << l);
    expected[l] = HUGE_VAL;
    for (int i = 0; i < n(); ++i) w.stage.x[i][l] = w.base[i][l];
  }

  /// Computes new directions at the points that need one. The full step along each is the next
  /// trial.
  void new_directions() {
    const LaneBits accepted = std::exchange(need_jacobian, 0);
    if (!with_jacobian) {
      set_layer_sums(model, table, w, accepted, true);
      kernel().evaluate(model.view, w.stage, lone(accepted));
    }
    set_floor(accepted);
    // Lanes that have ended keep their factors for the next stage.
    factor(model, table, w, accepted, factors.lanes);
    solve_watched<false>(model, table, w, accepted, w.stage.g, w.test, w.sound);
    for (int l = 0; l < L; ++l) {
      if (!has(accepted, l)) continue;
      factors.lanes |= 1U << l;
      factors.any |= 1U << l;
      secant_lanes = secants[l] > 0 ? secant_lanes | (1U << l) : secant_lanes & ~(1U << l);
      factors.pivoted &= ~(1U << l);
      if (w.sound[l] > 0) continue;
      factors.pivoted |= 1U << l;
      factor_pivoted(model, w, l, false);
      solve_pivoted(model, w, l, w.stage.g, w.test);
    }
    LaneRow norm;
    weighted_norms(w.test, norm);
    for (int l = 0; l < L; ++l) {
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
      chord &= ~(1U << l);
      for (int i = 0; i < n(); ++i) {
        w.base[i][l] = w.stage.x[i][l];
        w.delta[i][l] = w.test[i][l];
        w.stage.x[i][l] -= w.test[i][l];
      }
    }
  }
};

}  // namespace

template <int L>
LaneBits solve_stage(const CompiledModel& model, const kernels::KernelTable& table,
                     BasicWorkspace<L>& w, LaneBits lanes, const NewtonLimits& limits,
                     StageFactors<L>& factors, NewtonReport& report) {
  Search<L> s{model, table, w, limits, factors, report, lanes};
  s.take_over();
  bool first = true;
  while (s.searching != 0) {
    s.evaluate(first);
    first = false;
    s.test_trials();
    if (s.need_jacobian != 0 && (s.with_jacobian || s.need_jacobian == s.searching))
      s.new_directions();
  }
  if (s.spared != 0) {  // v and candidates where they ended
    s.searching = s.spared;
    s.locate(false);
  }
  s.factors.lanes &= ~s.secant_lanes;
  for (int l = 0; l < L; ++l) w.stage.friction_tangent[l] = 1;
  LaneBits converged = 0;
  for (int l = 0; l < L; ++l)
    if (has(lanes, l) && report.status[l] == StepStatus::converged) converged |= 1U << l;
  return converged;
}

template <int L>
void evaluate_elsewhere(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes, NewtonReport& report) {
  const NewtonLimits unused{};
  StageFactors<L> none;
  Search<L> s{model, table, w, unused, none, report, lanes};
  s.locate(false);
  set_layer_sums(model, table, w, lanes, false);
  s.kernel().residual(model.view, w.stage, s.lone(lanes));
  for (int l = 0; l < L; ++l)
    if (has(lanes, l)) ++report.iterations[l];
}

template <int L>
void solve_by_factor(const CompiledModel& model, const kernels::KernelTable& table,
                     BasicWorkspace<L>& w, const StageFactors<L>& factors, kernels::Row<L>* out) {
  solve(model, table, w, factors.any, w.stage.g, out);
  for (int l = 0; l < L; ++l)
    if (has(factors.pivoted & factors.any, l)) solve_pivoted(model, w, l, w.stage.g, out);
}

#define TANGERE_FOR_LANES(L)                                                          \
  template void evaluate_elsewhere(const CompiledModel&, const kernels::KernelTable&, \
                                   BasicWorkspace<L>&, LaneBits, NewtonReport&);      \
  template void scaled_residual(const CompiledModel&, const kernels::KernelTable&,    \
                                const BasicWorkspace<L>&, kernels::Row<L>&);          \
  template void solve_by_factor(const CompiledModel&, const kernels::KernelTable&,    \
                                BasicWorkspace<L>&, const StageFactors<L>&, kernels::Row<L>*);
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES
template LaneBits solve_stage(const CompiledModel&, const kernels::KernelTable&, Workspace&,
                              LaneBits, const NewtonLimits&, StageFactors<kernels::kGroup>&,
                              NewtonReport&);
template LaneBits solve_stage(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&,
                              LaneBits, const NewtonLimits&, StageFactors<1>&, NewtonReport&);
}  // namespace tangere
