// SPDX-License-Identifier: Apache-2.0
// A camera's axes are the columns of its frame.
#include "engine/model/compile_cameras.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

#include "engine/base/hash.hpp"
#include "engine/scene/frames.hpp"
#include "engine/scene/schema.hpp"

namespace tangere {
namespace {

[[noreturn]] void refuse_camera(const CameraDescription& d, const std::string& what) {
  throw InputError(d.source.prefix() + "camera '" + d.name + "': " + what);
}

constexpr std::size_t kMostBodies = 32766;  // the ground has the number after them

int body_of(const Scene& scene, const CameraDescription& d) {
  if (d.body.empty()) return -1;
  const auto at = std::ranges::find_if(
      scene.links, [&](const LinkDescription& link) { return link.body.name == d.body; });
  if (at == scene.links.end()) refuse_camera(d, "no body is named '" + d.body + "'");
  return static_cast<int>(at - scene.links.begin());
}

void check_camera_name(const Scene& scene, const CameraDescription& d) {
  const auto same = [&](const auto& other) { return other.name == d.name; };
  if (std::ranges::count_if(scene.cameras, same) > 1)
    refuse_camera(d, "another camera has this name; expected a name of its own");
  if (std::ranges::count_if(scene.sensors, same) > 0)
    refuse_camera(d, "a tactile sensor has this name; expected a name of its own");
}

}  // namespace

kernels::Frame<double> camera_frame(const CameraDescription& d) {
  kernels::Frame<double> frame;
  const CameraAxes axes = axes_of(d);
  const std::array<const Vector3*, 3> columns{&axes.right, &axes.down, &axes.forward};
  for (int row = 0; row < 3; ++row)
    for (int col = 0; col < 3; ++col)
      frame.R.m[row][col] = (*columns[std::size_t(col)])[std::size_t(row)];
  frame.p = vec3_of(d.position);
  return frame;
}

std::vector<CompiledCamera> compile_cameras(const Scene& scene) {
  std::vector<CompiledCamera> all;
  for (const CameraDescription& d : scene.cameras) {
    check_camera_name(scene, d);
    if (scene.links.size() > kMostBodies)
      refuse_camera(d, "the scene has " + std::to_string(scene.links.size()) +
                           " bodies; expected at most " + std::to_string(kMostBodies) +
                           ", whose numbers are 16-bit");
    if (const std::string fault = value_fault(kCamera, d); !fault.empty()) refuse_camera(d, fault);
    if (const std::string fault = camera_fault(d); !fault.empty()) refuse_camera(d, fault);
    CompiledCamera camera;
    camera.body = body_of(scene, d);
    camera.frame = camera_frame(d);
    camera.name_bits = hash_bytes(d.name);
    all.push_back(camera);
  }
  return all;
}

}  // namespace tangere
