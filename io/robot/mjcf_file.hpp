// SPDX-License-Identifier: Apache-2.0
// What the parts of a MJCF file share while it is read: settings of <compiler>, default classes and
// assets of a model, and names and joints of all models.
#pragma once

#include <array>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/robot/mesh_files.hpp"
#include "io/robot/robot_node.hpp"
#include "io/robot/rotations.hpp"

namespace tangere {

/// How MuJoCo finds the mass of a mesh. `legacy`, its default, counts what lies between its middle
/// and each face, so that a hollow may count several times.
enum class MeshInertia { legacy, exact, convex, shell };

/// A mesh of <asset>. Its file is read when a geom needs it, because most are for pictures.
struct MjcfMesh {
  RobotNode node;
  MeshInertia inertia = MeshInertia::legacy;
  bool is_read = false;
  Pose origin = {};  ///< of the file's frame in that of the geom's mesh, once it is read
  std::optional<RobotMesh> mesh = {};  ///< once it is read; none if scenes cannot have it
};

/// A joint of the file, for actuators: those of hinges and slides can be driven.
struct MjcfJoint {
  int link = -1;      ///< of the scene
  double ref = 0;     ///< the file's coordinate where ours is zero [m or rad]
  double spring = 0;  ///< springref, in our coordinate
  std::optional<std::array<double, 2>> actuator_range = {};  ///< [N or N m]
  std::optional<std::array<double, 2>> range = {};  ///< in the file's coordinate [m or rad]
  /// A free joint whose frame MuJoCo aligns with the inertia of its body, which keyframes refer to.
  bool is_aligned = false;
  /// Of such a joint: the frame of the inertia in that of the body, if the file gives it.
  std::optional<Pose> inertia = {};
};

enum class InertiaFrom { automatic, geoms, inertials };

/// In defaults all actuators share the attributes of <general>.
inline const std::vector<std::string> kActuators = {"general", "motor", "position", "velocity"};
inline constexpr const char* kOtherActuators[] = {"intvelocity", "damper",      "cylinder",
                                                  "muscle",      "adhesion",    "plugin",
                                                  "dcmotor",     "orientation", "pid"};

class MjcfFile;

/// A frame on a link, or in the world.
struct MjcfPlace {
  int link = -1;  ///< of the scene; -1: the world
  Pose pose;      ///< in the link's frame
};

/// A geom around which a tendon may go.
struct MjcfGeom {
  MjcfPlace place;  ///< z: along a cylinder
  bool ball = false;
  double radius = 0;  ///< [m]
};

/// Where elements stand in a whole of models: <attach> puts a prefix before the names of a model,
/// and <replicate> a suffix behind those of a copy.
struct MjcfScope {
  MjcfFile* file;
  int model = 0;  ///< number of the attached model, from 1; 0: the file that the user names
  std::string prefix = {}, suffix = {};
  const MjcfScope* outer = nullptr;  ///< of the <attach>; null: the file that the user names
  /// A number for each <replicate> and <attach> around it, and that of the copy.
  std::vector<int> copies = {};

  /// The name in the scene of what the file calls `name`.
  [[nodiscard]] std::string full_name(std::string name) const;
};

/// One of the things to which a name of a model refers.
struct MjcfCopy {
  std::string name;        ///< in the scene
  const MjcfScope* scope;  ///< in the model that has the name
};

/// Names of joints or bodies, which differ from each other in the scene.
struct MjcfNames {
  const char* what;                                ///< "joint"
  std::map<std::string, std::string> places = {};  ///< by name in the scene: "line 7"
  /// By number of a model and name there: copies, in the order of the scene. In a model that
  /// attaches another, names of the other have the prefix.
  std::map<std::pair<int, std::string>, std::vector<MjcfCopy>> copies = {};
};

/// What all models of a file share.
struct MjcfWhole {
  Robot& robot;
  bool has_limits = true, has_springs = true, has_dampers = true, has_friction = true,
       has_equalities = true;             ///< by <flag>
  bool merges_options = false;            ///< <compiler conflict="merge">
  std::vector<int> disabled_groups = {};  ///< of actuators
  bool free_base = false;                 ///< bodies of the world without joints move freely
  RobotNames names = {};
  MjcfNames body_names = {"body"}, joint_names = {"joint"};
  std::map<std::string, MjcfJoint> joints =
      {};                              ///< by name in the scene, those of tendons included
  std::set<std::string> tendons = {};  ///< joints that stand for tendons
  /// By number of a model and name there: the joint of a tendon.
  std::map<std::pair<int, std::string>, std::string> tendon_names = {};
  std::map<std::string, Pose> world_sites = {};  ///< sites of the world, by name in the scene
  std::map<std::string, MjcfGeom> geoms = {};    ///< spheres and cylinders, by name in the scene
  /// By name of a body in the scene: its link, and its frame in that of the link.
  std::map<std::string, std::pair<int, Pose>> body_frames = {};
  std::deque<MjcfScope> scopes = {};
  std::map<int, int> ranks = {};  ///< of a <replicate> or <attach>: its place in the order of names
  std::vector<const MjcfScope*> models = {};  ///< by number
  std::map<int, Source> gravcomp = {};        ///< bodies that have it, by link of the scene
  std::vector<int> motors = {};  ///< by actuator of the file: that of the scene; -1: left out

