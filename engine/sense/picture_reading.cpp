// SPDX-License-Identifier: Apache-2.0
// Points keep their order; a mirrored picture has their columns from right to left. A layer's
// surface moves out of the gel, a picture's height is towards the camera.
#include "engine/sense/picture_reading.hpp"

#include <cmath>

#include "engine/model/compiled_layer.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/lateral_spread.hpp"
#include "engine/sense/pad_depth.hpp"
#include "engine/sense/surface_map.hpp"

namespace tangere {
namespace {

constexpr double kUsualThickness = 4e-3;  // of a gel whose thickness is not known [m]
constexpr double kUsualReach = 0.2;       // of the thickness

double thickness_of(const TactileDescription& d) {
  if (d.material) return d.material->thickness;
  if (d.table) return d.table->thickness > 0 ? d.table->thickness : 2 * d.table->depth.back();
  if (d.markers && d.markers->thickness > 0) return d.markers->thickness;
  return kUsualThickness;
}

PictureGrid grid_of(const TactileDescription& d) {
  const std::array<double, 2> pitch = pitches(d.array);
  return picture_grid(*d.picture, d.array.rows, d.array.cols, std::abs(pitch[1]),
                      std::abs(pitch[0]));
}

}  // namespace

template <class T>
struct PictureReading<T>::Impl {
  Model model;  // owns the sensor
  const CompiledSensor& sensor;
  const TactileDescription& description;
  GelCamera<T> camera;
  std::optional<MarkerMap> markers;
  std::optional<SurfaceMap> surface;
  std::array<double, 2> direction;  // along x and y of the picture by axis1 and axis0
  std::vector<double> moved;        // (points, 3) or (points, 2)
  std::vector<double> depth;        // (points)
  std::vector<T> points;            // (points) or (points, 2), in the picture's order

  Impl(const Model& m, int number)
      : model(m),
        sensor(compiled(model).sensors[std::size_t(number)]),
        description(model.scene().sensors[std::size_t(number)]),
        camera(grid_of(description), *description.picture, kUsualReach * thickness_of(description),
               description.layer ? Outside::nearest : Outside::zero),
        depth(std::size_t(sensor.points())) {
    const std::array<double, 2> pitch = pitches(description.array);
    direction = {(pitch[1] < 0) != description.picture->mirror ? -1.0 : 1.0,
                 pitch[0] < 0 ? -1.0 : 1.0};
    if (description.layer) surface.emplace(sensor);
    if (description.markers && description.picture->markers[0] > 0) markers.emplace(model, number);
  }

  /// Whether the pad's z points out of the skin, 1 or -1.
  [[nodiscard]] int outward() const {
    return compiled(model).sensor_info[std::size_t(sensor.number)].pressure_sign;
  }
  /// Computes the cotangent of the surface at the points, in the picture's order, and adds that of
  /// the field by which the markers moved.
  std::vector<T> surface_bar(FieldForm form, std::span<const double> field,
                             std::span<const T> picture_bar, std::span<double> field_bar) {
    const std::span<const T> none;
    const bool height = form == FieldForm::height, printed = form == FieldForm::rgb_marker;
    std::vector<T> bar(depth.size()), moved_bar(printed ? 2 * depth.size() : 0);
    camera.pull_back(printed, height ? picture_bar : none, height ? none : picture_bar, bar,
                     moved_bar);
    if (!printed) return bar;
    moved.resize(moved_bar.size());
    for (std::size_t k = 0; k < depth.size(); ++k) {
      moved[2 * k + 1] = direction[0] * static_cast<double>(moved_bar[2 * place(k)]);
      moved[2 * k] = direction[1] * static_cast<double>(moved_bar[2 * place(k) + 1]);
    }
    markers->pull_back(field, moved, field_bar);
    return bar;
  }
  /// The number of a point in the picture's order.
  [[nodiscard]] std::size_t place(std::size_t point) const {
    if (!description.picture->mirror) return point;
    const auto cols = static_cast<std::size_t>(sensor.cols);
    return point / cols * cols + (cols - 1 - point % cols);
  }

