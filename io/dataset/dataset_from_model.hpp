// SPDX-License-Identifier: Apache-2.0
// Turns what the engine knows of the episodes of a data set into what its files say about them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/step/stepper.hpp"
#include "io/dataset/dataset_layout.hpp"

namespace tangere {

/// What the model does not know about a data set.
struct DatasetDescription : RunOrigin {
  std::int64_t episodes = 0, steps = 0;
  int every = 1;
  std::uint64_t seed = 0;
  bool single = false;  ///< observations are float32
  PlayedBy played_by;
  std::string set_name, controls, command;
  std::int64_t shards = 0;
  std::string compression = "none";
  std::string gradients_of;
  std::vector<GradientArray> gradients;
  bool sparse = false;
  std::vector<std::string> record = {};
  std::vector<OutputTimes> record_times = {};
  std::vector<BodyObservation> bodies = {};
  std::optional<std::vector<FieldOutput>> fields = {};  ///< none: the field of every sensor
};

DatasetLayout dataset_layout_from(const Model& model, const Stepper& stepper,
                                  const DatasetDescription& run);

}  // namespace tangere
