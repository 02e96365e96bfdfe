// SPDX-License-Identifier: Apache-2.0
// Connects the tape with the group: gathers states and cotangents of eight lanes, reverses their
// step, scatters the results.
#include "engine/derivative/adjoint.hpp"

#include <algorithm>

#include "engine/derivative/group_adjoint.hpp"
#include "engine/derivative/motor_pullback.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/model/transmission_state.hpp"
#include "engine/step/kept_anchors.hpp"
#include "engine/step/step_settings.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;
using kernels::Row;

namespace {

/// Scratch for the two lane counts that a step may have been taken with.
template <int L>
struct Lanes {
  BasicWorkspace<L> work;
  AdjointWorkspace<L> adjoint;
  Lanes(const CompiledModel& m, const AdjointOptions& requested, int inner_stages)
      : work(m, inner_stages), adjoint(m, requested.losses, requested.parameters, inner_stages) {}
};

/// The step of one group. Environment `first` + l of the block is in lane l.
struct GroupStepContext {
  const BlockTape& tape;
  std::int64_t step;
  int first;
  LaneBits live = 0;
};

}  // namespace

/// Folds joints that follow others by ratios.
static void fold_ratios(const CompiledModel& m, BlockCotangent& c, int lane) {
  for (auto* of : {&c.q, &c.v, &c.previous_q, &c.previous_v}) {
    const auto at = [&](int dof) -> double& { return (*of)[std::size_t(dof * kBlock + lane)]; };
    for (const kernels::FollowerTie& t : m.ties) at(t.leader_v) += t.ratio * at(t.v);
    for (const kernels::Follower& f : m.followers) at(f.v) = 0;
  }
}

/// Folds transmissions at a state into the cotangents of that state.
static void fold_transmissions(const CompiledModel& m, const double* state, const double* column,
                               double* q_bar, double* v_bar, BlockCotangent& c, int lane) {
  double* const places = c.parameters.empty()
                             ? nullptr
                             : &c.parameters[std::size_t(m.view.rows.places * kBlock + lane)];
  TransmissionState(m).pull_back(state, state + m.nq * kBlock, kBlock, column, q_bar, v_bar, places,
                                 kBlock);
}

/// Folds dofs that follow by polynomials at a state into the cotangents of that state. q = p(q_l)
/// and v = p'(q_l) v_l.
static void fold_polynomials(const CompiledModel& m, const double* state, double* q_bar,
                             double* v_bar) {
  for (const kernels::PolynomialFollower& f : m.polynomials) {
    const auto p = kernels::polynomial_at(f.coefficients, state[f.leader_q * kBlock]);
    const double rate = state[(m.nq + f.leader_v) * kBlock];
    double &own_q = q_bar[f.v * kBlock], &own_v = v_bar[f.v * kBlock];
    q_bar[f.leader_v * kBlock] += p.slope * own_q + p.second * rate * own_v;
    v_bar[f.leader_v * kBlock] += p.slope * own_v;
    own_q = own_v = 0;
  }
}

/// Folds what follows others by the state's own numbers. `state`, `column`: of the lane.
static void fold_state(const CompiledModel& m, const double* state, const double* column,
                       double* q_bar, double* v_bar, BlockCotangent& c, int lane) {
  if (!m.transmissions.empty()) fold_transmissions(m, state, column, q_bar, v_bar, c, lane);
  fold_polynomials(m, state, q_bar, v_bar);
}

void fold_followers(const Model& model, BlockCotangent& c, int lane, const double* state,
                    const double* block) {
  const CompiledModel& m = compiled(model);
  fold_state(m, state + lane, block + lane, &c.q[std::size_t(lane)], &c.v[std::size_t(lane)], c,
             lane);
  fold_ratios(m, c, lane);
}

struct Adjoint::Impl {
  Model model;
  StepSettings settings;
  GroupAdjoint group;
  Lanes<kGroup> eight;
  Lanes<1> one;
  std::vector<BlockCotangent> losses;
  /// A block as it was before the step: states from the tape, parameters from the batch.
  AlignedVector<double> rows;

