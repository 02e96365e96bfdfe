// SPDX-License-Identifier: Apache-2.0
// The reference is SDIRK4, which is not among the schemes that are measured. Its step shrinks until
// it is off by at most a fortieth of the target, or until finer steps make it no better. How far it
// is off follows from SDIRK2 at the same step and from its own coarser steps: errors that all
// schemes share at one step show in the second alone.
#include "tasks/accuracy/accuracy_sweep.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "engine/base/as_size.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/accuracy/measured_order.hpp"
#include "tasks/accuracy/quantiles.hpp"

namespace tangere {
namespace {

constexpr double kReferenceTolerance = 1e-12;
/// Steps of the reference in a timestep of the scene.
constexpr std::array kReferenceParts = {8, 32, kFinestParts};
constexpr std::array kParts = {1, 2, 5, 10, 20, 50, 100};
constexpr std::array kAccuracies = {1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4};
constexpr std::array kTolerances = {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9};
constexpr int kPasses = 3;
constexpr double kEnoughSeconds = 0.3;  // of CPU time, after which a pass is not repeated
constexpr double kBlur = 10, kFineEnough = 40;
constexpr int kMostRepeats = 3;  // confirmation runs

/// Share of the errors that are 0.3 to 3 times `requested`. NaN entries do not count.
double share_near(double requested, const std::vector<double>& errors) {
  if (!(requested > 0)) return std::nan("");
  const auto known = std::ranges::count_if(errors, [](double x) { return !std::isnan(x); });
  const auto near = std::ranges::count_if(
      errors, [&](double x) { return x >= 0.3 * requested && x <= 3 * requested; });
  return static_cast<double>(near) / static_cast<double>(known);
}

std::string status_of(const AccuracyOutcome& outcome, int environments) {
  if (outcome.failures.empty()) return "ok";
  const FailedEnvironment& first = outcome.failures.front();
  return std::to_string(outcome.failures.size()) + " of " + std::to_string(environments) +
         " environments failed, " + std::to_string(first.environment) +
         " first: " + to_string(first.status) + " in step " + std::to_string(first.step);
}

class Sweep {
 public:
  Sweep(const FixedEpisodes& episodes, const AccuracyOptions& options,
        const AccuracyListener& listener, const FreshEpisodes& fresh)
      : episodes_(episodes),
        options_(options),
        listener_(listener),
        fresh_(fresh),
        run_(make_accuracy_run(episodes, options.quantity, options.threads)) {}

  AccuracyReport run_own() {
    report_.stopped = !find_reference() || !measure_own();
    return std::move(report_);
  }

  AccuracyReport run() {
    if (!find_reference()) return stop();
    if (!report_.resolved) check_vibration();
    if (report_.reference.environments == 0) return std::move(report_);  // the reference failed
    if (!measure_points() || !recompute_snapshots()) return stop();
    measure_orders();
    choose();
    if (!measure_own() || !measure_tolerances() || !measure_pitches()) return stop();
    return std::move(report_);
  }

 private:
  AccuracyReport stop() {
    report_.stopped = true;
    choose();
    return std::move(report_);
  }

  bool find_reference() {
    double last = HUGE_VAL;
    for (const int per_step : kReferenceParts) {
      AccuracySetting setting{Integrator::reference, episodes_.every * per_step,
                              kReferenceTolerance};
      const AccuracyOutcome made = run_->make_reference(setting, listener_.stop);
      // Discard an unfinished reference. The ones before it were too inaccurate.
      if (made.stopped) return false;
      std::array<AccuracyOutcome, 3> others;  // SDIRK2; itself with twice and four times the step
      for (std::size_t k = 0; k < others.size(); ++k) {
        const int divisor = k == 0 ? 1 : 1 << k;
        others[k] = run_->compare({k == 0 ? Integrator::second_reference : Integrator::reference,
                                   setting.parts / divisor, kReferenceTolerance},
                                  listener_.stop);
        if (others[k].stopped) return false;
      }
      describe_reference(setting, made, others);
      report_.reference.counts = made.counts;
      if (report_.reference.environments == 0 && made.failures.empty())
        throw InputError(options_.quantity == AccuracyQuantity::tactile
                             ? "nothing to compare: every field stays zero in every environment"
                         : options_.quantity == AccuracyQuantity::state
                             ? "nothing to compare: no coordinate moves in any environment"
                             : "nothing to compare: every derivative is zero in every environment");
      if (listener_.reference) listener_.reference(report_.reference);
      const double error = report_.reference.error;
      if (error <= options_.target / kFineEnough || error > 0.5 * last) break;
      last = error;
    }
    report_.resolved = report_.reference.error <= options_.target / 3;
    return true;
  }

