// SPDX-License-Identifier: Apache-2.0
// View of a compiled scene for kernels: plain arrays of constants, no names, no ownership.
#pragma once

#include <cstdint>

#include "kernels/contact/contact_types.hpp"
#include "kernels/contact/shapes/distance_grid.hpp"
#include "kernels/numbers/linalg.hpp"
#include "kernels/numbers/polynomial.hpp"
#include "kernels/step/transmission_types.hpp"

namespace tangere::kernels {

/// Elementary joints: their motion subspace S is constant in the child frame. A free joint is a
/// translational link without mass, then a spherical one; planar is two prismatic links.
enum class JointKind : std::uint8_t { revolute, prismatic, translational, spherical };

/// Whether the motion subspace has no angular part.
constexpr bool slides(JointKind k) {
  return k == JointKind::prismatic || k == JointKind::translational;
}
constexpr int dofs(JointKind k) {
  return k == JointKind::revolute || k == JointKind::prismatic ? 1 : 3;
}
constexpr int coordinates(JointKind k) { return k == JointKind::spherical ? 4 : dofs(k); }

/// Forces on a joint's dofs besides inertia and contacts. Bits of Link::effects.
enum JointEffect : std::uint8_t {
  kDamping = 1,
  kArmature = 2,
  kSpring = 4,
  kLimit = 8,
  kPositionServo = 16,
  kDryFriction = 32
};
inline constexpr int kPositionDependent = kSpring | kLimit | kPositionServo | kDryFriction,
                     kBeyondDamping = kPositionDependent | kArmature;

/// One elementary joint and everything that moves rigidly with it.
struct Link {
  int parent;  ///< -1: the world
  JointKind kind;
  int q, v;                   ///< first coordinate, first dof
  Vec3<double> axis;          ///< revolute, prismatic: unit, same in parent joint frame and child
  Frame<double> frame;        ///< joint frame at rest, in the parent link's frame
  bool has_rest_rotation;     ///< frame.R is not the identity
  bool may_rotate;            ///< the link's axes may differ from its parent's
  bool has_offset;            ///< its origin may differ from its parent's
  bool parent_never_rotates;  ///< no ancestor ever turns: ω and α of the parent are zero
  /// Nor does this joint: ω and α are zero, and only the force of a wrench does work.
  bool never_rotates;
  bool has_mass;                ///< false: no inertia of its own
  std::uint8_t effects;         ///< JointEffect bits: effects that some dof of the joint has
  double mass;                  ///< [kg]
  Vec3<double> mass_times_com;  ///< mass times centre of mass, link axes [kg m]
  Mat3<double> inertia;         ///< about the link's origin, link axes [kg m²]
  int inertia_row = -1;  ///< ≥ 0: mass, mass · centre and inertia (xx xy xz yy yz zz) are read
                         ///< from ten rows of the block instead
  int place_row = -1;    ///< ≥ 0: frame.p is read from three rows of the block instead
  double gravity_share = 1;  ///< of gravity that acts on it
  double lift = 0;           ///< the share of its tree's root less its own
  /// A dof that follows by a polynomial: its q and v go by LinkScratch::chart, as those of a
  /// spherical joint do.
  bool has_chart = false;
};

/// A number of the scene: the same for all environments, or one row of the batch.
struct Parameter {
  double value;
  int row;  ///< row of the block, -1: constant
};

/// Effects on one dof [SI of its kind]. Effects that its link's flags leave out are not read.
struct DofEffects {
  Parameter damping, armature, stiffness, limit_stiffness;
  double rest;  ///< rest value of the spring; spherical: component of a rotation vector [m, rad]
  double low, high;              ///< limits [m, rad]
  Parameter P, D;                ///< gains of a position motor evaluated at the end of the step
  double force_low, force_high;  ///< range of the motor's force; infinite: none
  /// 1: q does not enter the motor's force, which is P u - D v. 0: it is P (u - q) - D v.
  double q_apart;
  Parameter friction;    ///< bound of dry friction [N or N m]
  double friction_rate;  ///< 1/θ_b of dry friction [1/m or 1/rad]
  double friction_time;  ///< t_f of dry friction [s]
};

/// Parameters of a link (mass, moment, inertia xx xy xz yy yz zz; Link::frame.p), of a solid (its
/// size as contacts see it, with masses held fixed) and of a dof that have a derivative.
inline constexpr int kInertiaNumbers = 10, kSizeNumbers = 3, kPlaceNumbers = 3, kLoopNumbers = 4;
enum DofNumber : int {
  kDofDamping,
  kDofStiffness,
  kDofP,
  kDofD,
  kDofArmature,
  kDofLimitStiffness,
  kDofFriction,
  kDofNumbers
};
/// Where a dof's effects keep these parameters.
inline constexpr Parameter DofEffects::*kDofParameters[kDofNumbers] = {
    &DofEffects::damping,  &DofEffects::stiffness,       &DofEffects::P,       &DofEffects::D,
    &DofEffects::armature, &DofEffects::limit_stiffness, &DofEffects::friction};

/// The row of each parameter among the derivatives by parameters: coefficients of pairs, of ground
/// contacts, inertia of links, parameters of dofs, of solids, places of links, numbers of loops,
/// coefficients of sensors. The compiler of models sets it. Kernels compute those before `sensors`.
struct ParameterRows {
  int grounds = 0, links = 0, dofs = 0, solids = 0, places = 0, loops = 0,
      sensors = 0;  ///< first row of each kind
  int count = 0;
  [[nodiscard]] int pair(int k) const { return kCoefficients * k; }
  [[nodiscard]] int ground(int k) const { return grounds + kCoefficients * k; }
  [[nodiscard]] int link(int k) const { return links + kInertiaNumbers * k; }
  [[nodiscard]] int dof(int k, int which) const { return dofs + kDofNumbers * k + which; }
  [[nodiscard]] int solid(int k) const { return solids + kSizeNumbers * k; }
  [[nodiscard]] int place(int k) const { return places + kPlaceNumbers * k; }
  [[nodiscard]] int loop(int k) const { return loops + kLoopNumbers * k; }
  [[nodiscard]] int sensor(int k) const { return sensors + kCoefficients * k; }
};

using ContactParameters = Coefficients<Parameter>;
/// Whether a contact with these coefficients has shear springs.
inline bool has_shear_spring(const ContactParameters& p) {
  return p.ks.value != 0 || p.ks.row >= 0;
}

/// A convex body for finding where it is widest: half its width along a unit vector e is
/// Σ straight_i |e_i| + √Σ (round_i e_i)².
struct Hull {
  Frame<double> frame;  ///< in its link (or the world)
  Vec3<double> straight, round;
  bool rounded;   ///< `round` is not zero
  double radius;  ///< of a ball around its centre that holds it [m]
};

/// Points of body 1 against the distance function of body 2.
struct PairContact {
  int link1, link2;      ///< -1: fixed in the world; then frame1/frame2 are world frames
  Frame<double> frame2;  ///< shape frame in link2 (or the world)
  PrimitiveShape shape;
  /// As the shape's of() takes it (kernels/contact/shapes), such as a sphere's radius in x. Not
  /// read for planes and meshes.
  Vec3<double> size;
  ContactLaw law;
  double ramp;
  ContactParameters parameters;
  const double* points;  ///< (n_points, 3) in link1's axes (or the world's), in the order of tiles
  const double* tile_points;  ///< (n_tiles, 3, 32) the same points tile by tile: x, y, z of
                              ///< kContactTile points, padded with far points
  const double* tile_bounds;  ///< (ceil(n_tiles/8), 4, 8) centres and radii of the tiles, padded
                              ///< with far tiles
  /// (ceil(n_tiles/2), 4, 8) centres and radii of every eight points of a tile, padded with far
  /// balls; or null in pairs without such balls.
  const double* eight_bounds = nullptr;
  /// (n_points) area for which each point stands [m²]: coefficients count per area. Null: they
  /// count per point.
  const double* weights;
  const double* tile_weights;  ///< (n_tiles, 32) the same tile by tile, padded with zeros
  int n_points, n_tiles;
  Vec3<double> middle;         ///< centre of a ball that holds all points, link1's axes
  double extent;               ///< its radius [m]
  double reach;                ///< largest |point| [m]: bounds how far a rotation moves a point
  int size_row = -1;           ///< ≥ 0: size is read from three rows of the block instead
  int body1 = -1, body2 = -1;  ///< indices into ModelView::solids
  bool faced = false;  ///< a convex body on a cuboid: its faces are chosen per solve (faces.hpp)
  /// How far another cuboid of the link goes on beyond the upper and lower faces of each axis of a
  /// cuboid, x y z [m]; 0: it does not.
  double beyond[6] = {};
  bool covered = false;  ///< some of these are not 0
  Hull hull{};           ///< body 1, if faced
  double overhang = 0;   ///< how far beyond a chosen face's edges a point still touches it [m]
  int memory = -1;       ///< ≥ 0: index into the contacts with shear springs
  const DistanceGrid* grid = nullptr;  ///< of a mesh
  /// > 0: body 1 is a ball of this radius, and `points` is its centre (ball_contact.hpp) [m].
  double ball_radius = 0;
  double ball_tangent = 0;  ///< tangent of `ball_radius`, used by dual numbers alone
  /// ≥ 0: index into the pads of layers that are contacts. Its force is in the layer sums of its
  /// links, which are computed outside of the kernels.
  int layer_pad = -1;
};
inline constexpr int kContactTile = 32;
inline constexpr double kFarAway =
    1e6;  ///< [m] coordinates of filler points: finite, and far from any shape

/// Two links that touch through one or several shapes: one relative motion, one 6×6 block.
struct LinkPair {
  int link1, link2;  ///< the links of all members
  int first, count;  ///< members: pairs pair_order[first] … pair_order[first + count - 1]
  double reach;      ///< largest reach of its members [m]
  double margin;     ///< of candidate lists: points nearer than this to the surface are listed [m]
  bool ball;  ///< its only shape is a sphere, centred at `centre` in link 2, so that turning it
              ///< changes nothing
  Vec3<double> centre;
  bool faced;  ///< some member is
  /// Centres of a ball that holds all contact points, link 1's axes, and of one that holds all
  /// shapes, link 2's axes. Where they are `apart` from each other or more, nothing touches [m].
  /// Infinite: no ball holds the shapes, or their faces.
  Vec3<double> points_middle, shapes_middle;
  double apart;
  double points_radius, shapes_radius;  ///< of these two balls, also where there are faces [m]
  int layer = -1;  ///< ≥ 0: index into StageArgs::layer_sums, if some member has a layer
};

/// Numbers of PairSums: a wrench, and two matrices (6, 6) in blocks.
inline constexpr int kPairSumNumbers = 6 + 2 * 36;
/// Numbers of a pair's motion: pose of link 2 in link 1, R row-major, then p; then the twist W.
inline constexpr int kPairMotionNumbers = 12 + 6;

/// A ball that holds everything of a link that touches other links.
struct LinkBall {
  Vec3<double> centre;  ///< link axes [m]
  double radius;        ///< [m]; < 0: it touches no other; infinite: no ball holds it
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
  Vec3<double> middle;  ///< centre of a ball that holds all of the body's points, link axes
  double extent;        ///< its radius [m]
  int radius_row = -1;  ///< ≥ 0: the row of a sphere's radius, which is not in `extent`
  int body = -1;        ///< index into ModelView::solids
  /// (n_points, 3) tangents of `points`, used by dual numbers alone; nullptr: points stay fixed.
  const double* point_tangents = nullptr;
  // Of bodies with many points, tiles of neighbours (low_points.hpp); without, n_tiles is 0.
  int n_tiles = 0;
  const int* in_tiles = nullptr;  ///< (n_points) numbers of the points, tile by tile
  /// (n_tiles, 4), (blocks, 4) centre and radius of a ball around each, link axes [m].
  const double *tiles = nullptr, *blocks = nullptr;
  int memory = -1;        ///< as in PairContact
  int first_anchor = -1;  ///< of its points among Stage::ground_anchors
};

/// Points of a tile, and tiles of a block. A body with no more points than kFewPoints has no tiles.
inline constexpr int kLowTile = 8, kLowBlock = 8, kFewPoints = 32;
/// Far above the rounding of a point's height [m].
inline constexpr double kAboveRounding = 1e-9;

/// Points with shear springs (kernels/contact/elastic_contact.hpp) against one shape: those of a
/// pair of bodies, of a body on the ground, or of a tactile sensor.
struct ShearSpringContact {
  PairContact contact;  ///< the ground is a plane that is fixed in the world
  bool ground = false;
  int grounded = -1;  ///< index into ModelView::grounds, or -1
  double radius = 0;  ///< as in GroundContact
  int radius_row = -1;
  int first = 0;    ///< number of its first point among all points with shear springs
  int pair = -1;    ///< index into ModelView::pairs, or -1
  int sensor = -1;  ///< index of the sensor, or -1
  int number = 0;   ///< row of its first coefficient (ParameterRows)
  /// (3, stride) all points, padded with far points to whole vectors; of the ground and of sensors.
  const double* places = nullptr;
  int stride = 0;
};

/// Closes a loop: springs hold a point of link 1 at one of link 2, and in a weld the axes of two
/// frames (kernels/step/loops.hpp).
struct Loop {
  int link1, link2;              ///< -1: fixed in the world; then its frame is a world frame
  Frame<double> frame1, frame2;  ///< in link 1 and link 2; the points are their origins
  bool weld;
  Parameter stiffness, damping;                  ///< [N/m, N s/m]
  Parameter turning_stiffness, turning_damping;  ///< of a weld [N m/rad, N m s/rad]
};
/// Its numbers that have a derivative, in this order.
inline constexpr Parameter Loop::*kLoopParameters[kLoopNumbers] = {
    &Loop::stiffness, &Loop::damping, &Loop::turning_stiffness, &Loop::turning_damping};

/// A body of the scene, for derivatives by its size. Its own contact points keep their place on its
/// surface.
struct Solid {
  Frame<double> frame;  ///< in its link (or the world)
  bool stretches;       ///< its contact points follow its size; else they are given, or it has none
  PrimitiveShape shape;
  Vec3<double> size;  ///< as in PairContact
};

/// A link that touches the ground with one or several bodies: one 6×6 block.
struct GroundedLink {
  int link;
  int first, count;  ///< members: grounds ground_order[first] … ground_order[first + count - 1]
};

/// The part of a pattern that may hold other numbers than zero. What lies outside of it is left
/// out: subtracting zeros changes no bit.
struct PatternPart {
  // Of each row (n): its first such entry and one past the last; the same of factor slots, where
  // the first is an even number of slots after the row's (lu.hpp adds them in pairs).
  const int *entry_first, *entry_end, *factor_first, *factor_end;
  const int* lower_begin;  ///< (n + 1) into lower_slot: the entries below pivot k
  const int* lower_slot;   ///< slot of L(i, k)
  const int* run_begin;    ///< (lower entries + 1) into runs: what row i subtracts of row k
  const struct EliminationRun* runs;
};

/// Structure of matrices over dofs. A scene of few trees has one for all environments and steps. In
/// a scene of many trees, A is stored in blocks, one for each tree and two for each two trees that
/// contacts couple at present (Stage::block_first); then only the first rows below are set.
struct Pattern {
  int n;        ///< dofs
  int entries;  ///< stored entries of G_q, C and A; in blocks: of trees alone
  /// Entries that kernels write to. Those from `entries` on are folded into others (Follower).
  int assembled;
  const int* diagonal_entry;  ///< (n): index of entry (i, i)
  int n_trees;
  const int* tree;      ///< (n) of each dof; dofs of a tree are adjacent
  const int* tree_dof;  ///< (n_trees + 1) first dof
  const int*
      ordinals;  ///< 0, 1, … (largest number of dofs of a tree)²: places in a block, row by row
  const int* slot;  ///< (n, n): index of entry (i, j), -1 where always zero; null: in blocks
  const int* entry_column;  ///< (entries) row by row
  // LU: entries of A are scattered to factor slots, then eliminated by interpreting these lists.
  // Factor slots go row by row in elimination order: L(i, ·), U(i, i), U(i, ·). The entries to the
  // right of a pivot are thus adjacent.
  int factor_entries;
  const int* permutation;    ///< (n) elimination step → dof
  const int* scatter;        ///< (entries) slot of A → slot of LU
  const int* row_begin;      ///< (n + 1) first factor slot of row i
  const int* diagonal;       ///< (n) slot of U(i, i)
  const int* factor_column;  ///< (factor_entries) elimination step j of each slot
  PatternPart whole;
  PatternPart apart;  ///< the pattern without contacts that couple dofs
};

/// work[target + r] -= L(i, k) work[source + r] for r < length.
struct EliminationRun {
  int source, target, length;
};

/// A dof that follows others: x = Σ ratio x_leader, with all coordinates kept. With x = G y, where
/// y has the other dofs, the solver's system is g_r = Gᵀ g, A_r = Gᵀ A G. It is stored on all dofs:
/// g of a follower is 0, and its row and column of A are a diagonal entry.
struct Follower {
  int v, q;
  double offset;  ///< of q
};
/// One leader of a follower, which follows none.
struct FollowerTie {
  int v, q, leader_v, leader_q;
  double ratio;
};
/// A[target] += factor A[source].
struct FoldedEntry {
  int target, source;
  double factor;
};

/// A dof that follows one that follows none by q = Σ c_k q_leaderᵏ (polynomial_followers.hpp).
struct PolynomialFollower {
  int v, q, link;
  int leader_v, leader_q;
  Polynomial coefficients;  ///< [SI of its q per power of the leader's]
};
/// A[target] += factor p' A[source], where p' is the slope of a polynomial follower: the row's.
struct SlopedEntry {
  int target, source;
  double factor;
  int follower;
};

struct ModelView {
  int n_links, nq, nv;
  const Link* links;
  Vec3<double> gravity;  ///< world axes [m/s²]
  bool lifted;           ///< some link has a lift
  Vec3<double> ground_point, ground_normal;
  const DofEffects* effects;  ///< (nv)
  int n_pairs, n_grounds;
  const PairContact* pairs;
  const GroundContact* grounds;
  int n_link_pairs, n_grounded;
  bool faced;  ///< some pair is
  const LinkPair* link_pairs;
  const GroundedLink* grounded;
  /// (n_links); null in scenes of few link pairs, whose pairs are all considered.
  const LinkBall* link_balls;
  const int *pair_order, *ground_order;  ///< (n_pairs), (n_grounds): members side by side
  int most_ground_points;                ///< largest number of points of a body on the ground
  int n_solids;
  const Solid* solids;  ///< (n_solids) all bodies of the scene
  ParameterRows rows;
  int n_shear_springs;
  const ShearSpringContact* memories;
  Frame<double> ground;  ///< frame of the ground in the world; its third axis is the normal
  Pattern pattern;
  int n_followers, n_ties, n_folded;
  const Follower* followers;
  const FollowerTie* ties;  ///< (n_ties) follower after follower
  const FoldedEntry* folded;
  int n_polynomials, n_sloped;
  const PolynomialFollower* polynomials;
  const SlopedEntry* sloped;
  int n_loops;
  const Loop* loops;
  int n_transmissions;
  const Transmission* transmissions;
  const TransmissionPiece* pieces;
  int n_transmission_dofs, most_transmission_dofs;  ///< of all together, and of one at most
  const TransmissionDof* transmission_dofs;
};

/// Start of the row that holds the environments of lanes 8 g … 8 g + 7 of a block.
inline const double* row_of(const double* block, int row, int group) {
  return block + row * kBlock + group * kGroup;
}

}  // namespace tangere::kernels
