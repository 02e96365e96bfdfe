// SPDX-License-Identifier: Apache-2.0
// Taxel (i, j) of an array lies at (i, j) * spacing - offset in the sensor's frame, whose z points
// out of the skin, as in the reader of urdf_tactile. The file does not say how stiff the skin is.
#include "io/robot/urdf_skins.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "engine/scene/outer_pose.hpp"
#include "engine/scene/skin_material.hpp"
#include "io/files/nearest_name.hpp"
#include "io/robot/scene_writer.hpp"
#include "io/robot/urdf_parts.hpp"

namespace tangere {
namespace {

constexpr SkinMaterial kGuess{.modulus = 5e5, .thickness = 1.5e-3};  // of a film
constexpr double kPitch = 4e-3;  // of a taxel without a neighbour [m]
constexpr int kMost = 4096;      // rows or columns

const char* const kData = "where the numbers stand in messages of other software";

/// The list of points as attributes. Each stands for `area` [m²].
std::string list_text(const std::vector<Pose>& taxels, double area) {
  const ContactCoefficients c = skin_springs(kGuess);
  std::string points;
  for (const Pose& at : taxels)
    for (const Vector3& x :
         {at.position, outer_direction(at, {0, 0, 1}), outer_direction(at, {1, 0, 0})})
      for (const double number : x) points += (points.empty() ? "" : " ") + number_text(number);
  return fmt::format(
      " type=\"abstract\" points=\"{}\" kn=\"{:.4g}\" kt=\"{:.4g}\" mu=\"1\" damping=\"{:.4g}\" "
      "ks=\"{:.4g}\"",
      points, c.kn * area, c.kt * area, c.damping * area, c.ks * area);
}

std::array<double, 2> pair_of(const RobotNode& node, const char* name,
                              const std::array<double, 2>& usual) {
  if (!node.has(name)) return usual;
  const std::vector<double> x = node.numbers(name, 2);
  return {x[0], x[1]};
}

std::string array_text(const RobotNode& node) {
  node.check({{"rows"}, {"cols"}, {"size"}, {"spacing"}, {"offset"}, {"order", Fate::idle, kData}});
  static_cast<void>(node.parts({}));
  const int rows = node.integer("rows", 1, kMost), cols = node.integer("cols", 1, kMost);
  const std::vector<double> size = node.numbers("size", 2);
  const auto spacing = pair_of(node, "spacing", {size[0], size[1]}),
             offset = pair_of(node, "offset", {0, 0});
  if (spacing[0] == 0 || spacing[1] == 0 || !(size[0] > 0 && size[1] > 0))
    node.fail(
        fmt::format("size=\"{} {}\", spacing=\"{} {}\"; expected lengths above 0, and "
                    "distances other than 0",
                    size[0], size[1], spacing[0], spacing[1]));
  const auto at = [&](int row, int col) {
    return Vector3{row * spacing[0] - offset[0], col * spacing[1] - offset[1], 0};
  };
  if (rows == 1 || cols == 1) {
    std::vector<Pose> taxels;
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < cols; ++j) taxels.push_back({at(i, j), {1, 0, 0, 0}});
    return list_text(taxels, size[0] * size[1]);
  }
  const Vector3 first = at(0, 0), last = at(rows - 1, cols - 1);
  return fmt::format(
      " type=\"rect_array\" resolution=\"{} {}\" rect_pos0=\"{} {} 0\" rect_pos1=\"{} {} 0\" "
      "axis0=\"{} 0 0\" axis1=\"0 {} 0\" modulus=\"{}\" thickness=\"{}\" mu=\"1\"",
      rows, cols, number_text(first[0]), number_text(first[1]), number_text(last[0]),
      number_text(last[1]), spacing[0] > 0 ? 1 : -1, spacing[1] > 0 ? 1 : -1, kGuess.modulus,
      kGuess.thickness);
}

/// The square of the usual distance to the nearest neighbour.
double area_of(const std::vector<Pose>& taxels) {
  std::vector<double> nearest;
  for (const Pose& a : taxels) {
    double square = INFINITY;
    for (const Pose& b : taxels) {
      const Vector3 way = b.position - a.position;
      if (&a != &b && dot(way, way) > 0) square = std::min(square, dot(way, way));
    }
    nearest.push_back(std::isfinite(square) ? square : kPitch * kPitch);
  }
  std::sort(nearest.begin(), nearest.end());
  return nearest[nearest.size() / 2];
}

/// Taxels in the order of their numbers.
std::string taxels_text(const std::vector<RobotNode>& nodes) {
  std::vector<std::pair<int, Pose>> found;
  std::set<int> numbers;
  for (const RobotNode& node : nodes) {
    node.check({{"idx"}, {"xyz"}, {"rpy"}});
    static_cast<void>(node.parts({{"geometry", Fate::idle, "for pictures only"}}));
    const int idx = node.integer("idx", 0, 1 << 24);
    if (!numbers.insert(idx).second)
      node.fail(fmt::format("idx=\"{}\": a taxel before has this number; expected one each", idx));
    found.emplace_back(idx, read_place(node));
  }
  std::ranges::sort(found, {}, &std::pair<int, Pose>::first);
  std::vector<Pose> taxels;
  for (const auto& [idx, pose] : found) taxels.push_back(pose);
  return list_text(taxels, area_of(taxels));
}

}  // namespace

bool is_skin(const RobotNode& sensor) {
  return sensor.element().FirstChildElement("tactile") != nullptr;
}

void read_skin(const RobotNode& sensor, const std::vector<std::string>& links) {
  sensor.check({{"name"},
                {"group", Fate::idle, kData},
                {"update_rate", Fate::idle, "a skin is read as often as a run says"},
                {"type", Fate::idle, kData}});
  const std::vector<RobotNode> parts = sensor.parts({{"parent"}, {"origin"}, {"tactile"}});
  const RobotNode parent = required(sensor, parts, "parent"),
                  tactile = required(sensor, parts, "tactile");
  parent.check({{"link"}});
  RobotSkin skin{sensor.text("name"), parent.text("link"), read_origin(last_of(parts, "origin")),
                 "", sensor.source()};
  if (std::ranges::find(links, skin.link) == links.end())
    parent.fail(fmt::format("no link is named '{}'{}", skin.link, suggestion(skin.link, links)));
  tactile.check({{"channel", Fate::idle, kData}});
  std::vector<RobotNode> taxels;
  const std::vector<RobotNode> inside = tactile.parts({{"array"}, {"taxel"}});
  std::ranges::copy_if(inside, std::back_inserter(taxels),
                       [](const RobotNode& node) { return node.name() == "taxel"; });
  const std::optional<RobotNode> array = last_of(inside, "array");
  if (!array && taxels.empty()) tactile.fail("has no <array> and no <taxel>; expected one of them");
  if (array && !taxels.empty()) array->idle("<array> beside <taxel>s, which count");
  skin.layout = taxels.empty() ? array_text(*array) : taxels_text(taxels);
  sensor.changed("<sensor> of touch: a skin, whose stiffness is a guess; set it for your material");
  sensor.robot().skins.push_back(std::move(skin));
}

}  // namespace tangere
