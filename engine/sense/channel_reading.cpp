// SPDX-License-Identifier: Apache-2.0
// Sums run over points, loads and pairs in order.
#include "engine/sense/channel_reading.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/lateral_spread.hpp"
#include "engine/model/random_run.hpp"

namespace tangere {
namespace {

/// Rounds ties to even, as readings of points are rounded.
double rounded_to(double step, double x) { return step * std::nearbyint(x / step); }

}  // namespace

ChannelReading::ChannelReading(const Model& model, int sensor) {
  const TactileDescription& d = model.scene().sensors[std::size_t(sensor)];
  if (!d.channels)
    throw InputError(d.source.prefix() + "sensor '" + d.name +
                     "' has no <channels>; expected them in its <tactile>");
  const SensorInfo& info = model.sensors()[std::size_t(sensor)];
  flaws_ = *d.channels;
  map_ = d.channels->map;
  weights_ = has_grid(d) ? node_weights(*map_, d.array.rows, d.array.cols)
                         : node_weights(*map_, 1, info.points);
  pressure_sign_ = info.pressure_sign;
  name_bits_ = compiled(model).sensors[std::size_t(sensor)].name_bits;
}

void ChannelReading::evaluate(std::span<const double> field, std::span<double> channels) const {
  thread_local std::vector<double> x;
  const std::size_t n = map_->loads();
  x.resize(n);
  node_loads(*map_, weights_, pressure_sign_, field, x);
  for (std::size_t c = 0; c < channels.size(); ++c) {
    double y = map_->offset[c];
    const double* const linear = &map_->linear[c * n];
    for (std::size_t k = 0; k < n; ++k) y += linear[k] * x[k];
    if (!map_->quadratic.empty()) {
      const double* pair = &map_->quadratic[c * map_->pairs()];
      for (std::size_t k = 0; k < n; ++k)
        for (std::size_t l = k; l < n; ++l) y += *pair++ * x[k] * x[l];
    }
    channels[c] = y;
  }
}

void ChannelReading::pull_back(std::span<const double> field, std::span<const double> channels_bar,
                               std::span<double> field_bar) const {
  thread_local std::vector<double> x, x_bar;
  const std::size_t n = map_->loads(), each = map_->shear ? 3 : 1;
  x.resize(n);
  x_bar.assign(n, 0.0);
  node_loads(*map_, weights_, pressure_sign_, field, x);
  for (std::size_t c = 0; c < channels_bar.size(); ++c) {
    const double bar = channels_bar[c];
    if (bar == 0) continue;
    const double* const linear = &map_->linear[c * n];
    for (std::size_t k = 0; k < n; ++k) x_bar[k] += bar * linear[k];
    if (map_->quadratic.empty()) continue;
    const double* pair = &map_->quadratic[c * map_->pairs()];
    for (std::size_t k = 0; k < n; ++k)
      for (std::size_t l = k; l < n; ++l, ++pair) {
        x_bar[k] += bar * *pair * x[l];
        x_bar[l] += bar * *pair * x[k];
      }
  }
  for (std::size_t i = 0; i < weights_.size(); ++i)
    for (std::size_t s = 0; s < 4; ++s) {
      const double weight = weights_[i].weight[s];
      const double* const bar = &x_bar[each * std::size_t(weights_[i].node[s])];
      for (std::size_t k = 0; k + 1 < each; ++k) field_bar[3 * i + k] += weight * bar[k];
      field_bar[3 * i + 2] += weight * pressure_sign_ * bar[each - 1];
    }
}

void ChannelReading::apply_flaws(const ReadingKey& key, double time,
                                 std::span<double> channels) const {
  if (flaws_.perfect()) return;
  thread_local RandomWords words;
  thread_local RandomNormals step_normals, episode_normals;
  const double limit =
      flaws_.quantisation == 0
          ? flaws_.saturation
          : flaws_.quantisation * std::floor(flaws_.saturation / flaws_.quantisation * (1 + 1e-12));
  for (std::size_t first = 0; first < channels.size(); first += kRandomRun) {
    const auto draw = [&](Purpose purpose, std::int64_t step, RandomNormals& to) {
      random_run(
          {key.seed ^ name_bits_, key.episode, step, purpose, static_cast<std::uint32_t>(first)},
          words);
      normal_run(words, to);
    };
    draw(Purpose::channel_noise, key.step, step_normals);
    draw(Purpose::channel_episode, 0, episode_normals);
    const std::size_t end = std::min(channels.size(), first + kRandomRun);
    for (std::size_t c = first; c < end; ++c) {
      const std::size_t l = c - first;
      double& y = channels[c];
      y = map_->offset[c] + (1 + flaws_.gain * episode_normals[0][l]) * (y - map_->offset[c]) +
          flaws_.bias * episode_normals[1][l] + flaws_.drift * episode_normals[2][l] * time +
          flaws_.noise * step_normals[0][l];
      if (limit != 0) y = std::clamp(y, -limit, limit);
      if (flaws_.quantisation != 0) y = rounded_to(flaws_.quantisation, y);
    }
  }
}

}  // namespace tangere