  void put_surface(std::span<const double> field) {
    moved.resize(field.size());
    surface->displace(field, moved);
    points.resize(depth.size());
    for (std::size_t k = 0; k < depth.size(); ++k)
      points[place(k)] = static_cast<T>(-moved[3 * k + 2]);
    camera.set_surface(points);
  }
  void put_markers(std::span<const double> field) {
    moved.resize(2 * depth.size());
    markers->displace(field, moved);
    points.resize(moved.size());
    for (std::size_t k = 0; k < depth.size(); ++k) {
      points[2 * place(k)] = static_cast<T>(direction[0] * moved[2 * k + 1]);
      points[2 * place(k) + 1] = static_cast<T>(direction[1] * moved[2 * k]);
    }
    camera.move_markers(points);
  }
};

template <class T>
PictureReading<T>::PictureReading(const Model& model, int sensor)
    : impl_(std::make_unique<Impl>(model, sensor)) {}
template <class T>
PictureReading<T>::~PictureReading() = default;
template <class T>
PictureReading<T>::PictureReading(PictureReading&&) noexcept = default;
template <class T>
PictureReading<T>& PictureReading<T>::operator=(PictureReading&&) noexcept = default;

template <class T>
bool PictureReading<T>::needs_depth() const {
  return !impl_->surface;
}
template <class T>
bool PictureReading<T>::needs_field(FieldForm form) const {
  return impl_->surface || form == FieldForm::rgb_marker;
}

template <class T>
void PictureReading<T>::set_touches(const kernels::TactileArgs<double>& touch) {
  Impl& m = *impl_;
  read_depths(m.sensor, touch, m.outward(), thickness_of(m.description), m.depth);
  m.points.resize(m.depth.size());
  for (std::size_t k = 0; k < m.depth.size(); ++k)
    m.points[m.place(k)] = static_cast<T>(m.depth[k]);
  m.camera.set_depth(m.points);
}

template <class T>
void PictureReading<T>::set_field(FieldForm form, std::span<const double> field) {
  if (impl_->surface) impl_->put_surface(field);
  if (form == FieldForm::rgb_marker) impl_->put_markers(field);
}

template <class T>
void PictureReading<T>::set_draws(const ReadingKey& key) {
  impl_->camera.set_draws({key.seed ^ impl_->sensor.name_bits, key.episode, key.step});
}

template <class T>
void PictureReading<T>::read(FieldForm form, std::span<T> picture) {
  if (form == FieldForm::height) return impl_->camera.read_height(picture);
  impl_->camera.read(form == FieldForm::rgb_marker, picture);
}
template <class T>
void PictureReading<T>::read(FieldForm form,
                             std::span<std::uint8_t> picture) requires std::is_same_v<T, float> {
  impl_->camera.read(form == FieldForm::rgb_marker, picture);
}

template <class T>
void PictureReading<T>::pull_back(FieldForm form, std::span<const double> field,
                                  std::span<const T> picture_bar, std::span<double> field_bar) {
  Impl& m = *impl_;
  const std::vector<T> surface_bar = m.surface_bar(form, field, picture_bar, field_bar);
  m.moved.assign(3 * m.depth.size(), 0.0);
  for (std::size_t k = 0; k < m.depth.size(); ++k)
    m.moved[3 * k + 2] = -static_cast<double>(surface_bar[m.place(k)]);
  m.surface->pull_back(field, m.moved, field_bar);
}

template <class T>
void PictureReading<T>::pull_back_touches(FieldForm form, const kernels::TactileArgs<double>& touch,
                                          std::span<const T> picture_bar, bool sizes,
                                          std::span<kernels::TouchCotangent<double>> touches,
                                          std::span<double> field_bar) {
  Impl& m = *impl_;
  const std::vector<T> surface_bar = m.surface_bar(form, {}, picture_bar, field_bar);
  m.points.resize(m.depth.size());
  m.camera.pull_back_depth(surface_bar, m.points);
  std::vector<double> depth_bar(m.depth.size());
  for (std::size_t k = 0; k < depth_bar.size(); ++k)
    depth_bar[k] = static_cast<double>(m.points[m.place(k)]);
  pull_back_depths(m.sensor, touch, m.outward(), thickness_of(m.description), depth_bar, sizes,
                   touches);
}

template class PictureReading<float>;
template class PictureReading<double>;

}  // namespace tangere
