// SPDX-License-Identifier: Apache-2.0
// A link of a robot has any number of pieces. A link of a scene has one body, so the others hang on
// it by fixed joints, which cost a step nothing.
#include "io/robot/robot.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <variant>

#include "io/files/nearest_name.hpp"

namespace tangere {

void Remarks::add(const Source& at, const std::string& text) {
  const std::string key = at.file + ": " + text;
  std::vector<int>& lines = places_[key];
  if (lines.empty()) texts_.push_back(key);
  if (lines.empty() || lines.back() != at.line) lines.push_back(at.line);
}

std::vector<std::string> Remarks::lines() const {
  std::vector<std::string> out;
  for (const std::string& text : texts_) {
    const std::vector<int>& places = places_.at(text);
    out.push_back(fmt::format("{} (line{} {})", text, places.size() == 1 ? "" : "s",
                              fmt::join(places, ", ")));
  }
  return out;
}

std::string place_in(const Robot& robot, const Source& source) {
  if (source.file == robot.scene.path) return fmt::format("line {}", source.line);
  return fmt::format("line {} of {}", source.line,
                     std::filesystem::path(source.file).filename().string());
}

RobotPlace find_place(const Robot& robot, const std::string& name, const std::string& what,
                      const std::string& file) {
  std::vector<std::string> names;
  for (const LinkDescription& link : robot.scene.links) {
    if (link.name == name) return {&link, nullptr, {}};
    names.push_back(link.name);
  }
  for (const auto& [known, site] : robot.sites) {
    if (known == name) return {&robot.scene.links[std::size_t(site.link)], &site, site.pose};
    names.push_back(known);
  }
  throw InputError(fmt::format("{}: {} has no link{} of this name{}", what, file,
                               robot.sites.empty() ? "" : " or site", suggestion(name, names)));
}

std::string RobotNames::free_name(const std::string& wanted) {
  if (names_.insert(wanted).second) return wanted;
  for (int k = 2;; ++k)
    if (std::string name = fmt::format("{}_{}", wanted, k); names_.insert(name).second) return name;
}

int add_link(Robot& robot, RobotNames& names, const std::string& name, int parent,
             JointDescription joint, const std::vector<RobotPiece>& pieces,
             const std::string& origin, const Source& source) {
  const auto index = static_cast<int>(robot.scene.links.size());
  LinkDescription link;
  link.name = name;
  link.parent = parent;
  link.joint = std::move(joint);
  link.body = {name, AbstractShape{}, {}, 0, {0.7, 0.7, 0.7, 1}, source};
  robot.origins[name] = fmt::format("{}: {}", place_in(robot, source), origin);
  robot.scene.links.push_back(link);
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    const RobotPiece& piece = pieces[k];
    BodyDescription body{name, piece.shape, piece.pose, piece.density, piece.rgba, piece.source};
    const bool only_mass = std::holds_alternative<AbstractShape>(piece.shape);
    if (k > 0) {
      body.name = names.free_name(name + (only_mass ? "_inertia" : "_shape"));
      LinkDescription more;
      more.name = body.name;
      more.parent = index;
      more.joint.name = body.name;
      more.joint.source = piece.source;
      robot.scene.links.push_back(more);
      robot.origins[body.name] = fmt::format("{}: {}", place_in(robot, piece.source), piece.origin);
      robot.pieces.insert(body.name);
    } else {
      robot.origins[name] += fmt::format(", {} of {}", piece.origin, place_in(robot, piece.source));
    }
    if (std::holds_alternative<MeshShape>(piece.shape)) robot.meshes[body.name] = piece.mesh;
    robot.scene.links.back().body = std::move(body);
  }
  return index;
}

RobotPiece inertial_piece(double mass, const std::array<double, 6>& inertia, const Pose& pose,
                          const std::string& origin, const Source& source) {
  const bool none = std::all_of(inertia.begin(), inertia.end(), [](double x) { return x == 0; });
  if (!(mass >= 0) || (mass == 0 ? !none : !is_inertia(inertia)))
    throw InputError(fmt::format(
        "{}{}: no solid body of mass {} kg has the inertia xx xy xz yy yz zz = {} kg m^2; expected "
        "positive principal moments, each less than the sum of the other two, or zeros with mass 0",
        source.prefix(), origin, mass, fmt::join(inertia, " ")));
  RobotPiece piece;
  piece.shape = AbstractShape{mass, inertia, {}};
  piece.pose = pose;
  piece.origin = origin;
  piece.source = source;
  return piece;
}

}  // namespace tangere
