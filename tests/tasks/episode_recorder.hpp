// SPDX-License-Identifier: Apache-2.0
// A sink that keeps every bit, and reports pieces that arrive out of order or two at a time.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere::testing {

/// The bytes of numbers: equal where every bit is, -0 and NaN included.
template <class T>
std::string bytes_of(std::span<const T> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

/// Bytes of (rows, width) per name of an episode.
struct RecordedEpisode {
  std::string actions;
  std::vector<std::string> observations;  // q, v, end effectors if any, then each sensor
  bool operator==(const RecordedEpisode&) const = default;
};

class Recorder : public EpisodeSink {
 public:
  /// `rows`: R, actions of an episode.
  explicit Recorder(std::int64_t rows) : rows_(rows) {}

  void write(const EpisodeRows& piece) override {
    const Turn turn(*this);
    ++pieces;
    const auto next = next_row_.try_emplace(piece.first_episode, 0).first;
    EXPECT_EQ(piece.first_episode % 16, 0);
    EXPECT_EQ(piece.first_row, next->second) << "block of episode " << piece.first_episode;
    EXPECT_GE(piece.rows, 1);
    const bool last = piece.first_row + piece.rows == rows_ + 1;
    EXPECT_EQ(piece.action_rows, piece.rows - (last ? 1 : 0));
    next->second += piece.rows;
    EXPECT_LE(next->second, rows_ + 1) << "more rows than the episode has";
    for (int e = 0; e < piece.episodes; ++e) {
      RecordedEpisode& episode = episodes[piece.first_episode + e];
      episode.actions += part(piece.actions, e, piece.episodes);
      episode.observations.resize(piece.observations.size());
      for (std::size_t name = 0; name < piece.observations.size(); ++name)
        std::visit(
            [&](const auto& all) { episode.observations[name] += part(all, e, piece.episodes); },
            piece.observations[name]);
    }
    most_rows = std::max(most_rows, piece.rows);
    single = std::holds_alternative<std::span<const float>>(piece.observations[0]);
    for (const Observation& values : piece.observations)
      EXPECT_EQ(std::holds_alternative<std::span<const float>>(values), single);
  }

  void finish(std::int64_t first_episode, std::span<const FailedEpisode> of_block,
              const EpisodeSteps& of_all) override {
    const Turn turn(*this);
    steps += of_all;
    EXPECT_EQ(next_row_.at(first_episode), rows_ + 1) << "finished early";
    EXPECT_TRUE(finished.insert(first_episode).second) << first_episode << " finished twice";
    for (const FailedEpisode& failure : of_block) {
      EXPECT_EQ(failure.episode / 16 * 16, first_episode);
      EXPECT_TRUE(failures.emplace(failure.episode, failure).second);
    }
  }

  std::map<std::int64_t, RecordedEpisode> episodes;
  std::map<std::int64_t, FailedEpisode> failures;
  std::set<std::int64_t> finished;  // first episodes of blocks
  EpisodeSteps steps;
  int pieces = 0, most_rows = 0;
  bool single = false;  // observations came as float32

 private:
  /// One call at a time.
  struct Turn {
    explicit Turn(Recorder& r) : recorder(r) {
      EXPECT_EQ(recorder.callers_++, 0) << "two threads in the sink";
    }
    ~Turn() { --recorder.callers_; }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    Recorder& recorder;
  };

  template <class T>
  static std::string part(std::span<const T> all, int episode, int episodes) {
    const std::size_t count = all.size() / static_cast<std::size_t>(episodes);
    EXPECT_EQ(count * static_cast<std::size_t>(episodes), all.size());
    return bytes_of(all.subspan(static_cast<std::size_t>(episode) * count, count));
  }

  std::int64_t rows_;
  std::map<std::int64_t, std::int64_t> next_row_;  // by first episode
  std::atomic<int> callers_{0};
};

}  // namespace tangere::testing
