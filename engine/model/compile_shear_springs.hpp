// SPDX-License-Identifier: Apache-2.0
// Finds contacts and sensors with shear springs (k_s > 0) and numbers their points.
#pragma once

#include "kernels/step/model_view.hpp"

namespace tangere {

struct CompiledModel;

/// Fills CompiledModel::shear_springs from the contacts and sensors whose k_s is not zero or
/// varies. Call it last: it reads all other members.
void compile_shear_springs(CompiledModel& model);

/// Returns a frame whose third axis is the normal.
kernels::Frame<double> ground_frame(const kernels::Vec3<double>& point,
                                    const kernels::Vec3<double>& normal);

}  // namespace tangere
