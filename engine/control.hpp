// SPDX-License-Identifier: Apache-2.0
// Controls of an unattended rollout, from the scene's <control> or a table given by the caller.
#pragma once

#include <cstdint>
#include <span>

#include "engine/model.hpp"

namespace tangere {

/// u(step, environment) for a scene. Throws InputError when the description does not fit the model.
class ControlProgram {
 public:
  /// The scene's own <control>; zero for every control when it has none.
  ControlProgram(const Model& model, double timestep, std::uint64_t seed);
  ControlProgram(const Model& model, double timestep, std::uint64_t seed, ControlDescription description);

  /// Controls of one environment's step, (nu), before clipping. `episode` keys the random kind.
  void evaluate(std::int64_t step, std::int64_t episode, std::span<double> u) const;

  /// Number of steps it covers: rows of a table; -1 when unlimited.
  [[nodiscard]] std::int64_t steps() const;

 private:
  ControlDescription description_;
  int nu_;
  double timestep_;
  std::uint64_t seed_;
};

}  // namespace tangere
