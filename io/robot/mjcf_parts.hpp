// SPDX-License-Identifier: Apache-2.0
// The parts of a body of MJCF. The contents of frames, of copies and of attached models stand in
// their place.
#pragma once

#include <string>
#include <vector>

#include "io/robot/mjcf_file.hpp"

namespace tangere {

inline constexpr int kDeepestBodies = 90;  ///< bodies in bodies; a scene's limit is 200 links

/// A child of a body, with the frames around it, the class that they give it and its scope.
struct MjcfPart {
  RobotNode node;
  Pose frame;
  std::string defaults;
  const MjcfScope* scope;

  [[nodiscard]] MjcfFile& file() const { return *scope->file; }
  /// The same with the defaults of its class.
  [[nodiscard]] MjcfPart with_class() const;
  /// The class that its children inherit: its childclass, or the one around it.
  [[nodiscard]] std::string own_class() const;
};

/// The parts of the body of which `body` has node, class and scope: bodies, joints, geoms, sites
/// and the inertial. Throws InputError for frames and models nested too deep, and for what an
/// <attach> names and no model has.
std::vector<MjcfPart> body_parts(MjcfWhole& whole, const MjcfPart& body);
/// The same of a <worldbody>: bodies, geoms and sites.
std::vector<MjcfPart> world_parts(MjcfWhole& whole, const MjcfPart& world);

}  // namespace tangere
