// SPDX-License-Identifier: Apache-2.0
// Warns of sensors whose readings are always zero, or are forces without contact, of those that do
// not sense what touches their body, and of joints that start outside their limits.
#include "io/scene/scene_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <set>

#include "engine/scene/frames.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "engine/scene/shapes.hpp"
#include "io/scene/scene_sections.hpp"

namespace tangere {
namespace {

constexpr double kBelow = 0.1;   // share of a body's thickness
constexpr double kClose = 0.01;  // share of its width: so far off its surface points may be

std::string listed(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text;
}

class SensorWarnings {
 public:
  SensorWarnings(const Scene& scene, const TactileDescription& sensor, const SceneNode& root)
      : scene_(scene), sensor_(sensor), root_(root), own_(group_of(sensor.body)) {}

  void warn() {
    std::set<std::string> without;  // distance, and free to move against the sensor
    for (std::size_t k = 0; k < scene_.links.size(); ++k) {
      if (moving_link(scene_, static_cast<int>(k)) == own_) continue;
      if (is_transmission(scene_, scene_.links[k].joint)) continue;  // it has no place
      const BodyDescription& body = scene_.links[k].body;
      if (!has_distance(body.shape)) without.insert(body.name);
    }
    for (const int k : sensed_bodies(scene_, sensor_))
      sensed_groups_.insert(moving_link(scene_, k));
    if (sensed_groups_.empty())
      return add(without.empty()
                     ? "can feel nothing: no body that it feels moves against it; bodies that a "
                       "joint connects with it are felt if 'feels' names them" +
                           ground_hint()
                     : "can feel nothing: a sensor feels shapes with a distance, and " +
                           listed(without) + " has none");
    const bool touched = std::any_of(scene_.pair_contacts.begin(), scene_.pair_contacts.end(),
                                     [&](const auto& c) { return !other_of(c).empty(); });
    if (!touched)
      return add(
          "reads forces that nothing exerts: no contact is declared between that body, or one "
          "that is rigidly joined to it, and another, so bodies pass through it" +
          ground_hint());
    if (on_the_ground())
      add("does not feel the ground, which touches that body; expected a body of type plane in its "
          "place, where it should");
    warn_of_unsensed();
    warn_of_place();
  }

 private:
  /// A body with a distance that moves rigidly with the sensor's.
  struct Part {
    const BodyDescription& body;
    kernels::Frame<double> in_group;
    bool touched;
  };

  [[nodiscard]] int group_of(const std::string& body) const {
    for (std::size_t k = 0; k < scene_.links.size(); ++k)
      if (scene_.links[k].body.name == body) return moving_link(scene_, static_cast<int>(k));
    return -1;
  }

  /// Whether a body could be sensed. If it is not, the sensor's lists exclude it.
  [[nodiscard]] bool has_a_distance(const std::string& body) const {
    const auto link =
        std::ranges::find_if(scene_.links, [&](const auto& l) { return l.body.name == body; });
    return link != scene_.links.end() && has_distance(link->body.shape);
  }

  /// The other body of a contact with the sensor's; "" for none.
  [[nodiscard]] std::string other_of(const PairContactDescription& c) const {
    const bool first = group_of(c.general_body) == own_,
               second = group_of(c.primitive_body) == own_;
    if (first == second) return "";
    return first ? c.primitive_body : c.general_body;
  }

  /// Whether the sensor's body touches the ground by its points or by its surface. The ground is no
  /// link.
  [[nodiscard]] bool on_the_ground() const {
    return std::any_of(scene_.ground_contacts.begin(), scene_.ground_contacts.end(),
                       [&](const auto& c) { return c.body == sensor_.body; }) ||
           std::any_of(scene_.pair_contacts.begin(), scene_.pair_contacts.end(),
                       [&](const auto& c) {
                         const std::string other = other_of(c);
                         return !other.empty() && !is_link(other);
                       });
  }
  [[nodiscard]] bool is_link(const std::string& body) const {
    return std::ranges::any_of(scene_.links, [&](const auto& l) { return l.body.name == body; });
  }
  [[nodiscard]] std::string ground_hint() const {
    return on_the_ground() ? ". No sensor feels the ground; expected a body of type plane in its "
                             "place, where it should"
                           : "";
  }

  void warn_of_unsensed() {
    std::set<std::string> unsensed;
    for (const PairContactDescription& c : scene_.pair_contacts) {
      const std::string other = other_of(c);
      if (is_link(other) && !sensed_groups_.contains(group_of(other)) && !has_a_distance(other))
        unsensed.insert(other);
    }
    if (unsensed.empty()) return;
    add(
        fmt::format("does not feel {}, which touches that body: a sensor feels shapes with a "
                    "distance, and {} none",
                    listed(unsensed), unsensed.size() == 1 ? "it has" : "they have"));
  }

