// SPDX-License-Identifier: Apache-2.0
// The texts that `inspect` prints.
#include "engine/model/compile_effects.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "engine/model/compiled_layer.hpp"
#include "engine/scene/shapes.hpp"
#include "kernels/contact/distance.hpp"

namespace tangere {

namespace {

using kernels::JointKind;
using kernels::Link;

/// Returns how the points of a shape are summed (kernels/step/point_sums.hpp).
const char* sums_of(PrimitiveShape shape) {
  using kernels::Bending;
  using kernels::PointSumForm;
  return kernels::with_distance<double>(
      shape, kernels::Vec3<double>{1, 1, 1}, []<class S>(const S&) {
        if (S::kSums == PointSumForm::about_centre) return "products about the centre";
        if (S::kSums == PointSumForm::points) return "point by point";
        return S::kBending == Bending::flat ? "products, flat faces" : "products, one bent face";
      });
}

std::string counted(std::size_t n, const std::string& one, const std::string& many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

/// Whether some contact has shear springs. CompiledModel::shear_springs are filled later.
bool has_shear_springs(const CompiledModel& m) {
  const auto any = [](const auto& all) {
    return std::any_of(all.begin(), all.end(),
                       [](const auto& x) { return kernels::has_shear_spring(x.parameters); });
  };
  return any(m.pairs) || any(m.grounds) || any(m.sensors);
}

/// Returns "cuboid: products, flat faces; …" with each shape once, and once more if only some of
/// its contacts have shear springs, then the number of moving bodies.
std::string pair_variant(const CompiledModel& m, const kernels::LinkPair& links) {
  struct Kind {
    PrimitiveShape shape;
    bool elastic, ball;
    bool operator==(const Kind&) const = default;
  };
  std::vector<Kind> kinds;
  for (int i = links.first; i < links.first + links.count; ++i) {
    const kernels::PairContact& pair = m.pairs[std::size_t(m.pair_order[std::size_t(i)])];
    const Kind kind = {pair.shape, kernels::has_shear_spring(pair.parameters),
                       pair.ball_radius > 0};
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) kinds.push_back(kind);
  }
  std::string text;
  for (const auto& [shape, elastic, ball] : kinds)
    text += std::string(row_of(shape).name) + ": " +
            (ball ? "one point of a sphere's surface" : sums_of(shape)) +
            (elastic ? ", shear springs; " : "; ");
  if (links.link1 < 0 || links.link2 < 0) return text + "one body moves";
  return text + "both bodies move";
}

/// Returns the two bodies of the first contact between these links, and how many more contacts the
/// links have.
std::string pair_name(const CompiledModel& m, const kernels::LinkPair& links) {
  const ContactInfo& first = m.contact_info[std::size_t(m.pair_order[std::size_t(links.first)])];
  std::string text = first.first + " on " + first.second;
  if (links.count > 1)
    text += " and " + std::to_string(links.count - 1) + " more of the same links";
  return text;
}

const char* motion_variant(const std::vector<Link>& links) {
  if (std::all_of(links.begin(), links.end(), [](const Link& l) { return l.never_rotates; }))
    return "nothing turns";
  if (std::any_of(links.begin(), links.end(), [](const Link& l) { return l.never_rotates; }))
    return "some links never turn";
  return "every link may turn";
}

std::string effects_variant(std::uint8_t effects) {
  const std::pair<kernels::JointEffect, const char*> names[] = {
      {kernels::kDamping, "damping"},
      {kernels::kArmature, "armature"},
      {kernels::kSpring, "spring"},
      {kernels::kLimit, "limits"},
      {kernels::kDryFriction, "dry friction"},
      {kernels::kPositionServo, "position motor"}};
  std::string text;
  for (const auto& [bit, name] : names)
    if ((effects & bit) != 0) text += (text.empty() ? "" : ", ") + std::string(name);
  return text;
}

std::string field_variant(const CompiledSensor& s) {
  const std::string law = std::string("law ") + to_string(s.law);
  if (s.layer && s.layer->table) return "pressures by a table; springs of " + law;
  if (s.layer)
    return std::to_string(s.layer->grid.rows) + " × " + std::to_string(s.layer->grid.cols) +
           " coupled cells of a layer; springs of law " + to_string(s.law);
  if (!s.index.empty()) return "tiles of curved points, lanes are points; " + law;
  return (s.points() <= kSmallPad ? "flat pad, lanes are environments; "
                                  : "flat tiles, lanes are points; ") +
         law;
}

/// Returns the variant of the kernel that computes an effect; "" where it has none of its own.
std::string effect_variant(const CompiledModel& m, const Effect& effect) {
  if (effect.kind == EffectKind::velocity_products) return motion_variant(m.links);
  if (effect.element < 0) return "";
  if (effect.kind == EffectKind::pair_contact) {
    for (const kernels::LinkPair& links : m.link_pairs)
      for (int i = links.first; i < links.first + links.count; ++i)
        if (m.pair_order[std::size_t(i)] == effect.element) {
          kernels::LinkPair alone = links;
          alone.first = i, alone.count = 1;
          return pair_variant(m, alone);
        }
  }
  if (effect.kind == EffectKind::ground_contact)
    return m.grounds[std::size_t(effect.element)].radius > 0 ? "sphere" : "points";
  if (effect.kind == EffectKind::tactile)
    return field_variant(m.sensors[std::size_t(effect.element)]);
  return "";
}

}  // namespace

void decide_effects(CompiledModel& m) {
  m.effects = effects_of(m.scene);
  for (EffectInfo& info : m.effects)
    if (info.on) info.variant = effect_variant(m, info.effect);
}

void list_stages(CompiledModel& m) {
  const auto add = [&](const char* name, std::string of, std::string variant) {
    m.stages.push_back({name, std::move(of), std::move(variant)});
  };
  for (const MeshInfo& mesh : m.mesh_info) {
    char text[160];
    std::snprintf(text, sizeof text, "%d x %d x %d cells of %.3g m, %.2f MB, error %.2g m",
                  mesh.cells[0], mesh.cells[1], mesh.cells[2], mesh.cell, 1e-6 * double(mesh.bytes),
                  mesh.error);
    add("mesh distance", mesh.body, text);
  }
  add("kinematics", counted(m.links.size(), "link", "links"), motion_variant(m.links));
  if (!m.pairs.empty())
    add("search", counted(m.pairs.size(), "pair of shapes", "pairs of shapes"),
        "one sphere, tiles of 32, points");
  for (const kernels::LinkPair& links : m.link_pairs)
    add("pair contact", pair_name(m, links), pair_variant(m, links));
  for (const kernels::GroundedLink& grounded : m.grounded) {
    const int first = m.ground_order[std::size_t(grounded.first)];
    add("ground contact", m.contact_info[m.pairs.size() + std::size_t(first)].first,
        counted(std::size_t(grounded.count), "body", "bodies") +
            (m.grounds[std::size_t(first)].radius > 0 ? ", sphere" : ", points"));
  }
  if (!m.loops.empty())
    add("loops", counted(m.loops.size(), "loop", "loops"), "springs, one block each");
  if (!m.transmissions.empty())
    add("transmissions", counted(m.transmissions.size(), "transmission", "transmissions"),
        counted(m.transmission_pieces.size(), "piece", "pieces") + ", " +
            counted(m.transmission_dofs.size(), "dof", "dofs"));
  for (std::size_t j = 0; j < m.joints.size(); ++j) {
    std::uint8_t effects = 0;
    for (int i = 0; i < m.joints[j].link_count; ++i)
      effects = static_cast<std::uint8_t>(effects |
                                          m.links[std::size_t(m.joints[j].first_link + i)].effects);
    if (effects != 0) add("joint effects", m.scene.links[j].joint.name, effects_variant(effects));
  }
  add("Jacobian", counted(std::size_t(m.pattern.entries), "entry", "entries"),
      "composite inertia, one block per contact and loop");
  add("factor and solve", counted(std::size_t(m.pattern.factor_entries), "entry", "entries"),
      m.pattern.slot.empty() ? "and blocks of trees that touch"
      : m.pattern.factor_entries == m.pattern.entries
          ? "no fill"
          : std::to_string(m.pattern.factor_entries - m.pattern.entries) + " filled in");
  if (has_shear_springs(m))
    add("memory of friction", "points that touch", "looked up before a solve, kept after a step");
  for (std::size_t i = 0; i < m.sensors.size(); ++i)
    add("field", m.sensor_info[i].name, field_variant(m.sensors[i]));
}

}  // namespace tangere
