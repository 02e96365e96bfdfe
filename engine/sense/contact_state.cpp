// SPDX-License-Identifier: Apache-2.0
// Counts are functions of the state alone; the active sets of the last step are not used.
#include "engine/sense/contact_state.hpp"

#include <algorithm>

#include "engine/sense/pad_reader.hpp"
#include "engine/sense/point_depths.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;

namespace {

/// -1, 0 or 1 for each dof of a lane.
std::vector<int> beyond_limits(const CompiledModel& m, const double* column) {
  std::vector<int> beyond(static_cast<std::size_t>(m.nv));
  for (const kernels::Link& link : m.links) {
    if ((link.effects & kernels::kLimit) == 0 || link.kind == kernels::JointKind::spherical)
      continue;
    for (int k = 0; k < kernels::dofs(link.kind); ++k) {
      const kernels::DofEffects& e = m.dof_effects[static_cast<std::size_t>(link.v + k)];
      const double q = column[(m.layout.q + link.q + k) * kBlock];
      beyond[static_cast<std::size_t>(link.v + k)] = q < e.low ? -1 : q > e.high ? 1 : 0;
    }
  }
  return beyond;
}

}  // namespace

struct ContactStateReader::Impl {
  Model model;
  PadReader reader;
};

ContactStateReader::ContactStateReader(const Model& model)
    : impl_(new Impl{model, PadReader(model)}) {}
ContactStateReader::~ContactStateReader() = default;
ContactStateReader::ContactStateReader(ContactStateReader&&) noexcept = default;
ContactStateReader& ContactStateReader::operator=(ContactStateReader&&) noexcept = default;

std::vector<ContactState> ContactStateReader::read(const Batch& batch, int block) {
  const CompiledModel& m = compiled(impl_->model);
  PadReader& reader = impl_->reader;
  const int lanes = std::min(kBlock, batch.environments() - block * kBlock);
  std::vector<ContactState> states;
  for (int l = 0; l < lanes; ++l) {
    const int group = l / kGroup, lane = l % kGroup;
    if (lane == 0) reader.move(batch, block, group);
    ContactState& state = states.emplace_back();
    for (const kernels::PairContact& pair : m.pairs)
      state.touching.push_back(pair_depths(pair, reader, group, lane, batch.block(block)).touching);
    for (const kernels::GroundContact& ground : m.grounds)
      state.touching.push_back(ground_depths(ground, m.view, reader, group, lane).touching);
    state.beyond = beyond_limits(m, batch.block(block) + l);
  }
  return states;
}

}  // namespace tangere
