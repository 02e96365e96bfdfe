// SPDX-License-Identifier: Apache-2.0
// Completes the layout of a data set from the model and the stepper.
#pragma once

#include "engine/step/stepper.hpp"
#include "io/dataset/dataset_layout.hpp"

namespace tangere {

/// Returns `requested` with the facts of a run of `model` by `stepper`, its bodies, sensors and tables.
DatasetLayout dataset_layout_from(const Model& model, const Stepper& stepper,
                                  const DatasetLayout& requested);

}  // namespace tangere
