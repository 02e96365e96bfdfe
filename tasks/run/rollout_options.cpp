// SPDX-License-Identifier: Apache-2.0
// A reading has times of its own, or the interval of its sensor, which the options may replace.
#include "tasks/run/rollout_options.hpp"

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "tasks/run/energy_balance_recorder.hpp"

namespace tangere {
namespace {

constexpr int kMotionWidth = 13, kEndEffectorWidth = 3;

/// Numbers of one environment in the largest reading.
std::size_t largest_reading(const Model& model, const RolloutOutputs& outputs) {
  std::size_t largest = 0;
  for (const FieldOutput output : fields_of(model, outputs))
    largest = std::max(largest, numbers_of(model, output));
  return largest;
}

std::size_t bodies_in(const Model& model, const RolloutOutputs& outputs) {
  if (!outputs.bodies) return 0;
  return outputs.chosen_bodies.empty() ? as_size(model.nb()) : outputs.chosen_bodies.size();
}

}  // namespace

std::vector<FieldOutput> fields_of(const Model& model, const RolloutOutputs& outputs) {
  if (!outputs.fields) return whole_fields(model.scene());
  check_outputs(model.scene(), *outputs.fields);
  return *outputs.fields;
}

std::vector<FieldOutput> sensor_fields_of(const Model& model, const RolloutOutputs& outputs) {
  std::vector<FieldOutput> fields = fields_of(model, outputs);
  std::erase_if(fields, [](const FieldOutput& of) { return is_view(of.form); });
  return fields;
}

int tactile_interval(const SensorInfo& sensor, const RolloutOptions& options) {
  if (options.every > 0) return options.every;
  return sensor.every > 0 ? sensor.every : 1;
}

OutputTimes reading_times(const Model& model, FieldOutput output, const RolloutOptions& options) {
  if (output.times.given()) return output.times;
  if (is_view(output.form)) return {std::max(1, options.every)};
  return {tactile_interval(model.sensors()[static_cast<std::size_t>(output.sensor)], options)};
}

/// Readings follow steps, so none is taken at row 0.
std::int64_t tactile_frames(const Model& model, FieldOutput output, const RolloutOptions& options) {
  const OutputTimes times = reading_times(model, output, options);
  return times.before(options.steps + 1, options.steps, options.first_step) -
         times.before(1, options.steps, options.first_step);
}

double rollout_bytes(const Model& model, int environments, const RolloutOutputs& outputs) {
  const double numbers =
      model.nq() + model.nv() + model.nu() +
      double{kMotionWidth} * static_cast<double>(bodies_in(model, outputs)) +
      static_cast<double>((outputs.end_effectors ? model.end_effectors().size() : 0) *
                              kEndEffectorWidth +
                          (outputs.transmissions ? model.scene().transmissions.size() : 0) +
                          largest_reading(model, outputs));
  constexpr double kFlags = sizeof(std::int32_t) + sizeof(std::int8_t);
  return environments * (numbers * sizeof(double) + kFlags) +
         (outputs.audit ? EnergyBalanceRecorder::bytes(environments) : 0);
}

}  // namespace tangere
