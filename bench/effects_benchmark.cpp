// SPDX-License-Identifier: Apache-2.0
// Measures what each effect of the shipped scenes costs: steps with it and without it from the same
// states, steps in which it is named but idle, and steps without any contact.
//
// Google Benchmark runs each once per repetition, because a repetition is a whole comparison that
// alternates between two models: only ratios of one run mean something on a busy machine.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/scene/scene_reader.hpp"
#include "kernels/numbers/block.hpp"
#include "kernels/table/isa.hpp"
#include "tasks/effects/ablation.hpp"
#include "tasks/effects/effect_costs.hpp"

namespace tangere {
namespace {

constexpr int kEnvironments = 32, kInstants = 12, kRounds = 15;

/// A coordinate by which bodies are moved, how far [m or rad], and the control that is its target,
/// if any: it moves along, or the motor would throw what it drives.
struct Move {
  std::string coordinate;
  double by;
  std::string target;
};
/// A shipped scene, and how its bodies are moved out of each other's reach.
struct Case {
  const char* scene;
  std::vector<Move> away;
  bool lifted = false;         // off the ground too
  std::vector<Move> beside{};  // near the pad, but not on it; empty: not looked at
};
/// Where bodies are: along the scene's own run, or moved from there.
enum class Place { run, away, beside };
const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"rolling_ball", {{"pad_joint.z", 1, ""}}, false, {{"pad_joint.x", 0.05, ""}}},
      {"box_pushing", {{"hand_slide.axis0", -1, ""}}},
      {"cap_opening",
       {{"upper_1.angle", -1, "upper_1.rate"},
        {"upper_2.angle", -1, "upper_2.rate"},
        {"upper_3.angle", -1, "upper_3.rate"}}},
      {"insertion", {{"hand_slide.z", 2, "hand_slide.vz"}, {"box.z", 1, ""}}},
      {"stable_grasp", {{"hand_slide.z", 1, "hand_slide.vz"}, {"bar.z", 2, ""}}, true}};
  return all;
}

/// Steps that create energy are not taken again, as in tasks/effects: from states that are not its
/// own, a model without an effect does that far more often.
Scene scene_of(const Case& of) {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/" + std::string(of.scene) + ".xml").scene;
  scene.solver.bounded_energy = false;
  return scene;
}

RecordedStates states_of(const Model& model, const Case& of, Place place) {
  RecordedStates states = record_states(model, kEnvironments, kInstants, 0);
  if (place == Place::run) return states;
  const auto add = [](const auto& names, const std::string& name, double by,
                      std::vector<double>& rows) {
    for (std::size_t k = 0; k < names.size(); ++k)
      for (std::size_t i = k; names[k] == name && i < rows.size(); i += names.size()) rows[i] += by;
  };
  for (const Move& move : place == Place::away ? of.away : of.beside)
    for (RecordedInstant& at : states.instants) {
      add(model.q_names(), move.coordinate, move.by, at.q);
      add(model.q_names(), move.coordinate, move.by, at.previous_q);
      add(model.u_names(), move.target, move.by, at.controls);
    }
  return states;
}

/// A scene with states along its run, or with the same states moved apart.
struct Recorded {
  Model model;
  RecordedStates states;
  StepperOptions options;
  TimedModel timed;
  StepTimes times;

  Recorded(const Case& of, Place place)
      : model(scene_of(of)),
        states(states_of(model, of, place)),
        options{{}, {}, Stepper(model).tolerance()},
        timed(model, states, options),
        times(measure_times(timed, *options.tolerance, kRounds)) {
    times.reading = 0;  // steps alone
  }

  /// What this model would save by being `scene`, as a share of its step.
  ModelComparison saved_by(const Scene& scene, int passes) {
    TimedModel other(Model(scene), states, options);
    return compare(timed, other, times, {true, false, passes}, *options.tolerance, kRounds);
  }
};

Recorded& recorded(const Case& of, Place place) {
  static std::map<std::pair<std::string, Place>, std::unique_ptr<Recorded>> all;
  std::unique_ptr<Recorded>& found = all[{of.scene, place}];
  if (found == nullptr) found = std::make_unique<Recorded>(of, place);
  return *found;
}

int passes_of(EffectKind kind) { return kind == EffectKind::pair_contact ? 2 : 1; }

/// Times of a step with an effect over those without it.
double ratio(const ModelComparison& c) { return 1 / (1 - c.saved.share); }

void count(benchmark::State& state, const Recorded& r, double with_over_without) {
  state.SetIterationTime(r.times.step);
  state.counters["step_us"] = 1e6 * r.times.step;
  state.counters["ratio"] = with_over_without;
  state.SetLabel(kernels::active_isa_name());
}

