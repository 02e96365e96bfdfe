// SPDX-License-Identifier: Apache-2.0
// Readers of the sections beside the tree of links. Each appends to the scene and checks references
// where they appear.
#pragma once

#include <filesystem>

#include "engine/base/error.hpp"
#include "io/scene/scene_element.hpp"

namespace tangere {

/// Reads a body in its joint's frame, including files that it names. The name is empty if it has
/// none.
BodyDescription read_body(const SceneNode& node);
/// Whether the pose of a mesh is given in the world, not in the joint's frame.
bool placed_in_world(const SceneNode& node, const BodyDescription& body);
void read_actuators(Scene& scene, const SceneNode& section);
void read_contacts(Scene& scene, const SceneNode& section);
void read_loops(Scene& scene, const SceneNode& section);
void read_transmissions(Scene& scene, const SceneNode& section);
/// In the published dialect (root <redmax>), warns of meshes that touch with all their vertices:
/// the published simulator takes about one in 50.
void warn_of_dense_meshes(const Scene& scene, const SceneNode& root);
/// Warns of pairs in which a cuboid's contact points are as far apart as the touched body is
/// across, or farther, and the touched body has no points on the cuboid.
void warn_of_coarse_points(const Scene& scene, const SceneNode& root);

void read_sensors(Scene& scene, const SceneNode& section);
void read_end_effectors(Scene& scene, const SceneNode& section);
/// Names end effectors that have no name: "endeffector" and their position in the file, or the next
/// free number.
void name_end_effectors(Scene& scene);
void read_initial(Scene& scene, const SceneNode& section);
void read_control(Scene& scene, const SceneNode& section);
void read_randomize(Scene& scene, const SceneNode& section);
void read_outputs(Scene& scene, const SceneNode& section);

/// Calls `read` with the file beside the scene that an attribute names. Errors name the element.
template <class Read>
auto read_beside(const SceneNode& node, const char* attribute, Read&& read) {
  const std::filesystem::path path =
      std::filesystem::path(node.context().file).parent_path() / node.text(attribute);
  try {
    return read(path.string());
  } catch (const IoError& e) {
    throw IoError(node.source().prefix() + "<" + node.name() + ">: " + e.what());
  }
}

/// Reads the closed surface of `filename`, scaled by `scale` and to metres.
MeshShape read_mesh(const SceneNode& node);

inline Vector3 scaled(const Vector3& a, double s) { return {s * a[0], s * a[1], s * a[2]}; }

/// Returns the index of the named joint or body. If there is none, fails at the attribute's element
/// with the nearest name.
int find_joint(const Scene& scene, const SceneNode& node, const char* attribute);
int find_body(const Scene& scene, const SceneNode& node, const char* attribute);

/// Factor to SI of coordinate `index` of a joint type, and of velocity `index`. Both have lengths
/// at the same indices.
double coordinate_scale(JointType type, int index, const SceneContext& context);

/// Number of controls of the motors read so far.
int control_count(const Scene& scene);
/// Factor to SI of each control. Targets of position motors are coordinates; controls of force
/// motors have no unit.
std::vector<double> control_scales(const Scene& scene, const SceneContext& context);

/// Adds a link without mass whose joint is a wrench. Returns its index.
std::size_t add_wrench_joint(Scene& scene, const std::string& name, const Source& source,
                             const TransmissionDescription& wrench);
/// The same for a motor that stands on a body.
std::size_t read_motor_place(Scene& scene, const SceneElement& node);

/// Reads damping, armature, spring and limits of a joint whose type is known.
void read_joint_effects(const SceneElement& node, JointDescription& joint);
/// Reads which joint a joint follows, with the ratio of the file's units.
void read_follower(const SceneElement& node, JointDescription& joint);
/// Turns the ratios of a joint into SI. `length`: of the file in which it stands, factor to metres.
void scale_ratios(const Scene& scene, double length, JointDescription& joint);

}  // namespace tangere
