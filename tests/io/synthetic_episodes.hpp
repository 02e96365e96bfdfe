// SPDX-License-Identifier: Apache-2.0
// A data set without the engine, in which every number encodes its own place.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "io/dataset/dataset_layout.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere::testing {

/// Episodes of three rows, two controls, q of 3, v of 2, a sensor of 3 × 4 points.
inline DatasetLayout dataset_layout(std::int64_t episodes, bool single = true) {
  DatasetLayout l;
  l.episodes = episodes;
  l.steps = 6;
  l.every = 2;
  l.seed = 18446744073709551615ULL;
  l.single = single;
  l.q_names = {"a.x", "a.y", "b"};
  l.q_units = {"m", "m", "rad"};
  l.v_names = {"a.vx", "b"};
  l.v_units = {"m/s", "rad/s"};
  l.u_names = {"a.vx", "b"};
  l.u_units = {"m", "1"};
  l.sensors = {skin()};
  l.scene_name = "syn \"thetic\"";
  l.scene_text = "<tangere/>";
  l.integrator = "BDF2";
  l.timestep = 0.01;
  l.tolerance = 1e-9;
  l.precision = single ? "mixed" : "double";
  l.version = "0.1.0";
  l.instruction_set = "scalar";
  return l;
}

/// Number k of a row. Name 0 is the actions, then q, v, end effectors if any, and skin. Exact in
/// float32.
template <class T>
T dataset_number(std::int64_t episode, std::size_t name, std::int64_t row, std::size_t k) {
  if (name == 0)
    return T(static_cast<double>((episode * 7 + row * 3 + std::int64_t(k)) % 17) / 16 - 0.5);
  return T(static_cast<double>(episode) * 16 + static_cast<double>(name) * 4 +
           static_cast<double>(row) + static_cast<double>(k) / 64);
}

/// Rows [first_row, first_row + rows) of a block, in memory of their own.
template <class T>
class SyntheticPiece {
 public:
  SyntheticPiece(const DatasetLayout& l, std::int64_t first_episode, std::int64_t first_row,
                 int rows) {
    const auto episodes = static_cast<int>(std::min<std::int64_t>(16, l.episodes - first_episode));
    const auto with_action = static_cast<int>(std::min<std::int64_t>(rows, l.rows() - first_row));
    std::vector<std::size_t> widths = {l.u_names.size(), l.q_names.size(), l.v_names.size()};
    if (!l.end_effector_names.empty()) widths.push_back(3 * l.end_effector_names.size());
    widths.push_back(3 * static_cast<std::size_t>(l.sensors[0].points));
    values_.resize(widths.size() - 1);
    for (std::int64_t e = first_episode; e < first_episode + episodes; ++e) {
      for (std::int64_t row = first_row; row < first_row + rows; ++row) {
        for (std::size_t k = 0; k < widths[0] && row < first_row + with_action; ++k)
          actions_.push_back(dataset_number<float>(e, 0, row, k));
      }
      for (std::size_t name = 1; name < widths.size(); ++name)
        for (std::int64_t row = first_row; row < first_row + rows; ++row)
          for (std::size_t k = 0; k < widths[name]; ++k)
            values_[name - 1].push_back(dataset_number<T>(e, name, row, k));
    }
    for (const std::vector<T>& v : values_) observations_.emplace_back(std::span<const T>(v));
    rows_ = {first_episode, episodes, first_row, rows, with_action, actions_, observations_};
  }
  [[nodiscard]] const EpisodeRows& rows() const { return rows_; }

 private:
  std::vector<float> actions_;
  std::vector<std::vector<T>> values_;
  std::vector<Observation> observations_;
  EpisodeRows rows_;
};

inline void write_piece(EpisodeSink& sink, const DatasetLayout& l, std::int64_t first_episode,
                        std::int64_t first_row, int rows) {
  if (l.single) {
    sink.write(SyntheticPiece<float>(l, first_episode, first_row, rows).rows());
  } else {
    sink.write(SyntheticPiece<double>(l, first_episode, first_row, rows).rows());
  }
}

inline FailedEpisode failure(std::int64_t episode) {
  return {episode, 3, StepStatus::rotation, {1.5, static_cast<double>(episode), 0.1}, {-2, 0.3}};
}

/// What the steps of a block did, other numbers for each block.
inline EpisodeSteps block_steps(std::int64_t first_episode) {
  return {96, 1 + first_episode / 16 % 16, 10 + first_episode % 64};
}

/// Writes a block as one piece, and its end.
inline void write_block(EpisodeSink& sink, const DatasetLayout& l, std::int64_t first_episode,
                        const std::vector<FailedEpisode>& failures = {}) {
  write_piece(sink, l, first_episode, 0, static_cast<int>(l.rows()) + 1);
  sink.finish(first_episode, failures, block_steps(first_episode));
}

}  // namespace tangere::testing
