// SPDX-License-Identifier: Apache-2.0
// What the parts of a MJCF file share while it is read: settings of <compiler>, default classes,
// assets, and the joints that actuators refer to.
#pragma once

#include <array>
#include <limits>
#include <map>
#include <optional>
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
  int link = -1;   ///< of the scene
  double ref = 0;  ///< the file's coordinate where ours is zero [m or rad]
  std::optional<std::array<double, 2>> actuator_range = {};  ///< [N or N m]
  std::optional<std::array<double, 2>> range = {};  ///< in the file's coordinate [m or rad]
  /// A free joint whose frame MuJoCo aligns with the inertia of its body, which keyframes refer to.
  bool is_aligned = false;
  /// Of such a joint: the frame of the inertia in that of the body, if the file gives it.
  std::optional<Pose> inertia = {};
};

/// An actuator of the file, in its order, and how its control becomes one of the scene:
/// scale · c + shift, with c and the result within bounds.
struct MjcfControl {
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  int motor = -1;  ///< of the scene; -1: the actuator is left out
  double scale = 1, shift = 0;
  std::array<double, 2> range{-kNone, kNone};
  double least = -kNone, most = kNone;
};

enum class InertiaFrom { automatic, geoms, inertials };

/// In defaults all actuators share the attributes of <general>.
inline const std::vector<std::string> kActuators = {"general", "motor", "position", "velocity"};
inline constexpr const char* kOtherActuators[] = {"intvelocity", "damper",      "cylinder",
                                                  "muscle",      "adhesion",    "plugin",
                                                  "dcmotor",     "orientation", "pid"};

class MjcfFile {
 public:
  explicit MjcfFile(const RobotNode& root) : robot(root.robot()) {}

  Robot& robot;
  bool degrees = true;
  std::string euler_sequence = "xyz";
  std::string mesh_folder;
  bool strip_path = false;
  bool auto_limits = true;
  InertiaFrom inertia_from = InertiaFrom::automatic;
  bool balance_inertia = false;
  double total_mass = 0;  ///< to which all masses are scaled [kg]; 0: they are not
  bool has_limits = true, has_springs = true, has_dampers = true;  ///< by <flag>
  bool free_base = false;   ///< bodies of the world without joints move freely
  bool align_free = false;  ///< free joints are aligned with the inertia of their bodies
  std::array<int, 2> inertia_groups{0, 5};
  std::vector<int> disabled_groups;   ///< of actuators
  std::vector<double> keyframe_ctrl;  ///< of the wanted keyframe, by actuator; may be short
  std::map<std::string, MjcfMesh> meshes;
  std::map<std::string, std::array<double, 4>> materials;
  std::map<std::string, MjcfJoint> joints;
  std::vector<MjcfControl> controls;
  RobotNames names;

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

  /// Reads pos and one of quat, axisangle, euler, xyaxes, zaxis.
  [[nodiscard]] Pose read_pose(const RobotNode& node) const;

 private:
  static void read_origin(MjcfMesh& mesh, const Vector3& scale);
  [[nodiscard]] Quaternion read_orientation(const RobotNode& node) const;

  std::map<std::string, SceneContext> classes_;                           // their defaults
  std::map<std::pair<std::string, std::string>, SceneContext> contexts_;  // of a file, a class
};

/// Reads <worldbody> and all bodies in it.
void read_mjcf_bodies(MjcfFile& file, const RobotNode& world);
/// Reads an <actuator> section.
void read_mjcf_actuators(MjcfFile& file, const RobotNode& section);
/// Returns the key `requested` of the <keyframe> sections, by its name or, without one, its number
/// from 0; none for "". Lists the others, and keeps its controls for the actuators.
std::optional<RobotNode> find_mjcf_keyframe(MjcfFile& file, const std::vector<RobotNode>& sections,
                                            const std::string& requested);
/// Gives the scene the start of a key, after all bodies and actuators.
void read_mjcf_keyframe(MjcfFile& file, const RobotNode& key);

}  // namespace tangere
