// SPDX-License-Identifier: Apache-2.0
// Both readings and their derivatives need the fields of the springs first.
#include "engine/sense/layer_reading.hpp"

#include "engine/sense/imperfect_field.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;

void LayerReading::read(PadReader& reader, ElasticField& elastic, const Batch& batch,
                        int environment, const CompiledSensor& sensor, bool friction,
                        std::span<double> field) {
  whole_.resize(field.size());
  normal_.resize(field.size());
  const auto touched =
      reader.arguments<double>(sensor.number, environment % kBlock / kGroup, environment % kGroup);
  auto smooth = touched;
  without_friction(smooth, frictionless_);
  read_ideal(reader, sensor, smooth, normal_);
  const bool controlled = sensor.layer->load_control;
  if (!friction && !controlled)
    whole_ = normal_;
  else if (sensor.elastic)
    elastic.read(reader, batch, environment, sensor.number, whole_);
  else
    read_ideal(reader, sensor, touched, whole_);
  const PadLoads loads =
      controlled ? contacts_.read(reader, batch, environment, sensor) : PadLoads{};
  layered_.read(sensor, touched, {whole_, normal_, friction || !controlled}, field, loads);
  if (controlled && !layered_.carries()) ++loads_not_carried_;
}

LayeredField::Cotangents& LayerReading::pull_back(
    std::span<const double> field_bar, bool sizes,
    std::span<kernels::TouchCotangent<double>> touches) {
  whole_bar_.resize(field_bar.size());
  normal_bar_.resize(field_bar.size());
  bar_ = {whole_bar_, normal_bar_, touches};
  layered_.pull_back(field_bar, sizes, bar_);
  return bar_;
}

}  // namespace tangere
