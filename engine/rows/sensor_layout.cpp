// SPDX-License-Identifier: Apache-2.0
// Points are in the order of the field: entry k of the list belongs to entry k of the field.
#include "engine/rows/sensor_layout.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/error.hpp"
#include "engine/model/lateral_spread.hpp"
#include "engine/rows/camera_layout.hpp"
#include "engine/scene/imperfection_checks.hpp"

namespace tangere {
namespace {

std::vector<double> numbers(const std::array<double, 3>& vector) {
  return {vector.begin(), vector.end()};
}

/// What is known of the pictures of a sensor that has some.
Attributes picture_facts_of(const TactileDescription& d) {
  const PictureDescription& of = *d.picture;
  const std::array<double, 2> size = shown_size(of, d.array.rows, d.array.cols, pitches(d.array));
  return {{"gel", of.gel->name},
          {"gel_checksum", fmt::format("{:016x}", of.gel->checksum)},
          {"pixel_size", std::vector<double>{size[0] / of.rows, size[1] / of.cols}},
          {"mirror", std::int64_t{of.mirror ? 1 : 0}},
          {"noise", of.noise},
          {"gain", of.gain}};
}

/// What is known of the channels of a sensor that has some.
Attributes channel_facts_of(const TactileDescription& d) {
  const ChannelsDescription& of = *d.channels;
  return {{"units", of.map->unit},
          {"names", of.map->names},
          {"map", of.map->name},
          {"map_checksum", fmt::format("{:016x}", of.map->checksum)},
          {"noise", of.noise},
          {"bias", of.bias},
          {"gain", of.gain},
          {"drift", of.drift},
          {"saturation", of.saturation},
          {"quantisation", of.quantisation}};
}

}  // namespace

std::array<double, 2> SensorLayout::pitch() const {
  double along0 = 0, along1 = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    along0 += (corner1[k] - corner0[k]) * axis0[k];
    along1 += (corner1[k] - corner0[k]) * axis1[k];
  }
  return {rows > 1 ? along0 / (rows - 1) : 0.0, cols > 1 ? along1 / (cols - 1) : 0.0};
}

SensorLayout sensor_layout(const SensorInfo& info, const TactileDescription& description,
                           int every) {
  SensorLayout layout;
  layout.name = info.name;
  layout.body = info.body;
  layout.rows = info.rows;
  layout.cols = info.cols;
  layout.points = info.points;
  layout.every = every;
  layout.pressure_sign = info.pressure_sign;
  layout.corner0 = description.array.corner0;
  layout.corner1 = description.array.corner1;
  layout.axis0 = description.array.axis0;
  layout.axis1 = description.array.axis1;
  layout.imperfections = text_of(description.imperfections);
  layout.list = description.points;
  layout.picture = info.picture;
  if (description.picture) layout.picture_facts = picture_facts_of(description);
  layout.channels = info.channels;
  if (description.channels) layout.channel_facts = channel_facts_of(description);
  return layout;
}

void check_sensor_name(const std::string& name) {
  if (name.empty() || name == "." || name.find('/') != std::string::npos)
    throw InputError(fmt::format(
        "sensor '{}': a dataset cannot have this name; expected one without '/'", name));
}

std::vector<std::uint64_t> reading_shape(const SensorLayout& sensor, FieldForm form) {
  SensorInfo info;
  info.rows = sensor.rows, info.cols = sensor.cols, info.points = sensor.points;
  info.picture = sensor.picture;
  info.channels = sensor.channels;
  const std::vector<std::size_t> shape = reading_shape(info, form);
  return {shape.begin(), shape.end()};
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
    case FieldForm::surface:
      return "displacement of the surface along axis0, axis1 and out of the layer";
    case FieldForm::flow: return across + ", over their largest length in this reading";
    case FieldForm::channels: return "what the hardware returns, channel by channel";
    case FieldForm::height: return "height of the gel's surface towards the camera";
    case FieldForm::rgb: return "R, G, B of the gel without printed markers, row 0 on top";
    case FieldForm::rgb_marker: return "R, G, B of the gel with printed markers, row 0 on top";
    case FieldForm::view_rgb:
    case FieldForm::view_depth:
    case FieldForm::view_ids: return view_text(form);
    case FieldForm::sum: break;
  }
  return "force x y z on the body [N], then x y z of its centre of pressure [m]; body axes";
}

