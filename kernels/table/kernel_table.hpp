// SPDX-License-Identifier: Apache-2.0
// The kernels of one instruction set as values: listed, chosen at start, forced with TANGERE_ISA.
#pragma once

#include <span>

#include "kernels/step/arguments.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// Kernels of a stage for groups of L environments.
template <int L>
struct StageKernels {
  std::size_t (*scratch_bytes)(const ModelView&);
  /// Poses and motions at x, and `excess`.
  void (*kinematics)(const ModelView&, const Stage<L>&);
  /// Bounds against shapes at the poses of kinematics().
  void (*near_pairs)(const ModelView&, const Stage<L>&, NearPairs<L>& out);
  /// g, v and force_scale at the x of kinematics(). `lone`: the only lane whose result matters, -1:
  /// all do.
  void (*residual)(const ModelView&, const Stage<L>&, int lone);
  /// The same with mass_diagonal and A. Both give the same bits.
  void (*evaluate)(const ModelView&, const Stage<L>&, int lone);
  /// weight, inverse_weight from mass_diagonal.
  void (*set_weights)(const ModelView&, Stage<L>&);
  /// floor from A, in lanes where accept > 0. `unknown_scale`: (nv) what an unknown is rounded
  /// against.
  void (*set_floor)(const ModelView&, Stage<L>&, const double* unknown_scale, const Row<L>& accept);
  /// ‖D^-½ g‖ over what it is measured by; 0 where it is below the floor.
  void (*scaled_residual)(const ModelView&, const Stage<L>&, double gravity, Row<L>& out);
  /// ‖D^½ a‖.
  void (*weighted_norm)(const ModelView&, const Stage<L>&, const Row<L>* a, Row<L>& out);
  /// LU of A in the lanes where accept > 0; in all when it is null.
  void (*factor)(const ModelView&, const Stage<L>&, const Row<L>* accept);
  /// out = A⁻¹ b by the factor as it is.
  void (*solve)(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out);
  /// The same, refined once; sound[l] = 1 where the result can be trusted.
  void (*solve_watched)(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out,
                        Row<L>* sound);
  /// out = A⁻ᵀ b, refined once.
  void (*solve_transposed)(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out,
                           Row<L>* sound);
  /// rhs of the adjoint at the x of evaluate().
  void (*adjoint_rhs)(const ModelView&, const Stage<L>&, const StageAdjoint<L>&);
  /// Everything that follows from λ.
  void (*adjoint_products)(const ModelView&, const Stage<L>&, const StageAdjoint<L>&);
  /// Adds -(∂g/∂p)ᵀ λ to (parameter_numbers(model)); after adjoint_products(). `lone` as in
  /// evaluate().
  void (*parameter_products)(const ModelView&, const Stage<L>&, const StageAdjoint<L>&, int lone,
                             Row<L>* out);
};

struct KernelTable {
  const char* name;  ///< "avx512", "avx2", "sse2", "scalar"
  StageKernels<kGroup> group;
  StageKernels<1> single;  ///< one environment on its own: the same bits as in a group
  /// Fills `points`, padded to whole eights; returns how many without the padding.
  int (*find_candidates)(const CandidateSearch&);
  /// The rows of a list from its lanes' points.
  void (*transpose_list)(GroupStage::List&);
  /// Poses and twists of every link, (n_links).
  void (*link_poses)(const ModelView&, const GroupState&, LinkPose<LaneRow>* out);
  /// Pose and twist of a shape against a pad, both given in their links (nullptr: the world).
  /// Parameters are left alone.
  void (*pad_touch)(const LinkPose<LaneRow>* sensor, const Frame<double>& pad,
                    const LinkPose<LaneRow>* body, const Frame<double>& shape, Touch<LaneRow>* out);
  /// Field of one environment; how many tiles are touched.
  int (*tactile)(const TactileArgs<double>&);
  int (*tactile_mixed)(const TactileArgs<float>&);
  /// Fields of eight and of sixteen environments.
  void (*tactile_block)(const TactileBlockArgs<double>&);
  void (*tactile_block_mixed)(const TactileBlockArgs<float>&);
  /// Cotangents of links (n_links; used up) to those of q and v, (nv), added to. `scratch`:
  /// pullback_bytes(model).
  void (*pull_back_links)(const ModelView&, const GroupState&, std::byte* scratch,
                          MotionCotangent<LaneRow>* links, LaneRow* q_bar, LaneRow* v_bar);
  std::size_t (*pullback_bytes)(const ModelView&);
  /// A field in reverse.
  void (*pull_back_field)(const TactilePullback&);
  /// A field along a change of motion.
  void (*field_tangent)(const TactileTangent&);

  template <int L>
  [[nodiscard]] const StageKernels<L>& stage() const {
    if constexpr (L == 1) {
      return single;
    } else {
      return group;
    }
  }
};

/// Tables that were built and this machine can run, best first; never empty.
std::span<const KernelTable* const> available_kernels();

/// The table in use: the best one, or the one named by the environment variable TANGERE_ISA when
/// the program started. Throws nothing; an unknown or unsupported name is reported by
/// forced_isa_error() (isa.hpp).
const KernelTable& active_kernels();

/// Runs on `table` from now on (tests visit every one).
void use_kernels(const KernelTable& table);

}  // namespace tangere::kernels
