// SPDX-License-Identifier: Apache-2.0
// Which contacts remember, and where their points are kept.
#pragma once

#include "kernels/step/model_view.hpp"

namespace tangere {

struct CompiledModel;

/// Fills CompiledModel::memories from the contacts and sensors whose k_s is not zero or varies.
/// Everything else of the model is compiled.
void compile_shear_springs(CompiledModel& model);

/// Returns a frame whose third axis is the normal.
kernels::Frame<double> ground_frame(const kernels::Vec3<double>& point,
                                    const kernels::Vec3<double>& normal);

}  // namespace tangere
