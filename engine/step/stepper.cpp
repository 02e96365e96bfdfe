// SPDX-License-Identifier: Apache-2.0
// Connects the batch with the group: gathers eight lanes, steps them, scatters those that
// succeeded.
#include "engine/step/stepper.hpp"

#include <algorithm>
#include <bit>
#include <numeric>

#include "engine/base/as_size.hpp"
#include "engine/step/awake_parts.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/interpenetration.hpp"
#include "engine/step/kept_anchors.hpp"
#include "engine/step/motor_force.hpp"
#include "engine/step/shear_update.hpp"
#include "engine/step/sleep.hpp"
#include "engine/step/step_settings.hpp"
#include "engine/step/tape.hpp"
#include "kernels/table/isa.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;
using kernels::Row;

/// Lanes of one group of a block. Environment `first` + l is in lane l.
struct GroupOfBlock {
  double* rows;  ///< row r of lane l: rows[r * kBlock + l]
  int first;
  LaneBits live = 0, history = 0;
};

/// Whether lanes are stepped one after another, by kernels of one lane: the bits are the same. A
/// group takes as long as two lanes alone for each register of a row.
static bool few(LaneBits lanes) {
  const int count = std::popcount(lanes), registers = kGroup / kernels::active_register_width();
  return count < kGroup && count < 2 * registers;
}

/// Calls f with a group of each of the live lanes alone, and the lane.
template <class F>
static void for_each_alone(const GroupOfBlock& g, const F& f) {
  for (int l = 0; l < kGroup; ++l) {
    if (!has(g.live, l)) continue;
    GroupOfBlock one = g;
    one.live = 1U << l;
    f(one, l);
  }
}

/// Stores a lane's state before a step replaces it, for sensors with lag.
static void store_past_state(const BlockLayout& layout, double* column, std::int64_t steps) {
  const int numbers = layout.previous_q - layout.q;
  const int place = layout.past + numbers * static_cast<int>(steps % layout.past_states);
  for (int k = 0; k < numbers; ++k) column[(place + k) * kBlock] = column[(layout.q + k) * kBlock];
}

/// A step of a model, and its scratch.
struct ModelStepper {
  GroupStep step;
  Workspace work;
  SingleWorkspace single;

  ModelStepper(const CompiledModel& m, const StepSettings& s)
      : step(m, s),
        work(m, s.integrator.scheme().most_inner_stages()),
        single(m, s.integrator.scheme().most_inner_stages()) {}
};

/// Model, step and scratch of a group: the whole model, or its awake sub-model.
struct SteppedModel {
  const CompiledModel& model;
  const GroupStep& step;
  SingleWorkspace& alone;     ///< for splits of its steps
  std::span<const int> q, v;  ///< number of its coordinates and dofs in the whole model
};

/// Ends the use of a batch's lists.
template <int L>
struct KeptLists {
  BasicWorkspace<L>& w;
  ~KeptLists() { w.use(w.own_candidates); }
};

/// Extra state used only when sleeping is enabled.
struct Sleeping {
  Sleep rules;
  AwakeParts parts;
  AlignedVector<kernels::LaneRow> moved;  // (trees) in a group
  std::vector<Row<1>> moved_alone;        // (trees) in one lane
  std::vector<double> q_in_lane;          // (nq)

  Sleeping(const CompiledModel& m, const StepSettings& s)
      : rules(m, s.sleep, s.timestep),
        parts(m, s),
        moved(as_size(rules.trees())),
        moved_alone(as_size(rules.trees())),
        q_in_lane(as_size(m.nq)) {}

  template <int L>
  Row<L>* moved_rows() {
    if constexpr (L == 1) {
      return moved_alone.data();
    } else {
      return moved.data();
    }
  }
};

struct Stepper::Impl {
  Model model;
  StepSettings settings;
  /// The model without inert contacts; null if there are none. Sleep uses all contacts.
  std::unique_ptr<ModelPart> without_inert;
  ModelStepper machine;
  /// With all of them, for derivatives by their parameters. Built when the first tape is written.
  std::unique_ptr<ModelStepper> with_all_contacts;
  std::vector<int> all_q, all_v;  ///< 0, 1, …
  std::unique_ptr<Sleeping> sleeping;
  Interpenetration overlaps;

