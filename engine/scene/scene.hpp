// SPDX-License-Identifier: Apache-2.0
// A scene as its author wrote it, in SI units, with defaults filled in. Its parts refer to each
// other by name. io/scene/scene_reader.hpp reads it from XML. Model compiles it to indices.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "engine/base/error.hpp"
#include "engine/base/vector3.hpp"
#include "engine/scene/camera.hpp"
#include "engine/scene/channels.hpp"
#include "engine/scene/gel.hpp"
#include "engine/scene/number_address.hpp"
#include "engine/scene/pose.hpp"
#include "engine/scene/scheme.hpp"
#include "engine/scene/sensor_imperfections.hpp"
#include "kernels/contact/contact_types.hpp"

namespace tangere {

enum class JointType { fixed, revolute, prismatic, planar, translational, free2d, spherical, free };
enum class MotorControl { force, position };
/// When a position motor's force is computed. end: implicit, stable for any gain. start: the
/// published explicit law, unstable once h D/I exceeds 2.
enum class MotorTiming { end, start };

/// Coefficients of one penalty contact or tactile point.
using ContactCoefficients = Coefficients<double>;

/// Effects on every dof of a joint, in SI by the dof's kind. Spherical joints have components of a
/// rotation vector in place of q, and torques and accelerations in body axes (docs/dynamics.md).
struct JointEffects {
  double damping = 0;   ///< force = -damping v [N s/m or N m s/rad]
  double armature = 0;  ///< inertia that moves with the dof alone, such as a rotor's [kg or kg m²]
  double stiffness = 0;        ///< force = -stiffness (q - rest) [N/m or N m/rad]
  double limit_stiffness = 0;  ///< force per distance of q outside the limits [N/m or N m/rad]
  std::optional<std::array<double, 2>> limits;  ///< low, high [m or rad]
  double friction = 0;                          ///< bound of dry friction [N or N m]
  /// Of dry friction (kernels/step/dry_friction.hpp): the elastic displacement at which a joint
  /// breaks away [m or rad], 0: that of default_friction_break(); and damping over stiffness of
  /// one that sticks [s].
  double friction_break = 0, friction_time = 1e-3;

  /// The numbers that may vary, in the order of effect_field().
  double& operator[](std::size_t k) { return this->*kOrder[k]; }
  const double& operator[](std::size_t k) const { return this->*kOrder[k]; }
  /// Whether number k acts. A stiffness of limits acts where there are limits.
  [[nodiscard]] bool acts(std::size_t k) const {
    return (*this)[k] != 0 && (kOrder[k] != &JointEffects::limit_stiffness || limits);
  }

 private:
  static constexpr double JointEffects::*kOrder[] = {
      &JointEffects::damping, &JointEffects::armature, &JointEffects::stiffness,
      &JointEffects::limit_stiffness, &JointEffects::friction};
};
inline constexpr std::size_t kJointEffects = 5;
/// Displacement at which a joint with dry friction breaks away, where none is given [m or rad].
constexpr double default_friction_break(bool turns) { return turns ? 1e-3 : 5e-5; }

/// Powers of a joint that follows another by a polynomial, from the second on.
inline constexpr std::size_t kMostPowers = 3;

struct JointDescription : JointEffects {
  std::string name;
  JointType type = JointType::fixed;
  Pose pose;  ///< joint frame in the parent joint's frame (frame="WORLD" is resolved by the reader)
  Vector3 axis0{0, 0, 1};  ///< revolute, prismatic, planar: unit, in the joint frame
  Vector3 axis1{0, 1, 0};  ///< planar only
  /// Rest position of the spring, one number per dof; empty: zeros. free: x y z, then a rotation
  /// vector.
  std::vector<double> rest;
  /// free2d, free: effects of the dofs that turn, where they differ from those that slide.
  std::optional<JointEffects> turning;
  /// Revolute, prismatic: the joints that this one follows, q = Σ ratio q_leader + offset; empty:
  /// none. ratio [m or rad of this joint per m or rad of the leader], offset [m or rad].
  std::vector<std::string> follows;
  std::vector<double> ratio;
  double offset = 0;
  /// With one leader: adds powers[k] q_leaderᵏ⁺², at most kMostPowers of them [m or rad of this
  /// joint per power of the leader's].
  std::vector<double> powers;
  Source source;

