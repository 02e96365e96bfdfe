// SPDX-License-Identifier: Apache-2.0
// A layout's sensors are written out, so that the scene stands on its own and each number can be
// changed. The frame of a layout has z out of the skin, x to the right and y up, seen from outside.
#include "io/robot/robot_pads.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "io/robot/rotations.hpp"
#include "io/robot/scene_writer.hpp"
#include "io/scene/layout_file.hpp"
#include "io/scene/scene_node.hpp"

namespace tangere {
namespace {

struct Face {
  const char* name;
  Vector3 x, y;  ///< of the skin, in the box's axes
};
constexpr Face kFaces[] = {{"+x", {0, 1, 0}, {0, 0, 1}},  {"-x", {0, -1, 0}, {0, 0, 1}},
                           {"+y", {-1, 0, 0}, {0, 0, 1}}, {"-y", {1, 0, 0}, {0, 0, 1}},
                           {"+z", {1, 0, 0}, {0, 1, 0}},  {"-z", {-1, 0, 0}, {0, 1, 0}}};

/// The frame in the body's own frame in which the layout lies.
Pose place_of(const PadRequest& pad, const RobotPlace& place, const std::string& what) {
  const LinkDescription& link = *place.link;
  if (pad.face.empty()) return compose(inverse(link.body.pose), compose(place.pose, pad.pose));
  if (place.site != nullptr)
    throw InputError(
        fmt::format("{}: '{}' is a site and has no face {}; expected @x,y,z or "
                    "@x,y,z,roll,pitch,yaw in the site's frame",
                    what, pad.link, pad.face));
  const auto* const box = std::get_if<CuboidShape>(&link.body.shape);
  if (box == nullptr)
    throw InputError(
        fmt::format("{}: the first shape of '{}' is no box, so it has no face {}; "
                    "expected @x,y,z or @x,y,z,roll,pitch,yaw in the link's frame",
                    what, pad.link, pad.face));
  const auto face = std::find_if(std::begin(kFaces), std::end(kFaces),
                                 [&](const Face& f) { return pad.face == f.name; });
  if (face == std::end(kFaces))
    throw InputError(fmt::format("{}: face {}; expected +x, -x, +y, -y, +z or -z", what, pad.face));
  const Vector3 normal = cross(face->x, face->y);
  Pose pose{{0, 0, 0}, from_axes(face->x, face->y)};
  for (std::size_t k = 0; k < 3; ++k) pose.position[k] = 0.5 * box->size[k] * normal[k];
  return pose;
}

/// Attributes of a layout that name a file lie beside the layout, not beside the scene.
void refuse_files(const SceneNode& sensor) {
  for (const char* name : {"spec", "filename"})
    if (sensor.has(name))
      sensor.fail(
          fmt::format("{}: a layout that names a file; write it into the scene with "
                      "<include file=\"…\"/>",
                      name));
}

/// Returns the attribute `ignores` of a skin on `link`: bodies without contact in the file, and
/// those of links that the file excludes from contact with this one.
std::string ignores_text(const Robot& robot, const LinkDescription& link) {
  std::vector<std::string> names = robot.untouched;
  const auto add_link = [&](const std::string& name) {
    for (const LinkDescription& other : robot.scene.links) {
      const bool piece = robot.pieces.contains(other.name) && other.parent >= 0 &&
                         robot.scene.links[std::size_t(other.parent)].name == name;
      if ((other.name == name || piece) && has_distance(other.body.shape) &&
          std::ranges::find(names, other.body.name) == names.end())
        names.push_back(other.body.name);
    }
  };
  for (const auto& [one, two] : robot.excluded) {
    if (one == link.name) add_link(two);
    if (two == link.name) add_link(one);
  }
  std::erase_if(names, [&](const std::string& name) { return name == link.body.name; });
  return names.empty() ? ""
                       : fmt::format(" ignores=\"{}\"",
                                     attribute_text(fmt::to_string(fmt::join(names, ","))));
}

/// A name that no other sensor has. Files use '/' as a separator.
std::string sensor_name(std::set<std::string>& names, std::string requested) {
  std::replace(requested.begin(), requested.end(), '/', '_');
  std::string name = requested;
  for (int k = 2; !names.insert(name).second; ++k) name = fmt::format("{}_{}", requested, k);
  return name;
}

/// The skins that the robot's file has.
std::string own_skins_text(const Robot& robot, std::set<std::string>& names,
                           const std::string& file) {
  std::string text;
  for (const RobotSkin& skin : robot.skins) {
    const LinkDescription& link = *find_place(robot, skin.link, "<sensor>", file).link;
    text += fmt::format("    <!-- {}: <sensor>; its stiffness is a guess -->\n",
                        comment_text(place_in(robot, skin.source)));
    text +=
        fmt::format("    <tactile name=\"{}\" body=\"{}\"{}{}{}/>\n",
                    attribute_text(sensor_name(names, skin.name)), attribute_text(link.body.name),
                    pose_text(compose(inverse(link.body.pose), skin.pose)), skin.layout,
                    ignores_text(robot, link));
  }
  return text;
}

}  // namespace

std::string pads_text(const Robot& robot, const std::vector<PadRequest>& pads,
                      const std::string& file) {
  std::set<std::string> names;
  std::string text = own_skins_text(robot, names, file);
  for (const PadRequest& pad : pads) {
    const std::string what = fmt::format("--pad {}={}", pad.link, pad.layout_name);
    const RobotPlace found = find_place(robot, pad.link, what, file);
    const LinkDescription& link = *found.link;
    const Pose place = place_of(pad, found, what);
    tinyxml2::XMLDocument document;
    SceneContext context;
    context.file = pad.layout_name;
    const tinyxml2::XMLElement& root = parse_layout(document, pad.layout, context);
    text += fmt::format("    <!-- {} on {} '{}' -->\n", comment_text(pad.layout_name),
                        found.site == nullptr ? "link" : "site", comment_text(pad.link));
    for (const SceneNode& sensor : SceneNode(root, context).children({"tactile"})) {
      refuse_files(sensor);
      const std::string name = sensor_name(names, pad.link + "_" + sensor.text("name", "skin"));
      const Pose own{sensor.vector("pos", Vector3{0, 0, 0}), sensor.quaternion("quat")};
      text += fmt::format("    <tactile name=\"{}\" body=\"{}\"{}", attribute_text(name),
                          attribute_text(link.body.name), pose_text(compose(place, own)));
      for (const auto* a = sensor.element().FirstAttribute(); a != nullptr; a = a->Next()) {
        const std::string_view known = a->Name();
        if (known != "name" && known != "body" && known != "pos" && known != "quat")
          text += fmt::format(" {}=\"{}\"", known, attribute_text(a->Value()));
      }
      if (!sensor.has("feels") && !sensor.has("ignores")) text += ignores_text(robot, link);
      const std::string inside = parts_text(sensor.element());
      text += inside.empty() ? "/>\n" : ">\n" + inside + "    </tactile>\n";
    }
  }
  return text;
}

}  // namespace tangere