  Impl(const Model& m, const StepSettings& s)
      : model(m),
        settings(s),
        without_inert(s.sleep > 0 || s.keep_inert_contacts
                          ? nullptr
                          : without_inert_contacts(compiled(model))),
        machine(without_inert ? without_inert->model : compiled(model), s),
        all_q(as_size(m.nq())),
        all_v(as_size(m.nv())),
        overlaps(compiled(model)) {
    std::iota(all_q.begin(), all_q.end(), 0);
    std::iota(all_v.begin(), all_v.end(), 0);
    if (s.sleep > 0) sleeping = std::make_unique<Sleeping>(compiled(model), s);
  }

  ModelStepper& machine_for(const BlockTape* tape) {
    if (tape == nullptr || !without_inert) return machine;
    if (!with_all_contacts)
      with_all_contacts = std::make_unique<ModelStepper>(compiled(model), settings);
    return *with_all_contacts;
  }
  /// All bodies, by a machine of this stepper.
  SteppedModel whole(ModelStepper& by) {
    return {without_inert && &by == &machine ? without_inert->model : compiled(model), by.step,
            by.single, all_q, all_v};
  }

  /// Sets the motor forces and targets of the live lanes; clears lanes with non-finite controls.
  template <int L>
  void set_motors_of(Batch& batch, BasicWorkspace<L>& w, GroupOfBlock& g, int lane,
                     std::span<const double> controls) {
    const CompiledModel& m = compiled(model);
    const std::size_t nu = as_size(m.nu);
    for (int l = 0; l < L; ++l) {
      if (!has(g.live, lane + l)) continue;
      const std::size_t e = std::size_t(g.first + lane + l);
      if (set_motors(m, w, l, g.rows + lane + l, controls.subspan(e * nu, nu))) continue;
      batch.status_[e] = StepStatus::non_finite;
      batch.iterations_[e] = 0;
      g.live &= ~(1U << (lane + l));
    }
  }

  /// Steps the live lanes of a group. `lane`: the one that is in lane 0 of a workspace of one.
  /// Returns lanes whose step must be repeated, because an awake body touches a sleeping one.
  template <int L>
  LaneBits step_lanes(Batch& batch, const SteppedModel& stepped, BasicWorkspace<L>& w,
                      const GroupOfBlock& g, int lane, BlockTape* tape) {
    const CompiledModel& m = compiled(model);
    const auto gather = [&](Row<L>* to, int row, std::span<const int> of) {
      for (std::size_t i = 0; i < of.size(); ++i)
        for (int l = 0; l < L; ++l) to[i][l] = g.rows[(row + of[i]) * kBlock + lane + l];
    };
    gather(w.q0, m.layout.q, stepped.q);
    gather(w.v0, m.layout.v, stepped.v);
    gather(w.q_before, m.layout.previous_q, stepped.q);
    gather(w.v_before, m.layout.previous_v, stepped.v);
    if (m.has_shear_state())
      for (int l = 0; l < L; ++l) {
        const ShearState& memory = batch.shear_[std::size_t(g.first + lane + l)];
        w.shear.now[std::size_t(l)].assign(memory.begin() + kept_entries(m, memory), memory.end());
      }
    w.stage.block = g.rows + lane;
    w.stage.group = 0;
    const KeptLists<L> kept{w};
    if (!sleeping && keeps_lists(stepped.model))
      w.use(batch.candidates_.lists<L>(as_size(g.first / kGroup), lane, stepped.model,
                                       &stepped.model == &m));
    const LaneBits live = g.live >> lane;
    NewtonReport report;
    SolveLog log;
    const int lane_in_block = g.first % kBlock + lane;
    if (tape != nullptr && tape->next_inner() != nullptr)
      log.inner = tape->next_inner() + lane_in_block;
    stepped.step.advance(kernels::active_kernels(), w, stepped.alone, live, g.history >> lane,
                         report, tape == nullptr ? nullptr : &log);
    for (int l = 0; l < L; ++l)
      if (std::vector<TapedSolve>& solves = log.special[std::size_t(l)]; !solves.empty())
        tape->add({tape->steps(), lane_in_block + l, std::move(solves)});
    LaneBits again = 0;
    if (sleeping) again = wake_touched(batch, stepped, w, g, lane, live, report);
    LaneBits moved = 0;
    std::array<ReadingLane, L> reading;
    for (int l = 0; l < L; ++l) {
      if (!has(live & ~again, l)) continue;
      const std::size_t e = std::size_t(g.first + lane + l);
      batch.status_[e] = report.status[l];
      batch.iterations_[e] = report.iterations[l];
      batch.residual_[e] = report.residual[l];
      if (failed(report.status[l])) continue;
      if (m.layout.past_states > 0) store_past_state(m.layout, g.rows + lane + l, batch.steps_[e]);
      ++batch.steps_[e];
      if (m.has_shear_state()) {
        ShearState& memory = batch.shear_[e];
        ShearState& now = w.shear.now[std::size_t(l)];
        if (m.kept_points == 0) {
          memory.swap(now);
        } else {
          memory.resize(std::size_t(kept_entries(m, memory)));
          memory.insert(memory.end(), now.begin(), now.end());
        }
        reading[std::size_t(l)] = {batch.steps_[e], &memory};
      }
      // One step back is too long for BDF2's history where a step had to be cut.
      batch.has_history_[e] = settings.accuracy > 0 ? 0 : 1;
      moved |= 1U << l;
    }
    if (m.kept_points > 0) update_sensor_shear_state(m, kernels::active_kernels(), w, reading);
    const auto shift = [&](int now, int before, const Row<L>* from, std::span<const int> of) {
      for (std::size_t i = 0; i < of.size(); ++i) {
        double* const row = g.rows + of[i] * kBlock + lane;
        put_lanes<L>(row + now * kBlock, moved, row + before * kBlock);
        put_lanes<L>(from[i].lane, moved, row + now * kBlock);
      }
    };
    shift(m.layout.q, m.layout.previous_q, w.q0, stepped.q);
    shift(m.layout.v, m.layout.previous_v, w.v0, stepped.v);
    if (sleeping) put_to_sleep<L>(batch, g, lane, live & ~again);
    return again << lane;
  }

