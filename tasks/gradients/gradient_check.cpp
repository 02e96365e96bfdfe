// SPDX-License-Identifier: Apache-2.0
// Differences sixteen rollouts at a time: all step sizes of one entry are environments of one
// batch.
#include "tasks/gradients/gradient_check.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "engine/derivative/parameters.hpp"
#include "engine/derivative/point_numbers.hpp"
#include "engine/derivative/tangent.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/displacement.hpp"
#include "tasks/gradients/loss_reading.hpp"

namespace tangere {
namespace {

/// The inputs of one rollout.
struct Inputs {
  std::vector<double> q, v, u;  ///< (nq), (nv), (steps, nu)
};

struct Setting {
  const Batch& start;
  const RolloutLoss& loss;
  const CheckOptions& options;
  Inputs at;
  std::vector<double> varying;  ///< what the scene randomises, in its order

  [[nodiscard]] std::span<const double> u(const Inputs& of, std::int64_t step) const {
    const auto nu = std::size_t(start.model().nu());
    if (step == options.steps) return {};
    return std::span(of.u).subspan(std::size_t(step) * nu, nu);
  }
};

std::vector<double> numbers(int n) { return std::vector<double>(std::size_t(n)); }

/// Reads a loss where one environment is, fields included.
class Look {
 public:
  explicit Look(const Model& model) : readout_(model), reading_(model) {
    for (std::size_t k = 0; k < model.sensors().size(); ++k) {
      frames_.push_back(std::make_unique<CompactFrame<double>>(model, static_cast<int>(k)));
      reading_.set_field(k, *frames_.back());
    }
  }
  double at(const Setting& s, const Batch& batch, int e, std::int64_t step,
            std::span<const double> u) {
    if (s.loss.reads_fields(step))
      for (auto& frame : frames_) readout_.read(batch, e, *frame);
    return reading_.evaluate(s.loss, batch, readout_, e, step, s.options.steps, u);
  }
  [[nodiscard]] const LossReading& reading() const { return reading_; }
  [[nodiscard]] Readout& readout() { return readout_; }
  [[nodiscard]] const CompactFrame<double>& frame(std::size_t sensor) const {
    return *frames_[sensor];
  }

