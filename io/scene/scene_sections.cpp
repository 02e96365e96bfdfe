// SPDX-License-Identifier: Apache-2.0
// Reads actuators and contacts of a scene file.
#include "io/scene/scene_sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/model/contact_resolution.hpp"
#include "engine/model/scene_number.hpp"
#include "engine/model/shapes.hpp"

namespace tangere {

namespace {

const std::vector<std::string> kLaws = {"clamped", "paper", "linear", "published"};
constexpr ContactLaw kLawOf[] = {ContactLaw::clamped, ContactLaw::paper, ContactLaw::linear,
                                 ContactLaw::linear};
constexpr std::size_t kPublishedShare = 50;  // vertices of a mesh for each that touches there
constexpr int kClamped = 0, kLinear = 2, kPublished = 3;  // indices into them

template <class Name>
int find_named(const Scene& scene, const SceneNode& node, const char* attribute, const char* kind,
               Name&& name_of) {
  const std::string wanted = node.text(attribute);
  std::vector<std::string> names;
  for (std::size_t i = 0; i < scene.links.size(); ++i) {
    names.push_back(name_of(scene.links[i]));
    if (names.back() == wanted) return static_cast<int>(i);
  }
  node.fail(fmt::format("{}=\"{}\": no {} has this name{}", attribute, wanted, kind,
                        suggestion(wanted, names)));
}

/// Reads law, ramp and coefficients of a contact of either kind.
template <class Contact>
void read_law(const SceneNode& node, int fallback, Contact& contact) {
  const int law = node.choice("law", kLaws, fallback);
  contact.law = kLawOf[law];
  if (node.has("ramp")) contact.ramp = node.not_negative("ramp") * node.context().length;
  if (node.has("ramp") && law != kLinear)
    node.warn("'ramp' has no effect with law=\"" + kLaws[std::size_t(law)] + "\"");
  if (law == kPublished) contact.ramp = 0;
  contact.coefficients = read_coefficients(node, contact.law);
}

}  // namespace

std::vector<std::string> with_coefficients(std::vector<std::string> attributes) {
  for (int k = 0; k < kCoefficients; ++k)
    attributes.emplace_back(number_kind(NumberOwner::contact, coefficient_field(k)).name);
  return attributes;
}

ContactCoefficients read_coefficients(const SceneNode& node, ContactLaw law) {
  ContactCoefficients c{};
  for (int k = 0; k < kCoefficients; ++k) {
    const NumberKind& kind = number_kind(NumberOwner::contact, coefficient_field(k));
    c[std::size_t(k)] = node.not_negative(kind.name, 0.0) *
                        node.context().factor(kind.unit_of(law == ContactLaw::linear));
  }
  return c;
}

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

void warn_of_coarse_points(const Scene& scene, const SceneNode& root) {
  const auto shape_of = [&](const std::string& body) -> const Shape& {
    return std::find_if(scene.links.begin(), scene.links.end(),
                        [&](const LinkDescription& l) { return l.body.name == body; })
        ->body.shape;
  };
  for (const PairContactDescription& c : scene.pair_contacts) {
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

void read_contacts(Scene& scene, const SceneNode& section) {
  section.check_attributes({});
  for (const SceneNode& node : section.children({"ground_contact", "general_primitive_contact"})) {
    if (node.name() == "ground_contact") {
      node.check_attributes(with_coefficients({"body", "law", "ramp"}), {"render", "scale"});
      if (!scene.ground) node.fail("the scene has no <ground> to touch");
      GroundContactDescription d;
      d.source = node.source();
      const int body = find_body(scene, node, "body");
      d.body = node.text("body");
      const Shape& shape = scene.links[std::size_t(body)].body.shape;
      if (!has_contact_points(shape) && !is_ball(shape))
        node.fail("body '" + d.body + "' is " + with_article(shape_name(shape)) + " body" +
                  ", which has no contact points");
      read_law(node, kLinear, d);
      scene.ground_contacts.push_back(std::move(d));
    } else {
      node.check_attributes(with_coefficients({"general_body", "primitive_body", "law", "ramp"}),
                            {"render", "scale"});
      PairContactDescription d;
      d.source = node.source();
      const int general = find_body(scene, node, "general_body");
      const int primitive = find_body(scene, node, "primitive_body");
      d.general_body = node.text("general_body");
      d.primitive_body = node.text("primitive_body");
      if (general == primitive)
        node.fail("body '" + d.general_body + "' against itself; expected two bodies");
      const Shape& points = scene.links[std::size_t(general)].body.shape;
      if (!has_contact_points(points) && !is_ball(points))
        node.fail(fmt::format(
            "general_body '{}' is {} body, which has no contact points; {}", d.general_body,
            with_article(shape_name(points)),
            has_distance(points) ? "swap the two bodies" : "give it a <collision contacts>"));
      const Shape& touched = scene.links[std::size_t(primitive)].body.shape;
      if (!has_distance(touched) && std::holds_alternative<MeshShape>(touched))
        node.fail(
            fmt::format("primitive_body '{}' is a mesh with resolution=\"0\", which has no "
                        "distance function; expected a resolution of 1 or more",
                        d.primitive_body));
      if (!has_distance(touched))
        node.fail(fmt::format(
            "primitive_body '{}' is {} body, which has no distance function; expected {}",
            d.primitive_body, with_article(shape_name(touched)),
            shapes_with([](const ShapeRow& row) { return row.distance.has_value(); })));
      if (!can_touch(points, touched))
        node.fail(fmt::format(
            "general_body '{}' is a sphere, and primitive_body '{}' a mesh, whose distance is "
            "known only near its surface; expected the mesh as general_body, with contact points "
            "nearer to each other than the sphere is wide ('pitch' or 'count')",
            d.general_body, d.primitive_body));
      read_law(node, kClamped, d);
      scene.pair_contacts.push_back(std::move(d));
    }
  }
}

}  // namespace tangere
