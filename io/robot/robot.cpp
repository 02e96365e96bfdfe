// SPDX-License-Identifier: Apache-2.0
// A link of a robot has any number of pieces. A link of a scene has one body, so the others hang on
// it by fixed joints, which cost a step nothing.
#include "io/robot/robot.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <variant>

#include "engine/scene/shapes.hpp"
#include "io/files/nearest_name.hpp"

namespace tangere {

void Remarks::add(const Source& at, const std::string& text) {
  const std::string key = at.file + ": " + text;
  std::vector<int>& lines = places_[key];
  if (lines.empty()) texts_.push_back(key);
  if (std::find(lines.begin(), lines.end(), at.line) == lines.end()) lines.push_back(at.line);
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

namespace {

const JointDescription* joint_named(const Robot& robot, const std::string& name) {
  const auto found = std::ranges::find_if(
      robot.scene.links, [&](const LinkDescription& l) { return l.joint.name == name; });
  return found == robot.scene.links.end() ? nullptr : &found->joint;
}

/// Whether f(joint) holds for a leader of a joint, or one of theirs.
template <class F>
bool any_leader(const Robot& robot, const JointDescription& joint, const F& f) {
  std::set<const JointDescription*> passed;
  std::vector<const JointDescription*> open = {&joint};
  while (!open.empty()) {
    const JointDescription& next = *open.back();
    open.pop_back();
    for (const std::string& name : next.follows) {
      const JointDescription* const leader = joint_named(robot, name);
      if (leader == nullptr || !passed.insert(leader).second) continue;
      if (f(*leader)) return true;
      open.push_back(leader);
    }
  }
  return false;
}

/// What keeps a joint from following others; "": nothing. Throws InputError for a leader that is
/// no joint.
std::string follower_fault(const Robot& robot, const JointDescription& joint) {
  for (const std::string& name : joint.follows) {
    const JointDescription* const leader = joint_named(robot, name);
    if (leader == nullptr)
      throw InputError(joint.source.prefix() + "joint '" + joint.name + "' follows '" + name +
                       "': no joint has this name");
    if (dof_count(joint.type) != 1 || dof_count(leader->type) != 1)
      return "which is not between joints of one degree of freedom each";
    if (name.find(',') != std::string::npos) return "whose name has a comma";
  }
  const auto leader_is = [&](const auto& f) { return any_leader(robot, joint, f); };
  if (leader_is([&](const JointDescription& l) { return &l == &joint; }))
    return "which follows it in turn";
  if (joint.powers.empty()) return "";
  if (leader_is([](const JointDescription& l) { return !l.powers.empty(); }))
    return "by a polynomial of a polynomial";
  if (leader_is([](const JointDescription& l) { return l.follows.size() > 1; }))
    return "by a polynomial of several joints";
  for (const LinkDescription& link : robot.scene.links)  // a tendon, which would move nothing else
    if (link.joint.follows.size() > 1 &&
        any_leader(robot, link.joint, [&](const JointDescription& l) { return &l == &joint; }))
      return fmt::format("by a polynomial, and '{}' follows it with others", link.joint.name);
  return "";
}

}  // namespace

void check_followers(Robot& robot) {
  for (LinkDescription& link : robot.scene.links) {
    JointDescription& joint = link.joint;
    const std::string fault = follower_fault(robot, joint);
    if (fault.empty()) continue;
    robot.lost.add(joint.source, fmt::format("joint '{}' follows '{}', {}", joint.name,
                                             fmt::join(joint.follows, "', '"), fault));
    joint.follows.clear();
    joint.ratio.clear();
    joint.powers.clear();
  }
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

std::string RobotNames::free_name(const std::string& requested) {
  if (names_.insert(requested).second) return requested;
  for (int k = 2;; ++k)
    if (std::string name = fmt::format("{}_{}", requested, k); names_.insert(name).second)
      return name;
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
    BodyDescription body{name,          piece.shape,         piece.pose,
                         piece.density, piece.material.rgba, piece.source};
    body.specular = piece.material.specular;
    body.shininess = piece.material.shininess;
    body.emission = piece.material.emission;
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
    if (!piece.touches && !only_mass) robot.untouched.push_back(body.name);
    robot.scene.links.back().body = std::move(body);
  }
  return index;
}

namespace {

constexpr double kNearly = 1e-6;     // of the moments: that much is rounding
constexpr double kWeight = 1000;     // of a ball in place of a point [kg/m³]
constexpr double kBallMoment = 0.4;  // of a ball, in mass times its radius squared

/// Adds the same to all moments, as little as makes them `possible`. Returns how much of them.
double raise(std::array<double, 6>& inertia, bool (*possible)(const std::array<double, 6>&)) {
  const double whole = std::abs(inertia[0]) + std::abs(inertia[3]) + std::abs(inertia[5]) +
                       2 * (std::abs(inertia[1]) + std::abs(inertia[2]) + std::abs(inertia[4]));
  const auto with = [&](double share) {
    std::array<double, 6> more = inertia;
    for (const std::size_t k : {0U, 3U, 5U}) more[k] += share * whole;
    return more;
  };
  double no = 0, yes = 2;
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (no + yes);
    (possible(with(middle)) ? yes : no) = middle;
  }
  inertia = with(yes + kNearly);
  return yes;
}

}  // namespace

bool stands(const Robot& robot, const JointDescription& joint, int parent) {
  if (joint.type != JointType::fixed) return false;
  for (int k = parent; k >= 0; k = robot.scene.links[std::size_t(k)].parent)
    if (robot.scene.links[std::size_t(k)].joint.type != JointType::fixed) return false;
  return true;
}

std::optional<RobotPiece> inertial_piece(Robot& robot, double mass, std::array<double, 6> inertia,
                                         const Pose& pose, const std::string& origin,
                                         const Source& source, Moments moments) {
  if (!(mass >= 0))
    throw InputError(
        fmt::format("{}{}: mass {} kg; expected 0 or more", source.prefix(), origin, mass));
  const bool none = std::all_of(inertia.begin(), inertia.end(), [](double x) { return x == 0; });
  if (mass == 0) {
    if (!none && moments == Moments::idle)
      robot.idle.add(source, origin + ": an inertia without a mass of a link that stands");
    else if (!none)
      robot.lost.add(source, origin + ": an inertia without a mass; it is left out");
    return std::nullopt;
  }
  if (moments == Moments::idle && !is_inertia(inertia)) {
    robot.idle.add(source,
                   origin + ": moments of inertia that are not positive, of a link that stands");
    inertia = {};
  } else if (none && moments == Moments::dispensable) {
    robot.changed.add(source, origin + ": a mass without an inertia, which is a point on its link");
  } else if (none) {
    const double radius = std::cbrt(3 * mass / (4 * 3.14159265358979323846 * kWeight));
    const double moment = kBallMoment * mass * radius * radius;
    inertia = {moment, 0, 0, moment, 0, moment};
    robot.lost.add(source, origin + ": a mass without an inertia; it is that of a ball of water");
  } else if (!is_inertia(inertia)) {
    std::array<double, 6> raised = inertia;
    if (raise(raised, is_inertia) > kNearly) {
      raise(inertia, is_solid_inertia);
      robot.lost.add(source, origin +
                                 ": a principal moment of the inertia is below 0; all moments are "
                                 "raised until a solid has them");
    } else {
      inertia = raised;
      robot.changed.add(source, origin + ": the inertia of a thin rod, raised by 1e-6");
    }
  } else if (!is_solid_inertia(inertia)) {
    robot.changed.add(source,
                      origin +
                          ": no solid has this inertia (a principal moment is not below the "
                          "sum of the others); it is taken as it is");
  }
  RobotPiece piece;
  piece.shape = AbstractShape{mass, inertia, {}};
  piece.pose = pose;
  piece.origin = origin;
  piece.source = source;
  return piece;
}

void scale_masses(Scene& scene, double total) {
  double sum = 0;
  for (const LinkDescription& link : scene.links) {
    if (const auto* const mass = std::get_if<AbstractShape>(&link.body.shape))
      sum += mass->mass;
    else if (link.body.density > 0)
      sum += link.body.density * volume_of(link.body.shape);
  }
  if (!(sum > 0)) return;
  const double factor = total / sum;
  for (LinkDescription& link : scene.links) {
    link.body.density *= factor;
    if (auto* const mass = std::get_if<AbstractShape>(&link.body.shape)) {
      mass->mass *= factor;
      for (double& x : mass->inertia) x *= factor;
    }
  }
}

bool balance_inertia(std::array<double, 6>& inertia) {
  if (is_solid_inertia(inertia)) return false;
  const double mean = (inertia[0] + inertia[3] + inertia[5]) / 3;
  inertia = {mean, 0, 0, mean, 0, mean};
  return true;
}

}  // namespace tangere
