// SPDX-License-Identifier: Apache-2.0
// The kernels' formulas (kernels/step/loops.hpp) in doubles.
#include "engine/sense/loop_readings.hpp"

#include <fmt/format.h>

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/sense/pad_reader.hpp"
#include "engine/step/batch.hpp"
#include "kernels/step/loops.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;

namespace {

double length(const kernels::Vec3<double>& a) { return std::sqrt(dot(a, a)); }

}  // namespace

std::vector<LoopReading> loop_readings(const Model& model, const Batch& batch, int environment) {
  if (environment < 0 || environment >= batch.environments())
    throw InputError(
        fmt::format("environment {}; expected 0 to {}", environment, batch.environments() - 1));
  const CompiledModel& m = compiled(model);
  const int lane = environment % kGroup, group = environment % kBlock / kGroup;
  PadReader reader(model);
  reader.move(batch, environment / kBlock, group);
  const double* const block = batch.block(environment / kBlock) + environment % kBlock;
  const auto number = [&](const kernels::Parameter& p) {
    return p.row < 0 ? p.value : block[p.row * kBlock];
  };
  std::vector<LoopReading> out;
  for (const kernels::Loop& loop : m.loops) {
    const kernels::LinkPose<double> one = reader.link(loop.link1, group, lane),
                                    two = reader.link(loop.link2, group, lane);
    const kernels::Frame<double> second = relative(one.world, two.world);
    const kernels::Vec6<double> W = motion_to_parent(second, two.V) - one.V;
    const kernels::LoopState<double> s = kernels::loop_state(loop, second, W);
    LoopReading r;
    r.gap = length(s.gap);
    r.force = length(number(loop.stiffness) * s.gap + number(loop.damping) * s.u);
    if (loop.weld) {
      r.turn = length(s.turned.phi);
      r.torque = length(number(loop.turning_stiffness) * s.turned.phi +
                        number(loop.turning_damping) * W.a);
    }
    out.push_back(r);
  }
  return out;
}

std::vector<std::string> open_loops(const Model& model) {
  constexpr double kGap = 1e-3, kTurn = 1e-2;
  std::vector<std::string> found;
  if (!model.has_loops()) return found;
  const std::vector<LoopReading> loops = loop_readings(model, Batch(model, 1, 0), 0);
  for (std::size_t k = 0; k < loops.size(); ++k) {
    if (loops[k].gap <= kGap && loops[k].turn <= kTurn) continue;
    found.push_back(fmt::format(
        "loop '{}' starts open by {:.3g} m{}, and the first steps pull it shut; expected a start "
        "in which it is closed",
        model.scene().loops[k].name, loops[k].gap,
        loops[k].turn > 0 ? fmt::format(" and {:.3g} rad", loops[k].turn) : ""));
  }
  return found;
}

}  // namespace tangere
