// SPDX-License-Identifier: Apache-2.0
// Differences sixteen rollouts at a time: all step sizes of one entry are environments of one batch.
#include "tasks/gradient_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "engine/compiled_model.hpp"
#include "engine/parameters.hpp"
#include "engine/random.hpp"
#include "engine/readout.hpp"
#include "engine/tangent.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

constexpr int kLevels = 8;          // step sizes, each a quarter of the one before: ±, 16 environments
constexpr double kLargest = 1e-3;   // of the first, times the input's scale
constexpr double kSettled = 3e-6;   // of the gradient's norm: two neighbouring step sizes agree so far, or there is a kink
constexpr double kControlScale = 10, kVelocityScale = 10;  // controls and velocities change more than positions

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
};

std::vector<double> numbers(int n) { return std::vector<double>(std::size_t(n)); }

/// q ⊕ e along a dof.
void move(const CompiledModel& m, std::vector<double>& q, int dof, double e) {
  for (const kernels::Link& link : m.links) {
    if (dof < link.v || dof >= link.v + kernels::dofs(link.kind)) continue;
    if (link.kind != kernels::JointKind::spherical) {
      q[std::size_t(link.q + dof - link.v)] += e;
      return;
    }
    kernels::Vec3<double> turn = {0, 0, 0};
    (dof == link.v ? turn.x : dof == link.v + 1 ? turn.y : turn.z) = e;
    double* a = &q[std::size_t(link.q)];
    const kernels::Quat<double> r = rotate_by(kernels::Quat<double>{a[0], a[1], a[2], a[3]}, turn);
    a[0] = r.w, a[1] = r.x, a[2] = r.y, a[3] = r.z;
  }
}

/// Loss of each of `inputs`, as environments of one batch; NaN where a step finds no solution.
std::vector<double> losses_of(const Setting& s, const Model& model, const std::vector<Inputs>& inputs,
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
  Readout readout(model);
  std::vector<double> sums(inputs.size()), u(inputs.size() * nu);
  std::vector<double> q = numbers(model.nq()), v = numbers(model.nv()), x(3 * model.variables().size());
  std::vector<double> unused_q = numbers(model.nv()), unused_v = unused_q, unused_u(nu), unused_x = x;
  std::vector<CompactFrame<double>> frames;
  for (std::size_t k = 0; k < model.sensors().size(); ++k) frames.emplace_back(model, static_cast<int>(k));
  std::vector<std::vector<double>> unused_fields(frames.size());
  const auto look = [&](std::int64_t t, std::size_t e) {
    batch.get_q(static_cast<int>(e), q);
    batch.get_v(static_cast<int>(e), v);
    std::vector<const CompactFrame<double>*> fields;
    std::vector<std::span<double>> cotangents;
    if (s.loss.reads_variables(t)) readout.variables(batch, static_cast<int>(e), x);
    for (std::size_t k = 0; k < frames.size() && s.loss.reads_fields(t); ++k) {
      readout.read(batch, static_cast<int>(e), frames[k]);
      unused_fields[k].assign(frames[k].values().size(), 0.0);
      fields.push_back(&frames[k]);
      cotangents.emplace_back(unused_fields[k]);
    }
    const std::span<const double> controls =
        t < s.options.steps ? std::span(inputs[e].u).subspan(std::size_t(t) * nu, nu) : std::span<const double>();
    const std::span<const double> positions = s.loss.reads_variables(t) ? std::span<const double>(x) : std::span<const double>();
    sums[e] += s.loss.evaluate({t, s.options.steps, static_cast<int>(e), q, v, controls, positions, fields},
                               {unused_q, unused_v, unused_u, unused_x, cotangents});
  };
  for (std::size_t e = 0; e < inputs.size(); ++e) look(0, e);
  for (std::int64_t t = 0; t < s.options.steps; ++t) {
    for (std::size_t e = 0; e < inputs.size(); ++e)
      std::copy_n(inputs[e].u.begin() + std::ptrdiff_t(std::size_t(t) * nu), nu, u.begin() + std::ptrdiff_t(e * nu));
    stepper.step(batch, u);
    for (std::size_t e = 0; e < inputs.size(); ++e) look(t + 1, e);
  }
  for (std::size_t e = 0; e < inputs.size(); ++e)
    if (failed(batch.status(static_cast<int>(e)))) sums[e] = NAN;
  return sums;
}

