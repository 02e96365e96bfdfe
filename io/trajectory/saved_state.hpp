// SPDX-License-Identifier: Apache-2.0
// Uses a row of a trajectory file as the start of another run.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/step/batch.hpp"
#include "io/trajectory/saved_memory.hpp"
#include "io/trajectory/saved_sleep.hpp"

namespace tangere {

/// Row K of a file: everything on which the following steps depend.
struct SavedState {
  std::string path;
  std::int64_t row = 0;   ///< K
  std::int64_t step = 0;  ///< steps since the first run of a chain; K if the run continued none
  int environments = 0;   ///< E
  std::uint64_t seed = 0;
  std::int64_t first_episode = 0;
  double timestep = 0;  ///< [s]
  double tolerance = 0;
  double accuracy = 0;  ///< 0: steps were not cut, or the file does not say
  double sleep = 0;     ///< as in RunFacts; 0: no body slept
  std::string integrator, scene_text;
  std::vector<std::string> q_names;            ///< (nq)
  std::vector<std::string> v_names;            ///< (nv)
  std::vector<double> q, v;                    ///< (E, nq), (E, nv)
  std::vector<double> previous_q, previous_v;  ///< of row K - 1; empty if the file lacks it
  std::optional<SavedMemory> memory;           ///< none: the file does not hold it at row K
  std::vector<std::int64_t> memory_rows;       ///< those at which the file holds it
  std::optional<SavedSleep> sleep_state;       ///< none: the file has no sleep state
  std::vector<StepStatus> status;              ///< (E) of the step to this row; converged for row 0
};

/// Reads `row`, or the last one if it is not given. Throws IoError for a file that is missing,
/// damaged or not a trajectory. Throws InputError for a row that does not exist, naming the rows
/// that do.
SavedState read_state(const std::string& path, std::optional<std::int64_t> row);

/// Copies environment e of a saved state to environment e of a batch. With `continues` it also sets
/// the row before, so that the next step continues BDF2, and the count of steps, which keys the
/// noise of sensors. The shear state is set if the file has it, with `continues` also the sleep
/// state. A failed environment stays failed. Throws InputError if the coordinates, the points with
/// shear springs or the trees do not match the model, or the batch is larger than the file's.
void restore_state(const SavedState& from, bool continues, Batch& batch);

}  // namespace tangere
