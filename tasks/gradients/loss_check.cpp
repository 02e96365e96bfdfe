// SPDX-License-Identifier: Apache-2.0
// Takes differences sixteen rollouts at a time: all step sizes of one entry are environments of one
// batch.
#include "tasks/gradients/gradient_check.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/derivative/tangent.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/sense/readout.hpp"
#include "tasks/gradients/gradient_compare.hpp"
#include "tasks/gradients/run_trace.hpp"
#include "tasks/gradients/scene_block.hpp"

namespace tangere {
namespace {

struct Setting {
  const Batch& start;
  const RolloutLoss& loss;
  const CheckOptions& options;
  CheckInputs at;

  [[nodiscard]] std::span<const double> u(const CheckInputs& of, std::int64_t step) const {
    const auto nu = std::size_t(start.model().nu());
    if (step == options.length) return {};
    return std::span(of.u).subspan(std::size_t(step) * nu, nu);
  }
};

std::vector<double> numbers(int n) { return std::vector<double>(std::size_t(n)); }

/// A loss at the current state of one environment.
struct LossReader {
  explicit LossReader(const Model& model) : readout(model), reading(model) {}
  double at(const Setting& s, const Batch& batch, int e, std::int64_t step,
            std::span<const double> u) {
    if (s.loss.reads_fields(step)) reading.read_fields(batch, readout, e);
    return reading.evaluate(s.loss, batch, readout, e, step, s.options.length, u);
  }
  Readout readout;
  LossReading reading;
};

/// Returns the loss of each of `inputs`, as environments of one batch; NaN where a step finds no
/// solution.
std::vector<double> losses_of(const Setting& s, const Model& model,
                              const std::vector<CheckInputs>& inputs,
                              const std::vector<double>& varying, RunTrace* trace) {
  const auto nu = std::size_t(model.nu());
  Batch batch(model, static_cast<int>(inputs.size()), s.start.seed(), s.start.episode(0));
  for (int e = 0; e < batch.environments(); ++e) {
    batch.reset(e, s.start.episode(0));  // with its own imperfections of sensors
    batch.set_steps(e, s.start.steps(0));
    for (std::size_t k = 0; k < model.scene().randomizations.size(); ++k)
      if (batch.is_parameter(static_cast<int>(k)))
        batch.set_randomized_value(e, static_cast<int>(k), varying[k]);
    batch.set_state(e, inputs[std::size_t(e)].q, inputs[std::size_t(e)].v);
    batch.set_shear_state(e, s.start.shear_state(0));
  }
  Stepper stepper(model, s.options.stepper);
  LossReader reader(model);
  std::vector<double> sums(inputs.size()), u(inputs.size() * nu);
  for (std::int64_t t = 0; t <= s.options.length; ++t) {
    for (std::size_t e = 0; e < inputs.size(); ++e) {
      const std::span<const double> own = s.u(inputs[e], t);
      sums[e] += reader.at(s, batch, static_cast<int>(e), t, own);
      std::copy(own.begin(), own.end(), u.begin() + std::ptrdiff_t(e * nu));
    }
    if (trace != nullptr) trace->add(batch);
    if (t < s.options.length) stepper.step(batch, u);
  }
  for (std::size_t e = 0; e < inputs.size(); ++e)
    if (failed(batch.status(static_cast<int>(e)))) sums[e] = NAN;
  return sums;
}

/// Changes one kind of number at all points of a sensor at once. They are random from point to
/// point. Positions change by parts of the sensor's size, coefficients by parts of their values.
struct PointChange {
  int sensor, number;
  std::vector<double> own;  ///< (points, kPointNumbers)
};

double extent_of(const TactileDescription& sensor) {
  const std::vector<TactilePoint> points = tactile_points(sensor);
  double extent = 0;
  for (const TactilePoint& p : points)
    for (std::size_t k = 0; k < 3; ++k)
      extent = std::max(extent, std::abs(p.position[k] - points[0].position[k]));
  return extent;
}

std::vector<PointChange> point_changes(const Model& model, std::span<const double> coefficients,
                                       std::uint64_t seed) {
  std::vector<PointChange> changes;
  for (int s = 0; s < static_cast<int>(model.sensors().size()); ++s) {
    const auto points = std::size_t(model.sensors()[std::size_t(s)].points);
    const double extent = extent_of(model.scene().sensors[std::size_t(s)]);
    for (int number = 0; number < kPointNumbers; ++number) {
      const std::vector<double> d =
          random_direction(points, seed, std::uint32_t(4 + changes.size()));
      const double size = number < 3 ? extent : 1,
                   has = number < 3 ? 1 : coefficients[std::size_t(4 * s + number - 3)];
      if (has == 0) continue;
      PointChange c{s, number, std::vector<double>(points * kPointNumbers)};
      for (std::size_t i = 0; i < points; ++i)
        c.own[i * kPointNumbers + std::size_t(number)] = has * size * d[i];
      changes.push_back(std::move(c));
    }
  }
  return changes;
}

/// Computes tangents along one direction per input.
class Directions {
 public:
  explicit Directions(const Setting& s) : s_(s) {
    const Model& model = s.start.model();
    Batch batch = s.start;
    Stepper stepper(model, s.options.stepper);
    tape_.emplace(model, stepper.integrator(), s.options.length);
    tape_->start(batch, 0);
    const auto nu = std::size_t(model.nu());
    std::vector<double> u(std::size_t(batch.environments()) * nu);
    for (std::int64_t t = 0; t < s.options.length; ++t) {
      const std::span<const double> own = s.u(s.at, t);
      for (int e = 0; e < batch.environments(); ++e)
        std::copy(own.begin(), own.end(), u.begin() + std::ptrdiff_t(std::size_t(e) * nu));
      stepper.step_block(batch, 0, u, &*tape_);
      if (failed(batch.status(0)))
        throw InputError("step " + std::to_string(t) +
                         " of the rollout finds no solution: " + to_string(batch.status(0)));
    }
  }