  /// Checks new states for bodies that passed through each other or overlap, in lanes in which
  /// bodies have moved farther than the clearance of the last check. `first`: the lane of the group
  /// that is lane 0 of the L.
  template <int L>
  void check_overlaps(Batch& batch, const GroupOfBlock& g, int first, LaneBits stepped,
                      SingleWorkspace& w) {
    if (!overlaps.has_pairs()) return;
    const Row<L> motion = overlaps.motions<L>(g.rows + first);
    for (int l = 0; l < L; ++l) {
      const std::size_t e = as_size(g.first + first + l);
      if (!has(stepped, first + l) || failed(batch.status_[e])) continue;
      double& clearance = batch.clearance_[e];
      clearance -= motion[l];
      if (clearance > 0) continue;
      const Interpenetration::Finding found =
          overlaps.check(kernels::active_kernels(), w, g.rows + first + l, motion[l]);
      clearance = found.clearance;
      if (found.tunnelled)
        batch.status_[e] = StepStatus::tunnelled;
      else if (found.overlapping && batch.status_[e] != StepStatus::tunnelled)
        batch.status_[e] = StepStatus::overlapping;
    }
  }

  /// Steps the live lanes of a group whose bodies may sleep: those with the same bodies asleep
  /// together.
  void step_sleepers(Batch& batch, const GroupOfBlock& g, std::span<const double> controls) {
    const std::size_t nu = as_size(compiled(model).nu);
    const auto state = [&](int l) -> SleepState& { return batch.sleep_[as_size(g.first + l)]; };
    for (int l = 0; l < kGroup; ++l)
      if (has(g.live, l))
        sleeping->rules.wake_on_control_change(state(l),
                                               controls.subspan(as_size(g.first + l) * nu, nu));
    const auto same = [](const SleepState& a, const SleepState& b) {
      return a.bodies == b.bodies && (a.bodies == 0 || a.asleep == b.asleep);
    };
    for (LaneBits left = g.live; left != 0;) {
      const int first = __builtin_ctz(left);
      GroupOfBlock alike = g;
      for (int l = 0; l < kGroup; ++l)
        if (!has(left, l) || !same(state(l), state(first))) alike.live &= ~(1U << l);
      if (few(alike.live)) alike.live = 1U << first;
      left &= ~alike.live;
      const bool alone = (alike.live & (alike.live - 1)) == 0;
      left |= alone ? step_alike(batch, machine.single, alike, first, controls)
                    : step_alike(batch, machine.work, alike, 0, controls);
    }
  }

