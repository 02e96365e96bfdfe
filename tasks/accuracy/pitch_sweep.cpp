// SPDX-License-Identifier: Apache-2.0
// Fields do not act on the motion, so pads of all pitches read one run. A point's force is linear
// in (kn, kt, damping), so instead of scaling coefficients with the area of a point, the sum over a
// pad is multiplied by that area divided by the scene's.
#include "tasks/accuracy/pitch_sweep.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "engine/base/as_size.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/accuracy/quantiles.hpp"
#include "tasks/run/block_reader.hpp"
#include "tasks/run/thread_time.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

/// Pitches over the scene's. The last that fits is the reference.
constexpr std::array kFactors = {8.0, 4.0, 2.0, 1.0, 0.5, 0.25};
constexpr std::int64_t kMostPoints = 1'000'000;

std::string reason_against_sweep(const TactileDescription& sensor) {
  if (!sensor.points.empty()) return "its points are a list, which has no pitch";
  if (sensor.array.rows * sensor.array.cols == 1) return "it has one point";
  if (sensor.coefficients.ks > 0)
    return "it has ks, so a reading depends on the shear state as well";
  return {};
}

int points_along(int points, double factor) {
  if (points == 1) return 1;
  return std::max(2, static_cast<int>(std::round(points / factor)));
}

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Way from a point to the next along an axis [m], signed; 0 where there is one point.
double step_along(const RectArray& a, const Vector3& axis, int points) {
  const Vector3 way = {a.corner1[0] - a.corner0[0], a.corner1[1] - a.corner0[1],
                       a.corner1[2] - a.corner0[2]};
  return points > 1 ? dot(way, axis) / (points - 1) : 0;
}

std::array<double, 2> pitch_of(const RectArray& a) {
  return {std::abs(step_along(a, a.axis0, a.rows)), std::abs(step_along(a, a.axis1, a.cols))};
}

/// The array of points that covers the same area, each point with a cell around it.
RectArray recut(const RectArray& a, double factor) {
  RectArray to = a;
  to.rows = points_along(a.rows, factor);
  to.cols = points_along(a.cols, factor);
  const double before[2] = {step_along(a, a.axis0, a.rows), step_along(a, a.axis1, a.cols)};
  const double step[2] = {before[0] * a.rows / to.rows, before[1] * a.cols / to.cols};
  for (std::size_t k = 0; k < 3; ++k) {
    to.corner0[k] += 0.5 * (step[0] - before[0]) * a.axis0[k];
    to.corner0[k] += 0.5 * (step[1] - before[1]) * a.axis1[k];
    to.corner1[k] =
        to.corner0[k] + (to.rows - 1) * step[0] * a.axis0[k] + (to.cols - 1) * step[1] * a.axis1[k];
  }
  return to;
}

/// The scene with pads of another pitch, without what changes a field afterwards.
Scene with_pitch(Scene scene, double factor) {
  scene.outputs.reset();
  for (TactileDescription& sensor : scene.sensors) {
    sensor.imperfections = {};
    sensor.markers.reset();
    if (reason_against_sweep(sensor).empty()) sensor.array = recut(sensor.array, factor);
  }
  return scene;
}

/// All sensors at one pitch, and their readings.
class Rung {
 public:
  Rung(const Batch& start, double factor)
      : factor_(factor),
        model_(with_pitch(start.model().scene(), factor)),
        batch_(model_, start.environments(), start.seed()),
        readout_(model_) {
    const std::size_t sensors = model_.sensors().size();
    const std::size_t numbers = sensors * as_size(start.environments());
    frames_.resize(sensors);
    sums_.resize(sensors * kBlock);
    read_seconds_.resize(sensors);
    for (std::vector<double>* sum : {&square_, &distance_, &strayed_}) sum->resize(numbers);
    for (int e = 0; e < start.environments(); ++e) {
      batch_.reset(e, start.episode(e));
      for (std::size_t k = 0; k < model_.scene().randomizations.size(); ++k)
        if (batch_.is_parameter(static_cast<int>(k)))
          batch_.set_randomized_value(e, static_cast<int>(k),
                                      start.randomized_value(e, static_cast<int>(k)));
    }
    for (std::size_t s = 0; s < sensors; ++s) {
      const std::array<double, 2> here = pitch(s),
                                  there = pitch_of(start.model().scene().sensors[s].array);
      area_.push_back(1);
      for (std::size_t k = 0; k < 2; ++k)
        if (here[k] > 0) area_.back() *= here[k] / there[k];
    }
  }