/// The central difference at which two neighbouring step sizes agree best, and how well.
struct Difference {
  double value = NAN, doubt = HUGE_VAL;
};
Difference best_of(const std::array<double, kLevels>& ahead, const std::array<double, kLevels>& behind, double scale) {
  Difference best;
  double before = NAN, step = kLargest * scale, coarse = NAN;
  for (std::size_t k = 0; k < kLevels; ++k, step *= 0.25) {
    const double central = (ahead[k] - behind[k]) / (2 * step);
    const double value = (16 * central - coarse) / 15;  // the error of second order taken out
    coarse = central;
    if (std::abs(value - before) < best.doubt) best = {value, std::abs(value - before)};
    before = value;
  }
  return best;
}

/// change(inputs, e): one entry of the inputs moved by e.
template <class Change>
Difference difference_of(const Setting& s, double scale, const Change& change) {
  std::vector<Inputs> all;
  double step = kLargest * scale;
  for (int k = 0; k < kLevels; ++k, step *= 0.25)
    for (const double sign : {1.0, -1.0}) {
      all.push_back(s.at);
      change(all.back(), sign * step);
    }
  const std::vector<double> losses = losses_of(s, s.start.model(), all, s.varying);
  std::array<double, kLevels> ahead{}, behind{};
  for (std::size_t k = 0; k < kLevels; ++k) ahead[k] = losses[2 * k], behind[k] = losses[2 * k + 1];
  return best_of(ahead, behind, scale);
}

/// Of number k of the scene, by its relative change.
Difference difference_of_number(const Setting& s, const Parameters& parameters, int k) {
  std::array<double, kLevels> ahead{}, behind{};
  double step = kLargest;
  for (std::size_t level = 0; level < kLevels; ++level, step *= 0.25)
    for (const double sign : {1.0, -1.0}) {
      Scene scene = s.start.model().scene();
      std::vector<double> varying = s.varying;
      const int random = parameters.randomization(scene, k);
      (random < 0 ? parameters.in(scene, k) : varying[std::size_t(random)]) *= 1 + sign * step;
      (sign > 0 ? ahead : behind)[level] = losses_of(s, Model(scene), {s.at}, varying)[0];
    }
  return best_of(ahead, behind, 1);
}

double norm_of(std::span<const double> x) {
  return std::sqrt(std::inner_product(x.begin(), x.end(), x.begin(), 0.0));
}

/// Which entries are compared: all, or as many as asked for, drawn.
std::vector<std::size_t> chosen(std::size_t count, const CheckOptions& o, std::uint32_t purpose) {
  std::vector<std::size_t> all(count);
  std::iota(all.begin(), all.end(), std::size_t{0});
  const auto wanted = std::size_t(o.entries);
  if (o.entries == 0 || count <= wanted) return all;
  for (std::size_t i = 0; i < wanted; ++i) {
    RandomKey key{o.seed, 0, static_cast<std::int64_t>(i), Purpose::control, purpose};
    std::swap(all[i], all[i + std::size_t(uniform(key, 0, double(count - i) - 1e-9))]);
  }
  all.resize(wanted);
  std::sort(all.begin(), all.end());
  return all;
}