  /// Returns the name in the scene of a node with a name. Fails at the node if it is used twice.
  std::string keep_name(MjcfNames& kind, const RobotNode& node, const MjcfScope& scope);
  /// By which MuJoCo sorts what copies refer to, after all names are kept.
  [[nodiscard]] std::vector<int> order(const MjcfScope& scope) const;
};

class MjcfFile {
 public:
  MjcfFile(const RobotNode& node, MjcfWhole& shared, const MjcfFile* from)
      : whole(shared), outer(from), root(node) {}

  MjcfWhole& whole;
  const MjcfFile* outer;  ///< whose <model> names this file; null: the user names it
  RobotNode root;         ///< <mujoco>
  std::vector<RobotNode> sections;
  bool degrees = true;
  std::string euler_sequence = "xyz";
  std::string mesh_folder;
  bool strip_path = false;
  bool auto_limits = true;
  InertiaFrom inertia_from = InertiaFrom::automatic;
  bool balance_inertia = false;
  double total_mass = 0;    ///< to which all masses are scaled [kg]; 0: they are not
  bool align_free = false;  ///< free joints are aligned with the inertia of their bodies
  std::array<int, 2> inertia_groups{0, 5};
  std::map<std::string, MjcfMesh> meshes;
  std::map<std::string, Material> materials;
  std::map<std::string, std::unique_ptr<MjcfFile>> models;  ///< that an <attach> may name

  [[nodiscard]] double angle(double x) const {
    return degrees ? x * 3.14159265358979323846 / 180 : x;
  }

  /// Reads <default>; nested classes inherit from enclosing ones.
  void read_defaults(const RobotNode& node, const std::string& parent);
  /// The node with the defaults of its own class, or of `inherited` if it names none.
  [[nodiscard]] RobotNode with_class(const RobotNode& node, const std::string& inherited);
  [[nodiscard]] std::string known_class(const RobotNode& node, const char* attribute);
  /// The mesh of this name with its file read. Fails at the node that names it if there is none.
  [[nodiscard]] const MjcfMesh& mesh_named(const RobotNode& node, const std::string& name);
  /// Moves the warnings of all classes and included files to `out`.
  void take_warnings(std::vector<std::string>& out);

  /// The rotation of three angles in the units and the order of the file.
  [[nodiscard]] Quaternion euler(const Vector3& x) const {
    return from_euler({angle(x[0]), angle(x[1]), angle(x[2])}, euler_sequence);
  }
  /// Reads pos and one of quat, axisangle, euler, xyaxes, zaxis.
  [[nodiscard]] Pose read_pose(const RobotNode& node) const;

 private:
  static void read_origin(MjcfMesh& mesh, const Vector3& scale);
  [[nodiscard]] Quaternion read_orientation(const RobotNode& node) const;

  std::map<std::string, SceneContext> classes_;                           // their defaults
  std::map<std::pair<std::string, std::string>, SceneContext> contexts_;  // of a file, a class
};

/// Reads the sections of a model that its bodies refer to.
void read_mjcf_settings(MjcfFile& file);
/// Reads the file of a <model>.
void read_mjcf_model(MjcfFile& file, const RobotNode& asset);

/// A copy that a <replicate> makes.
struct MjcfReplica {
  Pose pose;
  const MjcfScope* scope;
};
/// The copies of a <replicate>.
std::vector<MjcfReplica> replicas(MjcfWhole& whole, const RobotNode& node, const MjcfScope& scope);
/// The scope of the model that an <attach> names, or else of the same file.
const MjcfScope& attached_scope(MjcfWhole& whole, const RobotNode& node, const MjcfScope& outer);

/// Reads all bodies of the file that the user names.
void read_mjcf_bodies(MjcfWhole& whole, const MjcfScope& scope);
/// Gives the bodies of each tree their share of gravity, after all bodies are read.
void read_mjcf_gravity(MjcfWhole& whole);
/// Reads the tendons of all models, after the bodies.
void read_mjcf_tendons(MjcfWhole& whole);
/// Reads the constraints of all models, after the bodies.
void read_mjcf_equalities(MjcfWhole& whole);
/// The place of the site that an attribute names; none if no site of a body that stands once has
/// the name.
std::optional<MjcfPlace> mjcf_site(const MjcfWhole& whole, const MjcfScope& model,
                                   const RobotNode& node, const char* attribute);
/// The same frame in the body of its link, or in the world.
Pose in_body_frame(const Scene& scene, const MjcfPlace& place);
/// The name of that body; "" in the world.
std::string body_at(const Scene& scene, const MjcfPlace& place);
/// Adds the joint of an actuator at a site. Returns its name; "" if the scene cannot have it, which
/// is listed.
std::string add_mjcf_wrench(MjcfWhole& whole, const MjcfScope& model, const RobotNode& node);
/// Reads a <connect> or a <weld>.
void read_mjcf_loop(MjcfWhole& whole, const MjcfScope& model, const RobotNode& node);
/// Reads the actuators of all models, after the bodies.
void read_mjcf_actuators(MjcfWhole& whole);
/// Returns the key `requested` of the <keyframe> sections, by its name or, without one, its number
/// from 0; none for "". Lists the others, and keeps its controls for the actuators.
std::optional<RobotNode> find_mjcf_keyframe(MjcfWhole& whole,
                                            const std::vector<RobotNode>& sections,
                                            const std::string& requested);
/// Gives the scene the start of a key, after all bodies and actuators.
void read_mjcf_keyframe(MjcfWhole& whole, const RobotNode& key);

}  // namespace tangere