  Impl(const Model& m, const StepSettings& s, const AdjointOptions& requested)
      : model(m),
        settings(s),
        group(compiled(model)),
        eight(compiled(model), requested, s.integrator.scheme().most_inner_stages()),
        one(compiled(model), requested, s.integrator.scheme().most_inner_stages()),
        losses(std::size_t(requested.losses)),
        rows(std::size_t(compiled(model).layout.rows * kBlock)) {
    const std::size_t nv = std::size_t(m.nv()) * kBlock, nu = std::size_t(m.nu()) * kBlock;
    for (BlockCotangent& c : losses) {
      for (auto* x : {&c.q, &c.v, &c.previous_q, &c.previous_v}) x->assign(nv, 0.0);
      c.u.assign(nu, 0.0);
      if (requested.points)
        c.points.assign(std::size_t(kBlock) * std::size_t(tactile_points(m) * kPointNumbers), 0.0);
      if (requested.parameters)
        c.parameters.assign(std::size_t(parameter_rows(model) * kBlock), 0.0);
    }
  }

  /// Restores the block's rows to their values before `step`.
  void restore(const Batch& batch, int block, const BlockTape& tape, std::int64_t step) {
    const BlockLayout& layout = compiled(model).layout;
    const double* now = batch.block(block);
    std::copy(now + layout.parameters * kBlock, now + layout.rows * kBlock,
              rows.data() + layout.parameters * kBlock);
    const std::size_t count = std::size_t((model.nq() + model.nv()) * kBlock);
    std::copy_n(tape.state(step), count, rows.data() + layout.q * kBlock);
    std::copy_n(tape.state(step - 1), count, rows.data() + layout.previous_q * kBlock);
  }

  template <int L>
  Lanes<L>& lanes() {
    if constexpr (L == 1) {
      return one;
    } else {
      return eight;
    }
  }

  /// Gathers rows of a block from lane `first` on.
  template <int L>
  static void gather(Row<L>* to, const double* from, int count, int first) {
    for (int i = 0; i < count; ++i)
      for (int l = 0; l < L; ++l) to[i][l] = from[i * kBlock + first + l];
  }

  template <int L>
  void load(Lanes<L>& x, const GroupStepContext& g) {
    const CompiledModel& m = compiled(model);
    BasicWorkspace<L>& w = x.work;
    gather(w.q0, &rows[std::size_t(m.layout.q * kBlock)], m.nq, g.first);
    gather(w.v0, &rows[std::size_t(m.layout.v * kBlock)], m.nv, g.first);
    gather(w.q_before, &rows[std::size_t(m.layout.previous_q * kBlock)], m.nq, g.first);
    gather(w.v_before, &rows[std::size_t(m.layout.previous_v * kBlock)], m.nv, g.first);
    gather(w.q1, g.tape.state(g.step + 1), m.nq, g.first);
    gather(w.x_inner, g.tape.inner(g.step), settings.integrator.scheme().inner_stages() * m.nv,
           g.first);
    for (int l = 0; l < L && m.has_shear_state(); ++l) {
      const auto after = g.tape.memory(g.step + 1, g.first + l);
      set_memory(x, l, without_kept(g.tape.memory(g.step, g.first + l)), without_kept(after));
      for (std::size_t k = 0; k < losses.size(); ++k) {
        const std::vector<double>& bar = losses[k].shear[std::size_t(g.first + l)];
        const auto rest = bar.begin() + (bar.empty() ? 0 : 3 * kept_entries(m, after));
        x.adjoint.losses[k].kept[std::size_t(l)].assign(bar.begin(), rest);
        x.adjoint.losses[k].memory[std::size_t(l)].assign(rest, bar.end());
        const std::size_t count = losses[k].points.size() / kBlock;
        x.adjoint.losses[k].points[std::size_t(l)] =
            std::span(losses[k].points).subspan(count * std::size_t(g.first + l), count);
      }
    }
    w.stage.block = rows.data() + g.first;
    w.stage.group = 0;
    for (std::size_t k = 0; k < losses.size(); ++k) {
      LossRows<L>& o = x.adjoint.losses[k];
      gather(o.q, losses[k].q.data(), m.nv, g.first);
      gather(o.v, losses[k].v.data(), m.nv, g.first);
      for (Row<L>* p : {o.q_centre, o.v_centre, o.q_before, o.v_before, o.tau, o.target})
        std::fill(p, p + m.nv, Row<L>{});
      if (o.parameters != nullptr)
        std::fill(o.parameters, o.parameters + parameter_rows(model), Row<L>{});
    }
  }

