// SPDX-License-Identifier: Apache-2.0
// Records the energy balance of a rollout at both ends of every step of every environment.
#pragma once

#include <vector>

#include "engine/rows/row_sink.hpp"
#include "engine/sense/energy_balance.hpp"
#include "tasks/run/energy_balance_summary.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

class EnergyBalanceRecorder {
 public:
  /// `h`: of the steps [s].
  EnergyBalanceRecorder(const Batch& batch, double h, RowSink& sink);

  /// Writes row 0.
  void start();
  /// Reads the batch before a step. `u`: (E, nu).
  void before(std::span<const double> u);
  /// Writes the row after step `step`, which was taken but not counted yet.
  void after(std::int64_t step, std::span<const double> u, const StepTally& tally);

  [[nodiscard]] EnergyBalanceSummary summary() const;
  static double bytes(int environments);

 private:
  [[nodiscard]] EnergyBalance audit(int environment, std::span<const double> u);
  void set_row(int environment, const EnergyBalance& audit);

  const Batch& batch_;
  double h_;
  RowSink& sink_;
  EnergyBalanceReader auditor_;
  std::vector<EnergyBalance> before_;               // (E)
  std::vector<double> energy_, momentum_, passed_;  // as in AuditRow
  struct Sums {
    double motors = 0, taken = 0, made = 0, work = 0, most = 0;
  };
  std::vector<Sums> sums_;  // (E)
};

}  // namespace tangere
