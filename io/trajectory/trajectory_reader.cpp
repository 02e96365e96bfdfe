// SPDX-License-Identifier: Apache-2.0
// Reads what trajectory_file.cpp writes, attribute by attribute.
#include "io/trajectory/trajectory_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"
#include "engine/rows/sensor_layout.hpp"
#include "io/files/nearest_name.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_channels.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "io/trajectory/row_steps.hpp"

namespace tangere {

namespace {
constexpr std::int64_t kLargestImage = std::int64_t{1} << 30;  // pixels along one side
constexpr hsize_t kMostPoints = hsize_t{1} << 26;              // of a sensor
}  // namespace

struct TrajectoryReader::Impl {
  std::string path, scene_name;
  h5::Id file;
  std::int64_t environments = 0, steps = 0, first_step = 0;
  double timestep = 0;
  std::vector<SensorLayout> sensors;
  std::vector<std::vector<FieldForm>> forms;      // (sensors) what was recorded
  std::vector<std::vector<std::int64_t>> row_of;  // (sensors, frames) steps before each
  std::vector<std::string> sums;                  // sensors of which only these were
  std::vector<std::int64_t> frames;

  explicit Impl(const std::string& p) : path(p), file(open_trajectory(p)) {
    scene_name = h5::read_text(file, "scene_name");
    environments = h5::read_number<std::int64_t>(file, "environments");
    timestep = h5::read_number<double>(file, "timestep");
    steps = h5::read_number<std::int64_t>(file, "steps");
    first_step = h5::read_number<std::int64_t>(file, "first_step");
    if (!h5::has_link(file, "tactile")) return;
    const h5::Id group = h5::open_group(file, "tactile");
    for (const std::string& name : h5::link_names(group))
      add_readings(h5::open_group(group, name), name);
  }

  /// Takes a field, or where there is none the ideal one, or pressure, shear or both. Of other
  /// readings there is no picture.
  void add_readings(const h5::Id& group, const std::string& name) {
    std::vector<FieldForm> found;
    for (const FieldForm form :
         {FieldForm::field, FieldForm::ideal, FieldForm::pressure, FieldForm::shear})
      if (h5::has_link(group, dataset_of(form))) found.push_back(form);
    if (found.empty()) {
      if (std::ranges::none_of(
              field_forms(), [&](FieldForm form) { return h5::has_link(group, dataset_of(form)); }))
        throw IoError(
            fmt::format("{}: sensor '{}' has no reading: the file is damaged", path, name));
      sums.push_back(name);
      return;
    }
    if (components_of(found[0]) == 3) found.resize(1);
    // What was read at other steps makes no picture with the first.
    const auto apart = std::find_if(found.begin() + 1, found.end(), [&](FieldForm form) {
      return h5::has_link(group, own_steps(form));
    });
    found.erase(apart, found.end());
    add_sensor(group, name, found[0]);
    forms.push_back(found);
    row_of.push_back(row_steps(file, fmt::format("tactile/{}/{}", name, dataset_of(found[0]))));
    if (std::ssize(row_of.back()) != frames.back())
      throw IoError(fmt::format("{}: sensor '{}' has {} fields and {} steps: the file is damaged",
                                path, name, frames.back(), row_of.back().size()));
    for (const FieldForm form : found) {
      h5::Dims dims = h5::dimensions(h5::open_dataset(group, dataset_of(form))),
               expected = h5::dimensions(h5::open_dataset(group, dataset_of(found[0])));
      expected.back() = static_cast<hsize_t>(components_of(form));
      if (dims != expected)
        throw IoError(fmt::format("{}: sensor '{}': '{}' has not the shape of '{}'", path, name,
                                  dataset_of(form), dataset_of(found[0])));
    }
  }

  /// The name of a reading's list of steps, if it has one of its own.
  static std::string own_steps(FieldForm form) { return std::string(dataset_of(form)) + "_step"; }

