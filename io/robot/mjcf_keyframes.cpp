// SPDX-License-Identifier: Apache-2.0
// A keyframe has the coordinates of all joints, their velocities and the controls of all actuators,
// in the order of the file. A free joint's are those of the body in the world, and ours are seen
// from where the body starts.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/scene/outer_pose.hpp"
#include "io/robot/mjcf_file.hpp"

namespace tangere {
namespace {

const char* const kUse = "stored states; --keyframe NAME starts from one";

class Keyframe {
 public:
  Keyframe(const MjcfWhole& whole, const RobotNode& node) : whole_(whole), node_(node) {}

  void read() {
    Scene& scene = whole_.robot.scene;
    std::vector<double> q = numbers("qpos", position_count), v = numbers("qvel", dof_count);
    std::size_t iq = 0, iv = 0;
    for (const LinkDescription& link : scene.links) {
      const auto nq = std::size_t(position_count(link.joint.type)),
                 nv = std::size_t(dof_count(link.joint.type));
      if (nv == 0 || whole_.tendons.contains(link.joint.name)) continue;
      InitialState state;
      state.joint = link.joint.name;
      state.source = node_.source();
      const std::span<const double> at =
          q.empty() ? std::span<const double>() : std::span{&q[iq], nq};
      if (!q.empty()) state.q = coordinates(link.joint, at);
      if (!v.empty()) state.v = rates(link.joint, at, {&v[iv], nv});
      iq += nq;
      iv += nv;
      const auto zero = [](const std::vector<double>& x) {
        return std::all_of(x.begin(), x.end(), [](double n) { return n == 0; });
      };
      if (zero(state.v)) state.v.clear();
      if (nq == 1 && zero(state.q)) state.q.clear();
      if (nq == 1 && nv == 1 && !q.empty()) given_[link.joint.name] = state.q[0];
      if (!link.joint.follows.empty()) continue;  // its leaders say where it is
      if (!state.q.empty() || !state.v.empty()) scene.initial.push_back(std::move(state));
    }
    for (const LinkDescription& link : scene.links) check_follower(link.joint);
    read_controls();
  }

 private:
  /// Lists a start that is not that of the joints that a joint follows.
  void check_follower(const JointDescription& joint) const {
    const auto own = given_.find(joint.name);
    if (joint.follows.empty() || own == given_.end()) return;
    double place = joint.offset;
    for (std::size_t k = 0; k < joint.follows.size(); ++k)
      if (const auto leader = given_.find(joint.follows[k]); leader != given_.end())
        place += joint.share_of_leader(k, leader->second);
    if (std::abs(own->second - place) > 1e-6)
      node_.changed("<key> qpos of a joint that follows others: it starts where they put it");
  }

  /// One number for each coordinate or dof of the scene; none if the attribute is not there.
  [[nodiscard]] std::vector<double> numbers(const char* attribute, int (*count)(JointType)) const {
    if (!node_.has(attribute)) return {};
    std::size_t n = 0;
    for (const LinkDescription& link : whole_.robot.scene.links)
      if (!whole_.tendons.contains(link.joint.name)) n += std::size_t(count(link.joint.type));
    return sized_numbers(attribute, n, "the joints that are read");
  }

  [[nodiscard]] std::vector<double> sized_numbers(const char* attribute, std::size_t n,
                                                  const char* of) const {
    std::vector<double> x = node_.numbers(attribute);
    if (x.size() != n)
      node_.fail(fmt::format("{} has {} numbers; {} have {}", attribute, x.size(), of, n));
    return x;
  }

  [[nodiscard]] Quaternion unit(std::span<const double> x) const {
    const double length = std::sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]);
    if (!(length > 1e-100) || !std::isfinite(length))
      node_.fail("qpos has a quaternion without a length");
    return {x[0] / length, x[1] / length, x[2] / length, x[3] / length};
  }

  [[nodiscard]] std::vector<double> coordinates(const JointDescription& joint,
                                                std::span<const double> q) const {
    if (q.size() == 1) return {q[0] - whole_.joints.at(joint.name).ref};
    if (joint.type == JointType::spherical) {
      const Quaternion turn = unit(q);
      return {turn.begin(), turn.end()};
    }
    const Pose seen = compose(inverse(joint.pose), free_pose(joint, q));
    std::vector<double> out(seen.position.begin(), seen.position.end());
    out.insert(out.end(), seen.orientation.begin(), seen.orientation.end());
    return out;
  }