  template <int L>
  LaneBits step_alike(Batch& batch, BasicWorkspace<L>& w, GroupOfBlock& g, int lane,
                      std::span<const double> controls) {
    const SleepState& one = batch.sleep_[as_size(g.first + __builtin_ctz(g.live))];
    set_motors_of(batch, w, g, lane, controls);
    if (g.live == 0) return kNoLane;
    if (one.bodies == 0) return step_lanes(batch, whole(machine), w, g, lane, nullptr);
    if (std::ranges::count(one.asleep, 0) == 0) return rest(batch, g);
    AwakePart& part = sleeping->parts.without(one.asleep, sleeping->rules.tree_of_link());
    BasicWorkspace<L>& p = part.workspace<L>();
    const ModelPart& of = *part.part;
    for (std::size_t i = 0; i < of.v.size(); ++i) {
      p.stage.tau[i] = w.stage.tau[of.v[i]];
      p.stage.target[i] = w.stage.target[of.v[i]];
    }
    return step_lanes(batch, {of.model, part.step, part.single, of.q, of.v}, p, g, lane, nullptr);
  }

  /// Takes a step of the live lanes in which every body sleeps.
  LaneBits rest(Batch& batch, const GroupOfBlock& g) const {
    const BlockLayout& layout = compiled(model).layout;
    for (int l = 0; l < kGroup; ++l) {
      if (!has(g.live, l)) continue;
      const std::size_t e = as_size(g.first + l);
      batch.status_[e] = StepStatus::converged;
      batch.iterations_[e] = 0;
      batch.residual_[e] = 0;
      if (layout.past_states > 0) store_past_state(layout, g.rows + l, batch.steps_[e]);
      ++batch.steps_[e];
      batch.sleep_[e].slept += batch.sleep_[e].bodies;
    }
    return kNoLane;
  }

  /// Wakes what awake bodies of these lanes come near to. Returns the lanes in which one of them is
  /// touched already.
  template <int L>
  LaneBits wake_touched(Batch& batch, const SteppedModel& stepped, const BasicWorkspace<L>& w,
                        const GroupOfBlock& g, int lane, LaneBits lanes,
                        const NewtonReport& report) {
    Row<L>* const moved = sleeping->moved_rows<L>();
    sleeping->rules.movements(g.rows + lane, w, stepped.q, moved);
    LaneBits touched = 0;
    for (int l = 0; l < L; ++l) {
      if (!has(lanes, l) || failed(report.status[l])) continue;
      SleepState& state = batch.sleep_[as_size(g.first + lane + l)];
      if (state.bodies == 0) continue;
      double most = 0;
      for (int t = 0; t < sleeping->rules.trees(); ++t) most = std::max(most, moved[t][l]);
      if (sleeping->rules.no_awake_body_in_reach(state, most)) continue;
      double* const column = g.rows + lane + l;
      const CompiledModel& m = compiled(model);
      std::vector<double>& q = sleeping->q_in_lane;
      for (int i = 0; i < m.nq; ++i) q[as_size(i)] = column[(m.layout.q + i) * kBlock];
      for (std::size_t i = 0; i < stepped.q.size(); ++i) q[as_size(stepped.q[i])] = w.q0[i][l];
      if (sleeping->rules.wake_touched(kernels::active_kernels(), {column, state}, q, most,
                                       machine.single))
        touched |= 1U << l;
    }
    return touched;
  }

  /// Updates rest counters of stepped lanes and puts bodies to sleep.
  template <int L>
  void put_to_sleep(Batch& batch, const GroupOfBlock& g, int lane, LaneBits lanes) {
    const double* const moved = sleeping->moved_rows<L>()->lane;
    for (int l = 0; l < L; ++l) {
      const std::size_t e = as_size(g.first + lane + l);
      if (!has(lanes, l) || failed(batch.status_[e])) continue;
      SleepState& state = batch.sleep_[e];
      if (sleeping->rules.update_rest_counters(state, moved + l, L,
                                               batch.status_[e] == StepStatus::converged))
        sleeping->rules.put_to_sleep(kernels::active_kernels(), {g.rows + lane + l, state},
                                     machine.single);
    }
  }

