// SPDX-License-Identifier: Apache-2.0
// A picture has a ray for each pixel, and triangles of meshes that are drawn one by one.
#include "apps/inspect_cameras.hpp"

#include <fmt/format.h>

#include "engine/scene/field_form.hpp"
#include "engine/scene/scene_number.hpp"

namespace tangere::apps {
namespace {

constexpr std::size_t kManyTriangles = 100'000;  // from which on a picture takes a millisecond

std::size_t triangles_in(const Scene& scene) {
  std::size_t triangles = 0;
  for (const LinkDescription& link : scene.links) {
    if (link.body.rgba[3] == 0) continue;
    if (const auto* const mesh = std::get_if<MeshShape>(&link.body.shape))
      triangles += mesh->triangles.size();
    if (link.body.surface) triangles += link.body.surface->triangles.size();
  }
  return triangles;
}

/// "; varies: pos[0] light[1]", or "".
std::string varying_text(const Scene& scene, const CameraDescription& camera) {
  std::string text;
  for (const RandomizationDescription& d : scene.randomizations)
    if (d.number.owner == NumberOwner::camera && d.number.name == camera.name)
      text +=
          (text.empty() ? "; varies:" : "") + name_of(d.number).substr(owner_of(d.number).size());
  return text;
}

/// A line of the bodies with materials, or "".
std::string materials_text(const Scene& scene) {
  std::string text;
  for (const LinkDescription& link : scene.links) {
    const BodyDescription& b = link.body;
    if (b.rgba[3] == 0 || (b.specular == 0 && b.emission == 0)) continue;
    text += fmt::format("{} {} (specular {}, shininess {}, emission {})", text.empty() ? "" : ",",
                        b.name, b.specular, b.shininess, b.emission);
  }
  return text.empty() ? "" : "  materials:" + text + "\n";
}

}  // namespace

PictureCost picture_cost(const Scene& scene, const CameraDescription& camera) {
  const int pixels = camera.rows * camera.cols;
  const auto bytes = [pixels](FieldForm form) {
    const std::size_t own = own_bytes(form);
    return numbers_of(pixels, form) * (own > 0 ? own : sizeof(float));
  };
  return {static_cast<std::size_t>(pixels), triangles_in(scene), bytes(FieldForm::view_rgb),
          bytes(FieldForm::view_depth), bytes(FieldForm::view_ids)};
}

std::string cameras_text(const Scene& scene) {
  if (scene.cameras.empty()) return "";
  std::string text = fmt::format("\ncameras ({})\n", scene.cameras.size());
  for (const CameraDescription& c : scene.cameras) {
    const PictureCost cost = picture_cost(scene, c);
    text += fmt::format(
        "  {} {}: {} x {} pixels, {} degrees; a picture: {} rays, {} triangles; bytes: rgb {}, "
        "depth {}, ids {}{}\n",
        c.name, c.body.empty() ? std::string("in the world") : "on " + c.body, c.rows, c.cols,
        c.fov, cost.rays, cost.triangles, cost.rgb_bytes, cost.depth_bytes, cost.ids_bytes,
        varying_text(scene, c));
  }
  text += materials_text(scene);
  if (const std::size_t triangles = triangles_in(scene); triangles > kManyTriangles)
    text += fmt::format(
        "  warning: {} triangles; more than {} take a millisecond a picture: thin the meshes\n",
        triangles, kManyTriangles);
  return text;
}

}  // namespace tangere::apps