  [[nodiscard]] double factor() const { return factor_; }
  [[nodiscard]] const RectArray& array(std::size_t s) const {
    return model_.scene().sensors[s].array;
  }
  [[nodiscard]] std::array<double, 2> pitch(std::size_t s) const { return pitch_of(array(s)); }
  [[nodiscard]] double read_seconds(std::size_t s) const { return read_seconds_[s]; }

  /// Reads all sensors at the states of a block: as fields, which is timed, and as sums.
  void read_sensors(const Batch& at, int block, std::size_t s) {
    const int first = block * kBlock, lanes = lanes_of(at, block);
    std::vector<double> q(as_size(model_.nq())), v(as_size(model_.nv()));
    for (int e = first; e < first + lanes; ++e) {
      at.get_q(e, q);
      at.get_v(e, v);
      batch_.set_state(e, q, v);
    }
    std::vector<CompactFrame<double>>& frames = frames_[s];
    while (frames.size() < as_size(kBlock)) frames.emplace_back(model_, static_cast<int>(s));
    const double begin = thread_seconds();
    readout_.read_block(batch_, block, std::span(frames));
    read_seconds_[s] += thread_seconds() - begin;
    read_field<double>(readout_, batch_, block, {static_cast<int>(s), FieldForm::sum},
                       [&](int e) { return std::span<double>(sum(s, e)); });
    for (int e = first; e < first + lanes; ++e)
      for (std::size_t k = 0; k < 3; ++k) sum(s, e)[k] *= area_[s];
  }

  /// Adds how far a sample is from the finest pad's. A pad that misses a contact has no centre.
  void compare(const Rung& finest, std::size_t s, int e) {
    const FieldSum &here = sum(s, e), &there = finest.sum(s, e);
    double square = 0, distance = 0, strayed = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      square += there[k] * there[k];
      distance += (here[k] - there[k]) * (here[k] - there[k]);
      strayed += (here[3 + k] - there[3 + k]) * (here[3 + k] - there[3 + k]);
    }
    const bool loaded = here[0] != 0 || here[1] != 0 || here[2] != 0;
    square_[index(s, e)] += square;
    distance_[index(s, e)] += distance;
    if (loaded) strayed_[index(s, e)] += square * strayed;
  }

  /// Fills in the errors of a sensor. Environments without a force do not count.
  void set_errors(std::size_t s, PitchPoint& point) const {
    std::vector<double> force, centre;
    for (std::size_t i = index(s, 0); i < index(s + 1, 0); ++i) {
      if (!(square_[i] > 0)) continue;
      force.push_back(std::sqrt(distance_[i] / square_[i]));
      centre.push_back(std::sqrt(strayed_[i] / square_[i]));
    }
    point.force_error = quantile(force, 0.95);
    point.force_bound = sure_quantile(force, 0.95);
    point.centre_error = quantile(centre, 0.95);
  }

 private:
  [[nodiscard]] std::size_t index(std::size_t s, int e) const {
    return s * as_size(batch_.environments()) + as_size(e);
  }
  [[nodiscard]] FieldSum& sum(std::size_t s, int e) {
    return sums_[s * kBlock + as_size(e % kBlock)];
  }
  [[nodiscard]] const FieldSum& sum(std::size_t s, int e) const {
    return sums_[s * kBlock + as_size(e % kBlock)];
  }

  double factor_;
  Model model_;
  Batch batch_;
  Readout readout_;
  std::vector<double> area_;                               // (sensors) of a point over the scene's
  std::vector<std::vector<CompactFrame<double>>> frames_;  // (sensors, 16), made at the first use
  std::vector<FieldSum> sums_;                             // (sensors, 16)
  std::vector<double> read_seconds_;                       // (sensors)
  // (sensors, E) over samples: |F_ref|², |F - F_ref|², |F_ref|² |c - c_ref|²
  std::vector<double> square_, distance_, strayed_;
};

class Pitches {
 public:
  explicit Pitches(const FixedEpisodes& episodes) : episodes_(episodes) {
    const std::vector<TactileDescription>& sensors = episodes.start.model().scene().sensors;
    for (std::size_t s = 0; s < sensors.size(); ++s)
      if (reason_against_sweep(sensors[s]).empty()) swept_.push_back(s);
    if (swept_.empty()) return;
    for (const double factor : kFactors)
      if (fits(factor)) rungs_.push_back(std::make_unique<Rung>(episodes.start, factor));
  }

