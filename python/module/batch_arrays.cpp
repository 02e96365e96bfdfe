// SPDX-License-Identifier: Apache-2.0
// Faces are those that pictures of scenes have (io/picture), cut into triangles.
#include "python/module/batch_arrays.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/scene/scene_number.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/sense/transmission_forces.hpp"
#include "io/picture/body_faces.hpp"
#include "io/scene/convex_hull.hpp"

namespace tangere::python {
namespace {

/// The scene with the sizes that an environment has.
Scene sized_scene(const Batch& batch, int environment) {
  Scene scene = batch.model().scene();
  for (std::size_t k = 0; k < scene.randomizations.size(); ++k) {
    const SceneNumber& number = scene.randomizations[k].number;
    if (number.owner == NumberOwner::body && size_index(number) >= 0)
      number_in(scene, number) = batch.randomized_value(environment, static_cast<int>(k));
  }
  return scene;
}

/// Triangles, each with the body that has it.
struct Triangles {
  std::vector<double> corners;
  std::vector<std::int32_t> body;
  std::vector<double> rgba;

  void add(const std::vector<Face>& faces, int of, const std::array<double, 4>& colour) {
    for (const Face& face : faces)
      for (std::size_t k = 2; k < face.size(); ++k) {
        for (const Vector3& corner : {face[0], face[k - 1], face[k]})
          corners.insert(corners.end(), corner.begin(), corner.end());
        body.push_back(of);
        rgba.insert(rgba.end(), colour.begin(), colour.end());
      }
  }
};

/// A square in the ground's plane around its position, in the world's frame.
Face ground_face(const GroundDescription& ground, double half_space) {
  const Vector3& n = ground.normal;
  const Vector3 other = std::abs(n[2]) < 0.9 ? Vector3{0, 0, 1} : Vector3{1, 0, 0};
  const Vector3 u = half_space * unit(cross(other, n)), w = cross(n, u);
  const Vector3& at = ground.position;
  return {at - u - w, at + u - w, at + u + w, at - u + w};
}

}  // namespace

nb::tuple body_arrays(Readout& readout, const Batch& batch) {
  const std::size_t n = as_size(batch.model().nb()), count = as_size(batch.environments());
  std::span<double> pose, twist;
  const auto poses = new_array<double>({count, n, 7}, pose);
  const auto twists = new_array<double>({count, n, 6}, twist);
  for (std::size_t e = 0; e < count; ++e)
    readout.bodies(batch, static_cast<int>(e), pose.subspan(e * 7 * n, 7 * n),
                   twist.subspan(e * 6 * n, 6 * n));
  return nb::make_tuple(poses, twists);
}

Array<double> transmission_force_array(const Batch& batch, std::span<const double> controls) {
  const Model& model = batch.model();
  const auto environments = std::size_t(batch.environments());
  const std::size_t nu = controls.size() / environments, n = model.scene().transmissions.size();
  std::span<double> numbers;
  auto array = new_array<double>({environments, n}, numbers);
  for (std::size_t e = 0; e < environments && n > 0; ++e)
    std::ranges::copy(
        transmission_forces(model, batch, static_cast<int>(e), controls.subspan(e * nu, nu)),
        &numbers[e * n]);
  return array;
}

nb::tuple face_arrays(const Batch& batch, int environment, double half_space) {
  if (environment < 0 || environment >= batch.environments())
    throw InputError(
        fmt::format("environment {}; expected 0 to {}", environment, batch.environments() - 1));
  if (!(half_space >= 0 && std::isfinite(half_space)))
    throw InputError(fmt::format("half_space {}; expected 0 or more [m]", half_space));
  const Scene scene = sized_scene(batch, environment);
  Triangles all;
  for (std::size_t b = 0; b < scene.links.size(); ++b) {
    const BodyDescription& body = scene.links[b].body;
    const auto* const abstract = std::get_if<AbstractShape>(&body.shape);
    const tangere::Shape shape = abstract != nullptr && abstract->contact_points.size() > 9
                                     ? tangere::Shape(convex_hull(abstract->contact_points))
                                     : body.shape;
    all.add(faces_of(shape, half_space), static_cast<int>(b), body.rgba);
  }
  if (scene.ground) all.add({ground_face(*scene.ground, half_space)}, -1, BodyDescription{}.rgba);
  const std::size_t count = all.body.size();
  return nb::make_tuple(array_of<double>({count, 3, 3}, std::span<const double>(all.corners)),
                        array_of<std::int32_t>({count}, std::span<const std::int32_t>(all.body)),
                        array_of<double>({count, 4}, std::span<const double>(all.rgba)));
}

void check_state(const Model& model, std::span<const double> q, std::span<const double> v) {
  const auto finite = [](double x) { return std::isfinite(x); };
  if (!std::ranges::all_of(q, finite) || !std::ranges::all_of(v, finite))
    throw InputError("a state that is not finite; expected numbers");
  const auto names = model.q_names();
  for (std::size_t i = 0; i < q.size(); ++i) {
    if (!names[i % names.size()].ends_with(".qw")) continue;
    if (std::ranges::all_of(q.subspan(i, 4), [](double x) { return std::abs(x) < 1e-6; }))
      throw InputError(fmt::format("{} and its three neighbours are 0; expected a unit quaternion",
                                   names[i % names.size()]));
  }
}

}  // namespace tangere::python