  /// Where a body with a free joint is in the world. `q`: of the key; empty: as the file puts it.
  [[nodiscard]] Pose free_pose(const JointDescription& joint, std::span<const double> q) const {
    if (q.empty()) return joint.pose;
    return compose({{q[0], q[1], q[2]}, unit(q.subspan(3))}, inverse(key_frame(joint)));
  }

  /// The frame of a body whose place and velocity a key gives, in that of the body: its own, or
  /// that of its inertia.
  [[nodiscard]] Pose key_frame(const JointDescription& joint) const {
    const auto known = whole_.joints.find(joint.name);  // none: a joint of --base free
    if (known == whole_.joints.end() || !known->second.is_aligned) return {};
    if (!known->second.inertia)
      node_.fail(fmt::format(
          "the free joint '{}' is aligned with the inertia of its body (align, alignfree), whose "
          "axes MuJoCo chooses; expected an <inertial> with diaginertia, one geom with a mass that "
          "is no mesh, or align=\"false\"",
          joint.name));
    return *known->second.inertia;
  }

  [[nodiscard]] std::vector<double> rates(const JointDescription& joint, std::span<const double> q,
                                          std::span<const double> v) const {
    std::vector<double> out(v.begin(), v.end());
    if (joint.type != JointType::free) return out;
    const Pose frame = key_frame(joint), body = free_pose(joint, q);
    const Vector3 turn = outer_direction(frame, {v[3], v[4], v[5]});
    const Vector3 speed =
        Vector3{v[0], v[1], v[2]} - outer_direction(body, cross(turn, frame.position));
    const Vector3 seen = outer_direction(inverse(joint.pose), speed);
    std::copy(seen.begin(), seen.end(), out.begin());
    std::copy(turn.begin(), turn.end(), out.begin() + 3);
    return out;
  }

  void read_controls() const {
    std::vector<double> given(whole_.motors.size(), 0.0);  // MuJoCo's, without an attribute
    if (node_.has("ctrl")) given = sized_numbers("ctrl", given.size(), "the actuators");
    std::vector<double>& controls = whole_.robot.controls.emplace();
    controls.assign(whole_.robot.scene.motors.size(), 0.0);
    for (std::size_t k = 0; k < given.size(); ++k)
      if (whole_.motors[k] >= 0) controls[std::size_t(whole_.motors[k])] = given[k];
  }

  const MjcfWhole& whole_;
  const RobotNode& node_;
  std::map<std::string, double> given_;  ///< coordinates of joints with one
};

}  // namespace

std::optional<RobotNode> find_mjcf_keyframe(MjcfWhole& whole,
                                            const std::vector<RobotNode>& sections,
                                            const std::string& requested) {
  std::vector<std::string> names;
  std::vector<RobotNode> keys;
  for (const RobotNode& section : sections)
    for (const RobotNode& key : section.parts({{"key"}})) {
      key.check({{"name"},
                 {"qpos"},
                 {"qvel"},
                 {"ctrl"},
                 {"time", Fate::idle, "a scene starts at time 0"},
                 {"act", Fate::idle, "of actuators with a state, which are not read"},
                 {"mpos", Fate::idle, "of bodies that another program moves"},
                 {"mquat", Fate::idle, "of bodies that another program moves"}});
      names.push_back(key.text("name", fmt::format("{}", keys.size())));
      keys.push_back(key);
    }
  const auto at = std::find(names.begin(), names.end(), requested);
  for (const RobotNode& key : keys)
    if (requested.empty() || at == names.end() || &key != &keys[std::size_t(at - names.begin())])
      key.idle(std::string("<key>: ") + kUse);
  if (requested.empty()) return std::nullopt;
  if (at == names.end())
    throw InputError(fmt::format("--keyframe {}: {} has no keyframe of this name{}", requested,
                                 whole.robot.scene.path, suggestion(requested, names)));
  return keys[std::size_t(at - names.begin())];
}

void read_mjcf_keyframe(MjcfWhole& whole, const RobotNode& key) { Keyframe(whole, key).read(); }

}  // namespace tangere