  /// Steps the live lanes of a group: all bodies.
  template <int L>
  void step_whole(Batch& batch, BasicWorkspace<L>& w, GroupOfBlock g, int lane,
                  std::span<const double> controls, ModelStepper& by, BlockTape* tape) {
    set_motors_of(batch, w, g, lane, controls);
    if (g.live != 0) step_lanes(batch, whole(by), w, g, lane, tape);
  }

  /// Steps the live lanes of a group and checks them.
  void step_group(Batch& batch, const GroupOfBlock& g, std::span<const double> controls,
                  ModelStepper& by, BlockTape* tape) {
    if (g.live == 0) return;
    if (sleeping) {
      step_sleepers(batch, g, controls);
    } else if (!few(g.live)) {
      step_whole(batch, by.work, g, 0, controls, by, tape);
    } else {
      for_each_alone(g, [&](const GroupOfBlock& one, int lane) {
        step_whole(batch, by.single, one, lane, controls, by, tape);
      });
    }
    if (!few(g.live)) return check_overlaps<kGroup>(batch, g, 0, g.live, by.single);
    for_each_alone(g, [&](const GroupOfBlock& one, int lane) {
      check_overlaps<1>(batch, one, lane, one.live, by.single);
    });
  }
};

Stepper::Stepper(const Model& model, const StepperOptions& options)
    : impl_(std::make_unique<Impl>(model, step_settings(model, options))) {}
Stepper::~Stepper() = default;
Stepper::Stepper(Stepper&&) noexcept = default;
Stepper& Stepper::operator=(Stepper&&) noexcept = default;

double Stepper::timestep() const { return impl_->settings.timestep; }
Integrator Stepper::integrator() const { return impl_->settings.integrator; }
double Stepper::tolerance() const { return impl_->settings.tolerance; }
double Stepper::accuracy() const { return impl_->settings.accuracy; }
double Stepper::sleep() const { return impl_->settings.sleep; }

/// Throws InputError for a batch of another model and for controls of another shape.
void Stepper::check(const Batch& batch, std::span<const double> controls) const {
  if (batch.model() != impl_->model)
    throw InputError("the batch is of another Model; expected the Model of the stepper");
  check_size("controls", controls.size(),
             as_size(batch.environments()) * as_size(impl_->model.nu()));
}

void Stepper::step(Batch& batch, std::span<const double> controls) {
  for (int b = 0; b < batch.blocks(); ++b) step_block(batch, b, controls);
}

void Stepper::step_block(Batch& batch, int block, std::span<const double> controls,
                         BlockTape* tape) {
  check(batch, controls);
  Impl& i = *impl_;
  if (tape != nullptr) refuse_sleep(i.model, i.settings);
  ModelStepper& machine = i.machine_for(tape);
  for (int group = 0; group < kBlock / kGroup; ++group) {
    GroupOfBlock g{batch.block(block) + group * kGroup, block * kBlock + group * kGroup};
    for (int l = 0; l < kGroup; ++l) {
      const std::size_t e = std::size_t(g.first + l);
      if (g.first + l >= batch.environments() || failed(batch.status_[e]) || batch.held_[e] != 0)
        continue;
      g.live |= 1U << l;
      if (batch.has_history_[e] != 0) g.history |= 1U << l;
      if (!i.sleeping && !batch.sleep_[e].asleep.empty()) batch.sleep_[e].wake();
    }
    i.step_group(batch, g, controls, machine, tape);
  }
  if (tape != nullptr) tape->append(batch, block);
}

std::size_t Stepper::workspace_bytes(const Model& model) {
  return Workspace::bytes(compiled(model));
}

std::size_t Stepper::candidate_bytes(const Model& model) {
  return CandidateStore::group_bytes(compiled(model)) / kGroup;
}

Integrator integrator_in_force(const Model& model, const StepperOptions& options) {
  return step_settings(model, options).integrator;
}

}  // namespace tangere
