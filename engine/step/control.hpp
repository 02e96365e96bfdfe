// SPDX-License-Identifier: Apache-2.0
// Controls of an unattended rollout, from the scene's <control> or a table given by the caller.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// u(step, environment) for a scene. No state: any step of any environment can be asked for alone.
class ControlProgram {
 public:
  /// The scene's own <control>; zero for every control when it has none. Throws InputError when the
  /// timestep [s] is not positive or the description does not fit the model: a count of values that
  /// is not nu, NaN, times that do not ascend from 0, an empty table.
  ControlProgram(const Model& model, double timestep, std::uint64_t seed);
  ControlProgram(const Model& model, double timestep, std::uint64_t seed,
                 ControlDescription description);

  /// Controls of one environment's step, (nu), before clipping. `episode` keys the random kind.
  /// A time of the piecewise kind within 1e-6 steps of a step's start counts as that start. Throws
  /// InputError beyond a table's last row.
  void evaluate(std::int64_t step, std::int64_t episode, std::span<double> u) const;

  /// Number of steps it describes: rows of a table, the end of a piecewise program; -1 when open.
  [[nodiscard]] std::int64_t steps() const;
  /// Throws InputError naming both numbers when a table has fewer rows than `steps`. The last value
  /// of a piecewise program holds beyond its end.
  void check_covers(std::int64_t steps) const;

  [[nodiscard]] double timestep() const { return timestep_; }  ///< [s]

 private:
  ControlDescription description_;
  int nu_;
  double timestep_;
  std::uint64_t seed_;
  std::vector<std::int64_t> switches_;  // piecewise: step at which values[k] begins to hold
};

}  // namespace tangere
