// SPDX-License-Identifier: Apache-2.0
// Random numbers are drawn for 64 points at a time, and only those whose coefficient is not zero.
// Every point has one counter for its noise in a step, and one for its gain and bias in an episode.
#include "engine/sense/imperfect_field.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/model/random_run.hpp"
#include "engine/sense/dense_tiles.hpp"
#include "engine/sense/spread_field.hpp"

namespace tangere {
namespace {

double component_of(const NormalAndShear& pair, int component) {
  return component == 2 ? pair.normal : pair.shear;
}

using Run = std::array<double, kRandomRun>;

/// The random numbers of up to 64 points of a sensor in one reading. Loops go over all 64, which
/// compilers turn into vectors.
class Draws {
 public:
  Draws(const CompiledSensor& sensor, const ReadingKey& key)
      : of_(sensor.imperfections), key_(key) {
    key_.seed ^= sensor.name_bits;
    points_ = of_.gain != 0 || !(of_.bias == NormalAndShear{});
    noises_ = !(of_.noise == NormalAndShear{});
    if (of_.sensor_gain != 0)
      sensor_ = 1 + normal(random_key(0, Purpose::sensor_gain, 0), 0, of_.sensor_gain);
    if (!points_) point_normals_ = {};
    if (!noises_) step_normals_ = {};
    alive_.fill(1);
  }

  /// Draws for the points from `first` on.
  void draw(int first) {
    if (points_) fill(random_key(0, Purpose::sensor_point, first), point_normals_);
    if (noises_) fill(random_key(key_.step, Purpose::sensor_noise, first), step_normals_);
    for (int l = 0; l < kRandomRun; ++l) gain_[l] = sensor_ + of_.gain * point_normals_[3][l];
    if (of_.dead == 0) return;
    random_run(random_key(0, Purpose::dead_point, first), words_);
    const auto deadly = static_cast<std::uint64_t>(of_.dead * 0x1p32);
    for (int l = 0; l < kRandomRun; ++l) alive_[l] = words_[0][l] < deadly ? 0 : 1;
  }

  /// Scales a component of the 64 points, and adds to it.
  void add_to(int component, Run& x) const {
    const double bias = component_of(of_.bias, component),
                 noise = component_of(of_.noise, component);
    const auto c = std::size_t(component);
    for (int l = 0; l < kRandomRun; ++l)
      x[l] = gain_[l] * x[l] + bias * point_normals_[c][l] + noise * step_normals_[c][l];
  }
  [[nodiscard]] const Run& gain() const { return gain_; }
  /// 1, or 0 for dead points.
  [[nodiscard]] const Run& alive() const { return alive_; }

 private:
  [[nodiscard]] RandomKey random_key(std::int64_t step, Purpose purpose, int point) const {
    return {key_.seed, key_.episode, step, purpose, static_cast<std::uint32_t>(point)};
  }
  void fill(const RandomKey& key, RandomNormals& to) {
    random_run(key, words_);
    normal_run(words_, to);
  }

