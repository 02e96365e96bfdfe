// SPDX-License-Identifier: Apache-2.0
// Reads the field of a sensor with a coupled layer: the fields of its springs, then the layer.
#pragma once

#include "engine/sense/elastic_field.hpp"
#include "engine/sense/layered_field.hpp"

namespace tangere {

/// Owns the scratch of one thread.
class LayerReading {
 public:
  /// Computes the ideal field, (points, 3) [N], of one environment after PadReader::find_touches().
  /// `friction`: else without it.
  void read(PadReader& reader, ElasticField& elastic, const Batch& batch, int environment,
            const CompiledSensor& sensor, bool friction, std::span<double> field);
  /// Pulls the cotangent of that field back. Valid until the next call. `touches`: (targets) out.
  LayeredField::Cotangents& pull_back(std::span<const double> field_bar, bool sizes,
                                      std::span<kernels::TouchCotangent<double>> touches);

 private:
  LayeredField layered_;
  LayeredField::Cotangents bar_;
  std::vector<double> whole_, normal_, whole_bar_, normal_bar_;  // (points, 3) of the springs
  std::vector<kernels::Touch<double>> frictionless_;
};

}  // namespace tangere
