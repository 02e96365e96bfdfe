// SPDX-License-Identifier: Apache-2.0
// Uses names and joints only, so that the reader, the compiler and warnings agree.
#include "engine/scene/sensed_bodies.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/scene/shapes.hpp"

namespace tangere {

namespace {

class Sensing {
 public:
  Sensing(const Scene& scene, const TactileDescription& sensor)
      : scene_(scene),
        sensor_(sensor),
        body_(find(sensor.body, "body")),
        own_(moving_link(scene, body_)) {
    if (!sensor.feels.empty() && !sensor.ignores.empty())
      fail("has both feels and ignores; expected one of them");
    for (const std::string& name : sensor.feels) {
      const int k = find(name, "feels");
      if (moving_link(scene, k) == own_)
        fail(fmt::format("feels '{}', which does not move against it", name));
      if (!has_distance(shape(k)))
        fail(fmt::format("feels '{}', which is {} and has no distance; expected {}", name,
                         with_article(shape_name(shape(k))), shapes_with([](const ShapeRow& row) {
                           return row.distance.has_value();
                         })));
    }
    for (const std::string& name : sensor.ignores) find(name, "ignores");
  }

  [[nodiscard]] bool senses(int k) const {
    const int link = moving_link(scene_, k);
    const std::string& name = scene_.links[std::size_t(k)].body.name;
    if (link == own_ || !has_distance(shape(k))) return false;
    if (!sensor_.feels.empty()) return has(sensor_.feels, name);
    return !has(sensor_.ignores, name) && ((!jointed(k) && !looped(k)) || in_contact(link));
  }

 private:
  static bool has(const std::vector<std::string>& names, const std::string& name) {
    return std::ranges::find(names, name) != names.end();
  }
  [[nodiscard]] const Shape& shape(int k) const { return scene_.links[std::size_t(k)].body.shape; }

  int find(const std::string& body, const char* attribute) const {
    for (std::size_t k = 0; k < scene_.links.size(); ++k)
      if (scene_.links[k].body.name == body) return static_cast<int>(k);
    fail(fmt::format("{} '{}', which is no body of the scene", attribute, body));
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(
        fmt::format("{}<tactile>: sensor '{}' {}", sensor_.source.prefix(), sensor_.name, what));
  }

  /// Returns the first link up the tree whose joint is not fixed, or the root.
  [[nodiscard]] int rigid_root(int link) const {
    while (scene_.links[std::size_t(link)].joint.type == JointType::fixed &&
           scene_.links[std::size_t(link)].parent >= 0)
      link = scene_.links[std::size_t(link)].parent;
    return link;
  }
  /// Whether a joint connects a link, with all that is rigidly joined to it, with the sensor's. So
  /// a palm that is fixed in the world is a neighbour of its fingers, and a table is not.
  [[nodiscard]] bool jointed(int link) const {
    const auto hangs_on = [&](int child, int parent) {
      const int carrier = scene_.links[std::size_t(child)].parent;
      return carrier >= 0 && rigid_root(carrier) == parent;
    };
    const int one = rigid_root(link), two = rigid_root(body_);
    return hangs_on(one, two) || hangs_on(two, one);
  }

  /// Whether a loop connects what is rigidly joined to a link with what is to the sensor's.
  [[nodiscard]] bool looped(int link) const {
    const int one = rigid_root(link), two = rigid_root(body_);
    return std::ranges::any_of(scene_.loops, [&](const LoopDescription& loop) {
      const auto root = [&](const std::string& body) {
        const auto found = std::ranges::find_if(
            scene_.links, [&](const LinkDescription& l) { return l.body.name == body; });
        return found == scene_.links.end()
                   ? -1
                   : rigid_root(static_cast<int>(found - scene_.links.begin()));
      };
      const int first = root(loop.body1), second = root(loop.body2);
      return (first == one && second == two) || (first == two && second == one);
    });
  }

  /// Whether a contact of bodies of a link and the sensor's is declared.
  [[nodiscard]] bool in_contact(int link) const {
    return std::ranges::any_of(scene_.pair_contacts, [&](const PairContactDescription& c) {
      const auto at = [&](const std::string& body) {
        const auto found = std::ranges::find_if(
            scene_.links, [&](const LinkDescription& l) { return l.body.name == body; });
        return found == scene_.links.end()
                   ? -1
                   : moving_link(scene_, static_cast<int>(found - scene_.links.begin()));
      };
      const int one = at(c.general_body), two = at(c.primitive_body);
      return c.sensor.empty() && ((one == own_ && two == link) || (one == link && two == own_));
    });
  }

  const Scene& scene_;
  const TactileDescription& sensor_;
  int body_, own_;
};

}  // namespace

int moving_link(const Scene& scene, int link) {
  while (link >= 0 && scene.links[std::size_t(link)].joint.type == JointType::fixed)
    link = scene.links[std::size_t(link)].parent;
  return link;
}

std::vector<int> sensed_bodies(const Scene& scene, const TactileDescription& sensor) {
  const Sensing sensing(scene, sensor);
  std::vector<int> sensed;
  for (int k = 0; k < static_cast<int>(scene.links.size()); ++k)
    if (sensing.senses(k)) sensed.push_back(k);
  return sensed;
}

}  // namespace tangere
