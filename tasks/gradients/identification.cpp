// SPDX-License-Identifier: Apache-2.0
// Residuals, their Jacobian and the fit: minimise ½|r(exp x)|² by (F + λ diag F) δ = −g, F = JᵀJ.
#include "tasks/gradients/identification.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "engine/derivative/number_gradients.hpp"
#include "engine/model/random.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/sense/readout.hpp"

namespace tangere {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

constexpr double kDifference =
    1e-6;  // of logarithms; small, so that few points start to touch or slip within it
constexpr double kRounding = 1e-8;  // of logarithms
constexpr double kLongest = 1.5;    // of logarithms in one step, because the model is linear
constexpr double kFarthest = 4;     // factor of other starts
/// Of the squared change of normalised fields along the weakest direction: differences err by 1e-4.
constexpr double kWeakest = 1e-8;
constexpr double kNew = 1e-3;    // share of a column that the sought numbers must not have
constexpr double kAlike = 1e-3;  // of two misfits
constexpr double kShare = 0.1;   // of a number in that direction

std::size_t numbers_of_fields(const Model& model) {
  std::size_t n = 0;
  for (const SensorInfo& s : model.sensors()) n += 3 * std::size_t(s.points);
  return n;
}

void check_run(const RecordedRun& run) {
  if (run.every < 1 || run.steps < run.every)
    throw InputError(
        fmt::format("a recording of {} steps read every {}; expected at least one reading",
                    run.steps, run.every));
}

std::vector<int> places_of(const NumberGradients& parameters, const Scene& scene,
                           std::span<const std::string> names) {
  std::vector<int> out;
  std::string known;
  for (const NumberInfo& info : parameters.infos())
    known += (known.empty() ? "'" : ", '") + info.name + "'";
  for (const std::string& name : names) {
    const auto infos = parameters.infos();
    const auto at = std::find_if(infos.begin(), infos.end(),
                                 [&](const NumberInfo& i) { return i.name == name; });
    if (at == infos.end())
      throw InputError(
          fmt::format("{}: no number '{}'; expected one of {}", scene.path, name, known));
    out.push_back(static_cast<int>(at - infos.begin()));
  }
  return out;
}

/// The residuals of the sequence as a function of x, the logarithms of the sought numbers.
class Problem {
 public:
  Problem(const Scene& scene, const RecordedRun& run, const FieldSequence& recorded,
          const std::vector<std::string>& names)
      : scene_(scene),
        run_(run),
        recorded_(recorded),
        names_(names),
        places_(places_of(NumberGradients(Model(scene)), scene, names)) {}

  [[nodiscard]] Eigen::Index count() const { return static_cast<Eigen::Index>(places_.size()); }
  [[nodiscard]] Vector start() const {
    const std::vector<double> values = numbers_of(scene_, names_);
    Vector x(count());
    for (Eigen::Index k = 0; k < count(); ++k) {
      const double value = values[std::size_t(k)];
      if (!(value > 0))
        throw InputError(
            fmt::format("{}: '{}' is {} at the start of a fit; expected a positive number",
                        scene_.path, names_[std::size_t(k)], value));
      x[k] = std::log(value);
    }
    return x;
  }

  struct Value {
    double misfit;    // infinite if the rollout fails there
    Vector gradient;  // by x
  };
  [[nodiscard]] Value evaluate(const Vector& x) const {
    const Model model(at(x));
    const FieldMisfit misfit(model, recorded_);
    const RolloutLoss* const losses[] = {&misfit};
    TapeOptions options;
    options.length = run_.steps;
    options.parameters = true;
    const GradientSummary summary =
        rollout_gradients(Batch(model, 1), run_.controls, options, losses);
    if (!summary.failures.empty())
      return {std::numeric_limits<double>::infinity(), Vector::Zero(count())};
    Value out{summary.losses[0].value[0], Vector(count())};
    for (Eigen::Index k = 0; k < count(); ++k)  // ∂/∂ log p = p ∂/∂p
      out.gradient[k] =
          std::exp(x[k]) * summary.losses[0].parameters[std::size_t(places_[std::size_t(k)])];
    return out;
  }

