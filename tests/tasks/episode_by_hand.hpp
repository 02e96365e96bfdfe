// SPDX-License-Identifier: Apache-2.0
// The run that tests of episodes vary, and one of its episodes stepped by hand.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "engine/sense/readout.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/tasks/episode_recorder.hpp"

namespace tangere::testing {

inline constexpr std::uint64_t kSeed = 5;
inline constexpr int kEpisodes = 70;  // five blocks, the last of six episodes
inline constexpr int kSteps =
    120;  // the pad is on the ball from step 40 or so, some 60 in every episode
inline constexpr int kEvery = 5;
inline constexpr int kRows = kSteps / kEvery;

inline Scene small_scene() {
  return read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball_small.xml").scene;
}

inline const Model& small_ball() {
  static const Model model(small_scene());
  return model;
}

inline EpisodeOptions options(int threads = 2, Precision precision = Precision::f64) {
  EpisodeOptions o;
  o.episodes = kEpisodes;
  o.steps = kSteps;
  o.every = kEvery;
  o.seed = kSeed;
  o.precision = precision;
  o.threads = threads;
  o.blocks_in_flight = threads + 1;
  return o;
}

inline EpisodeSummary run(const Model& model, const EpisodeOptions& o, EpisodeSink& sink,
                          const ProgressCallback& progress = {}, const std::stop_token& stop = {}) {
  return run_episodes(model, {}, ControlProgram(model, model.timestep(), kSeed), o, sink, progress,
                      stop);
}

/// One episode, stepped by hand. T: type of the stored observations.
template <class T>
struct ByHand {
  RecordedEpisode episode;
  std::vector<FailedEpisode> failure;  // none or one
  std::int64_t steps = 0;              // tried

  ByHand(const Model& model, const EpisodeOptions& o, std::int64_t number)
      : episode_(number), batch_(model, 1, o.seed, number), readout_(model, o.precision) {
    Stepper stepper(model);
    const ControlProgram controls(model, model.timestep(), o.seed);
    std::vector<double> u(std::size_t(model.nu()));
    episode.observations.resize(first_sensor(model) + model.sensors().size());
    observe(model);
    for (std::int64_t t = 0; t < o.steps; ++t) {
      controls.evaluate(t, number, u);
      if (t % o.every == 0) {
        std::vector<float> action;
        for (const double x : u) action.push_back(static_cast<float>(std::clamp(x, -1.0, 1.0)));
        episode.actions += bytes_of(std::span<const float>(action));
      }
      if (failure.empty()) step(stepper, u, t);
      if ((t + 1) % o.every == 0) observe(model);
    }
  }

 private:
  static std::size_t first_sensor(const Model& model) {
    return model.end_effectors().empty() ? 2 : 3;
  }
  void step(Stepper& stepper, const std::vector<double>& u, std::int64_t t) {
    std::vector<double> q(std::size_t(batch_.model().nq())), v(std::size_t(batch_.model().nv()));
    batch_.get_q(0, q);
    batch_.get_v(0, v);
    stepper.step(batch_, u);
    ++steps;
    if (failed(batch_.status(0))) failure.push_back({episode_, t, batch_.status(0), q, v});
  }
  void observe(const Model& model) {
    std::vector<double> q(std::size_t(model.nq())), v(std::size_t(model.nv()));
    batch_.get_q(0, q);
    batch_.get_v(0, v);
    keep(0, std::vector<T>(q.begin(), q.end()));
    keep(1, std::vector<T>(v.begin(), v.end()));
    if (!model.end_effectors().empty()) {
      std::vector<double> positions(3 * model.end_effectors().size());
      readout_.end_effectors(batch_, 0, positions);
      keep(2, std::vector<T>(positions.begin(), positions.end()));
    }
    for (std::size_t s = 0; s < model.sensors().size(); ++s) {
      std::vector<T> field(3 * std::size_t(model.sensors()[s].points));
      readout_.tactile(batch_, 0, static_cast<int>(s), field);
      keep(first_sensor(model) + s, field);
    }
  }
  void keep(std::size_t name, const std::vector<T>& values) {
    episode.observations[name] += bytes_of(std::span<const T>(values));
  }

  std::int64_t episode_;
  Batch batch_;
  Readout readout_;
};

}  // namespace tangere::testing
