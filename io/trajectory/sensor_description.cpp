// SPDX-License-Identifier: Apache-2.0
// Points are in the order of the field: entry k of the list belongs to entry k of the field.
#include "io/trajectory/sensor_description.hpp"

#include <algorithm>

namespace tangere {
namespace {

void write_vectors(const h5::Id& group, const char* name, const SensorLayout& sensor,
                   Vector3 TactilePoint::*member, const char* units) {
  std::vector<double> numbers;
  for (const TactilePoint& p : sensor.list)
    numbers.insert(numbers.end(), (p.*member).begin(), (p.*member).end());
  const h5::Dims dims{sensor.list.size(), 3};
  const h5::Id dataset = h5::create_dataset<double>(group, name, dims);
  h5::write_attribute(dataset, "units", units);
  h5::write_attribute(dataset, "frame", "body");
  h5::write_box<double>(dataset, {0, 0}, dims, numbers.data());
}

void describe_array(const h5::Id& object, const SensorLayout& s) {
  const std::int64_t resolution[] = {s.rows, s.cols};
  h5::write_list<std::int64_t>(object, "resolution", resolution);
  h5::write_list<double>(object, "corner0", s.corner0);
  h5::write_list<double>(object, "corner1", s.corner1);
  h5::write_list<double>(object, "axis0", s.axis0);
  h5::write_list<double>(object, "axis1", s.axis1);
}

}  // namespace

void describe_points(const h5::Id& group, const SensorLayout& s) {
  if (s.rectangular()) return;
  write_vectors(group, "position", s, &TactilePoint::position, "m");
  write_vectors(group, "normal", s, &TactilePoint::normal, "1");
  write_vectors(group, "axis0", s, &TactilePoint::axis0, "1");
  write_vectors(group, "axis1", s, &TactilePoint::axis1, "1");
  if (std::all_of(s.list.begin(), s.list.end(),
                  [](const TactilePoint& p) { return p.pixel[0] < 0; }))
    return;
  std::vector<std::int64_t> pixels;
  for (const TactilePoint& p : s.list) pixels.insert(pixels.end(), {p.pixel[0], p.pixel[1]});
  const h5::Dims dims{s.list.size(), 2};
  const h5::Id dataset = h5::create_dataset<std::int64_t>(group, "pixel", dims);
  h5::write_attribute(dataset, "meaning", "row and column of the point in an image; -1: none");
  h5::write_box<std::int64_t>(dataset, {0, 0}, dims, pixels.data());
}

const char* dataset_of(FieldForm form) {
  return form == FieldForm::field ? "force" : to_string(form);
}

std::string components_text(const SensorLayout& sensor, FieldForm form) {
  const std::string across = "f.axis0, f.axis1",
                    along = sensor.rectangular() ? "-f.(axis0 x axis1)" : "-f.normal";
  switch (form) {
    case FieldForm::field:
    case FieldForm::ideal: return across + ", " + along + "; f is the force on the body";
    case FieldForm::pressure: return along + "; f is the force on the body without friction";
    case FieldForm::shear: return across + "; f is the force on the body";
    case FieldForm::markers: return "displacement of each marker along axis0, axis1";
    case FieldForm::flow: return across + ", over their largest length in this reading";
    case FieldForm::sum: break;
  }
  return "force x y z on the body [N], then x y z of its centre of pressure [m]; body axes";
}

void describe_reading(const h5::Id& object, const SensorLayout& sensor, FieldForm form) {
  h5::write_attribute(object, "units",
                      form == FieldForm::sum       ? "N, N, N, m, m, m"
                      : form == FieldForm::markers ? "m"
                      : form == FieldForm::flow    ? "1"
                                                   : "N");
  h5::write_attribute(object, "body", sensor.body);
  h5::write_scalar<std::int64_t>(object, "pressure_sign", sensor.pressure_sign);
  h5::write_attribute(object, "components", components_text(sensor, form));
  h5::write_attribute(object, "frame",
                      form == FieldForm::sum ? "the body's"
                      : sensor.rectangular()
                          ? "axis0, axis1 of the sensor, in the body's axes"
                          : "axis0, axis1, normal of each point, in the body's axes");
  if (!sensor.imperfections.empty())
    h5::write_attribute(
        object, "imperfections",
        form == FieldForm::ideal || form == FieldForm::markers ? "none" : sensor.imperfections);
  if (sensor.rectangular()) describe_array(object, sensor);
}

}  // namespace tangere
