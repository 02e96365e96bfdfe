// SPDX-License-Identifier: Apache-2.0
// Poses are those of the camera's axes in double precision; what the picture needs of an
// environment is a list of numbers, and an equal list has the same picture.
#include "engine/sense/camera_reading.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>

#include "engine/model/compiled_model.hpp"
#include "engine/picture/camera_noise.hpp"
#include "engine/picture/scene_view.hpp"
#include "engine/scene/frames.hpp"
#include "engine/scene/scene_number.hpp"

namespace tangere {
namespace {

using kernels::Frame;
using kernels::kBlock;
using kernels::kGroup;
using kernels::Vec3;

constexpr std::array<double, 3> kGroundColour{0.62, 0.62, 0.6};
constexpr std::size_t kMostKeptBytes = 64U << 20;  // of pictures of a block, for each thread
constexpr float kWhiteLevel = 255;

bool is_finite(const Vector3& v) {
  return std::ranges::all_of(v, [](double x) { return std::isfinite(x); });
}

/// Whether its place is numbers.
bool has_place(const ViewSolid& solid) {
  return is_finite(solid.origin) && std::ranges::all_of(solid.axes, is_finite);
}

struct SizedSolid {
  SolidKind kind;
  Vector3 size;
};
/// Returns a shape as a solid; none for meshes and abstract bodies.
std::optional<SizedSolid> solid_of_shape(const Shape& shape) {
  if (const auto* s = std::get_if<SphereShape>(&shape))
    return SizedSolid{SolidKind::ball, {s->radius, s->radius, s->radius}};
  if (const auto* s = std::get_if<CuboidShape>(&shape))
    return SizedSolid{SolidKind::cuboid, 0.5 * s->size};
  if (const auto* s = std::get_if<EllipsoidShape>(&shape))
    return SizedSolid{SolidKind::ellipsoid, 0.5 * s->size};
  if (const auto* s = std::get_if<CylinderShape>(&shape))
    return SizedSolid{SolidKind::cylinder, {s->radius, 0.5 * s->length, 0}};
  if (const auto* s = std::get_if<CapsuleShape>(&shape))
    return SizedSolid{SolidKind::capsule, {s->radius, 0.5 * s->length, 0}};
  if (std::holds_alternative<PlaneShape>(shape)) return SizedSolid{SolidKind::half_space, {}};
  return std::nullopt;
}

constexpr double kMostExponent = kLargestExponent;

/// A number of the camera that varies.
struct VaryingCameraNumber {
  int randomization;
  SceneNumber number;
};

/// A number of a body's size that varies.
struct VaryingShapeNumber {
  std::size_t body;
  int randomization, which;
};

/// The rotation of the ground: its normal is z.
Frame<double> frame_of_ground(const GroundDescription& ground) {
  const Vector3& n = ground.normal;
  const Vector3 other = std::abs(n[0]) < 0.9 ? Vector3{1, 0, 0} : Vector3{0, 1, 0};
  const Vector3 y = unit(cross(n, other)), x = cross(y, n);
  Frame<double> frame;
  for (std::size_t k = 0; k < 3; ++k)
    frame.R.m[k][0] = x[k], frame.R.m[k][1] = y[k], frame.R.m[k][2] = n[k];
  frame.p = vec3_of(ground.position);
  return frame;
}

Vector3 column(const Frame<double>& frame, int k) {
  return {frame.R.m[0][k], frame.R.m[1][k], frame.R.m[2][k]};
}

/// Returns `light` as a direction of length one in the axes of a frame.
Vector3 turned_into(const Frame<double>& frame, const Vector3& light) {
  const Vector3 one = unit(light);
  return {dot(one, column(frame, 0)), dot(one, column(frame, 1)), dot(one, column(frame, 2))};
}

}  // namespace

struct CameraReading::Impl {
  struct Kept {
    std::vector<double> key;
    std::optional<SceneView> view;
  };

  Model model;
  const CameraDescription& description;
  const CompiledCamera& camera;
  CameraDescription drawn;  // as the environment at hand has it
  Frame<double> own_frame;  // of its axes, in the body's or the world's
  std::vector<VaryingCameraNumber> own_numbers;
  std::vector<const MeshShape*> meshes;  // of bodies; null: it has none
  // Of bodies, with the sizes of the environment at hand. Of a mesh only its scale.
  std::vector<Shape> shapes;
  std::vector<VaryingShapeNumber> varying;
  std::vector<Kept> kept;
  std::vector<ViewSolid> solids;  // one for each body that is seen
  std::vector<std::size_t> bodies;
  std::vector<double> key;
  Kept* now = nullptr;
  CameraKey draws;
  std::vector<std::uint8_t> bytes;
  std::vector<float> planes;

