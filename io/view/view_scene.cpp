// SPDX-License-Identifier: Apache-2.0
// A field is f·a0, f·a1, f2 at each point, with f2 = -f·(a0 × a1). With p = s f2 the pressure (s:
// pressure_sign), the force on the body is f = (f·a0) a0 + (f·a1) a1 - s p (a0 × a1): pressure
// pushes along -s (a0 × a1).
#include "io/view/view_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"
#include "engine/base/vector3.hpp"
#include "engine/rows/sensor_layout.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/sense/readout.hpp"
#include "io/picture/tactile_drawing.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

constexpr int kMostCells = 48;  // along one side of a map: 1000 frames of a sensor fit in 50 MB

/// The numbers of a scene on which shapes and places depend.
std::vector<SceneNumber> geometry_of(const Scene& scene) {
  std::vector<SceneNumber> numbers;
  for (const LinkDescription& link : scene.links) {
    for (const NumberField field : {NumberField::radius, NumberField::length, NumberField::scale})
      numbers.push_back({NumberOwner::body, field, link.body.name});
    for (int k = 0; k < 3; ++k) {
      numbers.push_back({NumberOwner::body, NumberField::size, link.body.name, k});
      numbers.push_back({NumberOwner::joint, NumberField::pos, link.joint.name, k});
    }
  }
  return numbers;
}

void append(std::vector<float>& to, const Vector3& x) {
  for (const double number : x) to.push_back(static_cast<float>(number));
}

ViewSensor view_sensor(const SensorInfo& info, const TactileDescription& d, int body) {
  const SensorLayout layout = sensor_layout(info, d, 1);
  const double push = -info.pressure_sign;
  ViewSensor s;
  s.name = info.name, s.body = body, s.points = info.points;
  TactileDrawing map;
  if (drawable(layout)) map = drawing_of(layout);
  const bool array = layout.rectangular();
  s.height = map.height, s.width = map.width;
  s.rows = array ? std::min(map.rows, kMostCells) : map.rows;
  s.cols = array ? std::min(map.cols, kMostCells) : map.cols;
  // A list is thinned where it is long, an array pooled.
  const int step =
      array ? 1 : (info.points + kMostCells * kMostCells - 1) / (kMostCells * kMostCells);
  const int cells = array ? s.rows * s.cols : (info.points + step - 1) / step;
  std::vector<Vector3> sums(static_cast<std::size_t>(cells), Vector3{});
  s.shared.assign(static_cast<std::size_t>(cells), 0);
  const std::array<double, 2> pitch = layout.pitch();
  for (int k = 0; k < info.points; ++k) {
    const int i = array ? k / map.cols : 0, j = array ? k % map.cols : 0;
    const int cell = array           ? i * s.rows / map.rows * s.cols + j * s.cols / map.cols
                     : k % step == 0 ? k / step
                                     : -1;
    s.cell.push_back(cell);
    if (cell < 0) continue;
    const auto at = static_cast<std::size_t>(cell), point = static_cast<std::size_t>(k);
    sums[at] = sums[at] + (array ? layout.corner0 + (i * pitch[0]) * layout.axis0 +
                                       (j * pitch[1]) * layout.axis1
                                 : layout.list[point].position);
    if (s.shared[at]++ > 0) continue;
    const Vector3 axis0 = array ? layout.axis0 : layout.list[point].axis0,
                  axis1 = array ? layout.axis1 : layout.list[point].axis1;
    append(s.axis0, axis0), append(s.axis1, axis1);
    append(s.press, push * (array ? cross(axis0, axis1) : layout.list[point].normal));
    std::array<int, 2> place{-1, -1};
    std::array<double, 4> turn{map.down, 0, 0, map.right};
    if (array) place = {cell / s.cols, cell % s.cols};
    if (!array && map.rows > 0) place = map.cell[point], turn = map.turn[point];
    s.place.insert(s.place.end(), place.begin(), place.end());
    for (const double x : turn) s.turn.push_back(static_cast<float>(x));
  }
  for (std::size_t c = 0; c < sums.size(); ++c) append(s.position, (1.0 / s.shared[c]) * sums[c]);
  return s;
}

}  // namespace

/// A compiled scene, and what reads it.
struct ViewScene::Posed {
  explicit Posed(const Scene& scene) : model(scene), batch(model, 1), readout(model) {
    v.assign(static_cast<std::size_t>(model.nv()), 0.0);
    pose.resize(7 * static_cast<std::size_t>(model.nb()));
    twist.resize(6 * static_cast<std::size_t>(model.nb()));
    ends.resize(3 * model.end_effectors().size());
  }
  Model model;
  Batch batch;
  Readout readout;
  std::vector<double> v, pose, twist, ends;
  int shapes = -1;  // index of its bodies in ViewData::shapes
};

