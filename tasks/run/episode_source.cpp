// SPDX-License-Identifier: Apache-2.0
// Computes sizes of rows from their contents.
#include "tasks/run/episode_source.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "engine/scene/control_bounds.hpp"
#include "tasks/run/block_reader.hpp"

namespace tangere {
namespace {

std::size_t number_bytes(const EpisodeOptions& options) {
  return options.precision == Precision::mixed ? sizeof(float) : sizeof(double);
}

/// Bytes of a number of a channel, in a slot's buffers and in a shard.
std::size_t channel_bytes(const EpisodeChannel& channel, const EpisodeOptions& options) {
  return channel.own_bytes() > 0 ? channel.own_bytes() : number_bytes(options);
}

/// Bytes of one row of one episode in a slot's buffers.
double row_bytes(const EpisodeSource& source, const EpisodeOptions& options) {
  double bytes = static_cast<double>(source.action + (source.whole ? 1 : 0)) * sizeof(float);
  for (const EpisodeChannel& channel : source.channels)
    if (channel.requested && !channel.times.final)
      bytes += static_cast<double>(channel.width() * channel_bytes(channel, options)) /
               static_cast<double>(std::max<std::int64_t>(1, channel.times.every));
  return bytes;
}

/// Bytes of one episode's readings since the last row.
double window_bytes(const EpisodeSource& source, const EpisodeOptions& options) {
  double bytes = 0;
  for (const EpisodeChannel& channel : source.channels)
    if (channel.window > 1)
      bytes += static_cast<double>(channel.width() * channel_bytes(channel, options));
  return bytes;
}

/// Rounds down to a multiple of 64, below 64 to a power of two. Chunks of such sizes are then
/// whole.
int whole_rows(int most) {
  constexpr int kRows = 64;
  if (most >= kRows) return most / kRows * kRows;
  int rows = 1;
  while (2 * rows <= most) rows *= 2;
  return rows;
}

/// Every action is held for K steps, so the controls must not change within them. Each kind of
/// control changes at the same steps in every episode, so checking one episode is enough.
void check_held(const ControlProgram& controls, const EpisodeOptions& options,
                const std::vector<std::array<double, 2>>& bounds) {
  std::vector<double> action(bounds.size()), u(bounds.size());
  for (std::int64_t t = 0; options.every > 1 && t < options.steps; ++t) {
    std::vector<double>& now = t % options.every == 0 ? action : u;
    controls.evaluate(t, 0, now);
    for (std::size_t k = 0; k < now.size(); ++k)
      now[k] = std::clamp(now[k], bounds[k][0], bounds[k][1]);
    if (t % options.every != 0 && u != action)
      throw InputError(fmt::format(
          "the controls change at step {}, but an action is held for {} steps; expected "
          "changes at multiples of {} steps, or another --every",
          t, options.every, options.every));
  }
}

}  // namespace

bool is_taken(const EpisodeSource& source, std::size_t name, std::int64_t row) {
  return source.channels[name].requested && source.channels[name].times.at(row, source.rows);
}
std::size_t taken_before(const EpisodeSource& source, std::size_t name, std::int64_t row) {
  if (!source.channels[name].requested) return 0;
  return static_cast<std::size_t>(source.channels[name].times.before(row, source.rows));
}

EpisodeSource shape_of(const Model& model, const EpisodeOptions& options) {
  EpisodeSource s;
  s.model = &model;
  s.rows = action_rows(options);
  s.steps_per_row = options.every;
  s.action = as_size(model.nu());
  s.bounds = control_bounds(model.scene());
  s.channels = episode_channels(model, nullptr, options.record, options.every);
  return s;
}

EpisodeSource shape_of(const Task& task, const EpisodeOptions& options) {
  EpisodeSource s;
  s.model = &task.model();
  s.rows = task.spec().horizon;
  s.steps_per_row = task.spec().steps_per_action;
  s.action = task.spec().action.size();
  s.channels = episode_channels(task.model(), &task.spec(), options.record, s.steps_per_row);
  s.whole = true;
  return s;
}

EpisodeSource source_of(const Model& model, const StepperOptions& solver,
                        const ControlProgram& controls, const EpisodeOptions& options) {
  EpisodeSource s = shape_of(model, options);
  s.solver = solver;
  const double timestep = Stepper(model, solver).timestep();
  if (controls.timestep() != timestep)
    throw InputError(fmt::format("controls laid out for a timestep of {} s; the stepper's is {} s",
                                 controls.timestep(), timestep));
  check_sensor_memory(model, timestep);
  controls.check_covers(options.steps);
  check_held(controls, options, s.bounds);
  s.program = [&controls, every = options.every](const Batch&) {
    return std::make_unique<SceneProgram>(controls, every);
  };
  return s;
}

EpisodeSource source_of(const Task& task, const Policy& policy, const EpisodeOptions& options) {
  EpisodeSource s = shape_of(task, options);
  s.program = [&task, &policy, precision = options.precision](const Batch& batch) {
    const auto data = std::make_shared<EnvironmentData>(task, batch.environments());
    data->restart(batch);
    return std::make_unique<TaskProgram>(task, policy, data, precision);
  };
  return s;
}

int piece_rows(const EpisodeSource& source, const EpisodeOptions& options) {
  if (source.whole) return static_cast<int>(source.rows) + 1;
  const double fitting =
      static_cast<double>(options.piece_bytes) / (kBlockEpisodes * row_bytes(source, options));
  constexpr std::int64_t kMostRows = 1 << 20;  // an int counts rows even if they hold no numbers
  const auto rows = static_cast<int>(
      std::clamp(fitting, 1.0, static_cast<double>(std::min(source.rows + 1, kMostRows))));
  return rows <= source.rows ? whole_rows(rows) : rows;
}

double piece_bytes(const EpisodeSource& source, const EpisodeOptions& options) {
  return kBlockEpisodes *
         (row_bytes(source, options) * piece_rows(source, options) + window_bytes(source, options));
}

}  // namespace tangere