  /// Returns the share of leader k, at its coordinate q_leader, in this joint's coordinate.
  [[nodiscard]] double share_of_leader(std::size_t k, double q_leader) const {
    double share = ratio[k] * q_leader, power = q_leader;
    for (const double c : powers) share += c * (power *= q_leader);
    return share;
  }
};

struct CuboidShape {
  Vector3 size{0, 0, 0};                           ///< full edge lengths [m]
  std::array<int, 3> contact_resolution{6, 6, 6};  ///< grid whose surface nodes are the points
};
struct SphereShape {
  double radius = 0;  ///< [m]
};
/// Closed cylinder along the body's z. Contact points: centres and rings of the two end faces.
struct CylinderShape {
  double length = 0, radius = 0;  ///< [m]
  int contact_angles = 8;         ///< points on a ring
  int contact_rings = 3;          ///< rings on a face; ring k has radius r k/rings
};
/// All points within `radius` of a segment of `length` along the body's z. Contact points: two
/// poles, and rings around the straight part, its ends included.
struct CapsuleShape {
  double length = 0, radius = 0;  ///< [m]; from pole to pole it is length + 2 radius
  int contact_rings = 5;
  int contact_angles = 4;  ///< points on a ring
};
/// The semi-axes are half the size. They differ by a factor of 100 at most. Contact points: a
/// spiral from pole to pole, evenly spread on a ball and stretched with it.
struct EllipsoidShape {
  Vector3 size{0, 0, 0};  ///< full lengths along the body's axes [m]
  int contact_count = 100;
};
/// The half-space z < 0 of the body frame: no mass, no contact points.
struct PlaneShape {};
/// A closed surface of triangles, whose corners are anticlockwise seen from outside.
struct MeshShape {
  std::vector<double> vertices;  ///< (n, 3), body frame [m]
  std::vector<std::array<int, 3>> triangles;
  std::vector<double> contact_points = {};  ///< (n, 3), body frame [m]; empty: all vertices
  static constexpr int kMostCells = 128;    ///< along the longest side
  /// Cells of its distance along the longest side. 0: it has no distance, and nothing touches it.
  int resolution = 64;
  /// Instead of `resolution`: how far the distance may be off on the surface, as MeshFit::error at
  /// the mesh's scale [m]; 0: `resolution` counts.
  double error = 0;
  double scale = 1;  ///< of all lengths above, which are given at scale 1
};
/// A body given by its mass, inertia and contact points alone. It has no distance. Its centre of
/// mass is the body frame's origin.
struct AbstractShape {
  double mass = 0;                     ///< [kg]; density has no effect
  std::array<double, 6> inertia{};     ///< xx xy xz yy yz zz, body axes [kg m²]
  std::vector<double> contact_points;  ///< (n, 3), body frame [m]
};
using Shape = std::variant<SphereShape, CuboidShape, CylinderShape, CapsuleShape, EllipsoidShape,
                           PlaneShape, MeshShape, AbstractShape>;

/// A rigid body of uniform density, or one given by its mass (AbstractShape).
struct BodyDescription {
  std::string name;
  Shape shape;
  Pose pose;           ///< body frame in the joint's frame
  double density = 1;  ///< [kg/m³]; 0: massless, so something with mass must move with it
  std::array<double, 4> rgba{0.7, 0.7, 0.7, 1};
  Source source;
  double gravity_share = 1;  ///< of gravity that acts on it; the same on one link
  /// What cameras see of an abstract body, body frame; null: nothing.
  std::shared_ptr<const MeshShape> surface = nullptr;
  double specular = 0;     ///< strength of the highlight of a camera's lamp, 0 to 1
  double shininess = 0.5;  ///< the smaller the highlight the larger: its exponent is 128 of it
  double emission = 0;     ///< share of its colour that it emits in pictures of cameras
};

/// A link: one joint to the parent link (or the world) and one body that moves with it.
struct LinkDescription {
  std::string name;
  int parent = -1;  ///< index into Scene::links, -1 = world; parents come first
  JointDescription joint;
  BodyDescription body;
};

/// Force motor: u in [-1, 1] per dof of the joint is clipped and mapped linearly to [low, high].
/// With `scale`, the force is scale u + offset, clipped to [low, high]. Position motor: the target
/// of q (spherical: a rotation vector) is u + offset or scale u + offset, and the force is
/// P (target - q) - D v, clipped to [low, high]. A force motor with D controls a velocity: its
/// force is scale u + offset - D v, clipped.
/// A joint may have several motors, of which at most one has gains.
struct MotorDescription {
  std::string joint;
  double low = -1;  ///< force at u = -1 [N or N m]; position: smallest force, -infinity for none
  double high = 1;  ///< force at u = +1; position: largest force, infinity for none
  Source source;
  MotorControl control = MotorControl::force;
  double P = 0, D = 0;                    ///< gains [N/m, N s/m or N m/rad, N m s/rad]
  MotorTiming timing = MotorTiming::end;  ///< position motors: when q and v are taken for the force
  /// free2d, free: low and high of the dofs that turn, where they differ from those that slide
  /// [N m].
  std::optional<std::array<double, 2>> turning = {};
  std::string name = {};  ///< of its controls; empty: that of the joint
  /// Force or target per u, where u has no unit [N, N m, m, rad]. A force motor without it has
  /// neither offset nor u_range.
  std::optional<double> scale = {};
  double offset = 0;  ///< force or target at u = 0
  static constexpr double kNoBound = std::numeric_limits<double>::infinity();
  std::array<double, 2> u_range = {-kNoBound, kNoBound};  ///< to which u is clipped first

