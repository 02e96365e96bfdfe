// SPDX-License-Identifier: Apache-2.0
// Random numbers are drawn for 64 points at a time, and only those whose coefficient is not zero.
// Every point has one counter for its noise in a step, and one for its gain and bias in an episode.
#include "engine/sense/imperfect_field.hpp"

#include <algorithm>
#include <cmath>

#include "engine/model/random_run.hpp"
#include "engine/sense/dense_tiles.hpp"

namespace tangere {
namespace {

double of_component(const NormalAndShear& pair, int component) {
  return component == 2 ? pair.normal : pair.shear;
}

RandomKey random_key(const ReadingKey& key, std::int64_t step, Purpose purpose, int index) {
  return {key.seed, key.episode, step, purpose, static_cast<std::uint32_t>(index)};
}

/// The random numbers of up to 64 points of a sensor in one reading.
class Draws {
 public:
  Draws(const CompiledSensor& sensor, const ReadingKey& key)
      : of_(sensor.imperfections), key_(key), first_point_(sensor.first_point) {
    point_ = of_.gain != 0 || !(of_.bias == NormalAndShear{});
    noise_ = !(of_.noise == NormalAndShear{});
    if (of_.sensor_gain != 0)
      sensor_ =
          1 + normal(random_key(key, 0, Purpose::sensor_gain, sensor.number), 0, of_.sensor_gain);
  }

  /// Draws for the points from `first` on.
  void draw(int first) {
    const int index = first_point_ + first;
    if (point_) fill(random_key(key_, 0, Purpose::sensor_point, index), points_);
    if (noise_) fill(random_key(key_, key_.step, Purpose::sensor_noise, index), noises_);
    if (of_.dead != 0) random_run(random_key(key_, 0, Purpose::dead_point, index), dead_);
  }

  // Of point `at` of the 64:
  [[nodiscard]] double gain(int at) const {
    return of_.gain != 0 ? sensor_ + of_.gain * points_[3][std::size_t(at)] : sensor_;
  }
  [[nodiscard]] double added(int at, int component) const {
    const auto k = std::size_t(component), p = std::size_t(at);
    double sum = 0;
    if (point_) sum += of_component(of_.bias, component) * points_[k][p];
    if (noise_) sum += of_component(of_.noise, component) * noises_[k][p];
    return sum;
  }
  [[nodiscard]] bool dead(int at) const {
    return of_.dead != 0 && fraction_of(dead_[0][std::size_t(at)]) < of_.dead;
  }

 private:
  void fill(const RandomKey& key, RandomNormals& to) {
    random_run(key, words_);
    normal_run(words_, to);
  }

