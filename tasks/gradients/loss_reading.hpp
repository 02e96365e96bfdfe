// SPDX-License-Identifier: Apache-2.0
// A loss at one environment's state: what it looks at, and room for its derivatives.
#pragma once

#include <vector>

#include "engine/derivative/loss.hpp"
#include "engine/sense/readout.hpp"

namespace tangere {

/// Made once, used for state after state.
class LossReading {
 public:
  explicit LossReading(const Model& model);

  /// Of a sensor, already read where the loss reads fields; it must live until evaluate() is done.
  void set_field(std::size_t sensor, const CompactFrame<double>& frame) {
    fields_[sensor] = &frame;
  }
  /// Reads the rest and evaluates. `u`: of the step that follows; empty after the last.
  double evaluate(const RolloutLoss& loss, const Batch& batch, Readout& readout, int environment,
                  std::int64_t step, std::int64_t steps, std::span<const double> u);

  // Derivatives of the loss evaluated last; of end effectors and fields if it reads them.
  [[nodiscard]] std::span<const double> q_bar() const { return q_bar_; }
  [[nodiscard]] std::span<const double> v_bar() const { return v_bar_; }
  [[nodiscard]] std::span<const double> u_bar() const {
    return u_bar_;
  }  ///< zeros after the last step
  [[nodiscard]] std::span<const double> end_effectors_bar() const { return end_effectors_bar_; }
  [[nodiscard]] std::span<const double> field_bar(std::size_t sensor) const {
    return field_bars_[sensor];
  }

 private:
  std::vector<double> q_, v_, end_effectors_, q_bar_, v_bar_, u_bar_, end_effectors_bar_;
  std::vector<const CompactFrame<double>*> fields_;  // (sensors)
  std::vector<std::vector<double>> field_bars_;      // (sensors)
  std::vector<std::span<double>> field_spans_;
};

}  // namespace tangere
