// SPDX-License-Identifier: Apache-2.0
// Samples are compared as they come; only the reference's are kept, without their zeros.
#include "tasks/accuracy/accuracy_run.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "engine/base/as_size.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/accuracy/gradient_run.hpp"
#include "tasks/run/block_reader.hpp"
#include "tasks/run/block_threads.hpp"
#include "tasks/run/thread_time.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

constexpr double kStill = 1e-6;  // of the widest range

/// Numbers of one sample that are not zero.
struct SparseSample {
  std::vector<std::int32_t> at;
  std::vector<double> value;

  void keep(std::span<const double> numbers) {
    at.clear();
    value.clear();
    for (std::size_t i = 0; i < numbers.size(); ++i)
      if (numbers[i] != 0) {
        at.push_back(static_cast<std::int32_t>(i));
        value.push_back(numbers[i]);
      }
  }
};

/// Σ (w (x - reference))². `weight` is empty where all are one.
template <class T>
double squared_distance(std::span<const T> x, const SparseSample& reference,
                        std::span<const double> weight) {
  double sum = 0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    double difference = static_cast<double>(x[i]);
    if (next < reference.at.size() && as_size(reference.at[next]) == i)
      difference -= reference.value[next++];
    if (!weight.empty()) difference *= weight[i];
    sum += difference * difference;
  }
  return sum;
}

std::size_t width_of(const Model& model, AccuracyQuantity quantity) {
  if (quantity == AccuracyQuantity::state) return as_size(model.nq());
  std::size_t width = 0;
  for (const SensorInfo& sensor : model.sensors()) width += 3 * as_size(sensor.points);
  return width;
}

/// What one block did.
struct BlockOutcome {
  double step_seconds = 0;
  std::array<double, kPrecisions.size()> read_seconds{};
  StepCounts counts;
  std::int64_t samples = 0;
  std::vector<FailedEnvironment> failures;
};

/// Of fields and states, sample by sample.
class SampleRun : public AccuracyRun {
 public:
  SampleRun(const FixedEpisodes& fixed, AccuracyQuantity what, int thread_count)
      : episodes(fixed),
        quantity(what),
        width(width_of(fixed.start.model(), what)),
        threads(thread_count) {
    const Model& model = episodes.start.model();
    if (width == 0) throw InputError("the scene has no tactile sensor; compare its state instead");
    for (int i = 0; i < thread_count; ++i)
      workers.push_back({Readout(model), Readout(model, Precision::mixed),
                         std::vector<double>(kBlock * width), std::vector<float>(kBlock * width)});
    reference.resize(environments() * as_size(episodes.samples));
    for (std::size_t s = 0; s < model.sensors().size(); ++s)
      fields.push_back({static_cast<int>(s), FieldForm::ideal});
  }

  AccuracyOutcome make_reference(const AccuracySetting& setting,
                                 const std::stop_token& stop) override {
    AccuracyOutcome out = play(setting, stop, true);
    if (!out.stopped) weigh(out);
    return out;
  }

  AccuracyOutcome compare(const AccuracySetting& setting, const std::stop_token& stop) override {
    AccuracyOutcome out = play(setting, stop, false);
    if (out.stopped) return out;
    for (std::size_t p = 0; p < kPrecisions.size(); ++p)
      out.error[p] = relative_errors(sum[quantity == AccuracyQuantity::state ? 0 : p], norm,
                                     no_reference, out.failures);
    return out;
  }

 private:
  /// Scratch of one thread.
  struct Worker {
    Readout exact, mixed;
    std::vector<double> wide;  // (16, width)
    std::vector<float> narrow;
    std::unique_ptr<Stepper> stepper{};
  };

  const FixedEpisodes& episodes;
  AccuracyQuantity quantity;
  std::size_t width;
  BlockThreads threads;
  std::vector<Worker> workers;
  std::vector<FieldOutput> fields;                          // ideal, of every sensor
  std::vector<SparseSample> reference;                      // (E, samples)
  std::vector<double> norm;                                 // (E) squared, over samples
  std::vector<double> weight;                               // (width) of the state
  std::vector<char> no_reference;                           // (E) the reference failed
  std::array<std::vector<double>, kPrecisions.size()> sum;  // (E) squared distance so far