  /// The entries of a shear state that solves update.
  [[nodiscard]] std::span<const ShearEntry> without_kept(std::span<const ShearEntry> memory) const {
    return memory.subspan(std::size_t(kept_entries(compiled(model), memory)));
  }

  /// Sets a lane's shear states at the start and the end of a solve.
  template <int L>
  static void set_memory(Lanes<L>& x, int lane, std::span<const ShearEntry> now,
                         std::span<const ShearEntry> after) {
    x.work.shear.now[std::size_t(lane)].assign(now.begin(), now.end());
    x.work.shear.after[std::size_t(lane)].assign(after.begin(), after.end());
    for (LossRows<L>& o : x.adjoint.losses)
      o.memory_before[std::size_t(lane)].assign(3 * now.size(), 0.0);
  }

  /// Reverses the solves of one lane's special step, last first. Cotangents of its inner states
  /// stay in the lane.
  template <int L>
  void reverse_special(Lanes<L>& x, const TapedStep& special, int lane, const GroupStepContext& g) {
    BasicWorkspace<L>& w = x.work;
    const auto set = [lane](Row<L>* to, const std::vector<double>& from) {
      for (std::size_t i = 0; i < from.size(); ++i) to[i][lane] = from[i];
    };
    for (std::size_t k = special.solves.size(); k-- > 0;) {
      const TapedSolve& solve = special.solves[k];
      set(w.q1, solve.q);
      set(w.x_inner, solve.inner);
      if (compiled(model).has_shear_state())
        set_memory(x, lane,
                   k > 0 ? std::span<const ShearEntry>(special.solves[k - 1].memory)
                         : without_kept(g.tape.memory(g.step, g.first + lane)),
                   solve.memory);
      if (k > 0) {
        set(w.q0, special.solves[k - 1].q);
        set(w.v0, special.solves[k - 1].v);
      } else {
        const CompiledModel& m = compiled(model);
        const double* start = rows.data() + g.first + lane;
        for (int i = 0; i < m.nq; ++i) w.q0[i][lane] = start[(m.layout.q + i) * kBlock];
        for (int i = 0; i < m.nv; ++i) w.v0[i][lane] = start[(m.layout.v + i) * kBlock];
      }
      group.reverse(solve.integrator.scheme(), solve.h, kernels::active_kernels(), w, x.adjoint,
                    1U << lane);
      if (k == 0) return;
      for (LossRows<L>& o : x.adjoint.losses) {
        o.memory[std::size_t(lane)] = o.memory_before[std::size_t(lane)];
        for (int i = 0; i < model.nv(); ++i) {
          o.q[i][lane] = std::exchange(o.q_centre[i][lane], 0.0);
          o.v[i][lane] = std::exchange(o.v_centre[i][lane], 0.0);
        }
      }
    }
  }

