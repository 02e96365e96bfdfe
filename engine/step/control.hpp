// SPDX-License-Identifier: Apache-2.0
// Controls of an unattended rollout, from the scene's <control> or a table that the caller gives.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

class Batch;

/// u(step, environment) for a scene. It has no state, so any step of any environment can be
/// evaluated alone.
class ControlProgram {
 public:
  /// Uses the scene's own <control>; all controls are zero when it has none. Throws InputError when
  /// the timestep [s] is not positive or the description does not fit the model: the number of
  /// values is not nu, a value is NaN, times do not ascend from 0, a table is empty.
  ControlProgram(const Model& model, double timestep, std::uint64_t seed);
  ControlProgram(const Model& model, double timestep, std::uint64_t seed,
                 ControlDescription description);

  /// Computes the controls of one environment's step, (nu), before clipping. `episode` keys the
  /// random kind. A time of the piecewise kind within 1e-6 steps of a step's start counts as that
  /// start. Throws InputError beyond a table's last row.
  void evaluate(std::int64_t step, std::int64_t episode, std::span<double> u) const;

  /// Computes the controls of all environments of a batch, (E, nu). Throws InputError as above, and
  /// for an array of another length.
  void evaluate(std::int64_t step, const Batch& batch, std::span<double> u) const;

  /// Number of steps that it describes: rows of a table, or the end of a piecewise program; -1 when
  /// open.
  [[nodiscard]] std::int64_t steps() const;
  /// Throws InputError that names both numbers when a table has fewer rows than `steps`. The last
  /// value of a piecewise program holds beyond its end.
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
