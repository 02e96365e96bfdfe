// SPDX-License-Identifier: Apache-2.0
// The kernels of one instruction set as a value that can be listed, chosen at start, or forced with
// TANGERE_ISA.
#pragma once

#include <span>

#include "kernels/layer/layer_types.hpp"
#include "kernels/shear/shear_types.hpp"
#include "kernels/step/arguments.hpp"
#include "kernels/step/block_lu_types.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// Kernels of a stage for groups of L environments.
template <int L>
struct StageKernels {
  std::size_t (*scratch_bytes)(const ModelView&);
  /// Computes poses and motions at x, and `excess`.
  void (*kinematics)(const ModelView&, const Stage<L>&);
  /// Chooses faces (kernels/step/faces.hpp) at the poses of kinematics(), to (n_pairs, 3).
  void (*choose_faces)(const ModelView&, const Stage<L>&, Row<L>* out);
  /// The same at q. `zero`: (nv) zeros. Overwrites v and what kinematics() left.
  void (*choose_faces_at)(const ModelView&, const Stage<L>&, const Row<L>* q, const Row<L>* zero,
                          Row<L>* out);
  /// Computes the centres of the links' balls at q, (n_links, 3) [m]. `zero`, and what is
  /// overwritten: as in choose_faces_at().
  void (*place_balls)(const ModelView&, const Stage<L>&, const Row<L>* q, const Row<L>* zero,
                      Row<L>* out);
  /// Computes poses and twists of all links at (q, v). `zero`: (nv) zeros. Overwrites the stage's
  /// `work`.
  void (*poses_at)(const ModelView&, const Stage<L>&, const Row<L>* q, const Row<L>* v,
                   const Row<L>* zero, LinkPose<Row<L>>* out);
  /// Tests the bounds of pairs against shapes at the poses of kinematics().
  void (*near_pairs)(const ModelView&, const Stage<L>&, NearPairs<L>& out);
  /// Copies the motion of the link pairs with layers at the x of kinematics(), (those,
  /// kPairMotionNumbers). That of links that are apart is not set.
  void (*pair_motions)(const ModelView&, const Stage<L>&, Row<L>* out);
  /// Computes g, v and force_scale at the x of kinematics(). `lone`: the only lane whose result
  /// matters; -1: all lanes matter.
  void (*residual)(const ModelView&, const Stage<L>&, int lone);
  /// The same, with mass_diagonal and A. g, v and force_scale have the same bits as from
  /// residual().
  void (*evaluate)(const ModelView&, const Stage<L>&, int lone);
  /// Copies the wrenches of contacts at the x of residual() or evaluate(), (n_link_pairs +
  /// n_grounded, 6): torque, then force, on the first link about its origin, in its axes.
  void (*contact_wrenches)(const ModelView&, const Stage<L>&, Row<L>* out);
  /// Computes weight and inverse_weight from mass_diagonal.
  void (*set_weights)(const ModelView&, Stage<L>&);
  /// Computes floor from A, in lanes where accept > 0. `unknown_scale`: (nv) the magnitudes to
  /// which unknowns are rounded.
  void (*set_floor)(const ModelView&, Stage<L>&, const double* unknown_scale, const Row<L>& accept);
  /// Computes ‖D^-½ g‖ divided by its scale (kernels/step/norms.hpp); 0 where it is below the
  /// floor.
  void (*scaled_residual)(const ModelView&, const Stage<L>&, double gravity, Row<L>& out);
  /// Computes ‖D^½ a‖.
  void (*weighted_norm)(const ModelView&, const Stage<L>&, const Row<L>* a, Row<L>& out);
  /// Factors A into LU in the lanes where accept > 0, or in all lanes when it is null.
  void (*factor)(const ModelView&, const Stage<L>&, const Row<L>* accept);
  /// Computes out = A⁻¹ b from the present factor.
  void (*solve)(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out);
  /// The same, refined once. sound[l] = 1 where the result can be trusted.
  void (*solve_watched)(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out,
                        Row<L>* sound);
  /// Computes out = A⁻ᵀ b, refined once.
  void (*solve_transposed)(const ModelView&, const Stage<L>&, const Row<L>* b, Row<L>* out,
                           Row<L>* sound);
  /// Computes rhs of the adjoint at the x of evaluate().
  void (*adjoint_rhs)(const ModelView&, const Stage<L>&, const StageAdjoint<L>&);
  /// Computes everything that follows from λ.
  void (*adjoint_products)(const ModelView&, const Stage<L>&, const StageAdjoint<L>&);
  /// Adds -(∂g/∂p)ᵀ λ to rows (ParameterRows). Call after adjoint_products(). `lone` as in
  /// evaluate().
  void (*parameter_products)(const ModelView&, const Stage<L>&, const StageAdjoint<L>&, int lone,
                             Row<L>* out);
  /// Adds cotangents of the links' poses and twists at (q, v) to those of q and v, (nv), and of the
  /// links' places, (n_links, 3), or null. Overwrites those of links, (n_links), and the stage's
  /// `work`. `scratch`: pullback_bytes(model).
  void (*pull_back_poses)(const ModelView&, const Stage<L>&, const Row<L>* q, const Row<L>* v,
                          const Row<L>* zero, std::byte* scratch, MotionCotangent<Row<L>>* links,
                          Row<L>* q_bar, Row<L>* v_bar, Row<L>* places);
  /// Computes the touched shape in body 1 and the twist W of contacts with shear springs, from
  /// `first` up to but without `end`, (n_shear_springs), from poses and twists of the links.
  /// Contacts with lanes[k] = 0 are left out; null: none is.
  void (*touches_at)(const ModelView&, const LinkPose<Row<L>>* links, int first, int end,
                     const unsigned* lanes, LinkPose<Row<L>>* out);
  /// Clears the lanes of contacts with the ground and of sensors in which no point can touch.
  /// `lanes`: (n_shear_springs).
  void (*clear_far_contacts)(const ModelView&, const Stage<L>&, const LinkPose<Row<L>>* links,
                             unsigned* lanes);
  /// Computes Stage::ground_anchors from elastic displacements (body 1's axes, or null) and from
  /// the touches where a solve begins.
  void (*recall_ground)(const ModelView&, const Stage<L>&, const LinkPose<Row<L>>* touches,
                        const Row<L>* s);
  /// Computes the shear state at the end of a solve, (points, 4): s', then 1 at points that touch,
  /// else 0. s' is only set where a point touches. Contacts with lanes[k] = 0 are left out.
  void (*advance_ground)(const ModelView&, const Stage<L>&, const LinkPose<Row<L>>* touches,
                         const unsigned* lanes, Row<L>* kept);
};

