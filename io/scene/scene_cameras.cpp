// SPDX-License-Identifier: Apache-2.0
// Reads cameras of a scene file.
#include "io/scene/scene_cameras.hpp"

#include <algorithm>

#include "engine/scene/camera.hpp"
#include "engine/scene/field_form.hpp"
#include "io/scene/convex_hull.hpp"
#include "io/scene/scene_sections.hpp"

namespace tangere {

/// Whether a sensor's name is that of a camera or of one of its outputs, such as "eye.rgb".
static bool hides(const std::string& sensor, const std::string& camera) {
  return sensor == camera || std::ranges::any_of(view_forms(), [&](FieldForm form) {
           return sensor == output_name(camera, form);
         });
}

void read_camera(Scene& scene, const SceneElement& node) {
  node.check();
  CameraDescription d;
  d.source = node.source();
  d.name = node.text("name");
  if (d.name.empty() || d.name == "." || d.name.find_first_of("/,") != std::string::npos)
    node.fail("name \"" + d.name + "\"; expected a name without '/' and ',', and not '.'");
  if (node.has("body") && !node.text("body").empty()) {
    find_body(scene, node, "body");
    d.body = node.text("body");
  }
  for (const CameraDescription& other : scene.cameras)
    if (other.name == d.name) node.fail("camera name '" + d.name + "' is used twice");
  for (const TactileDescription& sensor : scene.sensors)
    if (hides(sensor.name, d.name))
      node.fail("a tactile sensor is named '" + sensor.name + "'; expected a name of its own");
  node.read(d);
  node.refuse(camera_fault(d));
  scene.cameras.push_back(std::move(d));
}

void check_free_name(const Scene& scene, const SceneNode& node, const std::string& sensor) {
  const auto same = [&](const CameraDescription& camera) { return hides(sensor, camera.name); };
  if (std::ranges::any_of(scene.cameras, same))
    node.fail("a camera is named '" + sensor +
              "' or has an output of this name; expected a name of its own");
}

void show_abstract_bodies(Scene& scene) {
  constexpr std::size_t kFewest = 4;  // points of a hull
  if (scene.cameras.empty()) return;
  for (LinkDescription& link : scene.links)
    if (const auto* const abstract = std::get_if<AbstractShape>(&link.body.shape);
        abstract != nullptr && abstract->contact_points.size() >= 3 * kFewest)
      link.body.surface = std::make_shared<const MeshShape>(convex_hull(abstract->contact_points));
}

}  // namespace tangere