  /// Reverses the updates of sensor shear states that were due at the end of the step.
  template <int L>
  void reverse_readings(Lanes<L>& x, const GroupStepContext& g) {
    gather(x.work.v1, g.tape.state(g.step + 1) + model.nq() * kBlock, model.nv(), g.first);
    std::array<TapedReading, L> readings;
    for (int l = 0; l < L; ++l) {
      if (!has(g.live, l)) continue;
      const auto kept = [&](std::int64_t step) {
        const auto memory = g.tape.memory(step, g.first + l);
        return memory.first(std::size_t(kept_entries(compiled(model), memory)));
      };
      readings[std::size_t(l)] = {g.tape.episode_step(g.step + 1, g.first + l), kept(g.step),
                                  kept(g.step + 1)};
    }
    x.adjoint.shear_adjoint.reverse_readings(compiled(model), kernels::active_kernels(), x.work,
                                             readings, x.adjoint.losses);
  }

  template <int L>
  void reverse(const GroupStepContext& g, std::span<const double> controls) {
    const CompiledModel& m = compiled(model);
    Lanes<L>& x = lanes<L>();
    load(x, g);
    LaneBits plain = 0;
    for (int l = 0; l < L; ++l) {
      if (!has(g.live, l)) continue;
      set_motors(m, x.work, l, rows.data() + g.first + l,
                 controls.subspan(std::size_t((g.first + l) * m.nu), std::size_t(m.nu)));
      if (g.tape.special(g.step, g.first + l) == nullptr) plain |= 1U << l;
    }
    if (m.kept_points > 0) reverse_readings(x, g);
    if (plain != 0)
      group.reverse(settings.integrator.scheme(), settings.timestep, kernels::active_kernels(),
                    x.work, x.adjoint, plain);
    for (int l = 0; l < L; ++l)
      if (has(g.live & ~plain, l)) reverse_special(x, *g.tape.special(g.step, g.first + l), l, g);
    for (std::size_t k = 0; k < losses.size(); ++k)
      for (int l = 0; l < L; ++l)
        if (has(g.live, l))
          scatter(x.adjoint.losses[k], losses[k], l, g.first + l, g.step, controls,
                  kept_entries(m, g.tape.memory(g.step, g.first + l)));
  }

  /// Writes one lane's results to its column. Forces that are known at the start depend on the
  /// state there and on the controls. `kept`: entries of sensors that keep anchors before the step.
  template <int L>
  void scatter(LossRows<L>& o, BlockCotangent& c, int lane, int column, std::int64_t step,
               std::span<const double> controls, std::ptrdiff_t kept) {
    const CompiledModel& m = compiled(model);
    const std::span<const double> u =
        controls.subspan(std::size_t(column * m.nu), std::size_t(m.nu));
    MotorPullback<L> pullback{m, rows.data() + column, u, lane};
    for (std::size_t k = 0; k < std::size_t(m.nu); ++k) c.u[k * kBlock + std::size_t(column)] = 0;
    pullback.run(o, c.u.data() + column);
    for (int i = 0; i < m.nv; ++i) {
      const std::size_t at = std::size_t(i * kBlock + column);
      c.q[at] = c.previous_q[at] + o.q_centre[i][lane];
      c.v[at] = c.previous_v[at] + o.v_centre[i][lane];
      c.previous_q[at] = o.q_before[i][lane];
      c.previous_v[at] = o.v_before[i][lane];
    }
    if (!c.past.empty()) go_back(c, column);
    if (step == 0) fold_start(c, column);
    fold_ratios(m, c, column);
    if (m.has_shear_state()) {
      std::vector<double>& memory = c.shear[std::size_t(column)];
      const std::vector<double>& rest = o.memory_before[std::size_t(lane)];
      memory = o.kept[std::size_t(lane)];
      memory.resize(3 * std::size_t(kept), 0.0);  // nothing reached them: zeros
      memory.insert(memory.end(), rest.begin(), rest.end());
    }
    if (o.parameters == nullptr) return;
    for (int i = 0; i < parameter_rows(model); ++i)
      c.parameters[std::size_t(i * kBlock + column)] += o.parameters[i][lane];
  }

