// SPDX-License-Identifier: Apache-2.0
// The functions of one instruction set's table, in parts that are compiled separately, so that a
// change in a kernel recompiles only the parts that use it. Arch: xsimd's tag of the instruction
// set, or ScalarArch.
#pragma once

#include "kernels/shear/shear_types.hpp"
#include "kernels/step/arguments.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// A stage forward, in numbers N of L lanes. StageKernels documents each function.
template <class N, int L>
struct StepPart {
  static void kinematics(const ModelView&, const Stage<L>&);
  static void choose_faces(const ModelView&, const Stage<L>&, Row<L>* out);
  static void choose_faces_at(const ModelView&, const Stage<L>&, const Row<L>* q,
                              const Row<L>* zero, Row<L>* out);
  static void poses_at(const ModelView&, const Stage<L>&, const Row<L>* q, const Row<L>* v,
                       const Row<L>* zero, LinkPose<Row<L>>* out);
  static void near_pairs(const ModelView&, const Stage<L>&, NearPairs<L>& out);
  static void residual(const ModelView&, const Stage<L>&, int lone);
  static void evaluate(const ModelView&, const Stage<L>&, int lone);
  static void contact_wrenches(const ModelView&, const Stage<L>&, Row<L>* out);
  static void set_weights(const ModelView&, Stage<L>&);
  static void set_floor(const ModelView&, Stage<L>&, const double* unknown_scale,
                        const Row<L>& accept);
  static void scaled_residual(const ModelView&, const Stage<L>&, double gravity, Row<L>& out);
  static void weighted_norm(const ModelView&, const Stage<L>&, const Row<L>* a, Row<L>& out);
  static void factor(const ModelView&, const Stage<L>&, const Row<L>* accept);
  static void solve(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out);
  static void solve_watched(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out,
                            Row<L>* sound);
  static void solve_transposed(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out,
                               Row<L>* sound);
};

/// A stage in reverse. This part knows all of a stage's scratch.
template <class N, int L>
struct AdjointPart {
  static std::size_t scratch_bytes(const ModelView&);
  static void adjoint_rhs(const ModelView&, const Stage<L>&, const StageAdjoint<L>&);
  static void adjoint_products(const ModelView&, const Stage<L>&, const StageAdjoint<L>&);
  static void parameter_products(const ModelView&, const Stage<L>&, const StageAdjoint<L>&,
                                 int lone, Row<L>* out);
  static void pull_back_poses(const ModelView&, const Stage<L>&, const Row<L>* q, const Row<L>* v,
                              const Row<L>* zero, std::byte* scratch,
                              MotionCotangent<Row<L>>* links, Row<L>* q_bar, Row<L>* v_bar);
};

/// What a group needs besides its stages. KernelTable documents these functions and those below.
template <class Arch>
struct GroupPart {
  static int find_candidates(const CandidateSearch&);
  static void transpose_list(GroupStage::List&);
  static void link_poses(const ModelView&, const GroupState&, LinkPose<LaneRow>* out);
  static void pad_touch(const LinkPose<LaneRow>* sensor, const Frame<double>& pad,
                        const LinkPose<LaneRow>* body, const Frame<double>& shape,
                        Touch<LaneRow>* out);
};

/// Tactile fields, with points in numbers of type Real.
template <class Arch, class Real>
struct TactilePart {
  static int tactile(const TactileArgs<Real>&);
  static void tactile_block(const TactileBlockArgs<Real>&);
};

/// What friction remembers.
template <class Arch>
struct ShearPart {
  static void recall(const ShearSpringTouch&, const ShearSpringPoints&);
  static void advance(const ShearSpringTouch& end, const ShearSpringPoints&, double* s,
                      double* force);
  static void pull_back_memory(const ShearPullback&);
};

/// The same of all lanes of a group, in numbers N of L lanes.
template <class N, int L>
struct ShearRowsPart {
  static void touches_at(const ModelView&, const LinkPose<Row<L>>* links, LinkPose<Row<L>>* out);
  static void recall_ground(const ModelView&, const Stage<L>&, const LinkPose<Row<L>>* touches,
                            const Row<L>* s);
  static void advance_ground(const ModelView&, const Stage<L>&, const LinkPose<Row<L>>* touches,
                             Row<L>* kept);
};

/// Readings in reverse, and their change along a change of motion.
template <class Arch>
struct ReadingPullbackPart {
  static void pull_back_links(const ModelView&, const GroupState&, std::byte* scratch,
                              MotionCotangent<LaneRow>* links, LaneRow* q_bar, LaneRow* v_bar);
  static std::size_t pullback_bytes(const ModelView&);
  static void pull_back_field(const TactilePullback&);
  static void field_tangent(const TactileTangent&);
};

}  // namespace tangere::kernels