  Impl(const Model& m, int number)
      : model(m),
        description(model.scene().cameras[std::size_t(number)]),
        camera(compiled(model).cameras[std::size_t(number)]),
        drawn(description),
        own_frame(camera.frame) {
    const Scene& scene = model.scene();
    for (std::size_t b = 0; b < scene.links.size(); ++b) {
      const BodyDescription& body = scene.links[b].body;
      meshes.push_back(body.surface ? body.surface.get() : std::get_if<MeshShape>(&body.shape));
      if (meshes[b] != nullptr) {
        shapes.emplace_back(MeshShape{});
        std::get<MeshShape>(shapes[b]).scale = meshes[b]->scale;
      } else {
        shapes.push_back(body.shape);
      }
      if (body.rgba[3] > 0 && !std::holds_alternative<AbstractShape>(shapes[b]))
        bodies.push_back(b);
    }
    for (std::size_t k = 0; k < scene.randomizations.size(); ++k) {
      const SceneNumber& n = scene.randomizations[k].number;
      if (n.owner == NumberOwner::camera && n.name == description.name)
        own_numbers.push_back({static_cast<int>(k), n});
      if (n.owner != NumberOwner::body || size_index(n) < 0) continue;
      for (std::size_t b = 0; b < scene.links.size(); ++b)
        if (scene.links[b].body.name == n.name)
          varying.push_back({b, static_cast<int>(k), size_index(n)});
    }
    const std::size_t bytes_of_pixel = sizeof(float) + 2 * sizeof(std::int32_t),
                      all = kBlock * grid().pixels() * bytes_of_pixel;
    kept.resize(all <= kMostKeptBytes ? kBlock : 1);
    bytes.resize(3 * grid().pixels());
  }

  [[nodiscard]] ViewGrid grid() const {
    return {description.rows, description.cols, description.fov, description.far};
  }

  /// The pose of a body, or of the world for -1, in the world.
  [[nodiscard]] Frame<double> pose_of(const PadReader& reader, int body, int group,
                                      int lane) const {
    if (body < 0) return kIdentityFrame;
    const CompiledBody& b = compiled(model).bodies[std::size_t(body)];
    Frame<double> frame = compose(reader.link(b.link, group, lane).world, b.frame);
    frame.p = compiled(model).in_world(frame.p);
    return frame;
  }

  void put_solid(const Frame<double>& eye, const Frame<double>& body, ViewSolid solid) {
    const Frame<double> at = relative(eye, body);
    for (int k = 0; k < 3; ++k) solid.axes[std::size_t(k)] = column(at, k);
    solid.origin = {at.p.x, at.p.y, at.p.z};
    solids.push_back(solid);
  }

  /// Sets the camera's own numbers to those of an environment.
  void place_camera(const Batch& batch, int environment) {
    for (const auto& [randomization, number] : own_numbers)
      *camera_number(drawn, number.field, number.component) =
          batch.randomized_value(environment, randomization);
    if (!own_numbers.empty()) own_frame = camera_frame(drawn);
  }

  /// Lists what is seen in the camera's axes.
  void list_solids(const PadReader& reader, const Batch& batch, int environment) {
    const int group = environment % kBlock / kGroup, lane = environment % kGroup;
    const Scene& scene = model.scene();
    for (const VaryingShapeNumber& n : varying)
      *size_number(shapes[n.body], n.which) = batch.randomized_value(environment, n.randomization);
    place_camera(batch, environment);
    const Frame<double> eye = compose(pose_of(reader, camera.body, group, lane), own_frame);
    solids.clear();
    key.clear();
    for (const std::size_t b : bodies) {
      ViewSolid solid;
      solid.number = static_cast<std::int32_t>(b);
      const BodyDescription& body = scene.links[b].body;
      solid.colour = {body.rgba[0], body.rgba[1], body.rgba[2]};
      solid.specular = body.specular, solid.emission = body.emission;
      solid.exponent = static_cast<int>(std::lround(kMostExponent * body.shininess));
      if (const auto sized = solid_of_shape(shapes[b]))
        solid.kind = sized->kind, solid.size = sized->size;
      else
        solid.size[0] = std::get<MeshShape>(shapes[b]).scale;
      put_solid(eye, pose_of(reader, static_cast<int>(b), group, lane), solid);
    }
    if (scene.ground) {
      ViewSolid ground;
      ground.kind = SolidKind::half_space;
      ground.number = static_cast<std::int32_t>(scene.links.size());
      ground.colour = kGroundColour;
      ground.square = kGroundSquare;
      put_solid(eye, frame_of_ground(*scene.ground), ground);
    }
    light = turned_into(eye, drawn.light);
    if (!is_finite(light)) light = {0, 0, 0};  // no direction: no lamp
    key.insert(key.end(), light.begin(), light.end());
    key.insert(key.end(), {drawn.ambient, drawn.brightness});
    for (const ViewSolid& s : solids) {
      for (const Vector3& axis : s.axes) key.insert(key.end(), axis.begin(), axis.end());
      key.insert(key.end(), s.origin.begin(), s.origin.end());
      key.insert(key.end(), s.size.begin(), s.size.end());
    }
  }

