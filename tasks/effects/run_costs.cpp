// SPDX-License-Identifier: Apache-2.0
// Outputs that <outputs> thins are weighted by their frequency.
#include "tasks/effects/run_costs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <optional>

#include "engine/base/as_size.hpp"
#include "engine/derivative/adjoint.hpp"
#include "engine/sense/energy_balance.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/tape.hpp"
#include "tasks/run/thread_time.hpp"

namespace tangere {
namespace {

constexpr double kPoseAndTwist = 13, kPlace = 3;
constexpr std::int64_t kNumber = sizeof(double);

/// How often a run of the scene takes a plain output, per step; 0: not at all.
struct Requested {
  double per_step = 1;
  std::string by;
};
Requested requested_rows(const Scene& scene, const std::string& name, std::int64_t steps) {
  const bool state = name == "q";  // simulate stores it in any case
  if (!scene.outputs) return {1, "no <outputs>: every row"};
  for (const std::string& word : scene.outputs->record) {
    const TimedName timed = split_times(word);
    if (timed.name != name && !(state && timed.name == "v")) continue;
    const std::string by = fmt::format("{}'{}'", scene.outputs->source.prefix(), word);
    if (timed.times.final) return {1.0 / double(std::max<std::int64_t>(1, steps)), by};
    return {timed.times.every > 0 ? 1.0 / double(timed.times.every) : 1.0, by};
  }
  if (state) return {1, "every row"};
  return {0, "left out by <outputs>"};
}

/// Makes one thing happen for the first block, and returns for how many environments.
using Work = std::function<int()>;

double lower_quartile_of(int rounds, const Work& work) {
  std::vector<double> times;
  work();  // warms caches
  for (int round = 0; round < rounds; ++round) {
    const double start = thread_seconds();
    const int environments = work();
    times.push_back((thread_seconds() - start) / std::max(1, environments));
  }
  const auto quarter = times.begin() + std::ptrdiff_t(times.size() / 4);
  std::nth_element(times.begin(), quarter, times.end());
  return *quarter;
}

/// Reverses one step of the first block, for one loss.
class StepBack {
 public:
  StepBack(const Model& model, const StepperOptions& options)
      : stepper_(model, options),
        adjoint_(model, options),
        tape_(model, stepper_.integrator(), 1) {}

  void take(Batch& batch, std::span<const double> controls) {
    tape_.start(batch, 0);
    stepper_.step_block(batch, 0, controls, &tape_);
  }
  int back(const Batch& batch, std::span<const double> controls) {
    adjoint_.clear();
    std::fill(adjoint_.loss(0).q.begin(), adjoint_.loss(0).q.end(), 1.0);
    std::fill(adjoint_.loss(0).v.begin(), adjoint_.loss(0).v.end(), 1.0);
    adjoint_.reverse_step(batch, 0, tape_, 0, controls);
    return std::min(batch.environments(), kBlockEnvironments);
  }
  static constexpr int kBlockEnvironments = 16;

 private:
  Stepper stepper_;
  Adjoint adjoint_;
  BlockTape tape_;
};

}  // namespace

std::vector<RunCost> measure_run_costs(TimedModel& timed, const StepTimes& times, int rounds) {
  const Model& model = timed.model();
  const Scene& scene = model.scene();
  if (!(times.whole() > 0)) return {};
  const std::size_t nq = as_size(model.nq()), nv = as_size(model.nv()), nb = as_size(model.nb()),
                    nu = as_size(model.nu());
  Readout readout(model);
  EnergyBalanceReader auditor(model);
  StepBack gradients(model, timed.options());
  std::vector<double> q(nq), v(nv), pose(7 * nb), twist(6 * nb),
      places(3 * model.end_effectors().size());

  std::vector<RunCost> costs;
  std::vector<Work> works;
  std::span<const double> controls;
  std::optional<Batch> end;
  const auto first_block = [&](const std::function<void(int)>& run_one) {
    const int count = std::min(end->environments(), StepBack::kBlockEnvironments);
    for (int e = 0; e < count; ++e) run_one(e);
    return count;
  };
  const auto add = [&](const char* name, const Requested& requested, double numbers, Work work) {
    costs.push_back({name, requested.by, requested.per_step > 0, 0, requested.per_step,
                     std::int64_t(numbers) * kNumber});
    works.push_back(std::move(work));
  };
  const auto requested = [&](const char* name) {
    return requested_rows(scene, name, timed.run_steps());
  };
  add("rows of q and v", requested("q"), double(nq + nv),
      [&] { return first_block([&](int e) { end->get_q(e, q), end->get_v(e, v); }); });
  add("rows of bodies", requested("bodies"), kPoseAndTwist * double(nb),
      [&] { return first_block([&](int e) { readout.bodies(*end, e, pose, twist); }); });
  if (!places.empty())
    add("rows of variables", requested("variables"), kPlace * double(model.end_effectors().size()),
        [&] { return first_block([&](int e) { readout.end_effectors(*end, e, places); }); });
  const Requested nobody{0, "--audit"};
  // Energies and momenta at both ends of every step, and the work in between.
  add("audit", nobody, 3 + 6 + 3, [&] {
    return first_block([&](int e) {
      auditor.read(*end, e, controls.subspan(as_size(e) * nu, nu));
      auditor.read(*end, e, controls.subspan(as_size(e) * nu, nu));
    });
  });
  const std::size_t tape =
      BlockTape::bytes(model, Stepper(model, timed.options()).integrator(), 1) -
      BlockTape::bytes(model, Stepper(model, timed.options()).integrator(), 0);
  add("gradients of a loss", {0, "--gradients: the way back"}, 0,
      [&] { return gradients.back(*end, controls); });
  costs.back().bytes = std::int64_t(tape) / StepBack::kBlockEnvironments;

  int instants = 0;
  for (int i = 0; i < timed.instants(); ++i) {
    if (timed.show(i) == 0) continue;  // every environment has failed before
    ++instants;
    controls = timed.controls(i);
    end.emplace(timed.batch());
    gradients.take(*end, controls);
    for (std::size_t k = 0; k < costs.size(); ++k)
      costs[k].seconds += lower_quartile_of(rounds, works[k]);
  }
  for (RunCost& cost : costs) {
    const double per_step = cost.on ? cost.share : 1;
    cost.seconds *= per_step / std::max(1, instants);
    cost.share = cost.seconds / times.whole();
  }
  return costs;
}

}  // namespace tangere