  /// Returns dL. `points`: changes of the points' own numbers, by sensor.
  double along(const InputDirection& d, const std::vector<std::vector<double>>& points = {}) {
    const Model& model = s_.start.model();
    const auto nu = std::size_t(model.nu());
    const std::vector<double> zero = numbers(model.nv()), no_u(nu);
    const auto given = [&](std::span<const double> x) {
      return x.empty() ? zero : std::vector<double>(x.begin(), x.end());
    };
    StateTangent state{given(d.q), given(d.v), zero, zero};
    Tangent tangent(model, s_.options.stepper);
    Batch batch = s_.start;
    LossReader reader(model);
    double sum = 0;
    for (std::int64_t t = 0; t <= s_.options.length; ++t) {
      const std::span<const double> u_dot = d.u.empty() || t == s_.options.length
                                                ? std::span<const double>(no_u)
                                                : d.u.subspan(std::size_t(t) * nu, nu);
      tape_->show(t, batch, 0);
      sum += change_at(batch, reader, tangent, t, state, u_dot, d.numbers, points);
      if (t == s_.options.length) break;
      tangent.step(batch, 0, 0, *tape_, t, s_.u(s_.at, t), u_dot, d.numbers, state, points);
    }
    return sum;
  }

 private:
  /// The loss's own derivatives at a state, times the change of that state.
  double change_at(const Batch& batch, LossReader& reader, Tangent& tangent, std::int64_t t,
                   const StateTangent& state, std::span<const double> u_dot,
                   std::span<const double> rows, const std::vector<std::vector<double>>& points) {
    const Model& model = batch.model();
    reader.at(s_, batch, 0, t, s_.u(s_.at, t));
    const LossReading& bar = reader.reading;
    double sum = 0;
    for (std::size_t i = 0; i < state.q.size(); ++i)
      sum += bar.q_bar()[i] * state.q[i] + bar.v_bar()[i] * state.v[i];
    for (std::size_t i = 0; i < u_dot.size(); ++i) sum += bar.u_bar()[i] * u_dot[i];
    for (std::size_t k = 0; k < model.sensors().size() && s_.loss.reads_fields(t); ++k) {
      std::vector<double> change(bar.field(k).dense_size()), tile_values(change.size());
      tangent.field(batch, 0, 0, *tape_, t, static_cast<int>(k), rows,
                    points.empty() ? std::span<const double>{} : points[k], state, change);
      // The cotangents have the layout of the tiles. Spread them as the frame spreads its values.
      bar.field(k).spread(bar.field_bar(k), tile_values);
      sum += std::inner_product(change.begin(), change.end(), tile_values.begin(), 0.0);
    }
    if (s_.loss.reads_end_effectors(t)) {
      const std::span<const double> x_bar = bar.end_effectors_bar();
      std::vector<double> change(x_bar.size());
      tangent.end_effectors(batch, 0, 0, *tape_, t, rows, state, change);
      sum += std::inner_product(change.begin(), change.end(), x_bar.begin(), 0.0);
    }
    return sum;
  }