  [[nodiscard]] std::size_t environments() const { return as_size(episodes.start.environments()); }
  [[nodiscard]] SparseSample& kept(int environment, int sample) {
    return reference[as_size(environment) * as_size(episodes.samples) + as_size(sample)];
  }
  template <class T>
  [[nodiscard]] std::span<T> lane(std::vector<T>& buffer, int environment) const {
    return std::span(buffer).subspan(as_size(environment % kBlock) * width, width);
  }

  template <class T>
  void read_fields(Readout& readout, const Batch& batch, int block, std::vector<T>& to) const {
    tangere::read_fields<T>(readout, batch, block, fields, [&](int e) { return lane(to, e); });
  }

  void read(Worker& w, const Batch& batch, int block, bool both, BlockOutcome& out) const {
    if (quantity == AccuracyQuantity::state) {
      const int first = block * kBlock;
      for (int e = first; e < first + lanes_of(batch, block); ++e) batch.get_q(e, lane(w.wide, e));
      return;
    }
    const double begin = thread_seconds();
    read_fields(w.exact, batch, block, w.wide);
    const double between = thread_seconds();
    out.read_seconds[0] += between - begin;
    if (!both) return;
    read_fields(w.mixed, batch, block, w.narrow);
    out.read_seconds[1] += thread_seconds() - between;
  }

  void compare_sample(Worker& w, int e, int sample) {
    const SparseSample& of = kept(e, sample);
    sum[0][as_size(e)] += squared_distance<double>(lane(w.wide, e), of, weight);
    if (quantity == AccuracyQuantity::tactile)
      sum[1][as_size(e)] += squared_distance<float>(lane(w.narrow, e), of, weight);
  }

  AccuracyOutcome play(const AccuracySetting& setting, const std::stop_token& stop, bool keep) {
    const double interval = episodes.interval();
    const std::optional<double> tolerance =
        setting.follows ? std::nullopt : std::optional(setting.tolerance);
    for (Worker& w : workers)
      w.stepper = std::make_unique<Stepper>(episodes.start.model(),
                                            StepperOptions{.integrator = setting.integrator,
                                                           .timestep = interval / setting.parts,
                                                           .tolerance = tolerance,
                                                           .accuracy = setting.accuracy,
                                                           .sleep = 0});
    for (std::vector<double>& s : sum) s.assign(environments(), 0);
    Batch batch = episodes.start;
    std::vector<BlockOutcome> blocks(as_size(batch.blocks()));
    std::atomic<bool> stopped{false};
    threads.for_each(batch.blocks(), workers, [&](Worker& w, int b) {
      play_block(setting, stop, keep, w, batch, b, blocks[as_size(b)], stopped);
    });
    AccuracyOutcome out;
    for (const BlockOutcome& block : blocks) {
      out.step_seconds += block.step_seconds;
      for (std::size_t p = 0; p < kPrecisions.size(); ++p)
        out.read_seconds[p] += block.read_seconds[p];
      out.counts += block.counts;
      out.simulated_seconds += static_cast<double>(block.samples) * interval;
      out.failures.insert(out.failures.end(), block.failures.begin(), block.failures.end());
    }
    out.stopped = stopped;
    return out;
  }

  void play_block(const AccuracySetting& setting, const std::stop_token& stop, bool keep, Worker& w,
                  Batch& batch, int b, BlockOutcome& out, std::atomic<bool>& stopped) {
    const int first = b * kBlock, lanes = lanes_of(batch, b);
    StepTally tally(batch, first, lanes);
    const auto after_step = [&](std::int64_t step) { tally.count(batch, step); };
    const auto after_sample = [&](int k) {
      read(w, batch, b, !keep, out);
      for (int e = first; e < first + lanes; ++e) {
        if (batch.held(e) || !tally.live(e)) continue;
        ++out.samples;
        if (keep)
          kept(e, k).keep(lane(w.wide, e));
        else
          compare_sample(w, e, k);
      }
    };
    if (!episodes.play(*w.stepper, setting.parts, batch, b, out.step_seconds, stop, after_step,
                       after_sample)) {
      stopped = true;
      return;
    }
    out.counts = tally.counts;
    out.failures = std::move(tally.failures);
  }

