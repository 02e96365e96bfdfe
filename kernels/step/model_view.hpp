// SPDX-License-Identifier: Apache-2.0
// A compiled scene as kernels see it: plain arrays of constants, no names, no ownership.
#pragma once

#include <cstdint>

#include "kernels/contact/contact_types.hpp"
#include "kernels/numbers/linalg.hpp"

namespace tangere::kernels {

/// Elementary joints: their motion subspace S is constant in the child frame. A free joint is a
/// translational link without mass, then a spherical one; planar is two prismatic links.
enum class JointKind : std::uint8_t { revolute, prismatic, translational, spherical };

/// The motion subspace has no angular part.
constexpr bool slides(JointKind k) {
  return k == JointKind::prismatic || k == JointKind::translational;
}
constexpr int dofs(JointKind k) {
  return k == JointKind::revolute || k == JointKind::prismatic ? 1 : 3;
}
constexpr int coordinates(JointKind k) { return k == JointKind::spherical ? 4 : dofs(k); }

/// What acts on a joint's dofs beside inertia and contacts; bits of Link::effects.
enum JointEffect : std::uint8_t {
  kDamped = 1,
  kArmoured = 2,
  kSprung = 4,
  kLimited = 8,
  kDriven = 16
};
inline constexpr int kOfPosition = kSprung | kLimited | kDriven,
                     kBeyondDamping = kOfPosition | kArmoured;

/// One elementary joint and everything that moves rigidly with it.
struct Link {
  int parent;  ///< -1: the world
  JointKind kind;
  int q, v;             ///< first coordinate, first dof
  Vec3<double> axis;    ///< revolute, prismatic: unit, same in parent joint frame and child
  Frame<double> frame;  ///< joint frame at rest, in the parent link's frame
  bool rotated;         ///< frame.R is not the identity
  bool turned;          ///< the link's axes may differ from its parent's
  bool placed;          ///< its origin may differ from its parent's
  bool steady;          ///< no ancestor ever turns: the parent's ω and α are zero
  bool still;  ///< nor does this joint: ω and α are zero, and of a wrench only the force does work
  bool massive;          ///< false: no inertia of its own
  std::uint8_t effects;  ///< JointEffect bits: what some dof of the joint has
  double mass;           ///< [kg]
  Vec3<double> moment;   ///< mass times centre of mass, link axes [kg m]
  Mat3<double> inertia;  ///< about the link's origin, link axes [kg m²]
  int inertia_row = -1;  ///< ≥ 0: mass, moment and xx xy xz yy yz zz of the inertia stand in ten
                         ///< rows of the block instead
  int place_row = -1;    ///< ≥ 0: frame.p stands in three rows of the block instead
};

/// A number of the scene: the same for all environments, or one row of the batch.
struct Parameter {
  double value;
  int row;  ///< row of the block, -1: constant
};

/// Effects on one dof [SI of its kind]; those that its link's flags leave out are not read.
struct DofEffects {
  Parameter damping, armature, stiffness, limit_stiffness;
  double rest;       ///< of the spring; spherical: component of a rotation vector [m, rad]
  double low, high;  ///< limits [m, rad]
  Parameter P, D;    ///< gains of a position motor evaluated at the end of the step
  double force_low, force_high;  ///< its range; infinite: none
};

using ContactParameters = Coefficients<Parameter>;

/// Points of body 1 against the distance function of body 2.
struct PairContact {
  int link1, link2;      ///< -1: fixed in the world; then frame1/frame2 are world frames
  Frame<double> frame2;  ///< shape frame in link2 (or the world)
  PrimitiveShape shape;
  /// Sphere: radius in x; cuboid: half edges; rods: radius, half axis; ellipsoid: semi-axes.
  Vec3<double> size;
  ContactLaw law;
  double ramp;
  ContactParameters parameters;
  const double* points;       ///< (n_points, 3) in link1's axes (or the world's), sorted into tiles
  const double* tile_points;  ///< (n_tiles, 3, 32) the same: x, y, z of kContactTile points, padded
                              ///< with far points
  const double* tile_bounds;  ///< (ceil(n_tiles/8), 4, 8) centres and radii of the tiles, padded
                              ///< with far ones
  int n_points, n_tiles;
  Vec3<double> middle;         ///< of a ball that holds all points, link1's axes
  double extent;               ///< its radius [m]
  double reach;                ///< largest |point| [m]: bounds how far a rotation moves one
  int size_row = -1;           ///< ≥ 0: size stands in three rows of the block instead
  int body1 = -1, body2 = -1;  ///< of ModelView::solids
};
inline constexpr int kContactTile = 32;
inline constexpr double kFarAway =
    1e6;  ///< [m] coordinates of filler points: finite, and no shape is there

/// Two links that touch through one shape or several: one relative motion, one 6×6 block.
struct LinkPair {
  int link1, link2;  ///< of all its members
  int first, count;  ///< members: pairs pair_order[first] … pair_order[first + count - 1]
  double reach;      ///< largest of its members' [m]
  double margin;     ///< of candidate lists: points this near to a shape are listed [m]
  bool ball;  ///< its only shape is a sphere, centred at `centre` in link 2: turning it changes
              ///< nothing
  Vec3<double> centre;
};

/// A body against the half-space below the ground: points of the body, or a sphere's lowest point.
struct GroundContact {
  int link;
  double radius;  ///< 0: material points; > 0: sphere, `points` holds its centre
  ContactLaw law;
  double ramp;
  ContactParameters parameters;
  const double* points;  ///< (n_points, 3), link axes
  int n_points;
  Vec3<double> middle;  ///< of a ball that holds all of the body's points, link axes
  double extent;        ///< its radius [m]
  int radius_row = -1;  ///< ≥ 0: a sphere's radius stands there instead, and is not in `extent`
  int body = -1;        ///< of ModelView::solids
  const double* point_tangents =
      nullptr;  ///< (n_points, 3) of `points`, for dual numbers alone; nullptr: they stay
};

/// A body of the scene, for derivatives by its size: its own contact points keep their place on its
/// surface.
struct Solid {
  Frame<double> frame;  ///< in its link (or the world)
  bool stretches;       ///< its contact points follow its size; else they are given, or it has none
  PrimitiveShape shape;
  Vec3<double> size;  ///< as in PairContact
};

/// A link that touches the ground with one body or several: one 6×6 block.
struct GroundedLink {
  int link;
  int first, count;  ///< members: grounds ground_order[first] … ground_order[first + count - 1]
};

/// Structure of matrices over dofs, shared by every environment and step.
struct Pattern {
  int n;            ///< dofs
  int entries;      ///< stored entries of G_q, C and A
  const int* slot;  ///< (n, n): index of entry (i, j), -1 where always zero
  const int*
      entry_begin;  ///< (n + 1): entries of row i are entry_begin[i] … entry_begin[i + 1] - 1
  const int* entry_column;  ///< (entries)
  // LU: entries of A scattered to factor slots, then an interpreted elimination. Factor slots go
  // row by row in elimination order: L(i, ·), U(i, i), U(i, ·), so that what is right of a pivot
  // lies side by side.
  int factor_entries;
  const int* permutation;    ///< (n) elimination step → dof
  const int* scatter;        ///< (entries) slot of A → slot of LU
  const int* row_begin;      ///< (n + 1) first factor slot of row i
  const int* diagonal;       ///< (n) slot of U(i, i)
  const int* factor_column;  ///< (factor_entries) elimination step j of each slot
  const int* lower_begin;    ///< (n + 1) into lower_slot: the entries below pivot k
  const int* lower_slot;     ///< slot of L(i, k)
  const int* run_begin;      ///< (lower entries + 1) into runs: what row i takes from row k
  const struct EliminationRun* runs;
};

/// work[target + r] -= L(i, k) work[source + r] for r < length.
struct EliminationRun {
  int source, target, length;
};

struct ModelView {
  int n_links, nq, nv;
  const Link* links;
  Vec3<double> gravity;  ///< world axes [m/s²]
  Vec3<double> ground_point, ground_normal;
  const DofEffects* effects;  ///< (nv)
  int n_pairs, n_grounds;
  const PairContact* pairs;
  const GroundContact* grounds;
  int n_link_pairs, n_grounded;
  const LinkPair* link_pairs;
  const GroundedLink* grounded;
  const int *pair_order, *ground_order;  ///< (n_pairs), (n_grounds): members side by side
  int n_solids;
  const Solid* solids;  ///< (n_solids) every body of the scene
  Pattern pattern;
};

/// Start of the row holding environment lanes 8 g … 8 g + 7 of a block.
inline const double* row_of(const double* block, int row, int group) {
  return block + row * kBlock + group * kGroup;
}

}  // namespace tangere::kernels