  /// Whether its force depends on the state at the end of the step: position motors, and force
  /// motors with D, whose force is scale u + offset - D v, clipped to [low, high].
  [[nodiscard]] bool acts_at_end() const {
    return control == MotorControl::position ? timing == MotorTiming::end : D > 0;
  }
  /// Whether it has a gain D, or P as well.
  [[nodiscard]] bool has_gains() const { return control == MotorControl::position || D > 0; }
  /// The name of its controls, before that of the dof.
  [[nodiscard]] const std::string& control_name() const { return name.empty() ? joint : name; }
  /// Whether u differs from what the law of the motor without scale, offset and u_range reads.
  [[nodiscard]] bool maps() const {
    return scale || offset != 0 || u_range != std::array{-kNoBound, kNoBound};
  }
};

/// Rectangular array of tactile points: p(i, j) = corner0 + i Δ0 axis0 + j Δ1 axis1, in the body
/// frame [m].
struct RectArray {
  Vector3 corner0{}, corner1{};  ///< the first point and the last
  Vector3 axis0{}, axis1{};      ///< unit, orthogonal
  int rows = 1, cols = 1;
};

/// A tactile point with its own position and axes, in the body frame.
struct TactilePoint {
  Vector3 position{};                  ///< [m]
  Vector3 normal{}, axis0{}, axis1{};  ///< unit
  std::array<int, 2> pixel{-1, -1};    ///< row and column in an image; -1: none
  /// Multiply the sensor's coefficients (factor_index()).
  std::array<double, kPointCoefficients> factors{1, 1, 1, 1};
};

/// Markers on a gel, one at every point, whose displacements a camera behind it measures
/// (engine/sense/marker_map.hpp).
struct MarkersDescription {
  double stiffness = 0;  ///< of the gel under a point against shear [N/m]; 0: the sensor's ks
  double thickness = 0;  ///< of the gel [m]; 0: it does not bulge beside a press
  double spread = 0;     ///< distance over which the surface moves along [m]
  Source source;
};

/// Material of a skin: a layer that is bonded to a stiff back (engine/scene/skin_material.hpp).
struct SkinMaterial {
  double modulus = 0;        ///< Young's modulus E [Pa]
  double thickness = 0;      ///< t [m]
  double relaxation = 5e-3;  ///< time in which it relaxes, τ [s]
};

/// A layer that couples the points of a skin (docs/layer.md).
struct LayerDescription {
  double poisson = 0.475;          ///< ν
  double cell = 0;                 ///< side of a cell [m]; 0: follows the thickness
  std::optional<double> margin{};  ///< from the cells to free sides [m]; none: no sides
  Source source;
  /// The layer is the contact of the sensor's points. It needs their contacts
  /// (engine/scene/sensor_contacts.hpp), which the scene reader adds.
  bool feedback = false;
  /// The layer carries the loads of the contacts between the sensor's body and those that it
  /// senses. A body without such a contact adds none. Not with feedback.
  bool load_control = false;
};

/// Pressure of a skin that is no elastic layer, by its depth (docs/table.md).
struct PressureTable {
  std::vector<double> depth;     ///< [m], from 0, ascending
  std::vector<double> pressure;  ///< [Pa], from 0, not falling
  double thickness = 0;          ///< where depth ends [m]; 0: at twice the last depth
  double relaxation = 5e-3;      ///< τ [s]

