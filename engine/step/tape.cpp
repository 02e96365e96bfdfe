// SPDX-License-Identifier: Apache-2.0
// States in the layout of a block: [step][row][lane].
#include "engine/step/tape.hpp"

#include <algorithm>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

using kernels::kBlock;
static_assert(sizeof(ShearEntry) == kShearEntryBytes);

int BlockTape::rows(const Model& model, Integrator integrator) {
  return model.nq() + model.nv() * (1 + integrator.scheme().inner_stages());
}

std::size_t BlockTape::bytes(const Model& model, Integrator integrator, std::int64_t steps) {
  // Upper bound of entries: all points of contacts; points of a sensor touch one body each.
  const std::size_t memory = std::size_t(compiled(model).taped_points) * sizeof(ShearEntry);
  const std::size_t past = std::size_t(compiled(model).layout.past_states) *
                           std::size_t(model.nq() + model.nv()) * sizeof(double);
  return std::size_t(steps + 2) * kBlock *
             (std::size_t(rows(model, integrator)) * sizeof(double) + memory) +
         kBlock * past;
}

BlockTape::BlockTape(const Model& model, Integrator integrator, std::int64_t steps)
    : model_(model),
      nq_(model.nq()),
      nv_(model.nv()),
      row_count_(std::size_t(rows(model, integrator))),
      states_(std::size_t(steps + 2) * row_count_ * kBlock),
      taken_(kBlock, 0),
      before_(kBlock, 0) {}

void BlockTape::copy(const Batch& batch, int block, int first_row, double* to) const {
  const double* from = batch.block(block) + first_row * kBlock;
  std::copy(from, from + (nq_ + nv_) * kBlock, to);
}

void BlockTape::start(const Batch& batch, int block) {
  const BlockLayout& layout = compiled(model_).layout;
  steps_ = 0;
  special_.clear();
  std::fill(taken_.begin(), taken_.end(), 0);
  for (int l = 0; l < kBlock; ++l) {
    const int e = block * kBlock + l;
    before_[std::size_t(l)] = e < batch.environments() ? batch.steps(e) : 0;
  }
  copy(batch, block, layout.previous_q, slot(-1));
  copy(batch, block, layout.q, slot(0));
  const double* const rows = batch.block(block);
  past_.assign(rows + layout.past * kBlock, rows + layout.rows * kBlock);
  memory_.clear();
  memory_end_.clear();
  keep_memory(batch, block);
}

void BlockTape::append(const Batch& batch, int block) {
  copy(batch, block, compiled(model_).layout.q, slot(++steps_));
  keep_memory(batch, block);
  for (int l = 0; l < kBlock; ++l) {
    const int e = block * kBlock + l;
    if (e < batch.environments() && !failed(batch.status(e)) && !batch.held(e))
      taken_[std::size_t(l)] = steps_;
  }
}

void BlockTape::keep_memory(const Batch& batch, int block) {
  if (!compiled(model_).has_shear_state()) return;
  for (int l = 0; l < kBlock; ++l) {
    if (const int e = block * kBlock + l; e < batch.environments()) {
      const ShearState& m = batch.shear_state(e);
      memory_.insert(memory_.end(), m.begin(), m.end());
    }
    memory_end_.push_back(memory_.size());
  }
}

std::span<const ShearEntry> BlockTape::memory(std::int64_t step, int lane) const {
  if (memory_end_.empty()) return {};
  const std::size_t at = std::size_t(step) * kBlock + std::size_t(lane);
  const std::size_t begin = at == 0 ? 0 : memory_end_[at - 1];
  return std::span(memory_).subspan(begin, memory_end_[at] - begin);
}

void BlockTape::show(std::int64_t step, Batch& batch, int block) const {
  std::copy_n(state(step), (nq_ + nv_) * kBlock,
              batch.block(block) + compiled(model_).layout.q * kBlock);
  for (int l = 0; l < kBlock && block * kBlock + l < batch.environments(); ++l) {
    batch.set_steps(block * kBlock + l, episode_step(step, l));
    batch.set_shear_state(block * kBlock + l, memory(step, l));
    if (!past_.empty()) show_past(step, l, batch.block(block) + l);
  }
}

/// Earlier states are on the tape, or those that the block had when it began.
void BlockTape::show_past(std::int64_t step, int lane, double* column) const {
  const BlockLayout& layout = compiled(model_).layout;
  const std::int64_t states = layout.past_states, now = episode_step(step, lane);
  for (std::int64_t ago = 1; ago <= states; ++ago) {
    const std::int64_t then = now - ago, on_tape = then - before_[std::size_t(lane)];
    const auto first = ((then % states + states) % states) * (nq_ + nv_);
    const double* const from =
        (on_tape >= 0 ? state(on_tape) : &past_[std::size_t(first) * kBlock]);
    for (int k = 0; k < nq_ + nv_; ++k)
      column[(layout.past + first + k) * kBlock] = from[k * kBlock + lane];
  }
}

double* BlockTape::next_inner() {
  if (row_count_ == std::size_t(nq_ + nv_)) return nullptr;
  return slot(steps_ + 1) + std::size_t(nq_ + nv_) * kBlock;
}

const TapedStep* BlockTape::special(std::int64_t step, int lane) const {
  const auto at =
      std::lower_bound(special_.begin(), special_.end(), step,
                       [](const TapedStep& s, std::int64_t value) { return s.step < value; });
  for (auto s = at; s != special_.end() && s->step == step; ++s)
    if (s->lane == lane) return &*s;
  return nullptr;
}

}  // namespace tangere
