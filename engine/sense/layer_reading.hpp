// SPDX-License-Identifier: Apache-2.0
// Reads the field of a sensor with a coupled layer: the fields of its springs, the loads of its
// contacts where it carries them, then the layer.
#pragma once

#include <cstdint>

#include "engine/sense/contact_loads.hpp"
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
  /// Pulls the cotangent of the loads back, after that of the field (ContactLoads::pull_back()).
  std::span<const ContactLoads::Share> pull_back_loads(bool numbers, std::span<double> memory) {
    return contacts_.pull_back(bar_.loads, numbers, memory);
  }
  /// How many readings so far were of a layer under load control that does not carry its loads.
  [[nodiscard]] std::int64_t loads_not_carried() const { return loads_not_carried_; }

 private:
  LayeredField layered_;
  ContactLoads contacts_;
  std::int64_t loads_not_carried_ = 0;
  LayeredField::Cotangents bar_;
  std::vector<double> whole_, normal_, whole_bar_, normal_bar_;  // (points, 3) of the springs
  std::vector<kernels::Touch<double>> frictionless_;
};

}  // namespace tangere
