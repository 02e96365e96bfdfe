// SPDX-License-Identifier: Apache-2.0
// The centre of mass is that of pyramids on the middle of the faces, weighted by area. Volume and
// inertia are sums of pyramids on that centre:
//   middle  m = Σ A c / Σ A                     c, A: centre and area of a face
//   centre  p = Σ V(m) (3 c + m) / 4 / Σ V(m)   V(x): volume of the pyramid between x and a face
//   volume  Σ V(p)
//   second moments  Σ V(p) (s sᵀ + Σ r rᵀ) / 20   r: corners of a face seen from p, s = Σ r
#include "io/robot/mesh_solid.hpp"

#include <cmath>

namespace tangere {
namespace {

Vector3 minus(const Vector3& a, const Vector3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

struct FaceCorners {
  std::array<Vector3, 3> at;  ///< seen from some point

  FaceCorners(const MeshShape& mesh, const std::array<int, 3>& triangle, const Vector3& from) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double* const p = &mesh.vertices[3 * std::size_t(triangle[k])];
      at[k] = minus({p[0], p[1], p[2]}, from);
    }
  }
  [[nodiscard]] Vector3 sum() const {
    Vector3 out{};
    for (const Vector3& p : at)
      for (std::size_t c = 0; c < 3; ++c) out[c] += p[c];
    return out;
  }
  [[nodiscard]] double area() const {
    const Vector3 twice = cross(minus(at[1], at[0]), minus(at[2], at[0]));
    return 0.5 * std::sqrt(dot(twice, twice));
  }
  /// Of the pyramid between the point and the face.
  [[nodiscard]] double volume() const { return std::abs(dot(at[0], cross(at[1], at[2]))) / 6; }
};

}  // namespace

MeshSolid solid_of(const MeshShape& faces) {
  MeshSolid out;
  Vector3 middle{}, moment{};
  double area = 0;
  for (const std::array<int, 3>& t : faces.triangles) {
    const FaceCorners face(faces, t, {0, 0, 0});
    const Vector3 sum = face.sum();
    for (std::size_t c = 0; c < 3; ++c) middle[c] += face.area() * sum[c] / 3;
    area += face.area();
  }
  if (!(area > 0)) return out;
  for (double& x : middle) x /= area;
  double volume = 0;
  for (const std::array<int, 3>& t : faces.triangles) {
    const FaceCorners face(faces, t, middle);
    const Vector3 sum = face.sum();
    volume += face.volume();
    for (std::size_t c = 0; c < 3; ++c) moment[c] += face.volume() * sum[c] / 4;
  }
  if (!(volume > 0)) return out;
  for (std::size_t c = 0; c < 3; ++c) out.centre[c] = middle[c] + moment[c] / volume;
  double second[3][3] = {};
  for (const std::array<int, 3>& t : faces.triangles) {
    const FaceCorners face(faces, t, out.centre);
    const Vector3 sum = face.sum();
    out.volume += face.volume();
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        double squares = sum[i] * sum[j];
        for (const Vector3& p : face.at) squares += p[i] * p[j];
        second[i][j] += face.volume() * squares / 20;
      }
  }
  const double trace = second[0][0] + second[1][1] + second[2][2];
  out.inertia = {trace - second[0][0], -second[0][1], -second[0][2],
                 trace - second[1][1], -second[1][2], trace - second[2][2]};
  return out;
}

}  // namespace tangere