/// As the scene has it, over removed.
void effect_on(benchmark::State& state, const Case& of, Effect effect) {
  Recorded& r = recorded(of, Place::run);
  for (auto _ : state)
    count(state, r, ratio(r.saved_by(without(r.model.scene(), effect), passes_of(effect.kind))));
}

/// With its coefficient at zero, or limits never met, over removed.
void effect_idle(benchmark::State& state, const Case& of, Effect effect, Ablation way) {
  Recorded& r = recorded(of, Place::run);
  const Scene& scene = r.model.scene();
  for (auto _ : state) {
    const int passes = passes_of(effect.kind);
    const double idle = 1 - r.saved_by(without(scene, effect, way), passes).saved.share;
    const double gone = 1 - r.saved_by(without(scene, effect), passes).saved.share;
    count(state, r, idle / gone);
  }
}

/// Out of reach, over removed. `first_pass`: without factor and solve, so what is left is the
/// search.
void contacts_away(benchmark::State& state, const Case& of, Effect effect) {
  Recorded& r = recorded(of, Place::away);
  const Scene removed = without(r.model.scene(), effect);
  for (auto _ : state) {
    count(state, r, ratio(r.saved_by(removed, passes_of(effect.kind))));
    state.counters["first_pass"] = ratio(r.saved_by(removed, 1));
  }
}

/// Reads all sensors at one instant in every environment of a block, dense or compact. Returns the
/// seconds that one environment takes.
class FieldReader {
 public:
  explicit FieldReader(const Recorded& r) : batch_(r.model, kernels::kBlock), readout_(r.model) {
    const RecordedInstant& at = r.states.instants[kInstants / 2];
    const auto nq = std::size_t(r.model.nq()), nv = std::size_t(r.model.nv());
    for (std::size_t e = 0; e < kernels::kBlock; ++e)
      batch_.set_state(int(e), std::span(at.q).subspan(e * nq, nq),
                       std::span(at.v).subspan(e * nv, nv));
    for (std::size_t s = 0; s < r.model.sensors().size(); ++s) {
      compact_.emplace_back();
      dense_.emplace_back();
      for (int e = 0; e < int(kernels::kBlock); ++e) {
        compact_.back().emplace_back(r.model, int(s));
        dense_.back().emplace_back(r.model, int(s));
      }
    }
  }
  double dense() { return seconds(dense_); }
  double compact() { return seconds(compact_); }

