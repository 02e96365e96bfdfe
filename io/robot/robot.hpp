// SPDX-License-Identifier: Apache-2.0
// What a robot file becomes before it is written as a scene.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Places of a file that share a remark. The remark names the element and what becomes of it.
class Remarks {
 public:
  void add(const Source& at, const std::string& text);
  [[nodiscard]] bool empty() const { return texts_.empty(); }
  /// "file: text (lines 3, 7)", in the order in which the remarks came.
  [[nodiscard]] std::vector<std::string> lines() const;

 private:
  std::vector<std::string> texts_;
  std::map<std::string, std::vector<int>> places_;  // text with its file, lines
};

/// The surface of a mesh body: a file, or numbers.
struct MeshFile {
  std::string path;
  Vector3 scale{1, 1, 1};
  bool hull = false;  ///< the body is the convex hull of the points
  /// Without a path: x y z of all vertices, and three vertices, from 0, of all triangles.
  std::vector<double> vertices = {};
  std::vector<int> triangles = {};
};

/// A named place on a link.
struct RobotSite {
  int link = -1;
  Pose pose;  ///< in the link's frame
  Source source;
};

/// A skin that the robot's file has.
struct RobotSkin {
  std::string name, link;
  Pose pose;           ///< in the link's frame
  std::string layout;  ///< attributes of <tactile>: type, points, stiffness
  Source source;
};

struct RobotFile;  // io/robot/robot_node.hpp

struct Robot {
  std::string format;  ///< "URDF" or "MJCF"
  /// In SI. Every source is a line of the robot's file, so errors of a model name it. Its path is
  /// the file that the user names.
  Scene scene;
  std::vector<std::shared_ptr<RobotFile>> included;  ///< files that this one has brought in
  std::map<std::string, MeshFile> meshes;            ///< by body
  std::map<std::string, std::string> origins;  ///< by link: what of the file it was, for a comment
  std::set<std::string> pieces;  ///< links made for further shapes of the link that they hang on
  std::vector<std::string> untouched;  ///< bodies that touch nothing in the file, in its order
  std::vector<std::array<std::string, 2>>
      excluded;                           ///< pairs of links that do not touch each other
  std::map<std::string, double> efforts;  ///< by joint: largest force or torque [N or N m]
  std::map<std::string, RobotSite> sites;
  std::vector<RobotSkin> skins;
  /// By motor of the scene: the control that a keyframe gives it. No value without a keyframe.
  std::optional<std::vector<double>> controls;
  Remarks idle;     ///< left out, and of no effect on the motion
  Remarks changed;  ///< expressed differently
  Remarks lost;     ///< left out although it changes the motion
};

/// "line 7", or "line 7 of hand.xml" in a file that <include> has brought in.
std::string place_in(const Robot& robot, const Source& source);

/// Lists and drops followers that scenes cannot have. Throws InputError for a leader that is no
/// joint.
void check_followers(Robot& robot);

/// A link, or a place on one, that an option names.
struct RobotPlace {
  const LinkDescription* link;
  const RobotSite* site;  ///< null: the link itself
  Pose pose;              ///< in the link's frame
};
/// Finds a link or else a site. `what` is the option and `file` the robot, for the InputError of a
/// name that is neither.
RobotPlace find_place(const Robot& robot, const std::string& name, const std::string& what,
                      const std::string& file);

/// Gives new links, joints and bodies names that no other has.
class RobotNames {
 public:
  /// `requested`, or `requested` with the next free number behind it.
  std::string free_name(const std::string& requested);
  /// Reserves a name that a file gives to one of its own elements.
  void keep(const std::string& name) { names_.insert(name); }

 private:
  std::set<std::string> names_;
};

/// Colour and material of a piece in pictures, as in BodyDescription.
struct Material {
  std::array<double, 4> rgba{0.7, 0.7, 0.7, 1};
  double specular = 0, shininess = 0.5, emission = 0;
};

/// A piece of a link: its shape in the link's frame, and how heavy it is.
struct RobotPiece {
  Shape shape;
  Pose pose;
  double density = 0;  ///< [kg/m³]; 0: it has no mass of its own
  Material material;
  bool touches = true;  ///< false: it has a mass, and nothing touches it
  MeshFile mesh;        ///< of mesh shapes
  std::string origin;   ///< "<collision>", "<geom>"
  Source source;
};

/// Appends a link with its pieces to the robot. The first piece is the link's own body and has its
/// name; each other piece hangs on a fixed joint, and is named after the link with a number. A link
/// without pieces is a frame without mass. Returns the link's index.
int add_link(Robot& robot, RobotNames& names, const std::string& name, int parent,
             JointDescription joint, const std::vector<RobotPiece>& pieces,
             const std::string& origin, const Source& source);

/// Whether the motion needs moments of inertia of a piece. dispensable: a point in its place
/// leaves the mass matrix positive. idle: its link stands in the world.
enum class Moments { needed, dispensable, idle };

/// Whether a link on `joint` of link `parent` (-1: the world) stands in the world.
bool stands(const Robot& robot, const JointDescription& joint, int parent);

/// A piece that is a mass alone. `inertia`: xx xy xz yy yz zz in the frame `pose` at the centre of
/// mass. Where a principal moment is not positive, another inertia takes its place, and the robot
/// lists that. Without `moments`, an inertia of zeros is kept. Without a mass there is no piece.
/// Throws InputError at `source` if the mass is negative.
std::optional<RobotPiece> inertial_piece(Robot& robot, double mass, std::array<double, 6> inertia,
                                         const Pose& pose, const std::string& origin,
                                         const Source& source, Moments moments = Moments::needed);

/// Scales all masses so that they add up to `total` [kg].
void scale_masses(Scene& scene, double total);

/// Where no solid has these moments (xx xy xz yy yz zz), puts their mean in place of all, as
/// balanceinertia of MuJoCo. Returns whether it did.
bool balance_inertia(std::array<double, 6>& inertia);

}  // namespace tangere