  const SensorImperfections& of_;
  ReadingKey key_;
  bool points_ = false, noises_ = false;
  double sensor_ = 1;
  RandomWords words_;
  RandomNormals point_normals_, step_normals_;
  Run gain_, alive_;
};

/// Rounds to a whole number, ties to even, without a call: adding 1.5 2^52 leaves no digits behind
/// the point. Numbers too large for that are kept.
double rounded(double x) {
  constexpr double kShift = 0x1.8p52;
  const double whole = (x + kShift) - kShift;
  return std::abs(x) < 0x1p51 ? whole : x;
}

/// Returns the largest magnitude that a component can read [N]; 0: there is none. Of readings that
/// are rounded, it is the largest multiple that saturation allows.
double largest_reading(const SensorImperfections& of, int component) {
  const double limit = component_of(of.saturation, component),
               step = component_of(of.quantisation, component);
  return step == 0 ? limit : step * std::floor(limit / step * (1 + 1e-12));
}

/// Limits and rounds the 64 points.
void digitise(double limit, double step, const Run& alive, Run& x) {
  if (limit != 0)
    for (double& a : x) a = std::clamp(a, -limit, limit);
  if (step != 0)
    for (double& a : x) a = step * rounded(a / step);
  for (int l = 0; l < kRandomRun; ++l) x[l] = alive[l] != 0 ? x[l] : 0;
}

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

void ImperfectField::spread(const CompiledSensor& s, int components, bool back,
                            std::span<double> field) {
  if (s.imperfections.spread == 0) return;
  spread_field(s.spread, s.grid_rows, s.grid_cols, components, back, field, before_);
}

/// x += c Σ (neighbour - x) on a grid, component by component. The matrix is symmetric.
void ImperfectField::share(const CompiledSensor& s, int components, std::span<double> field) {
  const double c = s.imperfections.crosstalk;
  if (c == 0) return;
  std::copy(field.begin(), field.end(), before_.begin());
  const auto width = std::size_t(components), row = width * std::size_t(s.grid_cols);
  const double* const from = before_.data();
  for (std::size_t i = 0; i < std::size_t(s.grid_rows); ++i)
    for (std::size_t k = i * row; k < (i + 1) * row; ++k) {
      double sum = 0;
      if (i > 0) sum += from[k - row] - from[k];
      if (i + 1 < std::size_t(s.grid_rows)) sum += from[k + row] - from[k];
      if (k >= i * row + width) sum += from[k - width] - from[k];
      if (k + width < (i + 1) * row) sum += from[k + width] - from[k];
      field[k] = from[k] + c * sum;
    }
}

namespace {

/// Whether an imperfection acts on single points. Lag, spread and crosstalk do not.
bool spoils_points(const SensorImperfections& of) {
  constexpr NormalAndShear kNone{};
  return of.gain != 0 || of.sensor_gain != 0 || of.dead != 0 || !(of.bias == kNone) ||
         !(of.noise == kNone) || !(of.saturation == kNone) || !(of.quantisation == kNone);
}

/// Does what happens to each point by itself. A field has `Components` numbers for each.
template <int Components>
void spoil_points(const CompiledSensor& s, const ReadingKey& key, int first_component,
                  double* field) {
  const SensorImperfections& of = s.imperfections;
  Draws draws(s, key);
  std::array<Run, Components> x{};
  for_runs(s.points(), [&](int first, int end) {
    draws.draw(first);
    double* const from = field + Components * first;
    for (int l = 0; l < end - first; ++l)
      for (int c = 0; c < Components; ++c) x[c][l] = from[Components * l + c];
    for (int c = 0; c < Components; ++c) {
      const int component = first_component + c;
      draws.add_to(component, x[c]);
      digitise(largest_reading(of, component), component_of(of.quantisation, component),
               draws.alive(), x[c]);
    }
    for (int l = 0; l < end - first; ++l)
      for (int c = 0; c < Components; ++c) from[Components * l + c] = x[c][l];
  });
}

}  // namespace

void ImperfectField::apply(const CompiledSensor& s, const ReadingKey& key, FieldPart part,
                           std::span<double> field) {
  if (!s.imperfect) return;
  spread(s, part.count, false, field);
  share(s, part.count, field);
  if (!spoils_points(s.imperfections)) return;
  switch (part.count) {
    case 1: return spoil_points<1>(s, key, part.first, field.data());
    case 2: return spoil_points<2>(s, key, part.first, field.data());
    default: return spoil_points<3>(s, key, part.first, field.data());
  }
}

void ImperfectField::push_forward(const CompiledSensor& s, const ReadingKey& key,
                                  std::span<const double> ideal, std::span<double> change) {
  if (!s.imperfect) return;
  spread(s, 3, false, change);
  share(s, 3, change);
  scale_by_slope(s, key, {}, ideal, change);
}

void ImperfectField::pull_back(const CompiledSensor& s, const ReadingKey& key, FieldPart part,
                               std::span<const double> ideal, std::span<double> cotangent) {
  if (!s.imperfect) return;
  scale_by_slope(s, key, part, ideal, cotangent);
  share(s, part.count, cotangent);
  spread(s, part.count, true, cotangent);
}

/// Multiplies each number by the derivative of its reading by its field after crosstalk.
void ImperfectField::scale_by_slope(const CompiledSensor& s, const ReadingKey& key, FieldPart part,
                                    std::span<const double> ideal, std::span<double> change) {
  const SensorImperfections& of = s.imperfections;
  const bool limited = !(of.saturation == NormalAndShear{});
  const std::span<double> shared = std::span(shared_).first(limited ? ideal.size() : 0);
  std::copy_n(ideal.begin(), shared.size(), shared.begin());
  if (limited) {
    spread(s, part.count, false, shared);
    share(s, part.count, shared);
  }
  Draws draws(s, key);
  Run x{};
  for_runs(s.points(), [&](int first, int end) {
    draws.draw(first);
    for (int c = 0; c < part.count; ++c) {
      const auto k = std::size_t(part.count * first + c);
      const auto at = [&](int l) { return k + std::size_t(part.count * l); };
      const double limit = largest_reading(of, part.first + c);
      for (int l = 0; l < end - first && limit != 0; ++l) x[l] = shared[at(l)];
      if (limit != 0) draws.add_to(part.first + c, x);
      for (int l = 0; l < end - first; ++l) {
        const bool flat = draws.alive()[l] == 0 || (limit != 0 && std::abs(x[l]) > limit);
        double& changes = change[at(l)];
        changes = flat ? 0 : draws.gain()[l] * changes;
      }
    }
  });
}

void check_has_no_lag(const Model& model, int sensor) {
  const SensorInfo& info = model.sensors()[std::size_t(sensor)];
  if (info.past_states == 0) return;
  const std::string where =
      model.scene().sensors[std::size_t(sensor)].imperfections.source.prefix();
  throw InputError(where + "derivatives of sensor '" + info.name +
                   "', which has low_pass, hysteresis or delay; expected a sensor without them");
}

void read_ideal(PadReader& reader, const CompiledSensor& sensor,
                kernels::TactileArgs<double> arguments, std::span<double> field) {
  arguments.dense = field.data();
  const int count = kernels::active_kernels().tactile(arguments);
  clear_tiles_between<double>(sensor.tiles(), {reader.active.data(), std::size_t(count)}, 3,
                              field.data());
}

}  // namespace tangere
