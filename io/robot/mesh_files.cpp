// SPDX-License-Identifier: Apache-2.0
// package:// stands for a folder that ROS would find by its package index. Here it is looked for
// above the robot's file, where it nearly always is.
#include "io/robot/mesh_files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "io/scene/surface_files.hpp"

namespace tangere {

namespace fs = std::filesystem;

std::string find_mesh(const RobotNode& node, const std::string& name, const std::string& folder) {
  const fs::path robot = fs::path(node.robot().scene.path).parent_path();
  std::vector<std::string> tried;
  constexpr std::string_view kPackage = "package://", kFile = "file://";
  std::string plain = name;
  if (name.starts_with(kPackage)) {
    plain = name.substr(kPackage.size());
    const fs::path inside(plain);
    fs::path below;  // without the name of the package
    for (auto part = inside.begin(); part != inside.end(); ++part)
      if (part != inside.begin()) below /= *part;
    std::error_code ignored;
    fs::path up = fs::absolute(robot, ignored).lexically_normal();
    for (int level = 0; level < 10; ++level, up = up.parent_path()) {
      tried.push_back((up / inside).string());
      if (up.filename() == *inside.begin()) tried.push_back((up / below).string());
      if (up == up.root_path()) break;
    }
  } else {
    if (name.starts_with(kFile)) plain = name.substr(kFile.size());
    tried.push_back((robot / folder / plain).lexically_normal().string());
  }
  const auto found = std::find_if(tried.begin(), tried.end(), [](const std::string& path) {
    std::error_code none;
    return fs::is_regular_file(path, none);
  });
  if (found == tried.end())
    node.fail(
        fmt::format("the file \"{}\" is not there; looked for {}", name, fmt::join(tried, ", ")));
  std::string ending = fs::path(*found).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending != ".obj" && ending != ".stl" && ending != ".ply")
    node.fail(fmt::format("\"{}\" is no OBJ, STL or PLY file; convert it to one of these", name));
  return *found;
}

MeshShape read_robot_mesh(const RobotNode& node, const MeshFile& file) {
  for (const double s : file.scale)
    if (!(s > 0)) node.fail(fmt::format("scale has {}; expected positive factors", s));
  try {
    MeshShape mesh = read_surface(file.path);
    for (std::size_t k = 0; k < mesh.vertices.size(); ++k) mesh.vertices[k] *= file.scale[k % 3];
    return mesh;
  } catch (const IoError& e) {
    throw IoError(node.source().prefix() + "<" + node.name() + ">: " + e.what());
  } catch (const InputError& e) {
    throw InputError(node.source().prefix() + "<" + node.name() + ">: " + e.what());
  }
}

}  // namespace tangere