template <class Of, class Name>
CheckedInput compare(const Setting& s, const char* what, std::span<const double> gradient, std::uint32_t purpose, const Of& of,
                     const Name& name) {
  CheckedInput c;
  c.name = what;
  c.entries = gradient.size();
  c.norm = norm_of(gradient);
  const double scale = c.norm > 0 ? c.norm : 1;
  for (const std::size_t i : chosen(gradient.size(), s.options, purpose)) {
    const Difference d = of(i);
    if (!(d.doubt <= kSettled * scale)) {
      ++c.kinks;
      continue;
    }
    ++c.compared;
    const double error = std::abs(d.value - gradient[i]) / scale;
    if (error >= c.difference_error) c.difference_error = error, c.worst = name(i);
  }
  return c;
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
      for (int e = 0; e < batch.environments(); ++e)
        std::copy_n(s.at.u.begin() + std::ptrdiff_t(std::size_t(t) * nu), nu, u.begin() + std::ptrdiff_t(std::size_t(e) * nu));
      stepper.step_block(batch, 0, u, &*tape_);
      if (failed(batch.status(0)))
        throw InputError("step " + std::to_string(t) + " of the rollout finds no solution: " + to_string(batch.status(0)));
    }
  }

  /// dL along (q, v, u, numbers), each empty for zeros.
  double along(const std::vector<double>& q, const std::vector<double>& v, const std::vector<double>& u,
               const std::vector<double>& change) {
    const Model& model = s_.start.model();
    const auto nu = std::size_t(model.nu());
    const std::vector<double> zero = numbers(model.nv()), no_u(nu);
    StateTangent state{q.empty() ? zero : q, v.empty() ? zero : v, zero, zero};
    std::vector<double> rows;
    if (!change.empty()) {
      rows.resize(std::size_t(parameter_rows(model.compiled())));
      parameters_.spread(change, rows);
    }
    Tangent tangent(model, s_.options.stepper);
    Batch batch = s_.start;
    Readout readout(model);
    double sum = 0;
    for (std::int64_t t = 0; t <= s_.options.steps; ++t) {
      const std::span<const double> u_dot =
          u.empty() || t == s_.options.steps ? std::span<const double>(no_u) : std::span(u).subspan(std::size_t(t) * nu, nu);
      tape_->show(t, batch, 0);
      sum += look(batch, readout, tangent, t, state, u_dot, rows);
      if (t == s_.options.steps) break;
      tangent.step(batch, 0, 0, *tape_, t, std::span(s_.at.u).subspan(std::size_t(t) * nu, nu), u_dot, rows, state);
    }
    return sum;
  }

 private:
  /// The loss's own derivatives at a state, times how that changes.
  double look(const Batch& batch, Readout& readout, Tangent& tangent, std::int64_t t, const StateTangent& state,
              std::span<const double> u_dot, std::span<const double> rows) {
    const Model& model = batch.model();
    const auto nu = std::size_t(model.nu()), nv = std::size_t(model.nv());
    std::vector<double> q = numbers(model.nq()), v = numbers(model.nv()), x(3 * model.variables().size());
    batch.get_q(0, q);
    batch.get_v(0, v);
    std::vector<double> q_bar(nv), v_bar(nv), u_bar(nu), x_bar(x.size());
    const bool of_fields = s_.loss.reads_fields(t), of_variables = s_.loss.reads_variables(t);
    std::vector<CompactFrame<double>> frames;
    std::vector<const CompactFrame<double>*> fields;
    std::vector<std::vector<double>> bars;
    std::vector<std::span<double>> spans;
    for (std::size_t k = 0; k < model.sensors().size() && of_fields; ++k) {
      frames.emplace_back(model, static_cast<int>(k));
      readout.read(batch, 0, frames.back());
      bars.emplace_back(frames.back().values().size());
    }
    for (std::size_t k = 0; k < frames.size(); ++k) fields.push_back(&frames[k]), spans.emplace_back(bars[k]);
    if (of_variables) readout.variables(batch, 0, x);
    const std::span<const double> u =
        t < s_.options.steps ? std::span(s_.at.u).subspan(std::size_t(t) * nu, nu) : std::span<const double>();
    s_.loss.evaluate({t, s_.options.steps, 0, q, v, u, of_variables ? std::span<const double>(x) : std::span<const double>(), fields},
                     {q_bar, v_bar, u_bar, of_variables ? std::span<double>(x_bar) : std::span<double>(), spans});
    double sum = 0;
    for (std::size_t i = 0; i < nv; ++i) sum += q_bar[i] * state.q[i] + v_bar[i] * state.v[i];
    for (std::size_t i = 0; i < nu; ++i) sum += u_bar[i] * u_dot[i];
    for (std::size_t k = 0; k < frames.size(); ++k) {
      std::vector<double> change(frames[k].dense_size()), of_tiles(change.size());
      tangent.field(batch, 0, 0, *tape_, t, static_cast<int>(k), rows, state, change);
      // The cotangents' layout is that of the tiles: spread them as the frame spreads its values.
      frames[k].spread(bars[k], of_tiles);
      sum += std::inner_product(change.begin(), change.end(), of_tiles.begin(), 0.0);
    }
    if (of_variables) sum += along_variables(batch, readout, x_bar, state);
    return sum;
  }

  static double along_variables(const Batch& batch, Readout& readout, const std::vector<double>& x_bar,
                                const StateTangent& state) {
    const auto nv = state.q.size();
    std::vector<double> jacobian(x_bar.size() * nv);
    readout.variable_jacobian(batch, 0, jacobian);
    double sum = 0;
    for (std::size_t i = 0; i < x_bar.size(); ++i)
      for (std::size_t k = 0; k < nv; ++k) sum += x_bar[i] * jacobian[i * nv + k] * state.q[k];
    return sum;
  }

  const Setting& s_;
  const Parameters& parameters_;
  std::optional<BlockTape> tape_;
};

std::vector<double> direction(std::size_t n, std::uint64_t seed, std::uint32_t purpose) {
  std::vector<double> d(n);
  for (std::size_t i = 0; i < n; ++i)
    d[i] = uniform({seed, 1, static_cast<std::int64_t>(i), Purpose::control, purpose}, -1, 1);
  return d;
}

void compare_tangent(CheckedInput& c, std::span<const double> gradient, const std::vector<double>& d, double along) {
  const double dot = std::inner_product(gradient.begin(), gradient.end(), d.begin(), 0.0);
  const double size = c.norm * norm_of(d);
  c.tangent_error = size > 0 ? std::abs(dot - along) / size : std::abs(along);
}

}  // namespace

