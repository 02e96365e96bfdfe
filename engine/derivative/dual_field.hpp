// SPDX-License-Identifier: Apache-2.0
// Directional derivative of a tactile field in dual numbers, for sensors without shear springs.
#pragma once

#include <span>

#include "engine/model/compiled_model.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/step/link_poses.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

/// Returns pose and twist of a link; those of the world for link -1.
inline kernels::LinkPose<kernels::Dual<double>> dual_pose(
    std::span<const kernels::LinkScratch<kernels::Dual<double>>> links, int link) {
  using D = kernels::Dual<double>;
  if (link < 0) return {{kernels::diagonal(D(1.0)), kernels::zero3<D>()}, kernels::zero6<D>()};
  return {links[std::size_t(link)].world, links[std::size_t(link)].V};
}
/// Returns the size of a body in a column of a block, with its tangents among `numbers` or none.
inline kernels::Vec3<kernels::Dual<double>> dual_size(const CompiledModel& m, int number,
                                                      const double* column,
                                                      std::span<const double> numbers) {
  const CompiledBody& body = m.bodies[std::size_t(number)];
  const auto first = static_cast<std::size_t>(m.view.rows.solid(number));
  const auto tangent = [&](std::size_t k) { return numbers.empty() ? 0.0 : numbers[first + k]; };
  const kernels::Vec3<double> has =
      kernels::load_vector<double>(body.size, body.size_row, column, 0);
  return {{has.x, tangent(0)}, {has.y, tangent(1)}, {has.z, tangent(2)}};
}

/// Computes the outputs of DualStage::field(). `links`: poses and twists of all links.
/// `coefficients`: the sensor's.
void read_dual_field(const CompiledModel& m, int sensor,
                     std::span<const kernels::LinkScratch<kernels::Dual<double>>> links,
                     const Coefficients<kernels::Dual<double>>& coefficients, const double* column,
                     std::span<const double> numbers, std::span<const double> points,
                     std::span<double> field, std::span<double> field_dot);

}  // namespace tangere
