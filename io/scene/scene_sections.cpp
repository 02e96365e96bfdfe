// SPDX-License-Identifier: Apache-2.0
// Reads actuators and contacts of a scene file.
#include "io/scene/scene_sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/model/shapes.hpp"

namespace tangere {

namespace {

const std::vector<std::string> kLaws = {"clamped", "paper", "linear"};
constexpr ContactLaw kLawOf[] = {ContactLaw::clamped, ContactLaw::paper, ContactLaw::linear};

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

double read_ramp(const SceneNode& node) {
  return node.has("ramp") ? node.not_negative("ramp") * node.context().length : 1e-5;
}

}  // namespace

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

void read_contacts(Scene& scene, const SceneNode& section) {
  section.check_attributes({});
  for (const SceneNode& node : section.children({"ground_contact", "general_primitive_contact"})) {
    if (node.name() == "ground_contact") {
      node.check_attributes({"body", "kn", "kt", "mu", "damping", "law", "ramp"},
                            {"render", "scale"});
      if (!scene.ground) node.fail("the scene has no <ground> to touch");
      GroundContactDescription d;
      d.source = node.source();
      const int body = find_body(scene, node, "body");
      d.body = node.text("body");
      const Shape& shape = scene.links[std::size_t(body)].body.shape;
      if (!has_contact_points(shape) && !is_ball(shape))
        node.fail("body '" + d.body + "' is " + with_article(shape_name(shape)) + " body" +
                  ", which has no contact points");
      d.law = kLawOf[node.choice("law", kLaws, 2)];
      d.ramp = read_ramp(node);
      d.coefficients = read_coefficients(node, d.law);
      scene.ground_contacts.push_back(std::move(d));
    } else {
      node.check_attributes(
          {"general_body", "primitive_body", "kn", "kt", "mu", "damping", "law", "ramp"},
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
      if (!has_contact_points(points))
        node.fail(fmt::format(
            "general_body '{}' is {} body, which has no contact points; {}", d.general_body,
            with_article(shape_name(points)),
            has_distance(points) ? "swap the two bodies" : "give it a <collision contacts>"));
      const Shape& touched = scene.links[std::size_t(primitive)].body.shape;
      if (!has_distance(touched))
        node.fail(fmt::format(
            "primitive_body '{}' is {} body, which has no distance function; expected {}",
            d.primitive_body, with_article(shape_name(touched)),
            shapes_with([](const ShapeRow& row) { return row.distance.has_value(); })));
      d.law = kLawOf[node.choice("law", kLaws, 0)];
      d.ramp = read_ramp(node);
      d.coefficients = read_coefficients(node, d.law);
      scene.pair_contacts.push_back(std::move(d));
    }
  }
}

}  // namespace tangere