  const Setting& s_;
  std::optional<BlockTape> tape_;
};

Setting setting_of(const Batch& start, const StepControls& controls, const RolloutLoss& loss,
                   const CheckOptions& options) {
  const Model& model = start.model();
  const auto nu = std::size_t(model.nu());
  if (start.has_history(0))
    throw InputError(
        "gradients are checked from a start, and this batch continues a run: what differences move "
        "has no past");
  Setting s{start,
            loss,
            options,
            {numbers(model.nq()), numbers(model.nv()),
             std::vector<double>(std::size_t(options.length) * nu)}};
  start.get_q(0, s.at.q);
  start.get_v(0, s.at.v);
  for (std::int64_t t = 0; t < options.length; ++t)
    controls(t, 0, std::span(s.at.u).subspan(std::size_t(t) * nu, nu));
  return s;
}

bool reads_fields(const RolloutLoss& loss, const CheckOptions& options) {
  for (std::int64_t t = 0; t <= options.length; ++t)
    if (loss.reads_fields(t)) return true;
  return false;
}

/// Whether points of sensors are checked: a layer and a table have no derivatives by them.
bool checks_points(const Model& model, const RolloutLoss& loss, const CheckOptions& options) {
  return reads_fields(loss, options) &&
         std::ranges::none_of(model.scene().sensors,
                              [](const TactileDescription& d) { return d.layer || d.table; });
}

LossGradient gradient_of(const Batch& start, const StepControls& controls, const RolloutLoss& loss,
                         const CheckOptions& options) {
  TapeOptions requested;
  requested.length = options.length;
  requested.stepper = options.stepper;
  requested.parameters = true;
  requested.points = checks_points(start.model(), loss, options);
  const RolloutLoss* const losses[] = {&loss};
  return rollout_gradients(start, controls, requested, losses).losses[0];
}

class LossChecker : public GradientChecker {
 public:
  LossChecker(const Setting& s, const LossGradient& g)
      : GradientChecker(s.start.model(), s.options), s_(s), g_(g), tangents_(s) {
    const auto first = [](const std::vector<double>& all, std::size_t n) {
      return std::vector<double>(all.begin(), all.begin() + std::ptrdiff_t(n));
    };
    for (std::size_t k = 0; k < model_.scene().randomizations.size(); ++k)
      varying_.push_back(s.start.randomized_value(0, static_cast<int>(k)));
    at_ = s.at;
    grad_u_ = first(g.u, s.at.u.size());
    grad_q_ = first(g.q, s.at.v.size());
    grad_v_ = first(g.v, s.at.v.size());
    grad_numbers_ = first(g.parameters, std::size_t(parameters_.count()));
    out_.loss = g.value[0];
    out_.length = s.options.length;
  }