  void draw(SceneView& view) const {
    view.begin(light, drawn.ambient, drawn.brightness);
    for (const ViewSolid& solid : solids) {
      const auto b = static_cast<std::size_t>(solid.number);
      const MeshShape* const mesh = b < meshes.size() ? meshes[b] : nullptr;
      if (!has_place(solid)) continue;
      if (mesh == nullptr)
        view.add(solid);
      else
        view.add(ViewMesh{mesh->vertices, mesh->triangles, solid.size[0]}, solid);
    }
  }

  void set(const PadReader& reader, const Batch& batch, int environment) {
    list_solids(reader, batch, environment);
    now = &kept[std::size_t(environment) % kept.size()];
    const ReadingKey at = key_of(batch, environment);
    draws = {at.seed ^ camera.name_bits, at.episode, at.step};
    if (now->view && now->key.size() == key.size() &&
        std::memcmp(now->key.data(), key.data(), key.size() * sizeof(double)) == 0)
      return;
    if (!now->view) now->view.emplace(grid());
    draw(*now->view);
    now->key = key;
  }

  /// Multiplies colours by gains and adds noise, row by row.
  void disturb() {
    const std::array<double, kColours> gains = camera_gains(draws, description.gain);
    const auto width = std::size_t(description.cols);
    planes.resize(kColours * width);
    for (int row = 0; row < description.rows; ++row) {
      std::uint8_t* const at = bytes.data() + kColours * width * std::size_t(row);
      for (std::size_t c = 0; c < kColours; ++c)
        for (std::size_t i = 0; i < width; ++i)
          planes[c * width + i] =
              static_cast<float>(at[kColours * i + c]) * static_cast<float>(gains[c]);
      if (description.noise != 0)
        add_camera_noise<float>(draws, description.noise, row * description.cols, planes);
      for (std::size_t c = 0; c < kColours; ++c)
        for (std::size_t i = 0; i < width; ++i)
          at[kColours * i + c] = static_cast<std::uint8_t>(
              std::clamp(planes[c * width + i], 0.0F, kWhiteLevel) + 0.5F);
    }
  }

  std::span<const std::uint8_t> colours() {
    unpack_colours(now->view->colours(), bytes);
    if (description.noise != 0 || description.gain != 0) disturb();
    return bytes;
  }

  Vector3 light{};  // in the camera's axes
};

CameraReading::CameraReading(const Model& model, int camera)
    : impl_(std::make_unique<Impl>(model, camera)) {}
CameraReading::~CameraReading() = default;
CameraReading::CameraReading(CameraReading&&) noexcept = default;
CameraReading& CameraReading::operator=(CameraReading&&) noexcept = default;

void CameraReading::set(const PadReader& reader, const Batch& batch, int environment) {
  impl_->set(reader, batch, environment);
}

template <class T>
void CameraReading::read(FieldForm form, std::span<T> picture) {
  const auto put = [&](const auto& numbers) {
    std::transform(numbers.begin(), numbers.end(), picture.begin(),
                   [](auto x) { return static_cast<T>(x); });
  };
  if (form == FieldForm::view_rgb) return put(impl_->colours());
  if (form == FieldForm::view_depth) return put(impl_->now->view->depth());
  put(impl_->now->view->numbers());
}

template void CameraReading::read(FieldForm, std::span<double>);
template void CameraReading::read(FieldForm, std::span<float>);
template void CameraReading::read(FieldForm, std::span<std::uint8_t>);
template void CameraReading::read(FieldForm, std::span<std::int16_t>);

}  // namespace tangere