  /// Computes norms and weights once the reference is complete.
  void weigh(const AccuracyOutcome& out) {
    no_reference.assign(environments(), 0);
    for (const FailedEnvironment& f : out.failures) no_reference[as_size(f.environment)] = 1;
    norm.assign(environments(), 0);
    if (quantity == AccuracyQuantity::state) weigh_state();
    for (int e = 0; e < episodes.start.environments(); ++e)
      for (int k = 0; k < episodes.samples_of[as_size(e)]; ++k)
        if (quantity == AccuracyQuantity::tactile) {
          for (const double x : kept(e, k).value) norm[as_size(e)] += x * x;
        } else {
          for (const double w : weight) norm[as_size(e)] += w > 0 ? 1 : 0;
        }
  }

  /// A coordinate weighs by the range that it covers in all environments together. One that stands
  /// still beside the others does not count: what it shows is rounding.
  void weigh_state() {
    std::vector<double> low(width, HUGE_VAL), high(width, -HUGE_VAL);
    for (int e = 0; e < episodes.start.environments(); ++e)
      for (int k = 0; k < episodes.samples_of[as_size(e)] && no_reference[as_size(e)] == 0; ++k) {
        std::vector<double> q(width);
        for (std::size_t i = 0; i < kept(e, k).at.size(); ++i)
          q[as_size(kept(e, k).at[i])] = kept(e, k).value[i];
        for (std::size_t i = 0; i < width; ++i) {
          low[i] = std::min(low[i], q[i]);
          high[i] = std::max(high[i], q[i]);
        }
      }
    double widest = 0;
    for (std::size_t i = 0; i < width; ++i) widest = std::max(widest, high[i] - low[i]);
    weight.resize(width);
    for (std::size_t i = 0; i < width; ++i)
      weight[i] = high[i] - low[i] > kStill * widest ? 1 / (high[i] - low[i]) : 0;
  }
};

}  // namespace

const char* to_string(AccuracyQuantity value) {
  switch (value) {
    case AccuracyQuantity::tactile: return "tactile";
    case AccuracyQuantity::state: return "state";
    case AccuracyQuantity::gradient: break;
  }
  return "gradient";
}

const char* accuracy_meaning(AccuracyQuantity value) {
  return value == AccuracyQuantity::tactile ? "tactile fields" : to_string(value);
}

std::vector<double> relative_errors(std::span<const double> squared_distance,
                                    std::span<const double> squared_norm,
                                    std::span<const char> no_reference,
                                    std::span<const FailedEnvironment> failures) {
  std::vector<double> errors(squared_norm.size());
  for (std::size_t e = 0; e < errors.size(); ++e)
    errors[e] = no_reference[e] != 0 || !(squared_norm[e] > 0)
                    ? std::numeric_limits<double>::quiet_NaN()
                    : std::sqrt(squared_distance[e] / squared_norm[e]);
  for (const FailedEnvironment& f : failures)
    if (no_reference[as_size(f.environment)] == 0) errors[as_size(f.environment)] = HUGE_VAL;
  return errors;
}

std::unique_ptr<AccuracyRun> make_accuracy_run(const FixedEpisodes& episodes,
                                               AccuracyQuantity quantity, int threads) {
  if (quantity == AccuracyQuantity::gradient)
    return std::make_unique<GradientRun>(episodes, threads);
  return std::make_unique<SampleRun>(episodes, quantity, threads);
}

double accuracy_bytes(const FixedEpisodes& episodes, AccuracyQuantity quantity, int threads) {
  if (quantity == AccuracyQuantity::gradient) return GradientRun::bytes(episodes, threads);
  const std::size_t width = width_of(episodes.start.model(), quantity);
  const double share = quantity == AccuracyQuantity::state ? 1 : 0.1;
  return static_cast<double>(as_size(episodes.start.environments()) * as_size(episodes.samples)) *
         (sizeof(SparseSample) + share * static_cast<double>(width) * (sizeof(double) + 4));
}

}  // namespace tangere
