// SPDX-License-Identifier: Apache-2.0
// The kernels of one instruction set as values: listed, chosen at start, forced with TANGERE_ISA.
#pragma once

#include <span>

#include "kernels/model_view.hpp"
#include "kernels/tactile_types.hpp"

namespace tangere::kernels {

/// Everything a group of L environments needs to evaluate and solve a stage; rows of L lanes
/// (eight, or one), sized by make_workspace_sizes(). Link and contact scratch is opaque bytes: its
/// layout belongs to the kernels.
template <int L>
struct Stage {
  Row<L>*centre, *x, *r, *s, *tau, *target;  // inputs
  Row<L> c0_over_h, inverse_h;
  const double* block;
  int group;
  /// Candidate points of a pair: by lane as they are found, and in rows of eight lanes once more
  /// than one lane needs them.
  struct List {
    double*
        own;  ///< (L, 3, stride): x, y, z of each lane's points, padded to eights with far points
    int own_count[L];  ///< padding not included
    int stride;  ///< the number of the pair's points, rounded up to eights, and eight more: a list
                 ///< cannot overflow
    Row<L>* points;     ///< (stride, 3)
    int count;          ///< rows in use
    Row<L>* reference;  ///< (12) pose of link 2 in link 1 that the list was made at; pairs of the
                        ///< same links share it
    double margin;
  };
  List* lists;         ///< (n_pairs)
  std::byte* scratch;  ///< scratch_bytes(model)
  Row<L>*v, *g, *force_scale, *mass_diagonal, *A, *LU, *work, *excess;
  Row<L>*weight, *inverse_weight;  ///< (nv) D^½ and D^-½, D the mass diagonal
  Row<L> friction_tangent = Row<L>::all(
      1);        ///< 1: the Jacobian is that of g; 0: friction of slipping points by its secant
  Row<L> floor;  ///< smallest ‖D^-½ g‖² that one rounding of x lets one see
};
using GroupStage = Stage<kGroup>;

/// How a stage's rates hang on two older states: r = ρ (q_other ⊖ q_centre), s = s_centre v_centre
/// + s_other v_other.
struct StageHistory {
  double rho, s_centre, s_other;
};

/// Numbers of a scene with a derivative, as parameter_products() lays them out: of each pair and
/// ground contact kn, kt, mu, damping; of each link mass, moment, inertia (xx xy xz yy yz zz); of
/// each dof damping, stiffness, P, D; of each solid its size as contacts see it, masses left alone.
inline constexpr int kContactNumbers = 4, kInertiaNumbers = 10, kDofNumbers = 4, kSizeNumbers = 3;
inline int first_inertia_number(const ModelView& m) {
  return kContactNumbers * (m.n_pairs + m.n_grounds);
}
inline int first_dof_number(const ModelView& m) {
  return first_inertia_number(m) + kInertiaNumbers * m.n_links;
}
inline int first_size_number(const ModelView& m) {
  return first_dof_number(m) + kDofNumbers * m.nv;
}
inline int parameter_numbers(const ModelView& m) {
  return first_size_number(m) + kSizeNumbers * m.n_solids;
}

/// Cotangents on their way back through a solved stage; every array is (nv), positions by their
/// right tangent (kernels/adjoint-inl.hpp).
template <int L>
struct StageAdjoint {
  const Row<L>*q_bar, *v_bar;  ///< of the stage's result
  Row<L>*rhs, *lambda;
  Row<L>*nu, *mass_lambda;  ///< out: v̄ - Cᵀ λ, M λ
  Row<L>* target;           ///< out: of the targets of position motors, zero where there are none
  const Row<L>* other;      ///< q_other ⊖ q_centre
  Row<L>*q_centre, *v_centre;  ///< added to
  Row<L>*q_other, *v_other;    ///< added to
  StageHistory history;
};

/// Which pairs are near enough to search, and the poses that the search needs.
template <int L>
struct NearPairs {
  Row<L>* link_poses;   ///< (n_link_pairs, 12) link 2 in link 1: R row-major, then p
  Row<L>* shape_poses;  ///< (n_pairs, 12) shape in body 1, of pairs with a near lane
  unsigned* lanes;  ///< (n_pairs) bit l: lane l has points that may be nearer to the shape than the
                    ///< list's margin
};

/// One lane's search for points near a shape.
struct CandidateSearch {
  const PairContact* pair;
  Vec3<double> size;   ///< the lane's, as in PairContact
  const double* pose;  ///< (12) shape in body 1: R row-major, then p
  double margin;       ///< points nearer than this to the surface, or inside, are candidates [m]
  double* points;      ///< (3, stride)
  int stride;
};

/// World pose and body twist of a link.
template <class N>
struct LinkPose {
  Frame<N> world;
  Vec6<N> V;
};

/// Cotangents of a link's displacement and body twist, its axes and origin.
template <class N>
struct MotionCotangent {
  Vec6<N> pose, twist;
};

/// State of eight environments as rows.
struct GroupState {
  const LaneRow *q, *v;
  const LaneRow* zero;            ///< (nv) zeros
  LaneRow* rates;                 ///< (nv) scratch
  const double* block = nullptr;  ///< of the batch, for places that vary
  int group = 0;                  ///< which half of it
};

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

/// Tables this machine can run, best first; never empty.
std::span<const KernelTable* const> available_kernels();

/// The table in use: the best one, or the one named by the environment variable TANGERE_ISA when
/// the program started. Throws nothing; an unknown or unsupported name is reported by
/// forced_isa_error().
const KernelTable& active_kernels();

/// "" or why TANGERE_ISA cannot be honoured, with the names that can. Programs check it at start.
const char* forced_isa_error();

/// Runs on `table` from now on (tests visit every one).
void use_kernels(const KernelTable& table);

}  // namespace tangere::kernels