 private:
  Readout readout_;
  LossReading reading_;
  std::vector<std::unique_ptr<CompactFrame<double>>> frames_;
};

/// Loss of each of `inputs`, as environments of one batch; NaN where a step finds no solution.
std::vector<double> losses_of(const Setting& s, const Model& model,
                              const std::vector<Inputs>& inputs,
                              const std::vector<double>& varying) {
  const auto nu = std::size_t(model.nu());
  Batch batch(model, static_cast<int>(inputs.size()), s.start.seed(), s.start.episode(0));
  for (int e = 0; e < batch.environments(); ++e) {
    for (std::size_t k = 0; k < model.scene().randomizations.size(); ++k)
      if (batch.is_parameter(static_cast<int>(k)))
        batch.set_randomized_value(e, static_cast<int>(k), varying[k]);
    batch.set_state(e, inputs[std::size_t(e)].q, inputs[std::size_t(e)].v);
  }
  Stepper stepper(model, s.options.stepper);
  Look look(model);
  std::vector<double> sums(inputs.size()), u(inputs.size() * nu);
  for (std::int64_t t = 0; t <= s.options.steps; ++t) {
    for (std::size_t e = 0; e < inputs.size(); ++e) {
      const std::span<const double> own = s.u(inputs[e], t);
      sums[e] += look.at(s, batch, static_cast<int>(e), t, own);
      std::copy(own.begin(), own.end(), u.begin() + std::ptrdiff_t(e * nu));
    }
    if (t < s.options.steps) stepper.step(batch, u);
  }
  for (std::size_t e = 0; e < inputs.size(); ++e)
    if (failed(batch.status(static_cast<int>(e)))) sums[e] = NAN;
  return sums;
}

/// change(inputs, e): one entry of the inputs moved by e.
template <class Change>
Difference difference_of(const Setting& s, double scale, const Change& change) {
  std::vector<Inputs> all;
  for (const double e : sweep(scale)) {
    all.push_back(s.at);
    change(all.back(), e);
  }
  return best_difference(losses_of(s, s.start.model(), all, s.varying), scale);
}

/// Of number k of the scene, by its relative change.
Difference difference_of_number(const Setting& s, const Parameters& parameters, int k) {
  std::vector<double> losses;
  for (const double e : sweep(1)) {
    Scene scene = s.start.model().scene();
    std::vector<double> varying = s.varying;
    const int random = parameters.randomization(scene, k);
    (random < 0 ? parameters.in(scene, k) : varying[std::size_t(random)]) *= 1 + e;
    losses.push_back(losses_of(s, Model(scene), {s.at}, varying)[0]);
  }
  return best_difference(losses, 1);
}

/// Changes of all points of a sensor at once, by one of their numbers: random from point to point,
/// places by parts of the sensor's size, coefficients of what they are.
struct PointChange {
  int sensor, number;
  std::vector<double> own;  ///< (points, kPointNumbers)
};

double extent_of(const TactileDescription& sensor) {
  const std::vector<TactilePoint> points =
      sensor.points.empty() ? list_points(sensor.array) : sensor.points;
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

/// `coefficients`: what this environment's sensors have, (sensors, 4); points have parts of them.
Difference difference_of_points(const Setting& s, const PointChange& change,
                                std::span<const double> coefficients) {
  std::vector<double> losses;
  for (const double e : sweep(1)) {
    Scene scene = s.start.model().scene();
    std::vector<double> moved = change.own;
    for (double& x : moved) x *= e;
    TactileDescription& sensor = scene.sensors[std::size_t(change.sensor)];
    const double* has = &coefficients[std::size_t(4 * change.sensor)];
    sensor.coefficients = {has[0], has[1], has[2], has[3]};
    add_to_points(sensor, moved);
    losses.push_back(losses_of(s, Model(scene), {s.at}, s.varying)[0]);
  }
  return best_difference(losses, 1);
}

/// Tangents along one direction per input.
class Directions {
 public:
  Directions(const Setting& s, const Parameters& parameters) : s_(s), parameters_(parameters) {
    const Model& model = s.start.model();
    Batch batch = s.start;
    Stepper stepper(model, s.options.stepper);
    tape_.emplace(model, stepper.integrator(), s.options.steps);
    tape_->start(batch, 0);
    const auto nu = std::size_t(model.nu());
    std::vector<double> u(std::size_t(batch.environments()) * nu);
    for (std::int64_t t = 0; t < s.options.steps; ++t) {
      const std::span<const double> own = s.u(s.at, t);
      for (int e = 0; e < batch.environments(); ++e)
        std::copy(own.begin(), own.end(), u.begin() + std::ptrdiff_t(std::size_t(e) * nu));
      stepper.step_block(batch, 0, u, &*tape_);
      if (failed(batch.status(0)))
        throw InputError("step " + std::to_string(t) +
                         " of the rollout finds no solution: " + to_string(batch.status(0)));
    }
  }

  /// dL along (q, v, u, numbers), each empty for zeros, and the points' own numbers, by sensor.
  double along(const std::vector<double>& q, const std::vector<double>& v,
               const std::vector<double>& u, const std::vector<double>& change,
               const std::vector<std::vector<double>>& points = {}) {
    const Model& model = s_.start.model();
    const auto nu = std::size_t(model.nu());
    const std::vector<double> zero = numbers(model.nv()), no_u(nu);
    StateTangent state{q.empty() ? zero : q, v.empty() ? zero : v, zero, zero};
    std::vector<double> rows;
    if (!change.empty()) {
      rows.resize(std::size_t(parameter_rows(model)));
      parameters_.spread(change, s_.start, 0, rows);
    }
    Tangent tangent(model, s_.options.stepper);
    Batch batch = s_.start;
    Look look(model);
    double sum = 0;
    for (std::int64_t t = 0; t <= s_.options.steps; ++t) {
      const std::span<const double> u_dot = u.empty() || t == s_.options.steps
                                                ? std::span<const double>(no_u)
                                                : std::span(u).subspan(std::size_t(t) * nu, nu);
      tape_->show(t, batch, 0);
      sum += change_at(batch, look, tangent, t, state, u_dot, rows, points);
      if (t == s_.options.steps) break;
      tangent.step(batch, 0, 0, *tape_, t, s_.u(s_.at, t), u_dot, rows, state);
    }
    return sum;
  }

 private:
  /// The loss's own derivatives at a state, times how that changes.
  double change_at(const Batch& batch, Look& look, Tangent& tangent, std::int64_t t,
                   const StateTangent& state, std::span<const double> u_dot,
                   std::span<const double> rows, const std::vector<std::vector<double>>& points) {
    const Model& model = batch.model();
    look.at(s_, batch, 0, t, s_.u(s_.at, t));
    const LossReading& bar = look.reading();
    double sum = 0;
    for (std::size_t i = 0; i < state.q.size(); ++i)
      sum += bar.q_bar()[i] * state.q[i] + bar.v_bar()[i] * state.v[i];
    for (std::size_t i = 0; i < u_dot.size(); ++i) sum += bar.u_bar()[i] * u_dot[i];
    for (std::size_t k = 0; k < model.sensors().size() && s_.loss.reads_fields(t); ++k) {
      std::vector<double> change(look.frame(k).dense_size()), of_tiles(change.size());
      tangent.field(batch, 0, 0, *tape_, t, static_cast<int>(k), rows,
                    points.empty() ? std::span<const double>{} : points[k], state, change);
      // The cotangents' layout is that of the tiles: spread them as the frame spreads its values.
      look.frame(k).spread(bar.field_bar(k), of_tiles);
      sum += std::inner_product(change.begin(), change.end(), of_tiles.begin(), 0.0);
    }
    if (s_.loss.reads_end_effectors(t))
      sum += along_end_effectors(batch, look.readout(), bar.end_effectors_bar(), state);
    return sum;
  }

  static double along_end_effectors(const Batch& batch, Readout& readout,
                                    std::span<const double> x_bar, const StateTangent& state) {
    const auto nv = state.q.size();
    std::vector<double> jacobian(x_bar.size() * nv);
    readout.end_effector_jacobian(batch, 0, jacobian);
    double sum = 0;
    for (std::size_t i = 0; i < x_bar.size(); ++i)
      for (std::size_t k = 0; k < nv; ++k) sum += x_bar[i] * jacobian[i * nv + k] * state.q[k];
    return sum;
  }

  const Setting& s_;
  const Parameters& parameters_;
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
             std::vector<double>(std::size_t(options.steps) * nu)},
            {}};
  for (std::size_t k = 0; k < model.scene().randomizations.size(); ++k)
    s.varying.push_back(start.randomized_value(0, static_cast<int>(k)));
  start.get_q(0, s.at.q);
  start.get_v(0, s.at.v);
  for (std::int64_t t = 0; t < options.steps; ++t)
    controls(t, 0, std::span(s.at.u).subspan(std::size_t(t) * nu, nu));
  return s;
}

bool reads_fields(const RolloutLoss& loss, const CheckOptions& options) {
  for (std::int64_t t = 0; t <= options.steps; ++t)
    if (loss.reads_fields(t)) return true;
  return false;
}

LossGradient gradient_of(const Batch& start, const StepControls& controls, const RolloutLoss& loss,
                         const CheckOptions& options) {
  GradientOptions wanted;
  wanted.steps = options.steps;
  wanted.stepper = options.stepper;
  wanted.parameters = true;
  wanted.points = reads_fields(loss, options);
  const RolloutLoss* const losses[] = {&loss};
  return rollout_gradients(start, controls, wanted, losses).losses[0];
}

/// The inputs, one after the other.
class Check {
 public:
  Check(const Setting& s, const LossGradient& g)
      : s_(s), g_(g), parameters_(s.start.model()), tangents_(s, parameters_) {
    out.loss = g.value[0];
  }

