// SPDX-License-Identifier: Apache-2.0
// The ground has the number after the last body.
#include "engine/rows/camera_layout.hpp"

#include <cmath>

#include "engine/base/as_size.hpp"

namespace tangere {
namespace {

std::vector<double> list_of(const Vector3& v) { return {v.begin(), v.end()}; }

}  // namespace

CameraLayout camera_layout(const Scene& scene, const CameraDescription& camera) {
  constexpr double kHalfDegree = 3.14159265358979323846 / 360;
  CameraLayout layout;
  layout.name = camera.name;
  layout.rows = camera.rows, layout.cols = camera.cols;
  const CameraAxes axes = axes_of(camera);
  layout.facts = {{"body", camera.body},
                  {"position", list_of(camera.position)},
                  {"right", list_of(axes.right)},
                  {"down", list_of(axes.down)},
                  {"forward", list_of(axes.forward)},
                  {"focal_pixels", 0.5 * camera.rows / std::tan(camera.fov * kHalfDegree)},
                  {"far", camera.far},
                  {"noise", camera.noise},
                  {"gain", camera.gain}};
  for (const LinkDescription& link : scene.links) layout.bodies.push_back(link.body.name);
  layout.bodies.emplace_back("ground");
  return layout;
}

std::vector<CameraLayout> camera_layouts(const Scene& scene) {
  std::vector<CameraLayout> layouts;
  for (const CameraDescription& camera : scene.cameras)
    layouts.push_back(camera_layout(scene, camera));
  return layouts;
}

std::vector<std::uint64_t> view_shape(const CameraLayout& camera, FieldForm form) {
  return {as_size(camera.rows), as_size(camera.cols), as_size(components_of(form))};
}

const char* view_text(FieldForm form) {
  if (form == FieldForm::view_rgb) return "R, G, B, row 0 on top";
  if (form == FieldForm::view_depth) return "depth along the camera's axis; far where nothing is";
  return "number of the body in the pixel, see names; -1: nothing";
}

Attributes view_attributes(const CameraLayout& camera, FieldForm form) {
  Attributes list{{"units", std::string(form == FieldForm::view_rgb     ? "grey levels"
                                        : form == FieldForm::view_depth ? "m"
                                                                        : "1")},
                  {"components", std::string(view_text(form))}};
  list.insert(list.end(), camera.facts.begin(), camera.facts.end());
  if (form == FieldForm::view_ids) list.push_back({"names", camera.bodies});
  return list;
}

}  // namespace tangere
