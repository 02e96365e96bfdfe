// SPDX-License-Identifier: Apache-2.0
// A path from soft contacts to stiff ones. Newton's method fails where a direction leads across
// several kinks at once: from free flight deep into stiff contacts, or from sticking far into
// slipping. With contacts a share s as stiff and as damped as they are, the kinks lie near each
// other, and the root moves little from one s to the next.
//
//   friction first: kt and ks by s = 1e-3, then ten times as much at each root, up to 1
//   else everything but mu: kn, damping, kt and ks by s = 1e-6 (or 1e-8), in the same way
//
// A share that finds no root is replaced by the geometric mean of it and the last one that did. A
// root on the way need not be exact. The last one, at s = 1, meets the tolerance and is a root of
// the unchanged stage, so derivatives do not depend on the path.
//
// Lanes have shares of their own and are searched together. A lane's bits do not depend on the
// others.
#include "engine/step/softened.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {

namespace {

/// One way to soften, and the patience of its searches.
struct Softening {
  bool normal;          ///< whether kn and damping are softened, too
  double first, least;  ///< shares to begin with; the second where the first has no root
  int halvings, patience;
};
constexpr Softening kSoftenings[] = {{false, 1e-3, 1e-3, 3, 2}, {true, 1e-6, 1e-8, 5, 4}};
constexpr double kLess = 1e-2;          ///< from one share to begin with to the next
constexpr double kShareGrowth = 10;     ///< from one share to the next
constexpr double kLeastGrowth = 1.2;    ///< a path that grows more slowly is given up
constexpr double kNearlyWhole = 0.999;  ///< from here on the share is 1
constexpr int kMostSearches = 30;       ///< of a path
constexpr double kLoose = 1e-3;         ///< tolerance on the way

/// Where a lane is on its path.
struct SharePath {
  double reached = 0;  ///< share of the last root; 0: none yet
  double next, growth = kShareGrowth;
  int searches = 0;

  /// Chooses the next share. Returns false where the path ends.
  bool go_on(bool found, double least) {
    if (found) {
      reached = next;
      next *= growth;
      if (next > kNearlyWhole) next = 1;
    } else if (reached == 0) {
      next *= kLess;
      if (next < least) return false;
    } else {
      growth = std::sqrt(next / reached);
      next = reached * growth;
      if (growth < kLeastGrowth) return false;
    }
    return ++searches < kMostSearches;
  }
};

template <int L>
void copy_lanes(const kernels::Row<L>* from, LaneBits lanes, kernels::Row<L>* to, int count) {
  for (int i = 0; i < count; ++i) put_lanes<L>(from[i].lane, lanes, to[i].lane);
}

/// Follows one way to soften. Returns the lanes that arrived.
template <int L>
LaneBits follow(const Softening& by, const CompiledModel& model, const kernels::KernelTable& table,
                BasicWorkspace<L>& w, LaneBits lanes, const NewtonLimits& limits,
                StageFactors<L>& factors, NewtonReport& report) {
  NewtonLimits exact = limits;
  exact.max_halvings = by.halvings;
  exact.patience = by.patience;
  NewtonLimits loose = exact;
  loose.tolerance = std::max(limits.tolerance, kLoose);
  std::array<SharePath, L> path{};
  for (SharePath& p : path) p.next = by.first;
  copy_lanes(w.x_guess, lanes, w.x_softened, model.nv);
  LaneBits open = lanes, arrived = 0;
  while (open != 0) {
    copy_lanes(w.x_softened, open, w.stage.x, model.nv);
    LaneBits last = 0;
    for (int l = 0; l < L; ++l) {
      if (!has(open, l)) continue;
      w.stage.friction_share[l] = path[l].next;
      if (by.normal) w.stage.normal_share[l] = path[l].next;
      if (path[l].next == 1) last |= 1U << l;
      report.status[l] = StepStatus::not_converged;
    }
    factors.lanes &= ~open;  // factors and floors are of other shares
    LaneBits found = 0;
    const auto solve = [&](LaneBits which, const NewtonLimits& to) {
      if (which == 0) return;
      factors.floored = false;
      found |= solve_stage(model, table, w, which, to, factors, report);
    };
    solve(open & ~last, loose);
    solve(last, exact);
    arrived |= found & last;
    open &= ~(found & last);
    copy_lanes(w.stage.x, found, w.x_softened, model.nv);
    for (int l = 0; l < L; ++l)
      if (has(open, l) && !path[l].go_on(has(found, l), by.least)) open &= ~(1U << l);
  }
  return arrived;
}

}  // namespace

template <int L>
LaneBits solve_from_softer(const CompiledModel& model, const kernels::KernelTable& table,
                           BasicWorkspace<L>& w, LaneBits lanes, const NewtonLimits& limits,
                           StageFactors<L>& factors, NewtonReport& report) {
  if (model.pairs.empty() && model.grounds.empty()) return kNoLane;
  LaneBits open = lanes;
  for (int l = 0; l < L; ++l)
    if (report.status[l] == StepStatus::non_finite ||
        report.status[l] == StepStatus::unsolved_layer)
      open &= ~(1U << l);
  LaneBits found = 0;
  for (const Softening& by : kSoftenings)
    if ((open & ~found) != 0)
      found |= follow(by, model, table, w, open & ~found, limits, factors, report);
  for (int l = 0; l < L; ++l) {
    w.stage.friction_share[l] = w.stage.normal_share[l] = 1;
    if (has(open & ~found, l)) report.status[l] = StepStatus::not_converged;
  }
  factors.lanes &= ~(open & ~found);
  return found;
}

template LaneBits solve_from_softer(const CompiledModel&, const kernels::KernelTable&, Workspace&,
                                    LaneBits, const NewtonLimits&, StageFactors<kernels::kGroup>&,
                                    NewtonReport&);
template LaneBits solve_from_softer(const CompiledModel&, const kernels::KernelTable&,
                                    SingleWorkspace&, LaneBits, const NewtonLimits&,
                                    StageFactors<1>&, NewtonReport&);

}  // namespace tangere