ViewScene::ViewScene(const std::string& text, const std::string& name, const std::string& path,
                     const ViewOptions& options, const IncludedTexts& included)
    : path_(path) {
  try {
    SceneReadOptions as_stored;
    as_stored.included = included;
    scene_ = parse_scene(text, options.scene.empty() ? name : options.scene, as_stored).scene;
    scene_.randomizations.clear();  // every episode stores its drawn values
    scene_.initial.clear();         // and where it was
    plain_ = std::make_unique<Posed>(scene_);
  } catch (const InputError& error) {
    throw IoError(fmt::format("{}: its scene cannot be compiled: {}", path, error.what()));
  } catch (const IoError& error) {
    throw IoError(
        fmt::format("{}: its scene names a file that cannot be read: {}; --scene FILE says "
                    "beside which file to look",
                    path, error.what()));
  }
}
ViewScene::~ViewScene() = default;

std::vector<ViewSensor> ViewScene::sensors() const {
  const Model& model = plain_->model;
  std::vector<ViewSensor> all;
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    const auto names = model.body_names();
    const auto body = std::find(names.begin(), names.end(), model.sensors()[s].body);
    all.push_back(
        view_sensor(model.sensors()[s], scene_.sensors[s], static_cast<int>(body - names.begin())));
  }
  return all;
}

void ViewScene::check_names(std::span<const std::string> q_names) const {
  const std::span<const std::string> expected = plain_->model.q_names();
  if (!std::equal(q_names.begin(), q_names.end(), expected.begin(), expected.end()))
    throw IoError(
        fmt::format("{}: its coordinates are not those of its scene ({} numbers; the scene has "
                    "{}): the file is "
                    "damaged",
                    path_, q_names.size(), expected.size()));
}

std::vector<std::string> ViewScene::q_units() const {
  const auto units = plain_->model.q_units();
  return {units.begin(), units.end()};
}

int ViewScene::begin_episode(const ViewNumbers& numbers, ViewData& data) {
  if (numbers.names.size() != numbers.values.size())
    throw IoError(
        fmt::format("{}: an episode has {} varying numbers and {} names: the file is "
                    "damaged",
                    path_, numbers.values.size(), numbers.names.size()));
  Scene own = scene_;
  bool differs = false;
  for (const SceneNumber& number : geometry_of(scene_)) {
    const auto found = std::find(numbers.names.begin(), numbers.names.end(), name_of(number));
    if (found == numbers.names.end()) continue;
    number_in(own, number) =
        numbers.values[static_cast<std::size_t>(found - numbers.names.begin())];
    differs = true;
  }
  if (differs) {
    try {
      posed_ = std::make_unique<Posed>(own);
    } catch (const InputError& error) {
      throw IoError(
          fmt::format("{}: the numbers of an episode are damaged: {}", path_, error.what()));
    }
  } else {
    posed_.reset();
  }
  Posed& posed = differs ? *posed_ : *plain_;
  if (posed.shapes < 0) {
    posed.shapes = static_cast<int>(data.shapes.size());
    data.shapes.push_back(own.links);
  }
  return posed.shapes;
}

void ViewScene::add_state(std::span<const double> q, ViewEpisode& episode) {
  Posed& posed = posed_ ? *posed_ : *plain_;
  for (const double x : q)
    if (!std::isfinite(x))
      throw IoError(
          fmt::format("{}: q has a number that is {}; expected finite numbers", path_, x));
  posed.batch.displace_state(0, q, posed.v);
  posed.readout.bodies(posed.batch, 0, posed.pose, posed.twist);
  for (const double x : posed.pose) episode.poses.push_back(static_cast<float>(x));
  if (posed.ends.empty()) return;
  posed.readout.end_effectors(posed.batch, 0, posed.ends);
  for (const double x : posed.ends) episode.end_effectors.push_back(static_cast<float>(x));
}

std::array<double, 2> add_field(const ViewSensor& sensor, int pressure_sign,
                                std::span<const double> force, ViewField& field) {
  std::vector<double> sums(3 * sensor.cells(), 0.0);
  double normal = 0, shear = 0;
  for (std::size_t k = 0; k < sensor.cell.size(); ++k) {
    const double* f = &force[3 * k];
    normal += pressure_sign * f[2];
    shear += std::hypot(f[0], f[1]);
    if (sensor.cell[k] < 0) continue;
    double* sum = &sums[3 * static_cast<std::size_t>(sensor.cell[k])];
    sum[0] += f[0], sum[1] += f[1], sum[2] += pressure_sign * f[2];
  }
  for (std::size_t c = 0; c < sensor.cells(); ++c)
    for (std::size_t i = 0; i < 3; ++i)
      field.values.push_back(static_cast<float>(sums[3 * c + i] / sensor.shared[c]));
  return {normal, shear};
}

}  // namespace tangere
