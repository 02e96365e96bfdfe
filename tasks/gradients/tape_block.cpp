// SPDX-License-Identifier: Apache-2.0
// Runs forward with checkpoints, then back segment by segment. Each segment is run again onto the
// tapes unless it is the only one.
#include "tasks/gradients/tape_block.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/base/as_size.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {

using kernels::kBlock;

double checkpoint_bytes(const Model& model, std::int64_t all, std::int64_t n) {
  if (n == all) return 0;
  return double(model.state_bytes_per_environment()) * kBlock * std::ceil(double(all) / double(n));
}

std::int64_t units_on_tape(const Model& model, std::int64_t all, double one, double most,
                           const std::function<double(std::int64_t)>& bytes_with,
                           const char* units) {
  if (bytes_with(all) <= most) return all;
  const double checkpoint = double(model.state_bytes_per_environment()) * kBlock;
  const auto best =
      std::clamp<std::int64_t>(std::llround(std::sqrt(double(all) * checkpoint / one)), 1, all);
  const double needed = bytes_with(best);
  if (needed > most)
    throw InputError(fmt::format("tapes of {:.0f} bytes for {} {}; expected at least {:.0f}", most,
                                 all, units, needed));
  return best;
}

TapeBlock::TapeBlock(const Model& model, const TapeOptions& options, int losses,
                     const TapePlan& plan)
    : model_(model),
      adjoint_(model, options.stepper, {losses, options.parameters, options.points}),
      pullback_(model),
      parameters_(model),
      plan_(plan) {
  const Integrator scheme = integrator_in_force(model, options.stepper);
  for (std::int64_t k = 0; k < plan.segment; ++k) tapes_.emplace_back(model, scheme, plan.steps);
}

void TapeBlock::begin(std::stop_token stop) {
  stop_ = std::move(stop);
  newton_iterations_ = recomputed_steps_ = 0;
  stopped_ = false;
}

bool TapeBlock::may_go_on() {
  stopped_ = stopped_ || stop_.stop_requested();
  return !stopped_;
}

void TapeBlock::start_forward(bool record) {
  recording_ = record;
  checkpoints_.clear();
  taken_ = left_ = 0;
}

void TapeBlock::take_tape(Batch& batch, int block) {
  if (recording_ && !plan_.whole() && taken_ % plan_.segment == 0)
    checkpoints_.push_back(batch.save_block(block));
  take_steps(taken_, recording_ && plan_.whole() ? &tapes_[as_size(taken_)] : nullptr);
  ++taken_;
}

void TapeBlock::start_back() {
  adjoint_.clear();
  left_ = taken_;
}

void TapeBlock::reverse_tape(Batch& batch, int block) {
  const std::int64_t last = left_ - 1;
  const std::int64_t first = plan_.whole() ? 0 : last / plan_.segment * plan_.segment;
  if (!plan_.whole() && (left_ == taken_ || left_ % plan_.segment == 0)) {
    batch.restore_block(block, checkpoints_[as_size(last / plan_.segment)]);
    for (std::int64_t k = first; k <= last; ++k) {
      retake_steps(k, k == first, tapes_[as_size(k - first)]);
      recomputed_steps_ += tapes_[as_size(k - first)].steps();
    }
  }
  reverse_steps(last, tapes_[as_size(last - first)]);
  left_ = last;
}

void TapeBlock::get_start(int loss, const Batch& batch, int environment, std::span<double> q,
                          std::span<double> v, std::span<double> parameters,
                          std::span<double> points) const {
  const std::size_t lane = as_size(environment % kBlock);
  BlockCotangent folded;
  const bool follows = batch.model().has_followers();
  if (follows) {
    folded = adjoint_.loss(loss);
    fold_followers(batch.model(), folded, static_cast<int>(lane), tapes_[0].state(0),
                   batch.block(environment / kBlock));
  }
  const BlockCotangent& c = follows ? folded : adjoint_.loss(loss);
  for (std::size_t i = 0; i < q.size(); ++i) q[i] = c.q[i * kBlock + lane];
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = c.v[i * kBlock + lane];
  if (!parameters.empty()) parameters_.gradient(c, batch, environment, parameters);
  std::copy_n(c.points.begin() + std::ptrdiff_t(lane * points.size()), points.size(),
              points.begin());
}

}  // namespace tangere
