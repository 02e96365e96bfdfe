// SPDX-License-Identifier: Apache-2.0
// What friction remembers, in reverse through one solve (docs/shear.md). Cotangents of the memory
// after the solve become those of the memory and the state before it, in three parts:
//   (i)   what is remembered at the end depends on the state there: its share is added to (q̄, v̄)
//         before the stages are reversed;
//   (iii) the forces of every stage depend on the anchors, with the weight of λ;
//   both reach the anchors, which follow from the state and the memory where the solve began.
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
  Rows parameters;          ///< out: (parameter_rows), or null
  /// Of what friction remembers, three numbers for each entry: in, after the solve; out, before it.
  std::array<std::vector<double>, L> memory, memory_before;
  /// The same of sensors that keep anchors, for whole steps: solves do not change them.
  std::array<std::vector<double>, L> kept;
};

/// What a lane's sensors that keep anchors remembered before and after a step. `steps`: of its
/// episode until its end; -1: it took none.
struct TapedReading {
  std::int64_t steps = -1;
  std::span<const ShearEntry> before, after;
};

/// Scratch of one thread, all losses.
template <int L>
class ShearAdjoint {
 public:
  ShearAdjoint(const CompiledModel& model, int losses);

  /// Begins a solve whose stages are about to be reversed, last first. Anchors follow from
  /// begin_shear().
  void begin(const CompiledModel& model);
  /// Part (i), once the last stage is assembled.
  void reverse_end(const CompiledModel& model, const kernels::KernelTable& table,
                   BasicWorkspace<L>& w, LaneBits lanes, LossRows<L>& loss, int number);
  /// Part (iii) of the assembled stage at q, with its λ.
  void reverse_forces(const CompiledModel& model, const kernels::KernelTable& table,
                      BasicWorkspace<L>& w, LaneBits lanes, const kernels::Row<L>* q,
                      const kernels::Row<L>* lambda, LossRows<L>& loss, int number);
  /// Reverses what the end of a step, at q1, v1, did to the memory of sensors that keep anchors:
  /// LossRows::kept becomes that before the step.
  void reverse_readings(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, const std::array<TapedReading, L>& readings,
                        std::vector<LossRows<L>>& losses);
  /// Adds to the cotangents of the state where the solve began.
  void finish(const CompiledModel& model, const kernels::KernelTable& table, BasicWorkspace<L>& w,
              LaneBits lanes, LossRows<L>& loss, int number);

 private:
  using Cotangents = AlignedVector<kernels::MotionCotangent<kernels::Row<L>>>;
  using Poses = AlignedVector<kernels::LinkPose<kernels::Row<L>>>;
  void pull_back(const CompiledModel& model, const kernels::KernelTable& table,
                 BasicWorkspace<L>& w, LaneBits lanes, bool of_forces, LossRows<L>& loss,
                 int number);
  void pull_back_reading(const CompiledModel& model, const kernels::KernelTable& table,
                         BasicWorkspace<L>& w, const kernels::ShearSpringContact& of, int lane,
                         const TapedReading& reading, LossRows<L>& loss);
  void add_to_state(const CompiledModel& model, const kernels::KernelTable& table,
                    BasicWorkspace<L>& w, LaneBits lanes, const kernels::Row<L>* q,
                    const kernels::Row<L>* v, Cotangents& links, kernels::Row<L>* q_bar,
                    kernels::Row<L>* v_bar);

  std::vector<Cotangents> start_;  ///< of each loss: (n_links) where the solve began
  Cotangents end_;
  Poses at_, slip_;                      ///< (n_links)
  Poses at_touches_, slip_touches_;      ///< (n_shear_springs), see StageKernels::touches_at
  AlignedVector<kernels::Row<L>> rows_;  ///< (nv) twice
  AlignedVector<std::byte> scratch_;
  AlignedVector<double> numbers_;    ///< (18, largest stride)
  std::vector<double> kept_before_;  ///< of one lane
};

}  // namespace tangere