  void describe_reference(const AccuracySetting& setting, const AccuracyOutcome& made,
                          const std::array<AccuracyOutcome, 3>& others) {
    errors_of_environments_ = others[0].error[0];
    const auto compared =
        std::ranges::count_if(errors_of_environments_, [](double x) { return !std::isnan(x); });
    const AccuracyOutcome& worse =
        made.failures.size() >= others[0].failures.size() ? made : others[0];
    const auto distance = [](const AccuracyOutcome& other) {
      const double found = quantile(other.error[0], 0.95);
      return std::isnan(found) ? HUGE_VAL : found;
    };
    AccuracyReference& r = report_.reference;
    r.setting = setting;
    r.step = episodes_.interval() / setting.parts;
    r.scheme_distance = distance(others[0]);
    r.step_distance = distance(others[1]);
    const RichardsonEstimate itself = richardson(r.step_distance, distance(others[2]));
    r.order = itself.order;
    r.error = std::max(r.scheme_distance, itself.error);
    r.environments = static_cast<int>(compared);
    r.failed = static_cast<int>(worse.failures.size());
    r.status = status_of(worse, episodes_.start.environments());
  }

  /// Measures vibration in the environment with the median reference error.
  void check_vibration() {
    if (episodes_.start.model().sensors().empty() || report_.reference.environments == 0) return;
    const double middle = quantile(errors_of_environments_, 0.5);
    const auto at = std::ranges::find(errors_of_environments_, middle);
    report_.vibration =
        strongest_vibration(episodes_, static_cast<int>(at - errors_of_environments_.begin()),
                            Integrator::second_reference, episodes_.every * kReferenceParts[0],
                            kReferenceTolerance, listener_.stop);
  }

  /// Gradients have a tolerance of their own. Nothing sleeps in a comparison.
  [[nodiscard]] double tolerance_in_force(StepperOptions options) const {
    const Model& model = episodes_.start.model();
    options.sleep = 0;
    options.differentiable = compares_gradients();
    return Stepper(model, options).tolerance();
  }
  [[nodiscard]] bool compares_gradients() const {
    return options_.quantity == AccuracyQuantity::gradient;
  }

  /// Sets the tolerance of a setting from its steps and accuracy. Whole steps use the default for
  /// their length, even if the scene has an explicit one.
  void give_tolerance(AccuracySetting& setting) const {
    const double step = episodes_.interval() / setting.parts;
    std::optional<double> tolerance = options_.tolerance;
    if (!tolerance && !compares_gradients() && setting.accuracy == 0)
      tolerance = episodes_.start.model().following_tolerance(setting.integrator, step);
    setting.tolerance = tolerance_in_force({.integrator = setting.integrator,
                                            .timestep = step,
                                            .tolerance = tolerance,
                                            .accuracy = setting.accuracy});
    setting.follows =
        !compares_gradients() && !options_.tolerance && !episodes_.start.model().solver().tolerance;
  }

  /// Plays a setting up to kPasses times; the least times count. Returns false when stopped.
  bool measure(const AccuracySetting& setting, std::vector<AccuracyPoint>& points) {
    AccuracyOutcome best = run_->compare(setting, listener_.stop);
    if (best.stopped) return false;
    double spent = best.step_seconds;
    bool stopped = false;  // what the first pass measured is kept
    for (int pass = 1; pass < kPasses && spent < kEnoughSeconds && !stopped; ++pass) {
      const AccuracyOutcome again = run_->compare(setting, listener_.stop);
      stopped = again.stopped;
      if (stopped) break;
      spent += again.step_seconds;
      best.step_seconds = std::min(best.step_seconds, again.step_seconds);
      for (std::size_t p = 0; p < kPrecisions.size(); ++p)
        best.read_seconds[p] = std::min(best.read_seconds[p], again.read_seconds[p]);
    }
    // States and derivatives have one precision, whatever fields are read in.
    for (std::size_t p = 0; p < precisions(); ++p) points.push_back(point_of(setting, best, p));
    if (listener_.setting) listener_.setting(std::span(points).last(precisions()));
    return !stopped;
  }
  [[nodiscard]] std::size_t precisions() const {
    return options_.quantity == AccuracyQuantity::tactile ? kPrecisions.size() : 1;
  }