  /// Mean stiffness by area [N/m³].
  [[nodiscard]] double stiffness() const { return pressure.back() / depth.back(); }
};

/// A tactile sensor: points of a skin on `body`, each with the coefficients of a penalty contact.
struct TactileDescription {
  std::string name;
  std::string body;
  ContactCoefficients coefficients{};
  ContactLaw law = ContactLaw::clamped;
  RectArray array;
  std::vector<TactilePoint> points;  ///< a curved pad, in field order; empty: `array` is used
  int every = 0;                     ///< read every k-th step; 0: not given, the caller chooses
  /// Whether the shear state is updated only at steps that are multiples of `every`, which must
  /// then be given, instead of every step.
  bool shear_at_readings = false;
  std::optional<int> pressure_sign;  ///< +1 or -1; found from the geometry when not given
  Source source;
  /// Names of bodies that it senses, or ignores (sensed_bodies.hpp); at most one list is given.
  std::vector<std::string> feels{}, ignores{};
  SensorImperfections imperfections{};          ///< of its readings; none to begin with
  std::optional<MarkersDescription> markers{};  ///< none: it has none
  /// Area of a point whose coefficients the file gives by area [m²]; 0: it gives those of a point.
  double cell = 0;
  /// From which the file takes the coefficients that it does not give; none: it gives all.
  std::optional<SkinMaterial> material{};
  /// Couples its points; needs a material. None: every point is a spring of its own.
  std::optional<LayerDescription> layer{};
  /// Takes the place of kn in readings. None: the pressure is linear in depth.
  std::optional<PressureTable> table{};
  /// Picture of a camera behind its gel. None: the sensor has no pictures.
  std::optional<PictureDescription> picture{};
  /// What its hardware returns. None: the sensor has no channels.
  std::optional<ChannelsDescription> channels{};
};

/// Lists the points of a sensor in field order: those of an array row by row, with its axes. The
/// list has the same field as the array.
std::vector<TactilePoint> tactile_points(const TactileDescription& sensor);

/// An end effector: a point that moves with a joint. Its world position is an output.
struct EndEffectorDescription {
  std::string name;
  std::string joint;
  /// In the joint's moving frame, in which bodies are placed too [m].
  Vector3 position{0, 0, 0};
  double radius = 2e-3;  ///< [m]; only for pictures, like the colour
  std::array<double, 4> rgba{1, 0, 0, 1};
  Source source;
};

/// The half-space below a plane through `position`, world frame.
struct GroundDescription {
  Vector3 position{0, 0, 0};  ///< [m]
  Vector3 normal{0, 0, 1};    ///< unit, pointing out of the half-space
};

inline constexpr double kUsualRamp = 1e-5;       ///< [m]
inline constexpr double kUsualRampShare = 1e-3;  ///< of a body's extent

/// Contact points of `body` against the ground.
struct GroundContactDescription {
  std::string body;
  ContactCoefficients coefficients{};
  ContactLaw law = ContactLaw::linear;
  /// Depth over which the linear law's damper fades in [m]; 0: the published law, which pulls.
  /// None: kUsualRamp, or kUsualRampShare of the body's extent if that is less.
  std::optional<double> ramp{};
  Source source;
};

/// Contact points of `general_body` against the signed distance of `primitive_body`.
struct PairContactDescription {
  std::string general_body, primitive_body;
  ContactCoefficients coefficients{};
  ContactLaw law = ContactLaw::clamped;
  std::optional<double> ramp{};  ///< as in GroundContactDescription, of general_body
  Source source;
  /// A tactile sensor of general_body whose points touch instead of the body's own; empty: none.
  std::string sensor = {};
  /// Its points (n, 3), in the frame of general_body [m]; empty: the body's own.
  std::vector<double> points = {};
  /// (n) areas for which `points` stand [m²]: all coefficients but mu count per area. Empty: they
  /// count per point.
  std::vector<double> areas = {};
  double spacing = 0;      ///< distance of neighbouring points that have areas, at most [m]
  bool on_ground = false;  ///< `points` touch the ground; primitive_body is "ground"
  /// With the contact before it, one contact of two surfaces, whose coefficients are those of the
  /// first.
  bool second_half = false;

