// SPDX-License-Identifier: Apache-2.0
// A step is audited under its own controls at both ends, so that a target that jumps between steps
// is work of the motor.
#include "tasks/run/energy_balance_recorder.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/as_size.hpp"

namespace tangere {
namespace {

constexpr std::size_t kEnergies = 3, kMomenta = 6, kPassed = 3;

}  // namespace

EnergyBalanceRecorder::EnergyBalanceRecorder(const Batch& batch, double h)
    : batch_(batch), h_(h), auditor_(batch.model()) {
  const std::size_t e = as_size(batch.environments());
  before_.resize(e);
  sums_.resize(e);
  energy_.resize(e * kEnergies);
  momentum_.resize(e * kMomenta);
  passed_.resize(e * kPassed);
}

double EnergyBalanceRecorder::bytes(int environments) {
  return environments * double(sizeof(EnergyBalance) + sizeof(Sums) +
                               (kEnergies + kMomenta + kPassed) * sizeof(double));
}

EnergyBalance EnergyBalanceRecorder::audit(int environment, std::span<const double> u) {
  const std::size_t nu = as_size(batch_.model().nu());
  return auditor_.read(batch_, environment, u.subspan(as_size(environment) * nu, nu));
}

void EnergyBalanceRecorder::set_row(int environment, const EnergyBalance& audit) {
  const std::size_t e = as_size(environment);
  const double energy[] = {audit.kinetic, audit.potential, audit.elastic};
  std::copy_n(energy, kEnergies, &energy_[e * kEnergies]);
  std::copy_n(audit.momentum.begin(), kMomenta, &momentum_[e * kMomenta]);
  sums_[e].most = std::max(sums_[e].most, audit.kinetic + audit.elastic);
}

void EnergyBalanceRecorder::start() {
  const std::vector<double> none(as_size(batch_.environments()) * as_size(batch_.model().nu()));
  for (int e = 0; e < batch_.environments(); ++e) set_row(e, audit(e, none));
}

void EnergyBalanceRecorder::before(std::span<const double> u) {
  for (int e = 0; e < batch_.environments(); ++e) before_[as_size(e)] = audit(e, u);
}

void EnergyBalanceRecorder::after(std::span<const double> u, const StepTally& tally) {
  for (int e = 0; e < batch_.environments(); ++e) {
    const std::size_t i = as_size(e);
    StepEnergyBalance passed;
    if (tally.steps(batch_, e) && !failed(batch_.status(e))) {
      const EnergyBalance now = audit(e, u);
      passed = between(before_[i], now, h_);
      set_row(e, now);
    }
    passed_[i * kPassed] = passed.motor_work;
    passed_[i * kPassed + 1] = passed.dissipated;
    passed_[i * kPassed + 2] = passed.integrator_error;
    Sums& sums = sums_[i];
    sums.motors += passed.motor_work;
    sums.work += std::abs(passed.motor_work);
    sums.taken += passed.dissipated;
    sums.made += passed.integrator_error;
  }
}

EnergyBalanceSummary EnergyBalanceRecorder::summary() const {
  EnergyBalanceSummary all;
  for (std::size_t e = 0; e < sums_.size(); ++e) {
    const Sums& sums = sums_[e];
    all.motors += sums.motors;
    all.taken += sums.taken;
    all.made += sums.made;
    const double had = std::max({sums.most, sums.work, sums.taken}),
                 share = had > 0 ? std::abs(sums.made) / had : 0;
    if (share <= all.worst_share) continue;
    all.worst_share = share;
    all.worst_environment = static_cast<int>(e);
  }
  return all;
}

}  // namespace tangere