  /// Bodies stop at the surface of the sensor's own body, so points well below it read zero, and
  /// points far above it read forces without contact.
  void warn_of_place() {
    const auto link = std::find_if(scene_.links.begin(), scene_.links.end(),
                                   [&](const auto& l) { return l.body.name == sensor_.body; });
    if (link == scene_.links.end()) return;
    const Shape& shape = link->body.shape;
    const std::array<double, 3> across = widths(shape);
    const double thin = *std::min_element(across.begin(), across.end()),
                 wide = *std::max_element(across.begin(), across.end());
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (const TactilePoint& p : some_points()) {
      const std::optional<SurfaceDistance> d = distance_from(shape, p.position);
      if (!d) return;
      least = std::min(least, d->distance);
      most = std::max(most, d->distance);
    }
    if (!(thin > 0)) return;
    if (most < -kBelow * thin)
      add(
          fmt::format("lies at least {:.3g} m below the surface of that body, so what touches the "
                      "body does not come as deep; expected points on its surface",
                      -most));
    if (least > wide)
      return add(
          fmt::format("lies at least {:.3g} m off that body, which is {:.3g} m across; expected "
                      "points on its surface, in the body's frame and the scene's unit",
                      least, wide));
    if (most > kClose * wide || !is_touched(sensor_.body)) warn_of_points_beside(kClose * wide);
  }

  /// Bodies stop at what they touch. So points that lie beside or above all that moves rigidly with
  /// the sensor's body and has a contact read forces that nothing exerts. Half the distance between
  /// points is allowed, and `close` [m] at least.
  void warn_of_points_beside(double close) {
    if (is_the_contact()) return;
    std::vector<Part> parts;
    kernels::Frame<double> own = kIdentityFrame;
    for (const LinkDescription& link : scene_.links) {
      if (group_of(link.body.name) != own_) continue;
      const Part part{link.body, frame_in_group(link), is_touched(link.body.name)};
      if (link.body.name == sensor_.body) own = part.in_group;
      if (distance_from(link.body.shape, {0, 0, 0}))
        parts.push_back(part);
      else if (part.touched)
        return;  // a mesh or points without a distance, which may carry the sensor
    }
    const std::vector<TactilePoint> points = tactile_points(sensor_);
    const double allowed = std::max(close, 0.5 * spacing(points));
    std::size_t beside = 0;
    double most = 0;
    std::set<std::string> untouched;  // where points lie that are off what bodies touch
    for (const TactilePoint& p : points) {
      const auto distance = [&](const Part& part) {
        const kernels::Frame<double> in_part = relative(part.in_group, own);
        const kernels::Vec3<double> at = in_part.R * vec3_of(p.position) + in_part.p;
        return distance_from(part.body.shape, {at.x, at.y, at.z})->distance;
      };
      double least = std::numeric_limits<double>::infinity();
      for (const Part& part : parts)
        if (part.touched) least = std::min(least, distance(part));
      if (!(least > allowed)) continue;
      ++beside;
      most = std::max(most, least);
      for (const Part& part : parts)
        if (!part.touched && distance(part) <= allowed) untouched.insert(part.body.name);
    }
    if (beside == 0) return;
    add(fmt::format(
        "has {} of {} points up to {:.3g} m off what bodies touch there: that body and "
        "what is rigidly joined to it, where a contact names them. Bodies reach these "
        "points without a contact, so they read forces that nothing exerts; expected "
        "{}points on the surface, to {:.2g} m",
        beside, points.size(), most,
        untouched.empty() ? "" : "a contact of " + listed(untouched) + ", or ", allowed));
  }

  /// Whether a contact names the body together with one that can move against it.
  [[nodiscard]] bool is_touched(const std::string& body) const {
    return std::ranges::any_of(scene_.pair_contacts, [&](const PairContactDescription& c) {
      return (c.general_body == body || c.primitive_body == body) && !other_of(c).empty();
    });
  }

  /// Whether bodies touch the sensor's points themselves.
  [[nodiscard]] bool is_the_contact() const {
    return (sensor_.layer && sensor_.layer->feedback) ||
           std::ranges::any_of(scene_.pair_contacts,
                               [&](const auto& c) { return c.sensor == sensor_.name; });
  }

  /// The frame of a link's body in the frame of the moving link that it is rigidly joined to.
  [[nodiscard]] kernels::Frame<double> frame_in_group(const LinkDescription& link) const {
    kernels::Frame<double> frame = to_frame(link.body.pose);
    const LinkDescription* up = &link;
    while (up->joint.type == JointType::fixed) {
      frame = compose(to_frame(up->joint.pose), frame);
      if (up->parent < 0) break;
      up = &scene_.links[std::size_t(up->parent)];
    }
    return frame;
  }