  void controls() {
    const Model& model = s_.start.model();
    const auto nu = std::size_t(model.nu());
    const std::span<const double> u = std::span(g_.u).first(std::size_t(s_.options.steps) * nu);
    add({"u", u, all_of(u.size()),
         [&](std::size_t i) {
           return difference_of(s_, kControlScale, [i](Inputs& x, double e) { x.u[i] += e; });
         },
         [&](std::size_t i) {
           return "step " + std::to_string(i / nu) + " " + std::string(model.u_names()[i % nu]);
         }},
        0, [&](const std::vector<double>& d) { return tangents_.along({}, {}, d, {}); });
  }
  void positions() {
    const Model& m = s_.start.model();
    const std::span<const double> q = std::span(g_.q).first(std::size_t(m.nv()));
    const auto move = [&m](std::size_t i) {
      return [&m, i](Inputs& x, double e) { displace(m, x.q, static_cast<int>(i), e); };
    };
    add({"q", q, all_of(q.size()), [&](std::size_t i) { return difference_of(s_, 1, move(i)); },
         dof_name()},
        1, [&](const std::vector<double>& d) { return tangents_.along(d, {}, {}, {}); });
  }
  void velocities() {
    const std::span<const double> v = std::span(g_.v).first(std::size_t(s_.start.model().nv()));
    add({"v", v, all_of(v.size()),
         [&](std::size_t i) {
           return difference_of(s_, kVelocityScale, [i](Inputs& x, double e) { x.v[i] += e; });
         },
         dof_name()},
        2, [&](const std::vector<double>& d) { return tangents_.along({}, d, {}, {}); });
  }
  /// By relative changes of what this environment has: units differ.
  void numbers_of_scene() {
    const Model& model = s_.start.model();
    const RelativeGradient r(parameters_, model.scene(), s_.varying,
                             std::span(g_.parameters).first(std::size_t(parameters_.count())));
    add({"numbers", r.gradient, r.given,
         [&](std::size_t k) { return difference_of_number(s_, parameters_, static_cast<int>(k)); },
         [&](std::size_t k) { return parameters_.infos()[k].name; }},
        3, [&](const std::vector<double>& d) { return tangents_.along({}, {}, {}, r.change(d)); });
  }