std::string unit_text(const SensorLayout& sensor, FieldForm form) {
  for (const RunAttribute& attribute : reading_attributes(sensor, form))
    if (const auto* const text = std::get_if<std::string>(&attribute.value);
        text != nullptr && attribute.name == "units")
      return *text;
  return "";
}

Attributes reading_attributes(const SensorLayout& s, FieldForm form) {
  if (is_picture(form)) {
    Attributes list{{"units", std::string(is_colour(form) ? "grey levels" : "m")},
                    {"body", s.body},
                    {"components", components_text(s, form)}};
    list.insert(list.end(), s.picture_facts.begin(), s.picture_facts.end());
    return list;
  }
  if (form == FieldForm::channels) {
    Attributes list{{"body", s.body}, {"components", components_text(s, form)}};
    list.insert(list.end(), s.channel_facts.begin(), s.channel_facts.end());
    return list;
  }
  Attributes list{
      {"units", form == FieldForm::sum    ? "N, N, N, m, m, m"
                : is_displacement(form)   ? "m"
                : form == FieldForm::flow ? "1"
                                          : "N"},
      {"body", s.body},
      {"pressure_sign", std::int64_t{s.pressure_sign}},
      {"components", components_text(s, form)},
      {"frame", form == FieldForm::sum ? "the body's"
                : s.rectangular()      ? "axis0, axis1 of the sensor, in the body's axes"
                                       : "axis0, axis1, normal of each point, in the body's axes"}};
  if (!s.imperfections.empty())
    list.push_back({"imperfections", is_ideal(form) ? "none" : s.imperfections});
  if (!s.rectangular()) return list;
  list.push_back({"resolution", std::vector<std::int64_t>{s.rows, s.cols}});
  list.push_back({"corner0", numbers(s.corner0)});
  list.push_back({"corner1", numbers(s.corner1)});
  list.push_back({"axis0", numbers(s.axis0)});
  list.push_back({"axis1", numbers(s.axis1)});
  return list;
}

std::vector<Table> point_tables(const SensorLayout& s, const std::string& group) {
  if (s.rectangular()) return {};
  std::vector<Table> tables;
  const auto rows = static_cast<std::int64_t>(s.list.size());
  const auto add = [&](const char* name, Vector3 TactilePoint::*member, const char* units) {
    std::vector<double> all;
    for (const TactilePoint& p : s.list)
      all.insert(all.end(), (p.*member).begin(), (p.*member).end());
    tables.push_back(
        {{.name = group + name, .shape = {3}, .rows = rows, .units = {units}, .frame = "body"},
         std::move(all)});
  };
  add("position", &TactilePoint::position, "m");
  add("normal", &TactilePoint::normal, "1");
  add("axis0", &TactilePoint::axis0, "1");
  add("axis1", &TactilePoint::axis1, "1");
  std::vector<std::int64_t> pixels;
  for (const TactilePoint& p : s.list) pixels.insert(pixels.end(), {p.pixel[0], p.pixel[1]});
  if (std::any_of(s.list.begin(), s.list.end(),
                  [](const TactilePoint& p) { return p.pixel[0] >= 0; }))
    tables.push_back({{.name = group + "pixel",
                       .type = NumberType::int64,
                       .shape = {2},
                       .rows = rows,
                       .meaning = "row and column of the point in an image; -1: none"},
                      std::move(pixels)});
  return tables;
}

}  // namespace tangere