 private:
  template <class Frames>
  double seconds(Frames& frames) {
    double least = HUGE_VAL;
    for (int k = 0; k < kRounds; ++k) {
      const auto start = std::chrono::steady_clock::now();
      for (auto& blocks : frames) readout_.read_block(batch_, 0, std::span(blocks));
      least = std::min(
          least, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    return least / kernels::kBlock;
  }
  Batch batch_;
  Readout readout_;
  std::vector<std::vector<CompactFrame<double>>> compact_;
  std::vector<std::vector<DenseFrame<double>>> dense_;
};

/// Readings of all sensors of an environment that touch nothing, over those in the middle of the
/// run.
void fields(benchmark::State& state, const Case& of, Place place) {
  FieldReader touching(recorded(of, Place::run)), away(recorded(of, place));
  for (auto _ : state) {
    const double dense = touching.dense(), compact = touching.compact();
    const double dense_away = away.dense(), compact_away = away.compact();
    count(state, recorded(of, Place::run), dense_away / dense);
    state.counters["dense_us"] = 1e6 * dense;
    state.counters["dense_away_us"] = 1e6 * dense_away;
    state.counters["compact_us"] = 1e6 * compact;
    state.counters["compact_away_us"] = 1e6 * compact_away;
    state.counters["away_step_us"] = 1e6 * recorded(of, place).times.step;
  }
}

/// Something of sensors that a scene may have besides their fields.
struct Extra {
  const char* name;
  bool requested;  ///< false: declared, but idle
  void (*add)(TactileDescription& sensor, double timestep);
  const char* form;  ///< what is read instead of the field; null: the field
};
/// Time constant of hysteresis and low-pass: a reading looks at 28 states. A delay of 2.5 steps
/// looks at two.
constexpr double kHysteresisSteps = 4;
const Extra kExtras[] = {
    {"markers", true,
     [](TactileDescription& s, double) {
       s.markers = MarkersDescription{100, 0.002, 0, {}};
     },
     "markers"},
    {"markers not read", false,
     [](TactileDescription& s, double) {
       s.markers = MarkersDescription{100, 0.002, 0, {}};
     },
     nullptr},
    {"hysteresis", true,
     [](TactileDescription& s, double h) {
       s.imperfections.hysteresis = 0.5;
       s.imperfections.hysteresis_time = kHysteresisSteps * h;
     },
     nullptr},
    {"delay", true, [](TactileDescription& s, double h) { s.imperfections.delay = 2.5 * h; },
     nullptr},
    {"low-pass", true,
     [](TactileDescription& s, double h) { s.imperfections.low_pass = kHysteresisSteps * h; },
     nullptr},
    {"hysteresis of coefficient 0", false,
     [](TactileDescription& s, double) { s.imperfections.source.line = 1; }, nullptr}};

/// Readings and steps of a scene whose sensors have something more, over those without it. Lists of
/// points have no neighbours, so their gel does not bulge.
void sensor_extra(benchmark::State& state, const Case& of, const Extra& extra) {
  Recorded& r = recorded(of, Place::run);
  Scene scene = r.model.scene();
  scene.outputs = OutputsDescription{};
  for (TactileDescription& sensor : scene.sensors) {
    extra.add(sensor, scene.timestep);
    if (!sensor.points.empty() && sensor.markers) sensor.markers->thickness = 0;
    scene.outputs->record.push_back(sensor.name +
                                    (extra.form == nullptr ? "" : "." + std::string(extra.form)));
  }
  TimedModel other(Model(scene), r.states, r.options);
  for (auto _ : state) {
    double with = 0, without = 0;
    for (int instant = 0; instant < kInstants; instant += 3)
      for (std::size_t k = 0; k < other.readings().size(); ++k) {
        std::vector<double> own, plain;
        for (int round = 0; round < kRounds; ++round) {
          own.push_back(other.time_reading(k, instant));
          plain.push_back(r.timed.time_reading(k, instant));
        }
        with += *std::min_element(own.begin(), own.end());
        without += *std::min_element(plain.begin(), plain.end());
      }
    const ModelComparison steps =
        compare(other, r.timed, r.times, {true, false, 1}, *r.options.tolerance, kRounds);
    count(state, r, with / without);
    state.counters["reading_us"] = 1e6 * with / 4;
    state.counters["plain_us"] = 1e6 * without / 4;
    state.counters["step_ratio"] = ratio(steps);
  }
}

/// A scene without contacts, over the scene as it is.
void contact_free(benchmark::State& state, const Case& of) {
  Recorded& r = recorded(of, Place::run);
  Scene bare = without(r.model.scene(), {EffectKind::pair_contact});
  bare = without(bare, {EffectKind::ground_contact});
  bare = without(bare, {EffectKind::tactile});
  for (auto _ : state) count(state, r, 1 - r.saved_by(bare, 2).saved.share);
}

/// The scene against itself: what chance shows.
void itself(benchmark::State& state, const Case& of) {
  Recorded& r = recorded(of, Place::run);
  for (auto _ : state) count(state, r, ratio(r.saved_by(r.model.scene(), 1)));
}

template <class F, class... Arguments>
void add(const std::string& name, const F& run, Arguments... arguments) {
  benchmark::RegisterBenchmark(name.c_str(), run, arguments...)
      ->UseManualTime()
      ->Iterations(1)
      ->Unit(benchmark::kMicrosecond);
}

void add_all() {
  for (const Case& of : cases()) {
    const std::string scene = of.scene;
    const Scene read = read_scene(TANGERE_SOURCE_DIR "/scenes/" + scene + ".xml").scene;
    add(scene + "/itself", itself, of);
    add(scene + "/contact_free", contact_free, of);
    add(scene + "/fields_away", fields, of, Place::away);
    if (!of.beside.empty()) add(scene + "/fields_beside", fields, of, Place::beside);
    for (const Extra& extra : kExtras)
      add(scene + (extra.requested ? "/reading/" : "/idle_reading/") + extra.name, sensor_extra, of,
          extra);
    for (const EffectInfo& info : effects_of(read)) {
      const EffectKind kind = info.effect.kind;
      if (!info.on || info.effect.element >= 0 || !has_way(kind, Ablation::removed)) continue;
      if (element_owner(kind) == NumberOwner::tactile) continue;
      add(scene + "/on/" + info.name, effect_on, of, info.effect);
      if (has_way(kind, Ablation::zero))
        add(scene + "/zero/" + info.name, effect_idle, of, info.effect, Ablation::zero);
      if (has_way(kind, Ablation::idle))
        add(scene + "/never_met/" + info.name, effect_idle, of, info.effect, Ablation::idle);
      if (kind == EffectKind::pair_contact || (kind == EffectKind::ground_contact && of.lifted))
        add(scene + "/away/" + info.name, contacts_away, of, info.effect);
    }
  }
}

}  // namespace
}  // namespace tangere

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  tangere::add_all();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
