// SPDX-License-Identifier: Apache-2.0
// The arrays of a Model. They are private to the engine; kernels read them through ModelView.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/compile_cameras.hpp"
#include "engine/model/mesh_grid.hpp"
#include "engine/model/model_info.hpp"
#include "engine/model/pattern.hpp"
#include "kernels/numbers/so3.hpp"
#include "kernels/step/model_view.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere {

/// A body after folding: where it sits on its link (-1: fixed in the world).
struct CompiledBody {
  int link = -1;
  kernels::Frame<double> frame;  ///< body frame in the link (or the world)
  /// Has a distance. A mesh has one if the scene needs it: where something touches it, or where
  /// there are sensors that might.
  bool touchable = true;
  PrimitiveShape shape = PrimitiveShape::sphere;
  kernels::Vec3<double> size{};    ///< as in kernels::PairContact
  double extent = 0;               ///< greatest distance of its points from its origin, about [m]
  kernels::Vec3<double> centre{};  ///< centre of mass, body frame [m]
  double mass = 0;                 ///< [kg]
  int size_row = -1;               ///< ≥ 0: size is read from three rows of the block instead
  /// Distance grid of a mesh that is touchable, or whose contact points are far apart; else null.
  const kernels::DistanceGrid* grid = nullptr;
  double inscribed = 0;  ///< of a mesh with a grid: radius of the largest ball in it at scale 1 [m]
};

/// A joint of the scene: its elementary links and its coordinates.
struct CompiledJoint {
  int first_link = -1, link_count = 0;  ///< none for a fixed joint
  int q = 0, v = 0;                     ///< first coordinate, first dof
  int link = -1;                        ///< the link that bodies of this joint move with
  kernels::Frame<double> frame;         ///< joint frame in that link
};

/// Motor on one dof. Its input is u or, where it maps, scale clip(u, u_low, u_high) + offset. Force
/// motors: force = low + (clip(u) + 1)/2 (high - low), or the input clipped to the range. Position
/// motors evaluated at the end of the step are effects of their joint
/// (kernels/step/joint_effects.hpp), and the input is their target. So are force motors with D:
/// clip(input - D v, range).
struct CompiledMotor {
  int dof;
  double low, high;
  MotorControl control;
  MotorTiming timing;
  int link, component;  ///< elementary link, and the index of the dof within it
  kernels::Parameter P, D;
  bool maps;
  double scale, offset, u_low, u_high;
  bool at_end;  ///< its force is an effect of its joint, and the input is its target
};

/// Flat pads with at most this many points are read in all environments at once.
inline constexpr int kSmallPad = 512;

struct CompiledLayer;

/// How far a force spreads along an axis of a grid. The force of point j moves to point i by the
/// share kernel[|i - j|] scale[j]; the shares of a point sum to 1.
struct LateralSpread {
  std::vector<double> kernel;  ///< (reach + 1); empty: no spread
  std::vector<double> scale;   ///< (points along the axis)
};