  /// Reads what a picture of a list of points needs.
  void read_image(const h5::Id& group, SensorLayout& s) const {
    const auto n = static_cast<hsize_t>(s.points);
    s.list.resize(n);
    std::vector<std::int64_t> pixels(2 * n);
    h5::read_box<std::int64_t>(h5::open_dataset(group, "pixel"), {0, 0}, {n, 2}, pixels.data());
    for (std::size_t p = 0; p < n; ++p)
      for (std::size_t k = 0; k < 2; ++k) {
        const std::int64_t x = pixels[2 * p + k];
        if (x < -1 || x >= kLargestImage)
          throw IoError(fmt::format("{}: sensor '{}' has pixel {}", path, s.name, x));
        s.list[p].pixel[k] = static_cast<int>(x);
      }
    const auto vectors = [&](const char* name, Vector3 TactilePoint::*to) {
      std::vector<double> x(3 * n);
      h5::read_box<double>(h5::open_dataset(group, name), {0, 0}, {n, 3}, x.data());
      check_finite(x, s.name, name);
      for (std::size_t p = 0; p < n; ++p) std::copy_n(&x[3 * p], 3, (s.list[p].*to).begin());
    };
    vectors("position", &TactilePoint::position);
    vectors("axis0", &TactilePoint::axis0);
    vectors("axis1", &TactilePoint::axis1);
  }

  void check_finite(const std::vector<double>& x, const std::string& sensor,
                    const std::string& what) const {
    for (const double number : x)
      if (!std::isfinite(number))
        throw IoError(
            fmt::format("{}: sensor '{}': {} has a number that is {}; expected finite "
                        "numbers",
                        path, sensor, what, number));
  }

  void add_sensor(const h5::Id& group, const std::string& name, FieldForm form) {
    const h5::Id force = h5::open_dataset(group, dataset_of(form));
    SensorLayout s;
    s.name = name;
    s.body = h5::read_text(force, "body");
    s.pressure_sign = static_cast<int>(h5::read_number<std::int64_t>(force, "pressure_sign"));
    s.every = static_cast<int>(h5::read_number<std::int64_t>(force, "every"));
    const auto copy = [&](const char* attribute, std::array<double, 3>& to) {
      const std::vector<double> x = h5::read_numbers<double>(force, attribute);
      if (x.size() != 3) throw IoError(path + ": attribute '" + attribute + "' is damaged");
      check_finite(x, name, attribute);
      std::copy(x.begin(), x.end(), to.begin());
    };
    const h5::Dims dims = h5::dimensions(force);
    if (s.every < 1)
      throw IoError(fmt::format("{}: sensor '{}' is read every {} steps; expected 1 or more", path,
                                name, s.every));
    // No run writes larger ones: what this guards are products of what a damaged file claims.
    for (std::size_t i = 2; i < dims.size(); ++i)
      if (dims[i] > kMostPoints)
        throw IoError(
            fmt::format("{}: sensor '{}' claims {} points along one side", path, name, dims[i]));
    if (dims.size() == 5 && dims[2] * dims[3] > kMostPoints)
      throw IoError(fmt::format("{}: sensor '{}' claims {} points", path, name, dims[2] * dims[3]));
    if (dims.size() > 1 && dims.back() != static_cast<hsize_t>(components_of(form)))
      throw IoError(fmt::format("{}: sensor '{}' has {} numbers a point; expected {}", path, name,
                                dims.back(), components_of(form)));
    if (dims.size() == 5) {
      s.rows = static_cast<int>(dims[2]);
      s.cols = static_cast<int>(dims[3]);
      s.points = s.rows * s.cols;
      copy("corner0", s.corner0);
      copy("corner1", s.corner1);
      copy("axis0", s.axis0);
      copy("axis1", s.axis1);
    } else if (dims.size() == 4) {
      s.points = static_cast<int>(dims[2]);
      if (h5::has_link(group, "pixel")) read_image(group, s);
    } else {
      throw IoError(fmt::format("{}: sensor '{}' has {} dimensions; expected 4 or 5", path, name,
                                dims.size()));
    }
    // A search for the newest field goes through all of them.
    if (dims[0] > static_cast<hsize_t>(std::max<std::int64_t>(steps, 0)))
      throw IoError(fmt::format("{}: sensor '{}' claims {} fields of {} steps: the file is damaged",
                                path, name, dims[0], steps));
    sensors.push_back(std::move(s));
    frames.push_back(static_cast<std::int64_t>(dims[0]));
  }

