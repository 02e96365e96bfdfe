// SPDX-License-Identifier: Apache-2.0
// Arguments of the kernels of a step: rows, poses, cotangents.
#pragma once

#include <cstddef>

#include "kernels/step/model_view.hpp"

namespace tangere::kernels {

/// Everything that a group of L environments needs to evaluate and solve a stage. Rows have L lanes
/// (eight, or one) and are sized by engine/step/workspace.cpp. Link and contact scratch is opaque
/// bytes, whose layout belongs to the kernels.
template <int L>
struct Stage {
  Row<L>*centre, *x, *r, *s, *tau, *target;  // inputs
  Row<L>* dry_anchor;  ///< (nv) q at which the spring of dry friction is slack; read where the
                       ///< joint has any
  Row<L> c0_over_h, inverse_h;
  const double* block;
  int group;
  /// Candidate points of a pair: lane by lane as they are found, and also in rows of eight lanes if
  /// more than one lane needs them.
  struct List {
    /// (L, 3, stride): x, y, z of each lane's points, padded to multiples of eight with far points.
    double* own;
    int own_count[L];  ///< without padding
    int stride;        ///< the number of the pair's points, rounded up to a multiple of eight, plus
                       ///< eight: a list cannot overflow
    Row<L>* points;    ///< (stride, 3)
    int count;         ///< rows in use
    Row<L>* reference;  ///< (12) pose of link 2 in link 1 at which the list was made; pairs of the
                        ///< same links share it
    double margin;
    /// (L, stride) of each lane's points in PairContact::points; null in pairs without shear
    /// springs and layers.
    int* own_index;
    // Anchors of the points, those of the present solve; null in pairs without shear springs.
    double* own_anchors;  ///< (L, kAnchorNumbers, stride)
    Row<L>* anchors;      ///< (stride, kAnchorNumbers)
    // Areas of the points; null in pairs whose coefficients count per point.
    double* own_weights;  ///< (L, stride)
    Row<L>* weights;      ///< (stride)
  };
  List* lists;  ///< (n_pairs)
  /// (n_link_pairs) 1: by the last detection, the links cannot touch in any lane. Their lists are
  /// not read.
  unsigned char* apart;
  /// (n_considered) ascending link pairs that may touch in this solve in some lane. The others are
  /// apart. Null: all link pairs are considered.
  const int* considered = nullptr;
  int n_considered = 0;
  /// Of scenes with link balls: (n_links, 3) their centres in the world where the solve starts [m],
  /// (n_links) how far these may move from there, and how far they did in kinematics() [m].
  Row<L>*ball_starts = nullptr, *ball_slack = nullptr, *ball_moves = nullptr;
  /// 0: the last Jacobian has zeros in all lanes wherever contacts alone couple dofs.
  unsigned char* coupled;
  Row<L>* ground_anchors;  ///< (points with shear springs, kAnchorNumbers)
  /// (link pairs with layers, kPairSumNumbers) as StageArgs::layer_sums, each as PairSums.
  Row<L>* layer_sums = nullptr;
  Row<L>* faces;       ///< (n_pairs, 3) faces that count in this solve (kernels/step/faces.hpp)
  std::byte* scratch;  ///< scratch_bytes(model)
  /// (n_link_pairs) square of the distance from LinkPair::points_middle to shapes_middle [m²], of
  /// links that are apart.
  Row<L>* between;
  Row<L>*v, *g, *force_scale, *mass_diagonal, *A, *LU, *work, *excess;
  /// (n_trees, n_trees) first entry of A of each block that is stored, row by row; null: not in
  /// blocks. All stored entries, in blocks.
  const int* block_first = nullptr;
  int block_entries = 0;
  Row<L>*weight, *inverse_weight;  ///< (nv) D^½ and D^-½, D the mass diagonal
  /// 1: the Jacobian is that of g. 0: it takes friction of slipping points by its secant.
  Row<L> friction_tangent = Row<L>::all(1);
  /// Factors of contacts' kn and damping, and of their kt and ks, while a root is approached from
  /// softer contacts; else 1.
  Row<L> normal_share = Row<L>::all(1), friction_share = Row<L>::all(1);
  Row<L> floor;  ///< smallest ‖D^-½ g‖² that the rounding of x can resolve
};
using GroupStage = Stage<kGroup>;

/// A state other than the centre that a stage depends on. Rows (nv); R is a row of lanes or a
/// number.
template <class R>
struct OlderState {
  double rho, s;        ///< r contains ρ (q ⊖ q_centre), s contains s v
  const R* difference;  ///< q ⊖ q_centre
  R *q, *v;             ///< cotangents; added to q unless ρ is zero, to v unless s is zero
};
/// How a stage's rates depend on earlier states: r = Σ ρ (q ⊖ q_centre),
/// s = s_centre v_centre + Σ s v.
template <class R>
struct StageHistory {
  static constexpr int kMost = 5;
  double s_centre;
  int count;
  OlderState<R> older[kMost];
};

/// Cotangents that pass back through a solved stage. Every array is (nv), positions by their right
/// tangent (kernels/reverse/adjoint.hpp).
template <int L>
struct StageAdjoint {
  const Row<L>*q_bar, *v_bar;  ///< of the stage's result
  Row<L>*rhs, *lambda;
  Row<L>*nu, *mass_lambda;  ///< out: v̄ - Cᵀ λ and M λ
  Row<L>* target;           ///< out: of the targets of position motors; zero where there are none
  Row<L>* dry_anchor;       ///< out: of Stage::dry_anchor; zero where there is no dry friction
  Row<L>*q_centre, *v_centre;  ///< added to
  StageHistory<Row<L>> history;
};

/// Which pairs are near enough to search, and the poses that the search needs. Nothing is set for
/// pairs of links that are apart.
template <int L>
struct NearPairs {
  Row<L>* link_poses;   ///< (n_link_pairs, 12) link 2 in link 1: R row-major, then p
  Row<L>* shape_poses;  ///< (n_pairs, 12) shape in body 1, for pairs that are near in some lane
  unsigned* lanes;      ///< (n_pairs) bit l: in lane l, points may be nearer to the shape than the
                        ///< list's margin
  unsigned* outrun;  ///< (n_link_pairs) bit l: lane l moved farther than the margin of its lists,
                     ///< or has none
};

/// One lane's search for points near a shape.
struct CandidateSearch {
  const PairContact* pair;
  Vec3<double> size;   ///< of this lane, as in PairContact
  const double* pose;  ///< (12) shape in body 1: R row-major, then p
  double margin;       ///< points nearer than this to the surface, or inside, are candidates [m]
  double* points;      ///< (3, stride)
  /// Room for points. Where more than stride - 8 are found, some may be missing.
  int stride;
  Vec3<double> faces;         ///< of this lane (kernels/step/faces.hpp)
  int* index;                 ///< out: (stride) of the points in PairContact::points; or null
  double* weights = nullptr;  ///< out: (stride) of the points; null where the pair has none
};

/// World pose and body twist of a link.
template <class N>
struct LinkPose {
  Frame<N> world;
  Vec6<N> V;
};

/// Cotangents of a link's displacement and body twist, in its axes at its origin.
template <class N>
struct MotionCotangent {
  Vec6<N> pose, twist;
};

/// State of eight environments, as rows.
struct GroupState {
  const LaneRow *q, *v;
  const LaneRow* zero;            ///< (nv) zeros
  LaneRow* rates;                 ///< (nv) scratch
  const double* block = nullptr;  ///< of the batch, for parameters that vary
  int group = 0;                  ///< which half of the block
};

}  // namespace tangere::kernels
