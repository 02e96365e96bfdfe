// SPDX-License-Identifier: Apache-2.0
// What the engine hands to kernels of a step and what they hand back: rows, poses, cotangents.
#pragma once

#include <cstddef>

#include "kernels/step/model_view.hpp"

namespace tangere::kernels {

/// Everything a group of L environments needs to evaluate and solve a stage; rows of L lanes
/// (eight, or one), sized by engine/step/workspace.cpp. Link and contact scratch is opaque bytes:
/// its layout belongs to the kernels.
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

/// A state that a stage hangs on beside its centre; rows (nv), R a row of lanes or a number.
template <class R>
struct OlderState {
  double rho, s;        ///< r has ρ (q ⊖ q_centre), s has s v
  const R* difference;  ///< q ⊖ q_centre
  R *q, *v;             ///< cotangents, added to: q unless ρ is zero, v unless s is zero
};
/// How a stage's rates hang on what came before: r = Σ ρ (q ⊖ q_centre),
/// s = s_centre v_centre + Σ s v.
template <class R>
struct StageHistory {
  static constexpr int kMost = 4;
  double s_centre;
  int count;
  OlderState<R> older[kMost];
};

/// Numbers of a scene with a derivative, as parameter_products() lays them out: of each pair and
/// ground contact its coefficients; of each link mass, moment, inertia (xx xy xz yy yz zz); of
/// each dof damping, stiffness, P, D; of each solid its size as contacts see it, masses left alone.
inline constexpr int kInertiaNumbers = 10, kDofNumbers = 4, kSizeNumbers = 3;
inline int first_inertia_number(const ModelView& m) {
  return kCoefficients * (m.n_pairs + m.n_grounds);
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
/// right tangent (kernels/reverse/adjoint.hpp).
template <int L>
struct StageAdjoint {
  const Row<L>*q_bar, *v_bar;  ///< of the stage's result
  Row<L>*rhs, *lambda;
  Row<L>*nu, *mass_lambda;  ///< out: v̄ - Cᵀ λ, M λ
  Row<L>* target;           ///< out: of the targets of position motors, zero where there are none
  Row<L>*q_centre, *v_centre;  ///< added to
  StageHistory<Row<L>> history;
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

}  // namespace tangere::kernels
