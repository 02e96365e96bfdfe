// SPDX-License-Identifier: Apache-2.0
// Spans of what a loss asks for, empty ones of what it does not.
#include "tasks/gradients/loss_reading.hpp"

#include <algorithm>

namespace tangere {

LossReading::LossReading(const Model& model)
    : q_(std::size_t(model.nq())),
      v_(std::size_t(model.nv())),
      end_effectors_(3 * model.end_effectors().size()),
      q_bar_(v_.size()),
      v_bar_(v_.size()),
      u_bar_(std::size_t(model.nu())),
      end_effectors_bar_(end_effectors_.size()),
      fields_(model.sensors().size()),
      field_bars_(fields_.size()),
      field_spans_(fields_.size()) {}

double LossReading::evaluate(const RolloutLoss& loss, const Batch& batch, Readout& readout,
                             int environment, std::int64_t step, std::int64_t steps,
                             std::span<const double> u) {
  const bool reads_fields = loss.reads_fields(step),
             reads_end_effectors = loss.reads_end_effectors(step);
  batch.get_q(environment, q_);
  batch.get_v(environment, v_);
  for (auto* x : {&q_bar_, &v_bar_, &u_bar_, &end_effectors_bar_})
    std::fill(x->begin(), x->end(), 0.0);
  LossPoint at{step, steps, environment, q_, v_, u, {}, {}};
  LossCotangent out{q_bar_, v_bar_, u.empty() ? std::span<double>() : std::span(u_bar_), {}, {}};
  if (reads_end_effectors) {
    readout.end_effectors(batch, environment, end_effectors_);
    at.end_effectors = end_effectors_;
    out.end_effectors = end_effectors_bar_;
  }
  if (reads_fields) {
    for (std::size_t s = 0; s < fields_.size(); ++s) {
      field_bars_[s].assign(fields_[s]->values().size(), 0.0);
      field_spans_[s] = field_bars_[s];
    }
    at.fields = fields_;
    out.fields = field_spans_;
  }
  return loss.evaluate(at, out);
}

}  // namespace tangere