  /// Of the points on the widest face of the box around them, if they cover it evenly [m].
  [[nodiscard]] static double spacing(const std::vector<TactilePoint>& points) {
    std::array<double, 3> extent{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] =
          std::ranges::minmax(points, {}, [&](const TactilePoint& p) { return p.position[k]; });
      extent[k] = high.position[k] - low.position[k];
    }
    std::ranges::sort(extent, std::greater<>());
    const auto n = static_cast<double>(points.size());
    return std::max(std::sqrt(extent[0] * extent[1] / n), extent[0] / n);
  }

  /// For an array its corners, which bound all points, and some between them.
  [[nodiscard]] std::vector<TactilePoint> some_points() const {
    if (!sensor_.points.empty()) return sensor_.points;
    TactileDescription coarse = sensor_;
    coarse.array.rows = std::min(coarse.array.rows, 3);
    coarse.array.cols = std::min(coarse.array.cols, 3);
    return tactile_points(coarse);
  }

  void add(const std::string& text) {
    root_.context().warnings.push_back(fmt::format("{}<tactile>: sensor '{}' on body '{}' {}",
                                                   sensor_.source.prefix(), sensor_.name,
                                                   sensor_.body, text));
  }

  const Scene& scene_;
  const TactileDescription& sensor_;
  const SceneNode& root_;
  int own_;
  std::set<int> sensed_groups_;  // groups of sensed bodies
};

/// Coordinates of joints at the start, [m] or [rad]; joints that follow others have theirs.
class Starts {
 public:
  explicit Starts(const Scene& scene) : scene_(scene), starts_(scene.links.size()) {}

  struct Start {
    double q = 0;
    bool drawn = false;  ///< by <randomize>, or that of a joint that it follows
  };
  Start at(std::size_t k) {
    if (starts_[k]) return *starts_[k];
    starts_[k].emplace();  // what a circle of joints reads; compiling the scene refuses it
    const JointDescription& joint = scene_.links[k].joint;
    Start start{joint.follows.empty() ? given(joint.name) : joint.offset, is_drawn(joint.name)};
    for (std::size_t i = 0; i < std::min(joint.follows.size(), joint.ratio.size()); ++i)
      for (std::size_t leader = 0; leader < starts_.size(); ++leader) {
        if (scene_.links[leader].joint.name != joint.follows[i]) continue;
        const Start of = at(leader);
        start.q += joint.share_of_leader(i, of.q);
        start.drawn = start.drawn || of.drawn;
      }
    starts_[k] = start;
    return start;
  }

 private:
  [[nodiscard]] double given(const std::string& joint) const {
    for (const InitialState& state : scene_.initial)
      if (state.joint == joint && state.q.size() == 1) return state.q[0];
    return 0;
  }
  [[nodiscard]] bool is_drawn(const std::string& joint) const {
    return std::ranges::any_of(scene_.randomizations, [&](const RandomizationDescription& d) {
      return d.number.owner == NumberOwner::joint && d.number.name == joint &&
             d.number.field == NumberField::q;
    });
  }

  const Scene& scene_;
  std::vector<std::optional<Start>> starts_;  // (links); empty: not computed yet
};

}  // namespace

void warn_of_starts(const Scene& scene, const SceneNode& root) {
  constexpr double kLimitRounding = 1e-9;  // of the limits
  constexpr std::size_t kListed = 8;       // joints in the message
  std::string listed;
  std::size_t count = 0;
  const Source* first = nullptr;
  Starts starts(scene);
  for (std::size_t k = 0; k < scene.links.size(); ++k) {
    const JointDescription& joint = scene.links[k].joint;
    if (joint.type != JointType::revolute && joint.type != JointType::prismatic) continue;
    if (!joint.limits || joint.limit_stiffness <= 0) continue;
    if (is_transmission(scene, joint)) continue;  // transmissions_outside_limits() tests it
    const auto [q, drawn] = starts.at(k);
    if (drawn) continue;
    const auto [low, high] = *joint.limits;
    const double slack = kLimitRounding * (std::abs(low) + std::abs(high));
    if (q >= low - slack && q <= high + slack) continue;
    if (first == nullptr) first = &joint.source;
    if (++count > kListed) continue;
    listed += fmt::format("{}'{}' at {:.4g} with limits {:.4g} {:.4g}", listed.empty() ? "" : ", ",
                          joint.name, q, low, high);
  }
  if (count == 0) return;
  if (count > kListed) listed += fmt::format(", and {} more", count - kListed);
  root.context().warnings.push_back(
      fmt::format("{}<joint>: {} outside {}, in m or rad: {}; the springs of limits push from the "
                  "first step on; expected another 'q' of <initial>, or other limits",
                  first->prefix(), count == 1 ? "a joint starts" : "joints start",
                  count == 1 ? "its limits" : "their limits", listed));
}

void warn_of_sensors(const Scene& scene, const SceneNode& root) {
  for (const TactileDescription& sensor : scene.sensors) SensorWarnings(scene, sensor, root).warn();
}

}  // namespace tangere
