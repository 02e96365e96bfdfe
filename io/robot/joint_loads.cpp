// SPDX-License-Identifier: Apache-2.0
// A position motor without a range of its force, with targets t and places q of its joint:
//
//   on a loop    P max(|t - q|, |t - t'|)
//   on a limit   P (what t is beyond the limit)
//
// Targets without bounds are the places of the joint, and the other way round. A tendon of force f
// acts on joint i as at most f a_i, where a_i is its ratio, or of a path the distance of its points
// from the joint.
#include "io/robot/joint_loads.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/scene/outer_pose.hpp"
#include "io/robot/rotations.hpp"

namespace tangere {
namespace {

constexpr double kLeastReach = 0.01;  // between a joint and what hangs on it [m]
constexpr double kUnbounded = std::numeric_limits<double>::infinity();

double length(const Vector3& v) { return std::sqrt(dot(v, v)); }

/// The largest force of a motor, as far as its ranges bound it; 0 if they do not.
double largest_force(const MotorDescription& m) {
  double largest = 0;
  const auto add = [&](double force) {
    if (std::isfinite(force)) largest = std::max(largest, std::abs(force));
  };
  add(m.low), add(m.high);
  if (m.control == MotorControl::force && m.scale)
    for (const double u : m.u_range) add(std::clamp(*m.scale * u + m.offset, m.low, m.high));
  return largest;
}

bool is_bounded(const std::array<double, 2>& range) {
  return std::isfinite(range[0]) && std::isfinite(range[1]);
}

/// The targets of a position motor.
std::array<double, 2> targets_of(const MotorDescription& m) {
  std::array<double, 2> targets;
  for (std::size_t k = 0; k < 2; ++k) targets[k] = m.scale.value_or(1) * m.u_range[k] + m.offset;
  if (targets[0] > targets[1]) std::swap(targets[0], targets[1]);
  return targets;
}

}  // namespace

JointLoads::JointLoads(const Robot& robot, Holder holder)
    : robot_(robot),
      scene_(robot.scene),
      holder_(holder),
      model_(scene_),
      known_(scene_.links.size()) {
  for (const LinkDescription& link : scene_.links)
    at_.push_back(link.parent < 0 ? link.joint.pose
                                  : compose(at_[std::size_t(link.parent)], link.joint.pose));
  list_tendons();
}

double JointLoads::load(std::size_t i) {
  if (known_[i]) return *known_[i];
  const JointDescription& joint = scene_.links[i].joint;
  double load = std::max(weight(i), motors(i));
  if (const auto effort = robot_.efforts.find(joint.name); effort != robot_.efforts.end())
    load = std::max(load, effort->second);
  for (const Tendon& tendon : tendons_)
    for (const Arm& a : tendon.arms)
      if (a.joint == i) load = std::max(load, a.length * motors(tendon.link));
  if (is_transmission(scene_, joint)) load = std::max(load, whole_weight());
  for (std::size_t k = 0; k < joint.follows.size() && weight(i) == 0; ++k)
    if (const std::size_t leader = link_of_joint(joint.follows[k]);
        leader < scene_.links.size() && joint.ratio[k] != 0)
      load = std::max(load, this->load(leader) / std::abs(joint.ratio[k]));
  return known_[i].emplace(load);
}

double JointLoads::load_at(std::size_t link, const Vector3& point) {
  double load = 0;
  for (auto i = static_cast<int>(link); i >= 0; i = scene_.links[std::size_t(i)].parent) {
    const auto joint = std::size_t(i);
    const JointType type = scene_.links[joint].joint.type;
    if (type == JointType::fixed) continue;
    const double reach = type == JointType::revolute ? distance(joint, point) : 1;
    load = std::max(load, this->load(joint) / reach);
    for (const Tendon& tendon : tendons_)
      for (const Arm& a : tendon.arms)
        if (a.joint == joint && !scene_.links[tendon.link].joint.follows.empty())
          load = std::max(load, this->load(tendon.link) * a.length / reach);
  }
  return load;
}

Vector3 JointLoads::place(std::size_t link, const Vector3& in_body) const {
  return outer_point(compose(at_[link], scene_.links[link].body.pose), in_body);
}

double JointLoads::distance(std::size_t joint, const Vector3& point) const {
  return std::max(kLeastReach, length(point - at_[joint].position));
}

/// Of all links, which hang on a transmission at most.
double JointLoads::whole_weight() const {
  double mass = 0;
  for (std::size_t k = 0; k < scene_.links.size(); ++k) mass += model_.mass(static_cast<int>(k));
  return mass * std::max(length(scene_.gravity), 1.0);
}

double JointLoads::weight(std::size_t i) const {
  const double g = std::max(length(scene_.gravity), 1.0);
  double mass = 0, reach = kLeastReach;
  for (std::size_t k = i; k < scene_.links.size(); ++k) {
    auto up = static_cast<int>(k);
    while (up > static_cast<int>(i)) up = scene_.links[std::size_t(up)].parent;
    if (up != static_cast<int>(i)) continue;
    mass += model_.mass(static_cast<int>(k));
    const Vector3 p = outer_point(at_[k], scene_.links[k].body.pose.position);
    reach = std::max(reach, length(p - at_[i].position));
  }
  return scene_.links[i].joint.type == JointType::revolute ? mass * g * reach : mass * g;
}

std::size_t JointLoads::link_of_joint(const std::string& name) const {
  const auto at = std::ranges::find_if(
      scene_.links, [&](const LinkDescription& l) { return l.joint.name == name; });
  return std::size_t(at - scene_.links.begin());
}

int JointLoads::link_of_body(const std::string& name) const {
  if (name.empty()) return -1;
  const auto at = std::ranges::find_if(
      scene_.links, [&](const LinkDescription& l) { return l.body.name == name; });
  return at == scene_.links.end() ? -1 : static_cast<int>(at - scene_.links.begin());
}

double JointLoads::arm(std::size_t joint, const Vector3& point) const {
  return scene_.links[joint].joint.type == JointType::prismatic
             ? 1
             : length(point - at_[joint].position);
}

void JointLoads::list_tendons() {
  for (std::size_t k = 0; k < scene_.links.size(); ++k) {
    const JointDescription& joint = scene_.links[k].joint;
    if (joint.follows.empty() || weight(k) != 0) continue;
    Tendon tendon{k, {}};
    for (std::size_t n = 0; n < joint.follows.size(); ++n)
      if (const std::size_t leader = link_of_joint(joint.follows[n]); leader < scene_.links.size())
        tendon.arms.push_back({leader, std::abs(joint.ratio[n])});
    tendons_.push_back(std::move(tendon));
  }
  for (const TransmissionDescription& d : scene_.transmissions)
    tendons_.push_back({link_of_joint(d.joint), d.kind == TransmissionDescription::Kind::path
                                                    ? path_arms(d)
                                                    : wrench_arms(d)});
}

std::vector<JointLoads::Arm> JointLoads::path_arms(const TransmissionDescription& path) const {
  std::vector<double> arms(scene_.links.size(), 0);
  std::vector<std::size_t> points(scene_.links.size(), 0);  // of the path, that a joint moves
  std::size_t all = 0;
  for (const PathPart& part : path.path) {
    if (part.kind == PathPart::Kind::pulley) continue;
    ++all;
    const int body = link_of_body(part.body);
    if (body < 0) continue;
    const Vector3 point = place(std::size_t(body), part.position);
    for (int i = body; i >= 0; i = scene_.links[std::size_t(i)].parent) {
      double& longest = arms[std::size_t(i)];
      longest = std::max(longest, arm(std::size_t(i), point) + part.radius);
      ++points[std::size_t(i)];
    }
  }
  std::vector<Arm> out;
  for (std::size_t i = 0; i < arms.size(); ++i)
    if (points[i] > 0 && points[i] < all && scene_.links[i].joint.type != JointType::fixed)
      out.push_back({i, arms[i]});
  return out;
}

std::vector<JointLoads::Arm> JointLoads::wrench_arms(const TransmissionDescription& wrench) const {
  std::vector<Arm> out;
  const auto add = [&](int body, const Vector3& position) {
    if (body < 0) return;
    const Vector3 point = place(std::size_t(body), position);
    for (int i = body; i >= 0; i = scene_.links[std::size_t(i)].parent) {
      const JointType type = scene_.links[std::size_t(i)].joint.type;
      if (type == JointType::fixed) continue;
      const double turning = type == JointType::prismatic ? 0 : length(wrench.torque);
      out.push_back({std::size_t(i), arm(std::size_t(i), point) * length(wrench.force) + turning});
    }
  };
  add(link_of_body(wrench.body), wrench.position);
  if (wrench.reference) add(link_of_body(*wrench.reference), wrench.reference_position);
  return out;
}

const JointLoads::Tendon* JointLoads::tendon_of(std::size_t link) const {
  const auto at = std::ranges::find(tendons_, link, &Tendon::link);
  return at == tendons_.end() ? nullptr : &*at;
}

JointLoads::Range JointLoads::places(std::size_t link) const {
  const JointDescription& joint = scene_.links[link].joint;
  if (joint.limits) return *joint.limits;
  const Tendon* const tendon = tendon_of(link);
  if (tendon == nullptr || !joint.powers.empty()) return {-kUnbounded, kUnbounded};
  Range sum{joint.offset, joint.offset};
  if (joint.follows.empty()) {
    int before = 0;
    for (std::size_t k = 0; k < link; ++k) before += position_count(scene_.links[k].joint.type);
    sum.fill(model_.initial_q()[std::size_t(before)]);
  }
  for (std::size_t n = 0; n < tendon->arms.size(); ++n) {
    const auto& [leader, arm] = tendon->arms[n];
    if (arm == 0) continue;
    const Range own = places(leader);
    if (!is_bounded(own)) return {-kUnbounded, kUnbounded};
    if (joint.follows.empty()) {
      sum = {sum[0] - arm * (own[1] - own[0]), sum[1] + arm * (own[1] - own[0])};
    } else {
      const double one = joint.ratio[n] * own[0], two = joint.ratio[n] * own[1];
      sum = {sum[0] + std::min(one, two), sum[1] + std::max(one, two)};
    }
  }
  return sum;
}

double JointLoads::position_force(const MotorDescription& m, std::size_t link) const {
  Range targets = targets_of(m), where = places(link);
  if (holder_ == Holder::limit) {
    if (!is_bounded(targets) || !is_bounded(where)) return 0;
    const double beyond = std::max({0.0, targets[1] - where[1], where[0] - targets[0]});
    return std::min(m.P * beyond, std::max(std::abs(m.low), m.high));
  }
  if (!is_bounded(targets)) targets = where;
  if (!is_bounded(targets)) return 0;
  if (!is_bounded(where)) where = targets;
  const double most =
      std::max({targets[1] - targets[0], targets[1] - where[0], where[1] - targets[0]});
  return std::min(m.P * most, std::max(std::abs(m.low), m.high));
}

double JointLoads::motors(std::size_t link) const {
  double most = 0;
  for (const MotorDescription& m : scene_.motors) {
    if (m.joint != scene_.links[link].joint.name) continue;
    most = std::max(most, largest_force(m));
    if (m.control == MotorControl::position) most = std::max(most, position_force(m, link));
  }
  return most;
}

}  // namespace tangere