  /// Returns ∂ fields / ∂x, (numbers of the whole sequence, count).
  [[nodiscard]] Matrix jacobian(const Vector& x) const {
    Matrix J(static_cast<Eigen::Index>(recorded_.readings.size() * recorded_.readings[0].size()),
             count());
    for (Eigen::Index k = 0; k < count(); ++k) {
      const Vector step = kDifference * Vector::Unit(count(), k);
      J.col(k) = (fields(x + step) - fields(x - step)) / (2 * kDifference);
      if (J.col(k).isZero(0))
        throw InputError(fmt::format(
            "{}: the fields do not depend on '{}'; expected numbers that a recording can show",
            scene_.path, names_[std::size_t(k)]));
    }
    return J;
  }
  /// Returns ∂ fields / ∂ log of another number of the scene; none where a rollout fails.
  [[nodiscard]] std::optional<Vector> column(const Vector& x, const NumberInfo& number) const {
    const Scene scene = at(x);
    const auto moved = [&](double change) {
      const double value = number.value * std::exp(change);
      return flat(simulate_fields(with_numbers(scene, {&number.name, 1}, {&value, 1}), run_));
    };
    try {
      return (moved(kDifference) - moved(-kDifference)) / (2 * kDifference);
    } catch (const InputError&) {
      return std::nullopt;
    }
  }
  /// The numbers of the scene that are not sought and not 0.
  [[nodiscard]] std::vector<NumberInfo> others() const {
    const NumberGradients parameters{Model(scene_)};
    std::vector<NumberInfo> out;
    for (const NumberInfo& info : parameters.infos())
      if (info.value != 0 && std::ranges::find(names_, info.name) == names_.end())
        out.push_back(info);
    return out;
  }
  [[nodiscard]] Vector residuals(const Vector& x) const { return fields(x) - flat(recorded_); }
  [[nodiscard]] ResidualTest test(const Vector& x, double noise) const {
    const Scene scene = at(x);
    return test_residuals(Model(scene), simulate_fields(scene, run_), recorded_, noise);
  }

 private:
  [[nodiscard]] Scene at(const Vector& x) const {
    const Vector values = x.array().exp();
    return with_numbers(scene_, names_, {values.data(), std::size_t(values.size())});
  }
  [[nodiscard]] Vector fields(const Vector& x) const { return flat(simulate_fields(at(x), run_)); }
  static Vector flat(const FieldSequence& s) {
    Vector out(static_cast<Eigen::Index>(s.readings.size() * s.readings[0].size()));
    Eigen::Index row = 0;
    for (const auto& reading : s.readings)
      for (double f : reading) out[row++] = f;
    return out;
  }

