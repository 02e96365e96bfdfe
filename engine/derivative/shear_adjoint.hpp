// SPDX-License-Identifier: Apache-2.0
// Adjoint of the shear state through one solve (docs/shear.md), that of joints included. Turns
// cotangents of the shear state after the solve into those of the shear state and the state before
// it, in three parts:
//   (i)   the final shear state depends on the final state: this part is added to (q̄, v̄) before
//         the stages are reversed;
//   (iii) the forces of every stage depend on the anchors, with the weight of λ;
//   both reach the anchors, which follow from state and shear state at the start of the solve.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/step/workspace.hpp"

namespace tangere {

/// Cotangents of one loss in a group, rows (nv). Positions are by their right tangent.
template <int L>
struct LossRows {
  using Rows = kernels::Row<L>*;
  Rows q, v;                ///< in: of the state after the step
  Rows q_centre, v_centre;  ///< out: of the state before it
  Rows q_before, v_before;  ///< out: of the one before that
  Rows q_inner, v_inner;    ///< of inner stages, (nv) each, one after another
  Rows tau, target;         ///< out: of forces known when the step begins, and of motors' targets
  Rows dry_anchor;          ///< of the anchors of dry friction in one solve
  Rows parameters;          ///< out: (parameter_rows), or null
  /// Out: of every tactile point's own numbers, (tactile points, kPointNumbers), or empty.
  std::array<std::span<double>, L> points{};
  /// Of the shear state, three numbers for each entry. In: after the solve; out: before it.
  std::array<std::vector<double>, L> memory, memory_before;
  /// The same of sensors that keep anchors, for whole steps: solves do not change them.
  std::array<std::vector<double>, L> kept;
};

/// One lane's anchors of sensors with shear_interval > 0, before and after a step. `steps`: number
/// of steps of the episode at the end of the step; -1: the lane took no step.
struct TapedReading {
  std::int64_t steps = -1;
  std::span<const ShearEntry> before, after;
};

/// Scratch of one thread, all losses.
template <int L>
class ShearAdjoint {
 public:
  ShearAdjoint(const CompiledModel& model, int losses);

  /// Prepares the reversal of one solve, last stage first. begin_shear() must have computed the
  /// anchors.
  void begin(const CompiledModel& model);
  /// Part (i), once the last stage is assembled.
  void reverse_end(const CompiledModel& model, const kernels::KernelTable& table,
                   BasicWorkspace<L>& w, LaneBits lanes, LossRows<L>& loss, int number);
  /// Part (iii) of the assembled stage at q, with its λ.
  void reverse_forces(const CompiledModel& model, const kernels::KernelTable& table,
                      BasicWorkspace<L>& w, LaneBits lanes, const kernels::Row<L>* q,
                      const kernels::Row<L>* lambda, LossRows<L>& loss, int number);
  /// Reverses update_sensor_shear_state() at the end of a step (q1, v1): turns LossRows::kept from
  /// cotangents after the step into those before it.
  void reverse_readings(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, const std::array<TapedReading, L>& readings,
                        std::vector<LossRows<L>>& losses);
  /// Adds to the cotangents of the state where the solve began.
  void finish(const CompiledModel& model, const kernels::KernelTable& table, BasicWorkspace<L>& w,
              LaneBits lanes, LossRows<L>& loss, int number);

 private:
  void reverse_dry_end(const CompiledModel& model, const BasicWorkspace<L>& w, LaneBits lanes,
                       LossRows<L>& loss) const;
  void finish_dry(const CompiledModel& model, const BasicWorkspace<L>& w, LaneBits lanes,
                  LossRows<L>& loss) const;
  using Cotangents = AlignedVector<kernels::MotionCotangent<kernels::Row<L>>>;
  using Poses = AlignedVector<kernels::LinkPose<kernels::Row<L>>>;
  void pull_back(const CompiledModel& model, const kernels::KernelTable& table,
                 BasicWorkspace<L>& w, LaneBits lanes, bool from_forces, LossRows<L>& loss,
                 int number);
  void pull_back_points(const CompiledModel& model, const kernels::KernelTable& table,
                        const BasicWorkspace<L>& w, kernels::ShearPullback& pullback,
                        std::span<double> points, double* own);
  void pull_back_reading(const CompiledModel& model, const kernels::KernelTable& table,
                         BasicWorkspace<L>& w, const kernels::ShearSpringContact& of, int lane,
                         const TapedReading& reading, LossRows<L>& loss);
  /// `parameters`: as in LossRows.
  void add_to_state(const CompiledModel& model, const kernels::KernelTable& table,
                    BasicWorkspace<L>& w, LaneBits lanes, const kernels::Row<L>* q,
                    const kernels::Row<L>* v, Cotangents& links, kernels::Row<L>* q_bar,
                    kernels::Row<L>* v_bar, kernels::Row<L>* parameters);

  std::vector<Cotangents> start_;  ///< of each loss: (n_links) where the solve began
  Cotangents end_;
  Poses at_, slip_;                      ///< (n_links)
  Poses at_touches_, slip_touches_;      ///< (n_shear_springs), see StageKernels::touches_at
  AlignedVector<kernels::Row<L>> rows_;  ///< (nv) twice
  AlignedVector<CacheLine> scratch_;
  AlignedVector<double> numbers_;    ///< (18, largest stride)
  std::vector<double> kept_before_;  ///< of one lane
};

}  // namespace tangere
