// SPDX-License-Identifier: Apache-2.0
// Reads actuators, contacts and loops of a scene file.
#include "io/scene/scene_sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/scene/contact_resolution.hpp"
#include "engine/scene/scene_faults.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/scene/surface_contact.hpp"

namespace tangere {

namespace {

constexpr std::size_t kPublishedShare = 50;  // vertices of a mesh for each that touches there
constexpr std::size_t kPublished = 3;        // among the words of `law`

template <class Name>
int find_named(const Scene& scene, const SceneNode& node, const char* attribute, const char* kind,
               Name&& name_of) {
  const std::string requested = node.text(attribute);
  std::vector<std::string> names;
  if (attribute == std::string_view("body2") && node.name() == to_string(kSurfaceContact))
    names.emplace_back(kGroundName);
  for (std::size_t i = 0; i < scene.links.size(); ++i) {
    names.push_back(name_of(scene.links[i]));
    if (names.back() == requested) return static_cast<int>(i);
  }
  node.fail(fmt::format("{}=\"{}\": no {} has this name{}", attribute, requested, kind,
                        suggestion(requested, names)));
}

/// Reads law, ramp and coefficients of a contact of either kind.
template <class Contact>
void read_law(const SceneElement& node, Contact& contact) {
  const std::size_t law = node.word("law");
  contact.law = law == kPublished ? ContactLaw::linear : static_cast<ContactLaw>(law);
  if (node.has("ramp")) contact.ramp = node.number("ramp");
  if (node.has("ramp") && (law == kPublished || contact.law != ContactLaw::linear))
    node.warn("'ramp' has no effect with law=\"" + node.text("law", to_string(contact.law)) + "\"");
  if (law == kPublished) contact.ramp = 0;
  node.read(contact.coefficients, contact.law == ContactLaw::linear);
}

}  // namespace

int find_joint(const Scene& scene, const SceneNode& node, const char* attribute) {
  return find_named(scene, node, attribute, "joint",
                    [](const LinkDescription& l) { return l.joint.name; });
}
int find_body(const Scene& scene, const SceneNode& node, const char* attribute) {
  return find_named(scene, node, attribute, "body",
                    [](const LinkDescription& l) { return l.body.name; });
}

void warn_of_dense_meshes(const Scene& scene, const SceneNode& root) {
  if (root.name() != "redmax") return;
  const auto touches = [&](const std::string& body) {
    return std::any_of(scene.ground_contacts.begin(), scene.ground_contacts.end(),
                       [&](const auto& c) { return c.body == body; }) ||
           std::any_of(scene.pair_contacts.begin(), scene.pair_contacts.end(),
                       [&](const auto& c) { return c.general_body == body; });
  };
  for (const LinkDescription& link : scene.links) {
    const auto* const mesh = std::get_if<MeshShape>(&link.body.shape);
    if (mesh == nullptr || !mesh->contact_points.empty() || !touches(link.body.name)) continue;
    const std::size_t all = mesh->vertices.size() / 3;
    root.context().warnings.push_back(fmt::format(
        "{}<body>: mesh '{}' touches with all its {} vertices. The published simulator takes about "
        "one in {}, so at the same kn this contact is as many times stiffer; "
        "general_contact_resolution=\"{}\" takes as few",
        link.body.source.prefix(), link.body.name, all, kPublishedShare,
        std::max<std::size_t>(all / kPublishedShare, 1)));
  }
}

/// Warns where bodies of a contact of surfaces touch by another contact as well.
static void warn_of_second_contact(const Scene& scene, const SceneNode& root,
                                   const PairContactDescription& c) {
  const auto same_pair = [&](const PairContactDescription& other) {
    return !other.per_area() && std::minmax(other.general_body, other.primitive_body) ==
                                    std::minmax(c.general_body, c.primitive_body);
  };
  const bool twice = std::ranges::any_of(scene.pair_contacts, same_pair) ||
                     (c.on_ground && std::ranges::any_of(scene.ground_contacts, [&](const auto& g) {
                        return g.body == c.general_body;
                      }));
  if (twice && !c.second_half)
    root.context().warnings.push_back(
        fmt::format("{}<surface_contact>: '{}' and '{}' touch by another contact as well, so the "
                    "forces of both add up; expected one of them",
                    c.source.prefix(), c.general_body, c.primitive_body));
}

void warn_of_coarse_points(const Scene& scene, const SceneNode& root) {
  const auto shape_of = [&](const std::string& body) -> const Shape& {
    return std::find_if(scene.links.begin(), scene.links.end(),
                        [&](const LinkDescription& l) { return l.body.name == body; })
        ->body.shape;
  };
  for (const PairContactDescription& c : scene.pair_contacts) {
    if (c.per_area()) {
      warn_of_second_contact(scene, root, c);
      continue;
    }
    const bool both_ways =
        std::any_of(scene.pair_contacts.begin(), scene.pair_contacts.end(), [&](const auto& other) {
          return other.general_body == c.primitive_body && other.primitive_body == c.general_body;
        });
    if (both_ways && is_ball(shape_of(c.general_body)))
      root.context().warnings.push_back(
          fmt::format("{}<general_primitive_contact>: '{}' touches '{}' with its whole surface, "
                      "and '{}' touches "
                      "it as well, so the forces of both contacts add up; expected one of them",
                      c.source.prefix(), c.general_body, c.primitive_body, c.primitive_body));
  }
  for (const auto& lines : {coarse_contact_lines(scene), polygonal_rolling_lines(scene)})
    for (const std::string& line : lines) root.context().warnings.push_back(line);
}

static void read_surface_contact(Scene& scene, const SceneElement& node) {
  SurfaceContactDescription d;
  d.source = node.source();
  if (node.text("body1") == kGroundName && node.text("body2") != kGroundName)
    node.fail("body1=\"ground\"; expected the ground as body2");
  find_body(scene, node, "body1");
  d.body1 = node.text("body1");
  d.body2 = node.text("body2");
  if (d.body2 != kGroundName) find_body(scene, node, "body2");
  d.law = static_cast<ContactLaw>(node.word("law"));
  node.read(d.coefficients);
  if (node.has("pitch")) d.pitch = node.number("pitch");
  node.refuse(contact_fault(scene, d));
  for (std::string& warning : add_surface_contact(scene, d))
    node.context().warnings.push_back(std::move(warning));
}

void read_contacts(Scene& scene, const SceneNode& section) {
  for (const SceneElement& node : elements_in(section)) {
    node.check();
    if (node.of() == kSurfaceContact) {
      read_surface_contact(scene, node);
    } else if (node.of() == kGroundContact) {
      GroundContactDescription d;
      d.source = node.source();
      find_body(scene, node, "body");
      d.body = node.text("body");
      read_law(node, d);
      node.refuse(contact_fault(scene, d));
      scene.ground_contacts.push_back(std::move(d));
    } else {
      PairContactDescription d;
      d.source = node.source();
      find_body(scene, node, "general_body");
      find_body(scene, node, "primitive_body");
      d.general_body = node.text("general_body");
      d.primitive_body = node.text("primitive_body");
      read_law(node, d);
      node.refuse(contact_fault(scene, d));
      scene.pair_contacts.push_back(std::move(d));
    }
  }
}

void read_loops(Scene& scene, const SceneNode& section) {
  for (const SceneElement& node : elements_in(section)) {
    node.check();
    LoopDescription d;
    d.source = node.source();
    d.weld = node.of() == kWeld;
    find_body(scene, node, "body1");
    d.body1 = node.text("body1");
    if (node.has("body2")) {
      find_body(scene, node, "body2");
      d.body2 = node.text("body2");
    }
    node.read(d);
    d.name = node.text("name", d.body1 + " " + (d.body2.empty() ? "world" : d.body2));
    if (node.has("pos2")) d.position2 = node.vector("pos2");
    if (node.has("quat2")) d.orientation2 = node.quaternion("quat2");
    node.refuse(loop_fault(scene, d));
    scene.loops.push_back(std::move(d));
  }
}

}  // namespace tangere