/// Points of one sensor in tiles of 8×8, in its pad's axes (kernels/tactile/tactile_types.hpp).
struct CompiledSensor {
  int body = -1, link = -1;
  /// Pad frame in the link: axes axis0, axis1 and their product, origin at the array's middle.
  kernels::Frame<double> pad;
  int rows = 0, cols = 0, tile_rows = 0, tile_cols = 0;
  AlignedVector<double> tile_x, tile_y, tile_z, tile_radius;  ///< (n_tiles, padded to 8)
  std::vector<int> tile_kind;                                 ///< (n_tiles)
  AlignedVector<double> offsets;  ///< (4, 2, 64) flat, (n_tiles, 3, 64) curved
  AlignedVector<float> offsets_f;
  std::vector<int> index;  ///< (n_tiles, 64) curved, empty: flat
  AlignedVector<double> frames,
      factors;  ///< (n_tiles, 9 and kPointCoefficients, 64); no factors: all 1
  AlignedVector<float> frames_f, factors_f;
  /// Spheres around eight tiles each, pad axes [m]: (n_tiles / 8, padded to 8).
  AlignedVector<double> eight_x, eight_y, eight_z, eight_radius;
  double middle[3] = {}, reach = 0;  ///< a sphere around all points, pad axes [m]
  AlignedVector<double> parts;       ///< (4, 8) spheres around eighths of the pad (PadTiles::parts)
  bool skewed = false;
  double axes[9] = {};  ///< rows axis0, axis1, -(axis0 × axis1), pad axes
  kernels::ContactParameters parameters{};
  ContactLaw law = ContactLaw::clamped;
  std::vector<int> targets;  ///< sensed bodies
  /// (targets) Of a layer that is the contact: number of the body's link among theirs. Bodies of
  /// one link share the layer. Else zeros.
  std::vector<int> target_groups;
  bool sizes_vary = false;  ///< some of their sizes vary
  /// Of a layer under load control: pairs of the sensor's body with the targets.
  std::vector<int> contacts;
  SensorImperfections imperfections{};
  bool imperfect = false;            ///< some imperfection is on
  int number = 0;                    ///< of the sensor in the scene
  int grid_rows = 0, grid_cols = 0;  ///< of points that have neighbours, row-major
  /// Of the sensor's name. Seeds of its random numbers differ by it, so that other sensors do not
  /// matter.
  std::uint64_t name_bits = 0;
  int delay = 0;  ///< [steps]
  /// (n) weights of the ideal fields `delay`, delay + 1, … steps ago; empty without lag.
  std::vector<double> weights{};
  std::array<LateralSpread, 2> spread{};         ///< from row to row, and from column to column
  bool elastic = false;                          ///< its points have shear springs (k_s)
  std::shared_ptr<const CompiledLayer> layer{};  ///< of its pressures; null: springs
  /// Steps between updates of the shear state. If > 0, the state stores the anchors b and a of each
  /// point (first all b, then all a). 0: updated at every step; the state stores s.
  int shear_interval = 0;
  /// Points of an elastic sensor in the order of the tiles of its contacts.
  std::vector<int> in_field;          ///< (n) number in the field
  std::vector<double> point_axes;     ///< (n, 9) rows axis0, axis1, -normal; axes of the link
  std::vector<double> point_factors;  ///< (n, kPointCoefficients) or empty: all 1

  /// Earlier states on which a reading depends.
  [[nodiscard]] int past_states() const {
    return weights.empty() ? 0 : delay + static_cast<int>(weights.size()) - 1;
  }
  [[nodiscard]] int points() const { return rows * cols; }
  [[nodiscard]] int n_tiles() const { return tile_rows * tile_cols; }
  [[nodiscard]] kernels::PadTiles tiles() const;
};

/// A dof with dry friction, and its coordinate.
struct DryDof {
  int v, q;
};

/// A sensor's pad whose layer is its contact.
struct LayerPad {
  int sensor;
  std::shared_ptr<const CompiledLayer> layer;
  kernels::Frame<double> frame;  ///< of the pad in its link, as in CompiledSensor
  std::vector<int> in_field;     ///< (points) number in the field of point k of its contacts
};

/// An end effector.
struct CompiledEndEffector {
  int link = -1;                  ///< -1: fixed in the world
  kernels::Vec3<double> point{};  ///< link axes (or the world's) [m]
};

/// Rows of a block: q, v, the state one step before, the varying numbers, then earlier states for
/// sensors with lag: a ring buffer of `past_states` times q and v, in which the state after n steps
/// of the episode is at n % past_states.
struct BlockLayout {
  int q = 0, v = 0, previous_q = 0, previous_v = 0, parameters = 0, rows = 0;
  int past = 0, past_states = 0;
};

/// Mass [kg], mass times centre of mass x y z [kg m], inertia xx xy xz yy yz zz about a link's
/// origin [kg m²], link axes.
using InertiaRows = std::array<double, 10>;