  /// Folds followers at the first state of a tape and the one before it.
  void fold_start(BlockCotangent& c, int column) {
    const CompiledModel& m = compiled(model);
    const double* const own = rows.data() + column;
    const auto at = [column](AlignedVector<double>& x) { return &x[std::size_t(column)]; };
    fold_state(m, own + m.layout.q * kBlock, own, at(c.q), at(c.v), c, column);
    fold_state(m, own + m.layout.previous_q * kBlock, own, at(c.previous_q), at(c.previous_v), c,
               column);
  }

  /// Adds the cotangents of the state one step before, and moves those of earlier ones up.
  void go_back(BlockCotangent& c, int column) const {
    const std::size_t state = 2 * std::size_t(model.nv()) * kBlock;
    for (std::size_t i = 0; i < std::size_t(model.nv()); ++i) {
      c.q[i * kBlock + std::size_t(column)] += c.past[i * kBlock + std::size_t(column)];
      c.v[i * kBlock + std::size_t(column)] += c.past[state / 2 + i * kBlock + std::size_t(column)];
    }
    for (std::size_t k = std::size_t(column); k < c.past.size(); k += kBlock)
      c.past[k] = k + state < c.past.size() ? c.past[k + state] : 0;
  }

  /// Reverses a step that was not taken: both states are the same.
  void stand_still(int column) {
    for (BlockCotangent& c : losses) {
      for (int i = 0; i < model.nv(); ++i) {
        const std::size_t at = std::size_t(i * kBlock + column);
        c.q[at] += std::exchange(c.previous_q[at], 0.0);
        c.v[at] += std::exchange(c.previous_v[at], 0.0);
      }
      for (int k = 0; k < model.nu(); ++k) c.u[std::size_t(k * kBlock + column)] = 0;
    }
  }
};

Adjoint::Adjoint(const Model& model, const StepperOptions& options, const AdjointOptions& requested)
    : impl_(std::make_unique<Impl>(model, step_settings(model, options), requested)) {
  refuse_sleep(model, impl_->settings);
}
Adjoint::~Adjoint() = default;
Adjoint::Adjoint(Adjoint&&) noexcept = default;
Adjoint& Adjoint::operator=(Adjoint&&) noexcept = default;

int Adjoint::losses() const { return static_cast<int>(impl_->losses.size()); }
BlockCotangent& Adjoint::loss(int k) { return impl_->losses[std::size_t(k)]; }

const BlockCotangent& Adjoint::loss(int k) const { return impl_->losses[std::size_t(k)]; }

void Adjoint::clear() {
  for (BlockCotangent& c : impl_->losses)
    for (auto* x :
         {&c.q, &c.v, &c.previous_q, &c.previous_v, &c.past, &c.u, &c.parameters, &c.points})
      std::fill(x->begin(), x->end(), 0.0);
  for (BlockCotangent& c : impl_->losses)
    for (std::vector<double>& lane : c.shear) lane.clear();
}

void Adjoint::reverse_step(const Batch& batch, int block, const BlockTape& tape, std::int64_t step,
                           std::span<const double> controls) {
  impl_->restore(batch, block, tape, step);
  const std::size_t nu = std::size_t(batch.model().nu());
  const std::span<const double> block_controls = controls.subspan(std::size_t(block * kBlock) * nu);
  for (int first = 0; first < kBlock; first += kGroup) {
    GroupStepContext g{tape, step, first};
    for (int l = 0; l < kGroup; ++l) {
      if (tape.took(step, first + l)) {
        g.live |= 1U << l;
      } else {
        impl_->stand_still(first + l);
      }
    }
    if (g.live == 0) continue;
    // As in the step, a lone lane takes a third of the time and has the same bits.
    if ((g.live & (g.live - 1)) == 0) {
      g.first += __builtin_ctz(g.live);
      g.live = 1;
      impl_->reverse<1>(g, block_controls);
    } else {
      impl_->reverse<kGroup>(g, block_controls);
    }
  }
}

}  // namespace tangere