  bool play(const std::stop_token& stop) {
    if (rungs_.empty()) return true;
    StepperOptions awake;
    awake.sleep = 0;
    Stepper stepper(episodes_.start.model(), awake);
    Batch batch = episodes_.start;
    for (int b = 0; b < batch.blocks(); ++b)
      if (!play_block(stepper, batch, b, stop)) return false;
    return true;
  }

  [[nodiscard]] PitchSweep sensor_sweep(std::size_t s, double target) const {
    PitchSweep sweep;
    sweep.sensor = static_cast<int>(s);
    sweep.left_out = reason_against_sweep(episodes_.start.model().scene().sensors[s]);
    if (!sweep.left_out.empty()) return sweep;
    for (const auto& rung : rungs_) {
      const PitchPoint point = point_of(*rung, s);
      const bool again = !sweep.points.empty() && sweep.points.back().rows == point.rows &&
                         sweep.points.back().cols == point.cols;
      if (again && point.own) sweep.points.back().own = true;
      if (!again) sweep.points.push_back(point);
    }
    sweep.reference = sweep.points.back();
    sweep.points.pop_back();
    if (sweep.points.empty()) return sweep;
    const PitchPoint& next = sweep.points.back();
    sweep.reference.force_error = next.force_error;
    sweep.reference.force_bound = next.force_bound;
    sweep.reference.centre_error = next.centre_error;
    const auto good = std::ranges::find_if(
        sweep.points, [&](const PitchPoint& p) { return p.force_bound <= target; });
    if (good != sweep.points.end()) sweep.advice = static_cast<int>(good - sweep.points.begin());
    return sweep;
  }

 private:
  [[nodiscard]] bool fits(double factor) const {
    return std::ranges::all_of(swept_, [&](std::size_t s) {
      const RectArray& a = episodes_.start.model().scene().sensors[s].array;
      return factor >= 1 ||
             std::int64_t{points_along(a.rows, factor)} * points_along(a.cols, factor) <=
                 kMostPoints;
    });
  }

  bool play_block(Stepper& stepper, Batch& batch, int b, const std::stop_token& stop) {
    const int first = b * kBlock, lanes = lanes_of(batch, b);
    const auto after_sample = [&](int) {
      for (const auto& rung : rungs_)
        for (const std::size_t s : swept_) rung->read_sensors(batch, b, s);
      reads_ += lanes;
      for (int e = first; e < first + lanes; ++e) {
        if (batch.held(e) || failed(batch.status(e))) continue;
        ++samples_;
        for (const auto& rung : rungs_)
          for (const std::size_t s : swept_) rung->compare(*rungs_.back(), s, e);
      }
    };
    return episodes_.play(
        stepper, episodes_.every, batch, b, step_seconds_, stop, [](std::int64_t) {}, after_sample);
  }

  [[nodiscard]] PitchPoint point_of(const Rung& rung, std::size_t s) const {
    PitchPoint point;
    point.rows = rung.array(s).rows;
    point.cols = rung.array(s).cols;
    point.pitch = rung.pitch(s);
    point.own = rung.factor() == 1;
    rung.set_errors(s, point);
    point.read_seconds =
        rung.read_seconds(s) / static_cast<double>(std::max<std::int64_t>(1, reads_));
    point.rate = static_cast<double>(samples_) * episodes_.interval() /
                 (step_seconds_ + rung.read_seconds(s));
    return point;
  }

  const FixedEpisodes& episodes_;
  std::vector<std::size_t> swept_;
  std::vector<std::unique_ptr<Rung>> rungs_;  // coarsest first
  double step_seconds_ = 0;
  std::int64_t samples_ = 0, reads_ = 0;
};

}  // namespace

std::vector<PitchSweep> sweep_pitches(const FixedEpisodes& episodes, double target,
                                      const std::stop_token& stop) {
  Pitches pitches(episodes);
  if (!pitches.play(stop)) return {};
  std::vector<PitchSweep> sweeps;
  for (std::size_t s = 0; s < episodes.start.model().sensors().size(); ++s)
    sweeps.push_back(pitches.sensor_sweep(s, target));
  return sweeps;
}

}  // namespace tangere