struct KernelTable {
  const char* name;  ///< "avx512", "avx2", "sse2", "scalar"
  StageKernels<kGroup> group;
  StageKernels<1> single;  ///< one environment on its own: the same bits as in a group
  /// Fills `points`, padded to a multiple of eight. Returns their number without padding.
  int (*find_candidates)(const CandidateSearch&);
  /// Makes the rows of a list from its lanes' points, all but the anchors.
  void (*transpose_list)(GroupStage::List&, unsigned lanes);
  /// Makes the rows of the anchors of all lanes.
  void (*transpose_anchors)(const GroupStage::List&);
  /// Computes poses and twists of all links, (n_links).
  void (*link_poses)(const ModelView&, const GroupState&, LinkPose<LaneRow>* out);
  /// Computes pose and twist of a shape against a pad, both given in their links (nullptr: the
  /// world). Leaves the contact parameters alone.
  void (*pad_touch)(const LinkPose<LaneRow>* sensor, const Frame<double>& pad,
                    const LinkPose<LaneRow>* body, const Frame<double>& shape, Touch<LaneRow>* out);
  /// Computes the field of one environment. Returns the number of touched tiles.
  int (*tactile)(const TactileArgs<double>&);
  int (*tactile_mixed)(const TactileArgs<float>&);
  /// Compute the fields of eight and of sixteen environments.
  void (*tactile_block)(const TactileBlockArgs<double>&);
  void (*tactile_block_mixed)(const TactileBlockArgs<float>&);
  /// Adds the cotangents of links, (n_links), to those of q and v, (nv), and of the links' places,
  /// (n_links, 3), or null. Overwrites those of links. `scratch`: pullback_bytes(model).
  void (*pull_back_links)(const ModelView&, const GroupState&, std::byte* scratch,
                          MotionCotangent<LaneRow>* links, LaneRow* q_bar, LaneRow* v_bar,
                          LaneRow* places);
  std::size_t (*pullback_bytes)(const ModelView&);
  /// Computes a field in reverse.
  void (*pull_back_field)(const TactilePullback&);
  /// Computes how a field changes with motion.
  void (*field_tangent)(const TactileTangent&);
  /// Converts elastic displacements, in rows 3 to 5 of the anchors, to anchors.
  void (*recall)(const ShearSpringTouch&, const ShearSpringPoints&);
  /// Computes anchors of listed points from the entries of a shear state. `index`: rising numbers
  /// of the points in their contact. Returns the entries behind those of the last point.
  ShearEntries (*recall_entries)(const ShearSpringTouch&, const ShearSpringPoints&,
                                 const int* index, ShearEntries);
  /// Computes a contact's entries at the end of a step: those of the points that touch there.
  void (*advance_entries)(ShearUpdate&);
  /// The same of a pair in the lanes of a group, whose lists are in rows.
  void (*advance_list)(ShearListUpdate&);
  /// Computes the shear state at the end of a step, (4, stride): s in body 1's axes, then 1 at
  /// points that touch, else 0; and the forces there, (3, stride), or null.
  void (*advance)(const ShearSpringTouch& end, const ShearSpringPoints&, double* s, double* force);
  /// Reverses both.
  void (*pull_back_memory)(const ShearPullback&);
  /// Factors a matrix in blocks, in place. `work`: a block of the two largest nodes.
  void (*factor_blocks)(const BlockPlan&, double* LU, double* work);
  /// Solves x = A⁻¹ b, padded vectors that may be the same. `work`: the largest node.
  void (*solve_blocks)(const BlockPlan&, const double* LU, const double* b, double* x,
                       double* work);
  /// The same, refined once; and x = A⁻ᵀ b. Return whether the result can be trusted. `work`: five
  /// vectors and the largest node.
  bool (*solve_blocks_watched)(const BlockPlan&, const double* A, const double* LU, const double* b,
                               double* x, double* work);
  bool (*solve_blocks_transposed)(const BlockPlan&, const double* A, const double* LU,
                                  const double* b, double* x, double* work);
  /// Finds the points that a body touches on a layer that is the contact. Returns their number.
  int (*find_layer_points)(const LayerSearch&);
  /// Sets the friction of points with loads, and adds their wrench, (6).
  void (*add_layer_forces)(const LayerPoints&, double* wrench);
  /// Adds the slopes of the wrench of one body's points, and their sums over cells.
  void (*add_layer_slopes)(const LayerSlopeSums&);
  /// Overwrites the upper triangle of M, (n, n), by U with M = Uᵀ U.
  void (*factor_layer)(double* U, int n);
  /// Solves M x = b in place.
  void (*solve_layer)(const double* U, int n, double* x);
  /// Computes C x of a layer's compliance.
  void (*couple_cells)(const LayerProduct&);
  /// Adds what the yield of the cells changes in the slopes of the wrench.
  void (*add_yield_slopes)(const LayerSystem&);

  template <int L>
  [[nodiscard]] const StageKernels<L>& stage() const {
    if constexpr (L == 1) {
      return single;
    } else {
      return group;
    }
  }
};

/// Returns the tables that were built and that this machine can run, best first; never empty.
std::span<const KernelTable* const> available_kernels();

/// Returns the table in use: the best one, or the one named by the environment variable TANGERE_ISA
/// when the program started. Throws nothing; isa_error() (isa.hpp) says why that table
/// cannot be used.
const KernelTable& active_kernels();

/// Makes `table` the table in use (tests visit every one).
void use_kernels(const KernelTable& table);

}  // namespace tangere::kernels