  /// Checks by positions and coefficients of all points of a sensor at once.
  void points() {
    std::vector<double> coefficients;  // of this environment
    for (std::size_t s = 0; s < model_.sensors().size(); ++s)
      for (std::size_t k = 0; k < kPointCoefficients; ++k)
        coefficients.push_back(sensor_coefficients(s_.start, 0, static_cast<int>(s))[k]);
    const std::vector<PointChange> changes = point_changes(model_, coefficients, s_.options.seed);
    const std::span<const double> all =
        std::span(g_.points).first(std::size_t(tactile_points(model_) * kPointNumbers));
    std::vector<double> gradient;
    gradient.reserve(changes.size());
    for (const PointChange& c : changes)
      gradient.push_back(std::inner_product(
          c.own.begin(), c.own.end(),
          all.begin() + first_tactile_point(model_, c.sensor) * kPointNumbers, 0.0));
    const auto move = [&](std::size_t k) { return move_points(changes[k], coefficients); };
    add({"points", gradient, all_of(gradient.size()),
         [&](std::size_t k) { return difference_of_scene(move(k)); },
         [&](std::size_t k) {
           return model_.sensors()[std::size_t(changes[k].sensor)].name + " " +
                  point_number_name(changes[k].number);
         },
         [&](std::size_t k) { return decisions_of_scene(move(k)); }},
        4, [&](const std::vector<double>& d) {
          return tangents_.along({}, together(model_, changes, d));
        });
  }

 private:
  [[nodiscard]] std::vector<double> values(const Scene* other,
                                           const std::vector<CheckInputs>& inputs,
                                           const std::vector<double>& varying,
                                           RunTrace* trace) const override {
    return losses_of(s_, other != nullptr ? Model(*other) : s_.start.model(), inputs, varying,
                     trace);
  }
  [[nodiscard]] bool reads_fields() const override {
    return tangere::reads_fields(s_.loss, s_.options);
  }
  [[nodiscard]] double along(const InputDirection& d) override { return tangents_.along(d); }
  [[nodiscard]] const Batch& batch() const override { return s_.start; }
  [[nodiscard]] std::string control_name(std::size_t i) const override {
    const auto nu = std::size_t(model_.nu());
    return "step " + std::to_string(i / nu) + " " + std::string(model_.u_names()[i % nu]);
  }

  /// `coefficients`: those of this environment's sensors, (sensors, 4); points have parts of them.
  static MoveScene move_points(const PointChange& change, std::span<const double> coefficients) {
    return [&change, coefficients](Scene& scene, std::vector<double>&, double e) {
      std::vector<double> moved = change.own;
      for (double& x : moved) x *= e;
      TactileDescription& sensor = scene.sensors[std::size_t(change.sensor)];
      const double* has = &coefficients[std::size_t(4 * change.sensor)];
      for (std::size_t k = 0; k < kPointCoefficients; ++k) sensor.coefficients[k] = has[k];
      add_to_points(sensor, moved);
    };
  }
  static std::vector<std::vector<double>> together(const Model& model,
                                                   const std::vector<PointChange>& changes,
                                                   const std::vector<double>& d) {
    std::vector<std::vector<double>> sum;
    for (const SensorInfo& s : model.sensors())
      sum.emplace_back(std::size_t(s.points * kPointNumbers));
    for (std::size_t k = 0; k < changes.size(); ++k)
      for (std::size_t i = 0; i < changes[k].own.size(); ++i)
        sum[std::size_t(changes[k].sensor)][i] += d[k] * changes[k].own[i];
    return sum;
  }
  const Setting& s_;
  const LossGradient& g_;
  Directions tangents_;
};

}  // namespace

GradientCheck check_gradient(const Batch& start, const StepControls& controls,
                             const RolloutLoss& loss, const CheckOptions& options) {
  const Setting s = setting_of(start, controls, loss, options);
  const LossGradient g = gradient_of(start, controls, loss, options);
  LossChecker checker(s, g);
  checker.check();
  if (checks_points(start.model(), loss, options)) checker.points();
  checker.explain();
  return checker.result();
}

}  // namespace tangere