  [[nodiscard]] AccuracyPoint point_of(const AccuracySetting& setting,
                                       const AccuracyOutcome& outcome, std::size_t p) const {
    AccuracyPoint point;
    point.setting = setting;
    point.precision = kPrecisions[p];
    point.step = episodes_.interval() / setting.parts;
    point.errors = outcome.error[p];
    const auto steps =
        static_cast<double>(std::max<std::int64_t>(1, outcome.counts.simulation_steps));
    point.evaluations = static_cast<double>(outcome.counts.newton_iterations) / steps;
    point.split = compares_gradients() ? std::nan("")
                                       : static_cast<double>(outcome.counts.split_steps) / steps;
    point.rate = outcome.simulated_seconds / (outcome.step_seconds + outcome.read_seconds[p]);
    point.failed = static_cast<int>(outcome.failures.size());
    point.status = status_of(outcome, episodes_.start.environments());
    set_errors(point);
    return point;
  }

  void set_errors(AccuracyPoint& point) const {
    point.error = quantile(point.errors, 0.95);
    point.bound = sure_quantile(point.errors, 0.95);
    point.median = quantile(point.errors, 0.5);
    point.within = share_near(point.setting.accuracy, point.errors);
    point.blurred = point.error < kBlur * report_.reference.error;
  }

  bool measure_points() {
    std::vector<int> cuts(kParts.begin(), kParts.end());
    cuts.push_back(episodes_.every);
    std::sort(cuts.begin(), cuts.end());
    cuts.erase(std::unique(cuts.begin(), cuts.end()), cuts.end());
    for (const int parts : cuts) {
      if (!episodes_.can_cut(parts) || 2 * parts > report_.reference.setting.parts) continue;
      for (const Integrator integrator : integrators()) {
        AccuracySetting setting{integrator, parts, 0};
        give_tolerance(setting);
        if (!measure(setting, report_.points)) return false;
      }
    }
    return measure_cut_steps();
  }

  void measure_orders() {
    for (const Integrator integrator : integrators()) {
      const AccuracyPoint *coarse = nullptr, *fine = nullptr;
      for (const AccuracyPoint& p : report_.points) {  // ever finer
        // Skip errors near the reference's own, unless coarser steps have most of the same error.
        const bool clear = !p.blurred || report_.reference.shares_errors();
        if (p.setting.integrator != integrator || p.setting.accuracy > 0 || !clear ||
            p.precision != Precision::f64 || !std::isfinite(p.median) || !(p.median > 0))
          continue;
        coarse = std::exchange(fine, &p);
      }
      if (coarse == nullptr) continue;
      report_.orders.push_back(
          {integrator, coarse->step, fine->step,
           std::log(coarse->median / fine->median) / std::log(coarse->step / fine->step)});
    }
  }

  /// Steps as long as the controls allow, cut into parts that keep an accuracy.
  bool measure_cut_steps() {
    const auto parts = std::ranges::find_if(kParts, [&](int n) { return episodes_.can_cut(n); });
    AccuracySetting setting{keeping_accuracy(Integrator::default_integrator, kAccuracies[0]),
                            parts == kParts.end() ? episodes_.every : *parts};
    for (const double accuracy : kAccuracies) {
      setting.accuracy = accuracy;
      give_tolerance(setting);
      if (!measure(setting, report_.points)) return false;
    }
    return true;
  }

  /// First points of the settings that may be cheaper than the best that is sure, fastest first.
  [[nodiscard]] std::vector<std::size_t> worth_repeating() const {
    double sure = 0;
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < report_.points.size(); ++i)
      if (suffices(report_.points[i])) sure = std::max(sure, report_.points[i].rate);
    // Of a setting's precisions the fastest that may do counts.
    std::vector<std::pair<double, std::size_t>> ranked;
    for (std::size_t i = 0; i < report_.points.size(); i += precisions()) {
      double fastest = 0;
      for (const AccuracyPoint& p : std::span(report_.points).subspan(i, precisions()))
        if (meets_target(p.error) && !meets_target(p.bound)) fastest = std::max(fastest, p.rate);
      if (fastest > options_.worth_repeating * sure) ranked.emplace_back(fastest, i);
    }
    std::ranges::sort(ranked, std::greater<>());
    for (const auto& [rate, i] : ranked) found.push_back(i);
    if (found.size() > kMostRepeats) found.resize(kMostRepeats);
    return found;
  }