  [[nodiscard]] bool per_area() const { return !areas.empty(); }
  /// The first part of the contact's name; the second is primitive_body.
  [[nodiscard]] std::string first_name() const {
    return sensor.empty() ? general_body : "tactile " + sensor;
  }
};

/// Closes a loop of links: springs hold a point of body 1 at a point of body 2; in a weld, they
/// also hold the axes of a frame of body 2 at those of body 1 (docs/dynamics.md).
struct LoopDescription {
  std::string name;
  std::string body1, body2;  ///< body 2 empty: the world
  bool weld = false;
  Vector3 position1{0, 0, 0};          ///< of the point, frame of body 1 [m]
  std::optional<Vector3> position2{};  ///< in body 2 or the world [m]; none: as at the start
  /// Of the axes of body 1 in body 2 (or the world), w x y z; none: as at the start. Welds only.
  std::optional<Quaternion> orientation2{};
  double stiffness = 0;          ///< [N/m]
  double damping = 0;            ///< [N s/m]
  double turning_stiffness = 0;  ///< of a weld [N m/rad]
  double turning_damping = 0;    ///< of a weld [N m s/rad]
  Source source;
};

/// One part of a path: a point of a body, a surface that the path goes around, or a pulley.
struct PathPart {
  enum class Kind { point, sphere, cylinder, pulley };
  Kind kind = Kind::point;
  std::string body = {};      ///< empty: the world
  Vector3 position{0, 0, 0};  ///< of the point or the centre, frame of the body [m]
  double radius = 0;          ///< of the surface [m]
  Vector3 axis{0, 0, 1};      ///< of a cylinder without ends; unit, frame of the body
  /// A point outside of the surface on the side of the path, frame of the body [m]; none: the path
  /// takes the shorter way round.
  std::optional<Vector3> side{};
  double divisor = 1;  ///< of a pulley: of the lengths after it, up to the next pulley
};

/// Makes a joint of one dof without mass a length of other joints, or the power of a wrench: what
/// acts on the joint acts through it (docs/dynamics.md).
struct TransmissionDescription {
  enum class Kind {
    path,   ///< its coordinate is the length of a path [m]
    wrench  ///< its rate is the power of a force and a torque on a body, and its coordinate 0
  } kind = Kind::path;
  std::string joint;
  std::vector<PathPart> path{};
  std::string body = {};      ///< of the wrench
  Vector3 position{0, 0, 0};  ///< where its force acts, frame of the body [m]
  Vector3 force{0, 0, 0};     ///< per force of the joint, axes of the body, or of `reference`
  Vector3 torque{0, 0, 0};    ///< per force of the joint, axes of the body [m]
  /// Of a wrench: the joint's coordinate is force · (point - point of this body), in its axes, and
  /// there is no torque. Empty: none.
  std::optional<std::string> reference{};
  Vector3 reference_position{0, 0, 0};  ///< in the frame of `reference` [m]
  Source source{};
};

/// Starting state of one joint; empty vectors leave the default (q = 0 or the identity, v = 0).
struct InitialState {
  std::string joint;
  std::vector<double> q;  ///< free: x y z qw qx qy qz; spherical: qw qx qy qz; else one per dof
  /// One number per dof; free: linear (joint frame axes), then angular (body axes).
  std::vector<double> v;
  Source source;
};

/// Controls of an unattended rollout. There is one value per control: motors in file order, each
/// dof in turn.
struct ConstantControl {
  std::vector<double> values;
};
struct PiecewiseControl {     ///< values[k] holds from times[k] until times[k+1]; times[0] = 0
  std::vector<double> times;  ///< [s], ascending
  std::vector<std::vector<double>> values;
  double end = 0;  ///< [s] length of the run that it describes; 0: open
};
struct CsvControl {
  std::vector<std::vector<double>>
      rows;  ///< one row per step; read by io; fewer rows than steps is an error
  std::string path;
};
struct RandomControl {   ///< smooth noise: cosine-interpolated uniform knots, drawn per environment
  double amplitude = 1;  ///< largest |u|
  double period = 0.1;   ///< time between knots [s]
};
using ControlDescription =
    std::variant<ConstantControl, PiecewiseControl, CsvControl, RandomControl>;

/// A number that differs between environments, drawn from (seed, episode, purpose).
struct Distribution {
  enum class Kind { uniform, log_uniform, normal, list } kind = Kind::uniform;
  double a = 0, b = 0;  ///< uniform, log_uniform: low, high; normal: mean, standard deviation
  std::vector<double> values;  ///< list: equally likely
};
struct RandomizationDescription {
  SceneNumber number;
  Distribution distribution;
  Source source;
  /// Numbers with the same tie are drawn by one random number: they have the same kind of
  /// distribution, and lists of one length. "": drawn alone.
  std::string tie{};
};

/// Outputs that runs of the scene compute and store (engine/scene/field_form.hpp).
struct OutputsDescription {
  std::vector<std::string> record;  ///< names of outputs
  Source source;
};

/// Default of SolverOptions::sleep when sleep is enabled without a value.
inline constexpr double kUsualSleep = 1e-3;

struct SolverOptions {
  /// Of the scaled residual, dimensionless. None: the one that follows scheme and step
  /// (docs/solver.md).
  std::optional<double> tolerance{};
  int max_iterations = 20;  ///< Newton passes before a step is split
  /// Relative accuracy of the parts into which a step is cut. None or 0: every step is one part.
  std::optional<double> accuracy{};
  /// Steps that would create energy are repeated by BDF1 or in parts (docs/solver.md).
  bool bounded_energy = true;
  /// Share of its size that a body may move and still rest, until it sleeps (docs/sleeping.md). 0:
  /// none sleeps.
  double sleep = 0;
  Source sleep_source{};
  bool keep_inert_contacts = false;  ///< as with StepperOptions::differentiable
};

struct Scene {
  std::string name;
  std::string path;             ///< file it was read from, "" if none
  std::string text;             ///< the file as read, stored with every dataset
  Vector3 gravity{0, 0, -9.8};  ///< world frame [m/s²]
  double timestep = 5e-3;       ///< [s]
  Integrator integrator = Integrator::default_integrator;
  SolverOptions solver;
  std::optional<GroundDescription> ground;
  std::vector<LinkDescription> links;
  std::vector<MotorDescription> motors;
  std::vector<TactileDescription> sensors;
  std::vector<CameraDescription> cameras;
  std::vector<EndEffectorDescription> end_effectors;
  std::vector<GroundContactDescription> ground_contacts;
  std::vector<PairContactDescription> pair_contacts;
  std::vector<LoopDescription> loops;
  std::vector<TransmissionDescription> transmissions;
  std::vector<InitialState> initial;
  std::optional<ControlDescription> control;
  std::vector<RandomizationDescription> randomizations;
  std::optional<OutputsDescription> outputs;  ///< none: everything
  Source gravity_source{};  ///< the <option> that gives gravity; line 0: none does
};

/// The name users write and read: "free3d", "clamped" …
const char* to_string(JointType value);
const char* to_string(ContactLaw value);
const char* to_string(Distribution::Kind value);  ///< as in scene files
/// The same, but "published" for law linear with ramp 0.
const char* law_name(ContactLaw law, std::optional<double> ramp);
/// Whether a joint is a transmission.
bool is_transmission(const Scene& scene, const JointDescription& joint);
/// Returns "sphere", "cuboid" …
const char* shape_name(const Shape& shape);

/// Returns a number of a shape's size: 0 radius, 1 length, 2 … 4 lengths along the axes [m], 5
/// scale of a mesh [1].
/// nullptr where the shape has no such number.
double* size_number(Shape& shape, int which);
inline constexpr int kSizeIndices = 6;

/// Whether contact points may touch the shape, and whether it has contact points itself.
bool has_distance(const Shape& shape);
bool has_contact_points(const Shape& shape);
/// Whether the shape is invariant under rotations. The ground then touches its lowest point.
bool is_ball(const Shape& shape);
/// Whether a body of the first shape can touch one of the second: with its contact points, or a
/// sphere with its surface. A mesh has a distance only near its own surface, so it touches spheres
/// and is not touched by them.
bool can_touch(const Shape& general, const Shape& primitive);
/// Whether the principal moments of xx xy xz yy yz zz are positive.
bool is_inertia(const std::array<double, 6>& inertia);
/// Whether it can be the inertia of a body with volume: besides, no principal moment is as large as
/// the sum of the other two.
bool is_solid_inertia(const std::array<double, 6>& inertia);

/// Numbers of configuration coordinates and of velocity dofs of a joint type: free has 7 and 6.
int position_count(JointType type);
int dof_count(JointType type);

/// Number of dofs that a motor drives, and so of its controls; 0 where the scene lacks its joint.
int dofs_driven(const Scene& scene, const MotorDescription& motor);

/// Whether dof `k` of a joint type turns; otherwise it slides.
bool dof_turns(JointType type, int k);

/// Unit of coordinate `k` of a joint type: "m", "rad", or "1" in a quaternion.
const char* coordinate_unit(JointType type, int k);

}  // namespace tangere