  const SensorImperfections& of_;
  ReadingKey key_;
  int first_point_;
  bool point_ = false, noise_ = false;
  double sensor_ = 1;
  RandomWords words_, dead_;
  RandomNormals points_, noises_;
};

/// Calls f(first point, one past the last) for runs of 64 points.
template <class F>
void for_runs(int points, const F& f) {
  for (int first = 0; first < points; first += kRandomRun)
    f(first, std::min(first + kRandomRun, points));
}

}  // namespace

ReadingKey key_of(const Batch& batch, int environment) {
  return {batch.seed(), batch.episode(environment), batch.steps(environment)};
}

ImperfectField::ImperfectField(const Model& model) {
  std::size_t most = 0;
  for (const CompiledSensor& s : compiled(model).sensors)
    if (s.imperfect) most = std::max(most, 3 * std::size_t(s.points()));
  before_.resize(most);
  shared_.resize(most);
}

/// y_i = Σ_j kernel[|i - j|] scale_j x_j along rows, then along columns; `back`: the transpose.
void ImperfectField::spread(const CompiledSensor& s, int components, bool back,
                            std::span<double> field) {
  if (s.imperfections.spread == 0) return;
  const int row = components * s.cols;
  const auto along = [&](const LateralSpread& of, int points, int stride, int others, auto place) {
    if (of.kernel.empty()) return;
    std::copy(field.begin(), field.end(), before_.begin());
    const int reach = static_cast<int>(of.kernel.size()) - 1;
    for (int i = 0; i < points; ++i) {
      const int low = std::max(0, i - reach), high = std::min(points - 1, i + reach);
      for (int other = 0; other < others; ++other) field[std::size_t(place(i, other))] = 0;
      for (int j = low; j <= high; ++j) {
        const double share =
            of.kernel[std::size_t(std::abs(i - j))] * of.scale[std::size_t(back ? i : j)];
        const int shift = (j - i) * stride;
        for (int other = 0; other < others; ++other) {
          const int at = place(i, other);
          field[std::size_t(at)] += share * before_[std::size_t(at + shift)];
        }
      }
    }
  };
  along(s.spread[0], s.rows, row, row, [&](int i, int other) { return i * row + other; });
  along(s.spread[1], s.cols, components, components * s.rows, [&](int i, int other) {
    return other / components * row + i * components + other % components;
  });
}

/// x += c Σ (neighbour - x) on a grid, component by component. The matrix is symmetric.
void ImperfectField::share(const CompiledSensor& s, int components, std::span<double> field) {
  const double c = s.imperfections.crosstalk;
  if (c == 0) return;
  std::copy(field.begin(), field.end(), before_.begin());
  const auto width = std::size_t(components), row = width * std::size_t(s.cols);
  const double* const from = before_.data();
  for (std::size_t i = 0; i < std::size_t(s.rows); ++i)
    for (std::size_t k = i * row; k < (i + 1) * row; ++k) {
      double sum = 0;
      if (i > 0) sum += from[k - row] - from[k];
      if (i + 1 < std::size_t(s.rows)) sum += from[k + row] - from[k];
      if (k >= i * row + width) sum += from[k - width] - from[k];
      if (k + width < (i + 1) * row) sum += from[k + width] - from[k];
      field[k] = from[k] + c * sum;
    }
}

void ImperfectField::apply(const CompiledSensor& s, const ReadingKey& key, FieldPart part,
                           std::span<double> field) {
  if (!s.imperfect) return;
  spread(s, part.count, false, field);
  share(s, part.count, field);
  const SensorImperfections& of = s.imperfections;
  Draws draws(s, key);
  for_runs(s.points(), [&](int first, int end) {
    draws.draw(first);
    for (int c = 0; c < part.count; ++c) {
      const int component = part.first + c;
      const double limit = of_component(of.saturation, component),
                   step = of_component(of.quantisation, component);
      for (int p = first; p < end; ++p) {
        double& x = field[std::size_t(p * part.count + c)];
        x = draws.gain(p - first) * x + draws.added(p - first, component);
        if (limit != 0) x = std::clamp(x, -limit, limit);
        if (step != 0) x = step * std::nearbyint(x / step);
        if (draws.dead(p - first)) x = 0;
      }
    }
  });
}

void ImperfectField::push_forward(const CompiledSensor& s, const ReadingKey& key,
                                  std::span<const double> ideal, std::span<double> change) {
  if (!s.imperfect) return;
  spread(s, 3, false, change);
  share(s, 3, change);
  scale_by_slope(s, key, ideal, change);
}

void ImperfectField::pull_back(const CompiledSensor& s, const ReadingKey& key,
                               std::span<const double> ideal, std::span<double> cotangent) {
  if (!s.imperfect) return;
  scale_by_slope(s, key, ideal, cotangent);
  share(s, 3, cotangent);
  spread(s, 3, true, cotangent);
}

/// Multiplies each number by the derivative of its reading by its field after crosstalk.
void ImperfectField::scale_by_slope(const CompiledSensor& s, const ReadingKey& key,
                                    std::span<const double> ideal, std::span<double> change) {
  const SensorImperfections& of = s.imperfections;
  const bool limited = !(of.saturation == NormalAndShear{});
  const std::span<double> shared = std::span(shared_).first(limited ? ideal.size() : 0);
  std::copy_n(ideal.begin(), shared.size(), shared.begin());
  if (limited) {
    spread(s, 3, false, shared);
    share(s, 3, shared);
  }
  Draws draws(s, key);
  for_runs(s.points(), [&](int first, int end) {
    draws.draw(first);
    for (int p = first; p < end; ++p)
      for (int c = 0; c < 3; ++c) {
        const auto k = std::size_t(3 * p + c);
        const double limit = of_component(of.saturation, c), gain = draws.gain(p - first);
        const bool flat =
            draws.dead(p - first) ||
            (limit != 0 && std::abs(gain * shared[k] + draws.added(p - first, c)) > limit);
        change[k] = flat ? 0 : gain * change[k];
      }
  });
}

void read_ideal(PadReader& reader, const CompiledSensor& sensor, int group, int lane,
                std::span<double> field) {
  auto a = reader.arguments<double>(sensor.number, group, lane);
  a.dense = field.data();
  const int count = kernels::active_kernels().tactile(a);
  clear_tiles_between<double>(sensor.tiles(), {reader.active.data(), std::size_t(count)}, 3,
                              field.data());
}

}  // namespace tangere