  /// A few environments can be much worse than the rest, and the bound of 64 takes the worst of
  /// them. More environments bound the same quantile by a smaller error.
  bool recompute_snapshots() {
    const std::vector<std::size_t> candidates = worth_repeating();
    if (!report_.resolved || !fresh_ || candidates.empty()) return true;
    const std::optional<FixedEpisodes> episodes = fresh_();
    if (!episodes) return false;
    if (listener_.before_confirmation) listener_.before_confirmation();
    const std::unique_ptr<AccuracyRun> run =
        make_accuracy_run(*episodes, options_.quantity, options_.threads);
    const AccuracyOutcome made = run->make_reference(report_.reference.setting, listener_.stop);
    if (made.stopped) return false;
    failed_again_ = static_cast<int>(made.failures.size());
    for (const std::size_t first : candidates) {
      const AccuracyOutcome repeated = run->compare(report_.points[first].setting, listener_.stop);
      if (repeated.stopped) return false;
      const std::span points = std::span(report_.points).subspan(first, precisions());
      for (std::size_t p = 0; p < points.size(); ++p) add(repeated, p, points[p]);
      if (listener_.setting) listener_.setting(points);
    }
    return true;
  }

  void add(const AccuracyOutcome& repeated, std::size_t precision, AccuracyPoint& point) const {
    const std::vector<double>& more = repeated.error[precision];
    point.errors.insert(point.errors.end(), more.begin(), more.end());
    if (point.failed == 0) point.status = status_of(repeated, static_cast<int>(more.size()));
    point.failed += static_cast<int>(repeated.failures.size());
    set_errors(point);
  }

  bool measure_own() {
    const Model& model = episodes_.start.model();
    const AccuracySetting setting = {model.integrator(), episodes_.every, tolerance_in_force({}),
                                     Stepper(model).accuracy(),
                                     !compares_gradients() && !model.solver().tolerance};
    const auto swept = std::ranges::find(report_.points, setting, &AccuracyPoint::setting);
    if (swept != report_.points.end()) {
      report_.own = *swept;
      return true;
    }
    std::vector<AccuracyPoint> own;
    if (!measure(setting, own)) return false;
    report_.own = own.front();
    return true;
  }

  /// Whether an error does, however the reference's own adds to it.
  [[nodiscard]] bool meets_target(double error) const {
    return error + report_.reference.error <= options_.target;
  }

  /// Whether it is sure to meet the target, and fails nowhere but where the reference does.
  [[nodiscard]] bool suffices(const AccuracyPoint& p) const {
    const bool again = p.errors.size() > as_size(episodes_.start.environments());
    return meets_target(p.bound) &&
           p.failed <= report_.reference.failed + (again ? failed_again_ : 0);
  }

  void choose() {
    for (std::size_t i = 0; i < report_.points.size(); ++i) {
      const AccuracyPoint& p = report_.points[i];
      if (!suffices(p)) continue;
      if (report_.advice < 0 || p.rate > report_.points[as_size(report_.advice)].rate)
        report_.advice = static_cast<int>(i);
    }
  }

  bool measure_tolerances() {
    AccuracySetting setting = report_.own.setting;
    if (report_.advice >= 0) setting = report_.points[as_size(report_.advice)].setting;
    setting.follows = false;
    for (const double tolerance : kTolerances) {
      setting.tolerance = tolerance;
      if (!measure(setting, report_.tolerances)) return false;
    }
    return true;
  }

  bool measure_pitches() {
    if (options_.quantity != AccuracyQuantity::tactile) return true;
    report_.pitches = sweep_pitches(episodes_, options_.target, listener_.stop);
    return !report_.pitches.empty();
  }

  const FixedEpisodes& episodes_;
  const AccuracyOptions& options_;
  const AccuracyListener& listener_;
  const FreshEpisodes& fresh_;
  std::unique_ptr<AccuracyRun> run_;
  AccuracyReport report_;
  std::vector<double> errors_of_environments_;
  int failed_again_ = 0;  ///< environments in which the reference of the confirmation run failed
};

}  // namespace

AccuracyReport accuracy_sweep(const FixedEpisodes& episodes, const AccuracyOptions& options,
                              const AccuracyListener& listener, const FreshEpisodes& fresh) {
  return Sweep(episodes, options, listener, fresh).run();
}

AccuracyReport own_accuracy(const FixedEpisodes& episodes, const AccuracyOptions& options,
                            const AccuracyListener& listener) {
  return Sweep(episodes, options, listener, {}).run_own();
}

}  // namespace tangere
