// SPDX-License-Identifier: Apache-2.0
// A mesh body is a closed surface, or the convex hull of a file's points. Its contact points are
// spread over the surface.
#include "io/scene/surface_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <utility>

#include "engine/base/error.hpp"
#include "io/files/word_reader.hpp"
#include "io/scene/closed_surface.hpp"
#include "io/scene/collada_file.hpp"
#include "io/scene/convex_hull.hpp"
#include "io/scene/inner_walls.hpp"
#include "io/scene/obj_file.hpp"

namespace tangere {
namespace {

/// Reads a file of the format of its extension: .stl, .ply, .dae, else OBJ.
RawMesh read_triangles(const std::string& path) {
  std::string end = std::filesystem::path(path).extension().string();
  for (char& c : end) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (end == ".stl") return read_stl(path);
  if (end == ".ply") return read_ply(path);
  if (end == ".dae") return read_collada(path);
  return read_obj(path);
}

/// Sums six times the volume over tetrahedra on the first vertex.
double six_volumes(const MeshShape& mesh) {
  double sum = 0;
  for (const std::array<int, 3>& t : mesh.triangles) {
    double e[3][3];
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t c = 0; c < 3; ++c)
        e[k][c] = mesh.vertices[3 * std::size_t(t[k]) + c] - mesh.vertices[c];
    sum += e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) +
           e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
           e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
  }
  return sum;
}

}  // namespace

std::string surface_fault(const MeshShape& mesh) {
  if (mesh.triangles.empty()) return "no faces; expected a closed surface";
  if (std::string fault = open_edge(mesh); !fault.empty()) return fault;
  const double volume = six_volumes(mesh) / 6;
  if (volume < 0)
    return "the faces point inwards; expected anticlockwise corners seen from outside";
  return volume > 0 ? "" : "the surface encloses no volume";
}

FileSurface surface_of(const RawMesh& raw, const std::string& name) {
  FileSurface out{weld(raw), {}, {}, raw.fault};
  for (const Vector3& p : raw.positions) out.points.insert(out.points.end(), p.begin(), p.end());
  if (out.fault.empty())
    if (const std::string fault = surface_fault(out.faces); !fault.empty())
      out.fault = name + ": " + fault;
  if (!out.fault.empty()) return out;
  out.closed = out.faces;
  std::string fault = remove_walls(out.closed);
  if (fault.empty() && !surface_fault(out.closed).empty())
    fault = "the surface encloses no volume but for walls without thickness";
  if (!fault.empty()) out.fault = name + ": " + fault;
  return out;
}

FileSurface read_faces(const std::string& path) {
  const RawMesh raw = read_triangles(path);
  if (raw.positions.empty()) throw InputError(path + ": no faces or vertices; expected a surface");
  return surface_of(raw, path);
}

MeshShape read_surface(const std::string& path) {
  FileSurface file = read_faces(path);
  if (!file.fault.empty()) throw InputError(file.fault);
  return std::move(file.closed);
}

MeshShape read_hull(const std::string& path) {
  MeshShape hull = convex_hull(read_faces(path).points);
  if (hull.triangles.empty())
    throw InputError(path + ": all points lie in a plane; expected a hull with a volume");
  return hull;
}

void scale_surface(MeshShape& mesh, const Vector3& scale) {
  for (std::size_t k = 0; k < mesh.vertices.size(); ++k) mesh.vertices[k] *= scale[k % 3];
  if (scale[0] * scale[1] * scale[2] < 0)
    for (std::array<int, 3>& t : mesh.triangles) std::swap(t[1], t[2]);
}

std::vector<double> spread_points(const std::vector<double>& points, int count) {
  std::vector<double> chosen, square(points.size() / 3, HUGE_VAL);  // of the way to a chosen one
  std::size_t next = 0;
  for (int i = 0; i < count; ++i) {
    const double* const at = &points[3 * next];
    chosen.insert(chosen.end(), at, at + 3);
    for (std::size_t k = 0; k < square.size(); ++k) {
      const double* const p = &points[3 * k];
      const double x = p[0] - at[0], y = p[1] - at[1], z = p[2] - at[2];
      square[k] = std::min(square[k], x * x + y * y + z * z);
    }
    next =
        static_cast<std::size_t>(std::max_element(square.begin(), square.end()) - square.begin());
  }
  return chosen;
}

namespace {

/// Returns a corner of a triangle and two edges from there.
std::array<Vector3, 3> corner_and_edges(const MeshShape& mesh, const std::array<int, 3>& t) {
  std::array<Vector3, 3> out{};
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t c = 0; c < 3; ++c)
      out[k][c] = mesh.vertices[3 * std::size_t(t[k]) + c] - (k == 0 ? 0 : out[0][c]);
  return out;
}
double triangle_area(const MeshShape& mesh, const std::array<int, 3>& t) {
  const auto [at, a, b] = corner_and_edges(mesh, t);
  return 0.5 * std::hypot(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                          a[0] * b[1] - a[1] * b[0]);
}

}  // namespace

double area_of(const MeshShape& mesh) {
  double sum = 0;
  for (const std::array<int, 3>& t : mesh.triangles) sum += triangle_area(mesh, t);
  return sum;
}

/// Many more points are laid out by area, in a sequence that fills a triangle evenly. Of these,
/// those are taken that are farthest from one another.
std::vector<double> points_by_area(const MeshShape& mesh, int count) {
  constexpr int kMore = 16;
  constexpr double kFirst = 0.7548776662466927, kSecond = 0.5698402909980532;
  const int all = kMore * count;
  const double step = area_of(mesh) / all;
  std::vector<double> points;
  double before = 0;  // area of the triangles so far
  int n = 0;
  for (const std::array<int, 3>& t : mesh.triangles) {
    before += triangle_area(mesh, t);
    const auto [at, a, b] = corner_and_edges(mesh, t);
    for (; n < all && (n + 0.5) * step < before; ++n) {
      double whole = 0, u = std::modf(0.5 + n * kFirst, &whole),
             v = std::modf(0.5 + n * kSecond, &whole);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      for (std::size_t c = 0; c < 3; ++c) points.push_back(at[c] + u * a[c] + v * b[c]);
    }
  }
  return spread_points(points, std::min(count, static_cast<int>(points.size() / 3)));
}

std::vector<double> read_contact_points(const std::string& path) {
  WordReader file(path);
  if (!file.next())
    throw InputError(path + ": empty; expected a count, then a line x y z per point");
  if (file.words.size() != 1)
    file.fail(fmt::format("{} words; expected the number of points alone", file.words.size()));
  const long count = file.integer(file.words[0], "the number of points");
  if (count < 1) file.fail(fmt::format("{} points; expected one or more", count));
  std::vector<double> points;
  while (file.next()) {
    if (file.words.size() != 3)
      file.fail(fmt::format("{} numbers; expected x y z", file.words.size()));
    for (std::size_t k = 0; k < 3; ++k) points.push_back(file.position(k));
  }
  if (points.size() / 3 != std::size_t(count))
    throw InputError(
        fmt::format("{}: {} points follow the count of {}; expected as many as it says", path,
                    points.size() / 3, count));
  return points;
}

}  // namespace tangere