double GradientCheck::max_relative_error() const {
  double worst = 0;
  for (const CheckedInput& c : inputs) worst = std::max({worst, c.difference_error, c.tangent_error});
  return worst;
}
std::size_t GradientCheck::entries() const {
  return std::accumulate(inputs.begin(), inputs.end(), std::size_t{0}, [](std::size_t n, const auto& c) { return n + c.compared; });
}
std::size_t GradientCheck::kinks() const {
  return std::accumulate(inputs.begin(), inputs.end(), std::size_t{0}, [](std::size_t n, const auto& c) { return n + c.kinks; });
}

GradientCheck check_gradient(const Batch& start, const StepControls& controls, const RolloutLoss& loss,
                             const CheckOptions& options) {
  const Model& model = start.model();
  const CompiledModel& m = model.compiled();
  const auto nu = std::size_t(model.nu());
  Setting s{start, loss, options, {numbers(model.nq()), numbers(model.nv()), std::vector<double>(std::size_t(options.steps) * nu)}, {}};
  for (std::size_t k = 0; k < model.scene().randomizations.size(); ++k)
    s.varying.push_back(start.randomized_value(0, static_cast<int>(k)));
  start.get_q(0, s.at.q);
  start.get_v(0, s.at.v);
  for (std::int64_t t = 0; t < options.steps; ++t) controls(t, 0, std::span(s.at.u).subspan(std::size_t(t) * nu, nu));
  const Parameters parameters(model);
  Directions tangents(s, parameters);

  GradientOptions wanted;
  wanted.steps = options.steps;
  wanted.stepper = options.stepper;
  wanted.parameters = true;
  const RolloutLoss* const losses[] = {&loss};
  const LossGradient g = rollout_gradients(start, controls, wanted, losses).losses[0];
  const std::span<const double> u(g.u.data(), std::size_t(options.steps) * nu), q(g.q.data(), std::size_t(m.nv)),
      v(g.v.data(), std::size_t(m.nv));
  // By relative changes of what this environment has: units differ.
  std::vector<double> has(std::size_t(parameters.count())), relative(has.size());
  for (std::size_t k = 0; k < has.size(); ++k) {
    const int random = parameters.randomization(model.scene(), static_cast<int>(k));
    has[k] = random < 0 ? parameters.infos()[k].value : s.varying[std::size_t(random)];
    relative[k] = g.parameters[k] * has[k];
  }

  GradientCheck out;
  out.loss = g.value[0];
  const auto along = [&](std::span<const double> gradient, const std::vector<double>& d, double value) {
    compare_tangent(out.inputs.back(), gradient, d, value);
  };
  if (nu > 0) {
    out.inputs.push_back(compare(
        s, "u", u, 0,
        [&](std::size_t i) { return difference_of(s, kControlScale, [i](Inputs& x, double e) { x.u[i] += e; }); },
        [&](std::size_t i) { return "step " + std::to_string(i / nu) + " " + std::string(model.u_names()[i % nu]); }));
    const std::vector<double> d = direction(u.size(), options.seed, 0);
    along(u, d, tangents.along({}, {}, d, {}));
  }
  out.inputs.push_back(compare(
      s, "q", q, 1,
      [&](std::size_t i) { return difference_of(s, 1, [&, i](Inputs& x, double e) { move(m, x.q, static_cast<int>(i), e); }); },
      [&](std::size_t i) { return std::string(model.v_names()[i]); }));
  std::vector<double> d = direction(q.size(), options.seed, 1);
  along(q, d, tangents.along(d, {}, {}, {}));
  out.inputs.push_back(compare(
      s, "v", v, 2,
      [&](std::size_t i) { return difference_of(s, kVelocityScale, [i](Inputs& x, double e) { x.v[i] += e; }); },
      [&](std::size_t i) { return std::string(model.v_names()[i]); }));
  d = direction(v.size(), options.seed, 2);
  along(v, d, tangents.along({}, d, {}, {}));
  out.inputs.push_back(compare(
      s, "numbers", relative, 3,
      [&](std::size_t k) { return difference_of_number(s, parameters, static_cast<int>(k)); },
      [&](std::size_t k) { return parameters.infos()[k].name; }));
  d = direction(relative.size(), options.seed, 3);
  std::vector<double> change(d.size());
  for (std::size_t k = 0; k < d.size(); ++k) change[k] = d[k] * has[k];
  along(relative, d, tangents.along({}, {}, {}, change));
  return out;
}

}  // namespace tangere