  [[nodiscard]] h5::Id open(std::size_t sensor, const std::string& dataset) const {
    return h5::open_dataset(h5::open_group(h5::open_group(file, "tactile"), sensors[sensor].name),
                            dataset);
  }
};

std::optional<TrajectorySummary> summarise_trajectory(const std::string& path) {
  const h5::Id file = h5::open_file(path);
  if (!is_trajectory(file)) return {};
  TrajectorySummary summary;
  for (const std::string& name : h5::attribute_names(file))
    summary.settings.emplace_back(name, h5::attribute_text(file, name));
  summary.channels = h5::list_channels(file);
  return summary;
}

TrajectoryReader::TrajectoryReader(const std::string& path) : impl_(std::make_unique<Impl>(path)) {}
TrajectoryReader::~TrajectoryReader() = default;
TrajectoryReader::TrajectoryReader(TrajectoryReader&&) noexcept = default;

const std::string& TrajectoryReader::path() const { return impl_->path; }
const std::string& TrajectoryReader::scene_name() const { return impl_->scene_name; }
std::int64_t TrajectoryReader::environments() const { return impl_->environments; }
double TrajectoryReader::timestep() const { return impl_->timestep; }
std::int64_t TrajectoryReader::first_step() const { return impl_->first_step; }
const std::vector<SensorLayout>& TrajectoryReader::sensors() const { return impl_->sensors; }

std::size_t TrajectoryReader::find_sensor(const std::string& name) const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < impl_->sensors.size(); ++i) {
    names.push_back(impl_->sensors[i].name);
    if (name.empty() || names.back() == name) return i;
  }
  if (std::find(impl_->sums.begin(), impl_->sums.end(), name) != impl_->sums.end())
    throw InputError(
        impl_->path + ": of sensor '" + name +
        "' the run recorded only the sum, markers, surface, flow, channels or pictures");
  if (names.empty())
    throw InputError(impl_->path + ": the run recorded no tactile field, pressure or shear");
  throw InputError(impl_->path + ": no sensor is named '" + name + "'" + suggestion(name, names));
}

bool TrajectoryReader::has_field(std::size_t sensor) const {
  return components_of(impl_->forms[sensor].front()) == 3;
}
bool TrajectoryReader::has_pressure(std::size_t sensor) const {
  return impl_->forms[sensor].front() != FieldForm::shear;
}
bool TrajectoryReader::has_shear(std::size_t sensor) const {
  return impl_->forms[sensor].back() != FieldForm::pressure;
}

std::int64_t TrajectoryReader::frames(std::size_t sensor) const { return impl_->frames[sensor]; }

std::int64_t TrajectoryReader::step(std::size_t sensor, std::int64_t frame) const {
  return impl_->row_of[sensor].at(static_cast<std::size_t>(frame));
}

std::vector<double> TrajectoryReader::force(std::size_t sensor, std::int64_t frame,
                                            std::int64_t environment) const {
  const SensorLayout& s = impl_->sensors[sensor];
  std::vector<double> whole(numbers_of(s.points, FieldForm::field), 0.0);
  for (const FieldForm form : impl_->forms[sensor]) {
    const std::vector<std::uint64_t> shape = reading_shape(s, form);
    h5::Dims offset(2 + shape.size(), 0), count = {1, 1};
    offset[0] = static_cast<hsize_t>(frame), offset[1] = static_cast<hsize_t>(environment);
    count.insert(count.end(), shape.begin(), shape.end());
    std::vector<double> values(numbers_of(s.points, form));
    h5::read_box<double>(impl_->open(sensor, dataset_of(form)), offset, count, values.data());
    impl_->check_finite(values, s.name, fmt::format("frame {}", frame));
    const auto components = static_cast<std::size_t>(components_of(form));
    const std::size_t first = form == FieldForm::pressure ? 2 : 0;
    for (std::size_t k = 0; k < values.size(); ++k)
      whole[k / components * 3 + first + k % components] = values[k];
  }
  return whole;
}

}  // namespace tangere
