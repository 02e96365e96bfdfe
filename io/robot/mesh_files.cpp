// SPDX-License-Identifier: Apache-2.0
// package:// names a folder of the ROS package index. Here it is searched above the robot's file,
// where it nearly always is.
#include "io/robot/mesh_files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "io/scene/convex_hull.hpp"
#include "io/scene/surface_files.hpp"

namespace tangere {

namespace fs = std::filesystem;

namespace {

std::string find_mesh(const RobotNode& node, const std::string& name, const std::string& folder,
                      const std::optional<std::string>& other_folder) {
  const fs::path robot = fs::path(node.context().outermost().file).parent_path();
  std::vector<std::string> tried;
  constexpr std::string_view kPackage = "package://", kFile = "file://";
  std::string plain = name;
  if (name.starts_with(kPackage)) {
    plain = name.substr(std::min(name.find_first_not_of('/', kPackage.size()), name.size()));
    const fs::path inside(plain);
    fs::path below;  // without the name of the package
    for (auto part = inside.begin(); part != inside.end(); ++part)
      if (part != inside.begin()) below /= *part;
    std::error_code ignored;
    fs::path up = fs::absolute(robot, ignored).lexically_normal();
    for (int level = 0; level < 10 && !plain.empty(); ++level, up = up.parent_path()) {
      tried.push_back((up / inside).string());
      if (up.filename() == *inside.begin()) tried.push_back((up / below).string());
      if (up == up.root_path()) break;
    }
  } else {
    if (name.starts_with(kFile)) plain = name.substr(kFile.size());
    tried.push_back((robot / folder / plain).lexically_normal().string());
  }
  if (other_folder)
    for (const fs::path& end : {fs::path(plain), fs::path(plain).filename()})
      tried.push_back((robot / *other_folder / end).lexically_normal().string());
  const auto found = std::find_if(tried.begin(), tried.end(), [](const std::string& path) {
    std::error_code none;
    return fs::is_regular_file(path, none);
  });
  if (found == tried.end())
    node.fail(
        fmt::format("the file \"{}\" is not there; looked for {}", name, fmt::join(tried, ", ")));
  return *found;
}

bool is_surface_file(const std::string& path) {
  std::string ending = fs::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending == ".obj" || ending == ".stl" || ending == ".ply" || ending == ".dae";
}

/// Makes the mesh of a surface. `name`: of the file, for the list of what is left out.
std::optional<RobotMesh> robot_mesh(const RobotNode& node, const std::string& name, MeshFile from,
                                    const FileSurface& surface) {
  RobotMesh mesh{std::move(from), surface.closed, surface.faces};
  if (!surface.fault.empty()) {
    mesh.file.hull = true;
    mesh.shape = convex_hull(surface.points);
    if (mesh.shape.triangles.empty()) {
      node.lost(fmt::format("<{}>: the flat surface of \"{}\"", node.name(), name));
      return std::nullopt;
    }
    if (mesh.faces.triangles.empty())
      mesh.faces = mesh.shape;  // points alone
    else
      node.changed(fmt::format("<{}>: its convex hull takes its place, because {}", node.name(),
                               surface.fault));
  }
  scale_surface(mesh.shape, mesh.file.scale);
  scale_surface(mesh.faces, mesh.file.scale);
  return mesh;
}

void check_scale(const RobotNode& node, const Vector3& scale) {
  for (const double s : scale)
    if (s == 0) node.fail("scale has 0; expected factors other than 0");
}

}  // namespace

std::optional<RobotMesh> read_robot_mesh(const RobotNode& node, const std::string& name,
                                         const std::string& folder, const Vector3& scale,
                                         const std::optional<std::string>& other_folder) {
  check_scale(node, scale);
  const MeshFile file{find_mesh(node, name, folder, other_folder), scale};
  if (!is_surface_file(file.path)) {
    node.lost(
        fmt::format("<{}>: the shape of \"{}\", which is no OBJ, STL, PLY or DAE file; convert it "
                    "to one of these",
                    node.name(), name));
    return std::nullopt;
  }
  const std::string place = node.source().prefix() + "<" + node.name() + ">: ";
  try {
    return robot_mesh(node, name, file, read_faces(file.path));
  } catch (const IoError& e) {
    throw IoError(place + e.what());
  } catch (const InputError& e) {
    throw InputError(place + e.what());
  }
}

std::optional<RobotMesh> read_written_mesh(const RobotNode& node, const Vector3& scale) {
  check_scale(node, scale);
  MeshFile file{"", scale};
  RawMesh raw;
  file.vertices = node.numbers("vertex");
  if (file.vertices.size() % 3 != 0)
    node.fail(fmt::format("vertex has {} numbers; expected x y z for each", file.vertices.size()));
  for (std::size_t k = 0; k < file.vertices.size(); k += 3)
    raw.positions.push_back({file.vertices[k], file.vertices[k + 1], file.vertices[k + 2]});
  const std::vector<double> corners =
      node.has("face") ? node.numbers("face") : std::vector<double>{};
  if (corners.size() % 3 != 0)
    node.fail(fmt::format("face has {} numbers; expected three for each", corners.size()));
  const auto all = static_cast<double>(raw.positions.size());
  for (std::size_t k = 0; k < corners.size(); ++k) {
    if (!(corners[k] >= 0 && corners[k] < all && corners[k] == std::floor(corners[k])))
      node.fail(
          fmt::format("face has the vertex {}; expected one of 0 to {}", corners[k], all - 1));
    file.triangles.push_back(static_cast<int>(corners[k]));
    if (k % 3 == 0) raw.triangles.emplace_back();
    raw.triangles.back()[k % 3] = file.triangles.back();
  }
  return robot_mesh(node, node.text("name", ""), file, surface_of(raw, "vertex"));
}

}  // namespace tangere