  const Scene& scene_;
  const RecordedRun& run_;
  const FieldSequence& recorded_;
  const std::vector<std::string>& names_;
  std::vector<int> places_;  // indices in NumberGradients::infos()
};

/// Returns JᵀJ. A lazy product suits few columns and compiles in a tenth of the time of a fast one.
Matrix information(const Matrix& J) { return J.transpose().lazyProduct(J); }

/// Whether the fit may end. A step that changed the misfit by `gain` ends it if it is worth at most
/// `tolerance` standard deviations of the numbers, which is ½ tolerance² variances of a residual,
/// or if it is a rounding error. The gradient is no criterion: a minimum may lie on a crease, where
/// points start to touch or to slip, and the gradient does not vanish there.
bool is_end(double gain, double misfit, Eigen::Index residuals, double tolerance,
            const Vector& step) {
  const double variance = 2 * misfit / static_cast<double>(residuals);
  return std::abs(gain) < 0.5 * tolerance * tolerance * variance ||
         step.lpNorm<Eigen::Infinity>() < kRounding;
}

FitPoint fit_point(const Vector& x, const Problem::Value& value) {
  FitPoint p;
  for (Eigen::Index k = 0; k < x.size(); ++k) p.values.push_back(std::exp(x[k]));
  p.misfit = value.misfit;
  p.gradient = value.gradient.norm();
  return p;
}

/// A fit from one start.
struct Fit {
  Vector x;
  Matrix J;
  std::vector<FitPoint> points;
  bool converged = false;
};

Fit fit_from(const Problem& problem, const Vector& start, Problem::Value now, Matrix J,
             const IdentificationOptions& options) {
  Fit fit{start, std::move(J), {fit_point(start, now)}};
  double damping = 1e-2;
  for (int iteration = 0; iteration < options.max_iterations && !fit.converged; ++iteration) {
    Matrix H = information(fit.J);
    H.diagonal() *= 1 + damping;
    Vector step = H.ldlt().solve(-now.gradient);
    step *= std::min(1.0, kLongest / step.lpNorm<Eigen::Infinity>());
    const Problem::Value next = problem.evaluate(fit.x + step);
    fit.converged =
        is_end(now.misfit - next.misfit, now.misfit, fit.J.rows(), options.tolerance, step);
    if (!(next.misfit < now.misfit)) {
      damping *= 8;
      continue;
    }
    damping /= 8;
    fit.x += step;
    now = next;
    fit.points.push_back(fit_point(fit.x, now));
    fit.J = problem.jacobian(fit.x);
  }
  return fit;
}

/// The same; none where a rollout fails, or one on the way does not depend on a number.
std::optional<Fit> try_from(const Problem& problem, const Vector& start,
                            const IdentificationOptions& options) {
  try {
    const Problem::Value value = problem.evaluate(start);
    if (!std::isfinite(value.misfit)) return std::nullopt;
    return fit_from(problem, start, value, problem.jacobian(start), options);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

Vector start_of(const Problem& problem, int fit, std::uint64_t seed) {
  Vector x = problem.start();
  for (Eigen::Index k = 0; k < x.size() && fit > 0; ++k)
    x[k] += std::log(log_uniform({seed, 1, fit, Purpose::tactile, static_cast<std::uint32_t>(k)},
                                 1 / kFarthest, kFarthest));
  return x;
}

/// Appends the numbers with a share in the first of `modes`, the weakest direction.
void add_weakest(const Eigen::SelfAdjointEigenSolver<Matrix>& modes, std::vector<int>& to) {
  for (Eigen::Index k = 0; k < modes.eigenvalues().size(); ++k)
    if (std::abs(modes.eigenvectors()(k, 0)) > kShare) to.push_back(static_cast<int>(k));
}

/// Computes deviations and correlations of the parameters from the information F.
void set_deviations(const Matrix& F, const Matrix& J, Identification& out) {
  const Eigen::Index n = F.cols();
  const Eigen::SelfAdjointEigenSolver<Matrix> modes(F);
  // Smaller eigenvalues are rounding errors of the largest.
  const double least = std::numeric_limits<double>::epsilon() * modes.eigenvalues()[n - 1];
  const Vector known = modes.eigenvalues().cwiseMax(least);
  out.condition = known[n - 1] / known[0];
  const Matrix V = modes.eigenvectors();
  const Matrix W = V * known.cwiseInverse().asDiagonal();
  const Matrix C = W.lazyProduct(V.transpose());
  for (Eigen::Index k = 0; k < n; ++k) out.deviation.push_back(std::sqrt(C(k, k)));
  for (Eigen::Index k = 0; k < n; ++k)
    for (Eigen::Index j = 0; j < n; ++j)
      out.correlation.push_back(C(k, j) / std::sqrt(C(k, k) * C(j, j)));
  if (modes.eigenvalues()[0] <= least) {
    add_weakest(modes, out.inseparable);
    for (const int k : out.inseparable) out.deviation[std::size_t(k)] = HUGE_VAL;
  }
  Matrix scaled = J;
  scaled.colwise().normalize();
  const Eigen::SelfAdjointEigenSolver<Matrix> scaled_modes(information(scaled));
  if (scaled_modes.eigenvalues()[0] < kWeakest) add_weakest(scaled_modes, out.inseparable);
  for (Eigen::Index k = 0; k < n; ++k)
    if (!(out.deviation[std::size_t(k)] <= Identification::kMostDeviation))
      out.inseparable.push_back(static_cast<int>(k));
  std::sort(out.inseparable.begin(), out.inseparable.end());
  out.inseparable.erase(std::unique(out.inseparable.begin(), out.inseparable.end()),
                        out.inseparable.end());
}

/// Sets the result flags of a finished fit.
void set_flags(const Problem& problem, const Fit& fit, double stated_noise, Identification& out) {
  const Matrix& J = fit.J;
  out.points = fit.points;
  out.converged = fit.converged;
  out.noise =
      std::sqrt(2 * fit.points.back().misfit / static_cast<double>(J.rows() - problem.count()));
  out.residual = problem.test(fit.x, stated_noise);
  // A perfect fit has no scale: the information is then that of unit noise.
  const double scale = out.noise > 0 ? 1 / (out.noise * out.noise) : 1;
  const Matrix F = scale * information(J);
  out.information.assign(F.data(), F.data() + F.size());
  set_deviations(F, J, out);
}

/// Whether a fit replaces the best one so far. Of equal fits the first converged one stays.
bool is_better(const FitEnds& fit, const Identification& best) {
  if (best.points.empty()) return true;
  const double misfit = best.points.back().misfit;
  return fit.misfit < (1 - kAlike) * misfit ||
         (fit.converged && !best.converged && fit.misfit <= (1 + kAlike) * misfit);
}

/// Finds the parameter outside the fit whose change would reduce the residual most.
void find_suspect(const Problem& problem, Identification& out) {
  ResidualTest& test = out.residual;
  if (!test.tested) return;
  const Vector x = Eigen::Map<const Vector>(out.values().data(), problem.count()).array().log();
  const Matrix J = problem.jacobian(x);
  const Vector r = problem.residuals(x);
  const Eigen::LDLT<Matrix> F = information(J).ldlt();
  double missed = 0;
  for (const NumberInfo& number : problem.others()) {
    const std::optional<Vector> column = problem.column(x, number);
    if (!column) continue;
    const Vector along = F.solve(J.transpose().lazyProduct(*column));
    const Vector across = *column - J.lazyProduct(along);
    const double size = across.norm();
    if (!(size > kNew * column->norm())) continue;
    const double score = -across.dot(r) / (out.noise * size);
    if (std::abs(score) <= std::abs(test.suspect_score)) continue;
    test.suspect = number.name;
    test.suspect_score = score;
    test.suspect_change = score * out.noise / size;
    missed = score * column->norm() / size;
  }
  test.excess = std::max(test.excess, missed * missed);
  test.score = std::max(test.score, std::abs(test.suspect_score));
}

}  // namespace

std::vector<double> numbers_of(const Scene& scene, std::span<const std::string> names) {
  const NumberGradients parameters{Model(scene)};
  std::vector<double> out;
  for (int k : places_of(parameters, scene, names))
    out.push_back(parameters.infos()[std::size_t(k)].value);
  return out;
}

Scene with_numbers(const Scene& scene, std::span<const std::string> names,
                   std::span<const double> values) {
  const NumberGradients parameters{Model(scene)};
  Scene out = scene;
  std::size_t n = 0;
  for (int k : places_of(parameters, scene, names))
    number_in(out, parameters.infos()[std::size_t(k)].number) = values[n++];
  return out;
}

FieldSequence simulate_fields(const Scene& scene, const RecordedRun& run) {
  check_run(run);
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model, {.differentiable = true});
  Readout readout(model);
  std::vector<double> u(std::size_t(model.nu()));
  FieldSequence out{run.every, {}};
  for (std::int64_t t = 0; t < run.steps; ++t) {
    run.controls(t, 0, u);
    stepper.step(batch, u);
    if (failed(batch.status(0)))
      throw InputError(fmt::format("{}: step {} failed ({}); expected a rollout of {} steps",
                                   scene.path, t, to_string(batch.status(0)), run.steps));
    if ((t + 1) % run.every != 0) continue;
    std::vector<double>& reading = out.readings.emplace_back(numbers_of_fields(model));
    std::size_t first = 0;
    for (std::size_t s = 0; s < model.sensors().size(); ++s) {
      const std::size_t size = 3 * std::size_t(model.sensors()[s].points);
      readout.tactile(batch, 0, static_cast<int>(s), std::span(reading).subspan(first, size));
      first += size;
    }
  }
  return out;
}

double identification_bytes(const Model& model, const RecordedRun& run, std::size_t numbers) {
  TapeOptions options;
  options.length = run.steps;
  options.parameters = true;
  // The recording, its residuals, two runs of a difference, and columns of the Jacobian.
  const double sequences = 4 + static_cast<double>(numbers);
  return sequences * static_cast<double>(run.steps / run.every) *
             static_cast<double>(numbers_of_fields(model) * sizeof(double)) +
         gradient_bytes(model, 1, options, 1);
}

void add_noise(FieldSequence& sequence, double deviation, std::uint64_t seed) {
  for (std::size_t k = 0; k < sequence.readings.size(); ++k)
    for (std::size_t i = 0; i < sequence.readings[k].size(); ++i)
      // Steps start at 1, because <randomize> draws for sensors with step 0.
      sequence.readings[k][i] += normal({seed, 0, static_cast<std::int64_t>(k) + 1,
                                         Purpose::tactile, static_cast<std::uint32_t>(i)},
                                        0, deviation);
}

FieldMisfit::FieldMisfit(const Model& model, const FieldSequence& recorded)
    : model_(model), recorded_(recorded) {
  for (std::size_t s = 0; s < model.sensors().size(); ++s)
    tiles_.push_back(points_by_tile(model, static_cast<int>(s)));
  for (const auto& reading : recorded.readings) {
    if (reading.size() != numbers_of_fields(model))
      throw InputError(
          fmt::format("a recorded reading of {} numbers; expected {}, three for each tactile point "
                      "of the scene",
                      reading.size(), numbers_of_fields(model)));
    std::vector<double>& squares = squares_.emplace_back();
    const double* sensor_field = reading.data();
    for (std::size_t s = 0; s < tiles_.size(); ++s) {
      for (const std::vector<TilePoint>& points : tiles_[s]) {
        double& sum = squares.emplace_back(0);
        for (const TilePoint& p : points)
          for (int c = 0; c < 3; ++c)
            sum += 0.5 * sensor_field[3 * p.point + c] * sensor_field[3 * p.point + c];
      }
      sensor_field += 3 * model.sensors()[s].points;
    }
  }
}

/// Where nothing touches, T = 0 and a tile contributes ½ T_recorded². That is known in advance and
/// constant.
double FieldMisfit::evaluate(const LossPoint& at, const LossCotangent& out) const {
  if (!reads_fields(at.step)) return 0;
  const auto k = static_cast<std::size_t>(at.step / recorded_.every) - 1;
  const double* reading = recorded_.readings[k].data();
  const double* squares = squares_[k].data();
  double sum = 0;
  for (std::size_t s = 0; s < at.fields.size(); ++s) {
    const std::span<const int> touched = at.fields[s]->tiles();
    std::size_t t = 0;
    for (std::size_t tile = 0; tile < tiles_[s].size(); ++tile) {
      if (t == touched.size() || touched[t] != static_cast<int>(tile)) {
        sum += squares[tile];
        continue;
      }
      for (const TilePoint& p : tiles_[s][tile])
        for (std::size_t c = 0; c < 3; ++c) {
          const std::size_t i = (3 * t + c) * kTilePoints + std::size_t(p.place);
          const double residual = at.fields[s]->values()[i] - reading[3 * std::size_t(p.point) + c];
          sum += 0.5 * residual * residual;
          out.fields[s][i] += residual;
        }
      ++t;
    }
    reading += 3 * model_.sensors()[s].points;
    squares += tiles_[s].size();
  }
  return sum;
}

Identification identify(const Scene& scene, const RecordedRun& run, const FieldSequence& recorded,
                        const IdentificationOptions& options) {
  check_run(run);
  if (recorded.every != run.every ||
      static_cast<std::int64_t>(recorded.readings.size()) != run.steps / run.every)
    throw InputError(
        fmt::format("a recording of {} readings, one every {} steps; expected {}, one every {}",
                    recorded.readings.size(), recorded.every, run.steps / run.every, run.every));
  const Problem problem(scene, run, recorded, options.numbers);
  const Vector x = problem.start();
  const Problem::Value value = problem.evaluate(x);
  if (!std::isfinite(value.misfit))
    throw InputError(scene.path + ": the rollout fails at the start of the fit");
  const Matrix J = problem.jacobian(x);
  const Vector difference_gradient = J.transpose().lazyProduct(problem.residuals(x));
  Identification best;
  std::vector<FitEnds> fits;
  for (int k = 0; k < options.starts; ++k) {
    const Vector from = start_of(problem, k, options.seed);
    const std::optional<Fit> fit = try_from(problem, from, options);
    const Vector values = from.array().exp();
    FitEnds& ends = fits.emplace_back();
    ends.start.assign(values.begin(), values.end());
    ends.misfit = HUGE_VAL;
    if (!fit) continue;
    ends.end = fit->points.back().values;
    ends.misfit = fit->points.back().misfit;
    ends.converged = fit->converged;
    if (!is_better(ends, best)) continue;
    best = {};
    set_flags(problem, *fit, options.noise, best);
    if (best.passed()) break;
  }
  if (best.points.empty())
    throw InputError(
        fmt::format("{}: none of {} starts leads to an end, because rollouts fail on "
                    "the way or show nothing; expected a better guess",
                    scene.path, fits.size()));
  find_suspect(problem, best);
  if (!best.residual.is_noise())
    for (double& deviation : best.deviation) deviation *= std::sqrt(1 + best.residual.excess);
  best.gradient_difference =
      (value.gradient - difference_gradient).norm() / difference_gradient.norm();
  best.fits = std::move(fits);
  return best;
}

}  // namespace tangere
