// SPDX-License-Identifier: Apache-2.0
// Recorded states become blocks of the model's own layout once; a sweep only restores them.
#include "tasks/effects/timed_model.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "engine/base/as_size.hpp"
#include "engine/base/error.hpp"
#include "engine/scene/scene_number.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/run/thread_time.hpp"

namespace tangere {
namespace {

using kernels::kBlock;
/// Environments that are solved together; half a block.
constexpr int kLanesOfGroup = kBlock / 2;

/// Returns where the numbers with the names `names` are among those recorded: joints without a
/// transmission, controls without their motors. `what`: "control", "coordinate" …
std::vector<std::size_t> columns_of(std::span<const std::string> names,
                                    std::span<const std::string> recorded, const char* what) {
  std::vector<std::size_t> columns;
  for (const std::string& name : names) {
    const auto at = std::find(recorded.begin(), recorded.end(), name);
    if (at == recorded.end())
      throw InputError(std::string("no ") + what + " '" + name + "' in the run that was recorded");
    columns.push_back(static_cast<std::size_t>(at - recorded.begin()));
  }
  return columns;
}

/// Returns the numbers in `columns` of environment `e`, of `width` recorded for each.
std::vector<double> numbers_at(const std::vector<double>& recorded, std::size_t e,
                               std::size_t width, const std::vector<std::size_t>& columns) {
  std::vector<double> numbers;
  for (const std::size_t column : columns) numbers.push_back(recorded[e * width + column]);
  return numbers;
}

}  // namespace

TimedModel::TimedModel(const Model& model, const RecordedStates& recorded,
                       const StepperOptions& options)
    : recorded_(recorded),
      options_(options),
      batch_(model, recorded.environments),
      stepper_(model, options),
      readout_(model),
      outputs_(requested_fields(model.scene())) {
  std::erase_if(outputs_, [](const FieldOutput& of) { return is_view(of.form); });
  const Model& run = recorded.model;
  const std::vector<std::size_t> q_columns =
                                     columns_of(model.q_names(), run.q_names(), "coordinate"),
                                 v_columns = columns_of(model.v_names(), run.v_names(), "rate"),
                                 u_columns = columns_of(model.u_names(), run.u_names(), "control");
  const std::size_t nq = as_size(run.nq()), nv = as_size(run.nv()), nu = as_size(run.nu());
  set_numbers();
  for (const RecordedInstant& at : recorded.instants) {
    std::vector<double> u;
    for (int e = 0; e < batch_.environments(); ++e) {
      const std::size_t i = as_size(e);
      const std::vector<double> q = numbers_at(at.q, i, nq, q_columns),
                                v = numbers_at(at.v, i, nv, v_columns);
      if (at.previous_q.empty())
        batch_.set_state(e, q, v);
      else
        batch_.set_state(e, q, v, numbers_at(at.previous_q, i, nq, q_columns),
                         numbers_at(at.previous_v, i, nv, v_columns));
      for (const double x : numbers_at(at.controls, i, nu, u_columns)) u.push_back(x);
    }
    starts_.emplace_back();
    for (int b = 0; b < batch_.blocks(); ++b) starts_.back().push_back(batch_.save_block(b));
    controls_.push_back(std::move(u));
  }
  const int read = std::min(int(kBlock), recorded.environments);
  sums_.resize(as_size(read));
  for (const FieldOutput of : outputs_) {
    frames_.emplace_back();
    for (int e = 0; e < read && of.form != FieldForm::sum; ++e)
      frames_.back().emplace_back(model, of.sensor, of.form);
  }
}

void TimedModel::set_numbers() {
  const Scene& own = batch_.model().scene();
  for (std::size_t k = 0; k < own.randomizations.size(); ++k) {
    const int at = static_cast<int>(k);
    const int there = randomization_of(recorded_.model.scene(), own.randomizations[k].number);
    if (!batch_.is_parameter(at) || there < 0) continue;
    for (int e = 0; e < batch_.environments(); ++e)
      batch_.set_randomized_value(e, at, recorded_.numbers[as_size(there)][as_size(e)]);
  }
}

void TimedModel::restore(int instant) {
  for (int b = 0; b < batch_.blocks(); ++b)
    batch_.restore_block(b, starts_[as_size(instant)][as_size(b)]);
  for (int e = 0; e < batch_.environments(); ++e)
    batch_.hold(e, recorded_.instants[as_size(instant)].failed[as_size(e)] != 0);
}

void TimedModel::solve_to(double tolerance) {
  if (options_.tolerance == tolerance) return;
  options_.tolerance = tolerance;
  stepper_ = Stepper(model(), options_);
}

int TimedModel::show(int instant) {
  restore(instant);
  int live = 0;
  for (int e = 0; e < batch_.environments(); ++e) live += batch_.held(e) ? 0 : 1;
  return live;
}

TimedStep TimedModel::time_step(int instant) {
  TimedStep step;
  restore(instant);
  const double start = thread_seconds();
  stepper_.step(batch_, controls_[as_size(instant)]);
  step.seconds = thread_seconds() - start;
  std::int32_t most = 0;
  int groups = 0;
  for (int e = 0; e < batch_.environments(); ++e) {
    if (!batch_.held(e)) {
      ++step.steps;
      step.passes += batch_.iterations(e);
      most = std::max(most, batch_.iterations(e));
      step.failures += failed(batch_.status(e)) ? 1 : 0;
    }
    if ((e + 1) % kLanesOfGroup != 0 && e + 1 < batch_.environments()) continue;
    groups += most > 0 ? 1 : 0;  // groups with failed environments only need no evaluations
    step.group_passes += std::exchange(most, 0);
  }
  step.seconds /= std::max(1, step.steps);
  step.passes /= std::max(1, step.steps);
  step.group_passes /= std::max(1, groups);
  return step;
}

double TimedModel::interval(std::size_t reading) const {
  const FieldOutput& of = outputs_[reading];
  if (of.times.final) return static_cast<double>(std::max<std::int64_t>(1, recorded_.steps));
  if (of.times.every > 0) return static_cast<double>(of.times.every);
  return std::max(1, model().sensors()[as_size(of.sensor)].every);
}

double TimedModel::time_reading(std::size_t reading, int instant) {
  std::vector<DenseFrame<double>>& frames = frames_[reading];
  std::array<std::span<double>, kBlock> sums;
  for (std::size_t e = 0; e < sums_.size(); ++e) sums[e] = sums_[e];
  restore(instant);
  const double start = thread_seconds();
  if (frames.empty())
    readout_.read_block(batch_, 0, outputs_[reading], std::span<const std::span<double>>(sums));
  else
    readout_.read_block(batch_, 0, std::span(frames));
  return (thread_seconds() - start) / double(sums_.size());
}

}  // namespace tangere