  /// By places and coefficients of all points of a sensor at once.
  void points() {
    const Model& model = s_.start.model();
    std::vector<double> coefficients;  // this environment's
    for (std::size_t s = 0; s < model.sensors().size(); ++s)
      for (const double c : sensor_coefficients(s_.start, 0, static_cast<int>(s)))
        coefficients.push_back(c);
    const std::vector<PointChange> changes = point_changes(model, coefficients, s_.options.seed);
    const std::span<const double> all =
        std::span(g_.points).first(std::size_t(tactile_points(model) * kPointNumbers));
    std::vector<double> gradient;
    for (const PointChange& c : changes)
      gradient.push_back(std::inner_product(
          c.own.begin(), c.own.end(),
          all.begin() + first_tactile_point(model, c.sensor) * kPointNumbers, 0.0));
    constexpr const char* kNames[kPointNumbers] = {"x", "y", "z", "kn", "kt", "mu", "damping"};
    add({"points", gradient, all_of(gradient.size()),
         [&](std::size_t k) { return difference_of_points(s_, changes[k], coefficients); },
         [&](std::size_t k) {
           return model.sensors()[std::size_t(changes[k].sensor)].name + " " +
                  kNames[changes[k].number];
         }},
        4, [&](const std::vector<double>& d) {
          return tangents_.along({}, {}, {}, {}, together(model, changes, d));
        });
  }

  GradientCheck out;

 private:
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
  void add(const Comparison& c, std::uint32_t purpose,
           const std::function<double(const std::vector<double>&)>& along) {
    out.inputs.push_back(compare(c, out.loss, s_.options, purpose));
    const std::vector<double> d = random_direction(c.gradient.size(), s_.options.seed, purpose);
    compare_along(out.inputs.back(), c.gradient, d, along(d));
  }
  [[nodiscard]] std::function<std::string(std::size_t)> dof_name() const {
    return [this](std::size_t i) { return std::string(s_.start.model().v_names()[i]); };
  }

  const Setting& s_;
  const LossGradient& g_;
  Parameters parameters_;
  Directions tangents_;
};

}  // namespace

double GradientCheck::max_relative_error() const {
  double worst = 0;
  for (const CheckedInput& c : inputs)
    worst = std::max({worst, c.difference_error, c.tangent_error});
  return worst;
}
std::size_t GradientCheck::entries() const {
  return std::accumulate(inputs.begin(), inputs.end(), std::size_t{0},
                         [](std::size_t n, const auto& c) { return n + c.compared; });
}
std::size_t GradientCheck::kinks() const {
  return std::accumulate(inputs.begin(), inputs.end(), std::size_t{0},
                         [](std::size_t n, const auto& c) { return n + c.kinks; });
}

GradientCheck check_gradient(const Batch& start, const StepControls& controls,
                             const RolloutLoss& loss, const CheckOptions& options) {
  const Setting s = setting_of(start, controls, loss, options);
  const LossGradient g = gradient_of(start, controls, loss, options);
  Check check(s, g);
  if (start.model().nu() > 0) check.controls();
  check.positions();
  check.velocities();
  check.numbers_of_scene();
  if (reads_fields(loss, options)) check.points();
  return check.out;
}

}  // namespace tangere