/// A link with bodies whose density varies. Rows `row` … of the block are constant + Σ density
/// per_density.
struct VaryingInertia {
  struct Part {
    int body;
    int row;                  ///< row of the block that holds the density [kg/m³]
    InertiaRows per_density;  ///< for a density of 1
  };
  int link = -1;
  int row = 0;
  bool anew = false;  ///< sizes vary too: the sum over all bodies is computed anew instead
  InertiaRows constant{};
  std::vector<Part> parts;
};

/// A number that a row of the block holds. `which`: index within a size (size_number), or
/// component.
struct VaryingNumber {
  int which, row;
};
/// Rows `row` … of the block hold a size as in CompiledBody.
struct VaryingSize {
  int body = -1;
  int row = 0;
  std::vector<VaryingNumber> numbers;
};
/// Rows `row` … of the block hold the place of a joint's first link at rest, in its parent link.
struct VaryingPlace {
  int joint = -1;
  int row = 0;
  kernels::Frame<double> base;  ///< frame in which the scene gives the joint's place
  std::vector<VaryingNumber> numbers;
};

/// Size of a ShearEntry [bytes].
inline constexpr std::size_t kShearEntryBytes = 32;

struct CompiledModel {
  Scene scene;
  /// Origin of internal coordinates in the world [m], zero unless the scene is far from the world's
  /// origin, where positions would lose digits. Outputs add it.
  kernels::Vec3<double> origin{0, 0, 0};
  bool moved = false;  ///< origin is not the world's
  [[nodiscard]] kernels::Vec3<double> in_world(const kernels::Vec3<double>& p) const {
    return moved ? p + origin : p;  // not p + 0, which would lose the sign of -0
  }
  int nq = 0, nv = 0, nu = 0;
  std::vector<kernels::Link> links;
  std::vector<CompiledJoint> joints;  ///< parallel to scene.links
  std::vector<CompiledBody> bodies;   ///< parallel to scene.links
  std::vector<CompiledMotor> motors;  ///< one per control
  std::vector<CompiledSensor> sensors;
  std::vector<CompiledEndEffector> end_effectors;
  std::vector<CompiledCamera> cameras;
  std::vector<LayerPad> layer_pads;
  int layer_rows = 0;  ///< layer_row(0)
  /// Returns the row of derivatives of the thickness of a sensor's layer; ν has the next one.
  [[nodiscard]] int layer_row(int sensor) const { return layer_rows + 2 * sensor; }
  int layer_link_pairs = 0;  ///< link pairs that they touch
  std::vector<kernels::PairContact> pairs;
  std::vector<kernels::GroundContact> grounds;
  std::vector<kernels::Solid> solids;  ///< parallel to bodies
  std::vector<kernels::ShearSpringContact> shear_springs;
  /// Bodies whose contact points are far apart for each other (contact_resolution.hpp).
  std::vector<std::array<int, 2>> coarse_pairs;
  int shear_spring_points = 0;  ///< points of all `shear_springs`
  /// Entries of a shear state at most: the points of a sensor count once, not once for every
  /// sensed body; dofs with dry friction count, too.
  int taped_points = 0;
  int ground_anchors = 0;  ///< points of those on the ground
  /// Joints' dofs with dry friction, ascending. The shear state has an entry for each, numbered
  /// after the points of `shear_springs`, with the elastic displacement in its first component.
  std::vector<DryDof> dry_dofs;
  [[nodiscard]] bool has_shear_state() const { return !shear_springs.empty() || !dry_dofs.empty(); }
  /// Numbers of entries that the shear state may have.
  [[nodiscard]] int shear_state_points() const {
    return shear_spring_points + static_cast<int>(dry_dofs.size());
  }
  /// Number of points of sensors with shear_interval > 0; they come first among
  /// shear_spring_points. Steps do not change their entries.
  int kept_points = 0;
  /// Steps between updates of a contact's shear state; 0: updated at every step.
  [[nodiscard]] int shear_interval(const kernels::ShearSpringContact& of) const {
    return of.sensor < 0 ? 0 : sensors[std::size_t(of.sensor)].shear_interval;
  }
  /// Number of shear-state entries that a contact may have.
  [[nodiscard]] int shear_rows(const kernels::ShearSpringContact& of) const {
    return of.contact.n_points * (shear_interval(of) > 0 ? 2 : 1);
  }
  std::vector<kernels::LinkPair> link_pairs;
  std::vector<kernels::GroundedLink> grounded;
  std::vector<kernels::LinkBall> link_balls;  ///< (links); empty in scenes of few link pairs
  std::vector<int> pair_order, ground_order;  ///< members of link_pairs and grounded, side by side
  std::vector<std::vector<double>> point_storage;           ///< what pairs and grounds point into
  std::vector<std::shared_ptr<const MeshGrid>> mesh_grids;  ///< what bodies' grids are in
  std::vector<AlignedVector<double>>
      tile_storage;  ///< what the tiles of pairs and of grounds point into
  std::vector<std::vector<int>> order_storage;  ///< what grounds' in_tiles point into
  std::vector<VaryingInertia> varying_inertia;
  std::vector<VaryingSize> varying_sizes;
  std::vector<VaryingPlace> varying_places;
  std::vector<kernels::DofEffects> dof_effects;          ///< (nv)
  std::vector<kernels::Follower> followers;              ///< dofs that follow others
  std::vector<kernels::FollowerTie> ties;                ///< their leaders
  std::vector<kernels::PolynomialFollower> polynomials;  ///< dofs that follow by polynomials
  /// Whether some dof follows others, not by a transmission.
  [[nodiscard]] bool has_followers() const { return !followers.empty() || !polynomials.empty(); }
  std::vector<kernels::Loop> loops;                  ///< parallel to scene.loops
  std::vector<kernels::Transmission> transmissions;  ///< parallel to scene.transmissions
  std::vector<kernels::TransmissionPiece> transmission_pieces;
  std::vector<kernels::TransmissionDof> transmission_dofs;
  /// (nv) magnitude to which an unknown is rounded: extent of the scene [m], 1 [rad].
  std::vector<double> unknown_scale;
  /// Dofs of bodies that can reach each other by joints and contacts, component by component: those
  /// of component c are component_dofs[component_begin[c]] … component_begin[c + 1] - 1.
  std::vector<int> component_dofs, component_begin;
  [[nodiscard]] int components() const { return static_cast<int>(component_begin.size()) - 1; }
  double fall_time = 0;  ///< √(extent of the scene/|gravity|) [s]; infinite without gravity
  std::vector<double> initial_q, initial_v;
  PatternStorage pattern;
  BlockLayout layout;
  std::vector<int> randomized_row;  ///< parallel to scene.randomizations: row of a block
  /// Parallel to scene.randomizations: the entry whose random number draws it (scene_number.hpp).
  std::vector<std::size_t> drawn_with;
  kernels::ModelView view{};

  std::vector<SensorInfo> sensor_info;
  std::vector<EndEffectorInfo> end_effector_info;
  std::vector<ContactInfo> contact_info;
  std::vector<MeshInfo> mesh_info;  ///< of bodies with a grid, in their order
  std::vector<EffectInfo> effects;  ///< of the whole scene
  std::vector<StageInfo> stages;
  std::vector<std::string> q_names, v_names, u_names, q_units, v_units, u_units, body_names;
};

/// Where missing points and tiles are put [m]: beyond any shape, but finite, so that nothing
/// overflows.
inline constexpr double kFarAway = 1e6;

/// Points the view at the model's own arrays. Gravity and the ground are left as they are.
void point_view(CompiledModel& m);
/// The same for transmissions alone.
void point_transmissions(const CompiledModel& m, kernels::ModelView& view);

}  // namespace tangere
