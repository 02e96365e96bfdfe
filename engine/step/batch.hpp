// SPDX-License-Identifier: Apache-2.0
// The state of many environments in blocks of kernels::kBlock = 16 lanes, [block][row][lane]. It is
// exactly what a checkpoint stores.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/base/checks.hpp"
#include "engine/model/model.hpp"
#include "engine/step/candidate_store.hpp"
#include "engine/step/shear_state.hpp"
#include "engine/step/sleep_state.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {

/// How the last step of an environment ended. Values are written to files: never renumber.
enum class StepStatus : std::int8_t {
  converged = 0,
  split = 1,             ///< converged in parts, or by SDIRK2 because a body rotated too far
  accuracy_not_met = 2,  ///< converged, but a part of h/256 missed the requested accuracy, created
                         ///< energy or rotated a body too far
  tunnelled = 3,         ///< converged, but a body passed through one of its contact partners
  damped = 4,            ///< converged by BDF1 or in parts: the scheme would have created energy
  overlapping = 5,      ///< converged, but bodies of a contact overlap and none of its points is as
                        ///< deep (engine/step/interpenetration.hpp)
  not_converged = -1,   ///< no root found down to h/256
  non_finite = -2,      ///< a control or state was NaN or infinite
  rotation = -3,        ///< a joint turned by π or more in one step
  singular = -4,        ///< the Jacobian could not be factored, pivoting included
  unsolved_layer = -5,  ///< the pressures of a layer that is a contact were not found
};
const char* to_string(StepStatus value);
/// Returns all of them.
std::span<const StepStatus> step_statuses();
inline bool failed(StepStatus s) { return static_cast<std::int8_t>(s) < 0; }

/// Everything in one block that a step may change.
struct BlockState {
  AlignedVector<double> rows;  ///< as Batch::block()
  // (16), by lane
  std::vector<StepStatus> status;
  std::vector<std::uint8_t> has_history;
  std::vector<std::int64_t> steps;
  std::vector<ShearState> shear;
  std::vector<SleepState> sleep;
};

/// Environments stepped together. A failed environment keeps its last good state and is not stepped
/// again until reset. Every function throws InputError for an environment or block that does not
/// exist and for an array of another length than its shape says.
class Batch {
 public:
  /// Makes `environments` states: environment e starts as the scene's <initial> says, with numbers
  /// drawn from <randomize> by the key (seed, first_episode + e). Throws InputError when
  /// environments < 1 or allocation fails.
  Batch(const Model& model, int environments, std::uint64_t seed = 0,
        std::int64_t first_episode = 0);

  [[nodiscard]] const Model& model() const { return model_; }
  [[nodiscard]] int environments() const { return environments_; }
  [[nodiscard]] int blocks() const { return blocks_; }
  [[nodiscard]] std::uint64_t seed() const { return seed_; }
  /// Number of the episode that an environment is in; it keys the draws.
  [[nodiscard]] std::int64_t episode(int environment) const { return episode_[lane(environment)]; }

  /// Draws another episode into one environment, with the same bits as in a new batch. Environments
  /// of different blocks may be reset from different threads.
  void reset(int environment, std::int64_t episode);
  /// A held environment is not stepped and keeps its state. reset() also releases it.
  void hold(int environment, bool held = true) { held_[lane(environment)] = held ? 1 : 0; }
  [[nodiscard]] bool held(int environment) const { return held_[lane(environment)] != 0; }

  /// Steps that an environment has taken since its episode began. Failed steps do not count. It
  /// keys the noise of sensors.
  [[nodiscard]] std::int64_t steps(int environment) const { return steps_[lane(environment)]; }
  /// Sets this count, to resume from a stored state, in [0, 2^48).
  void set_steps(int environment, std::int64_t steps) { steps_[lane(environment)] = steps; }

  /// Copy one environment's coordinates out of its lane: (nq), (nv).
  void get_q(int environment, std::span<double> q) const;
  void get_v(int environment, std::span<double> v) const;
  /// The coordinates themselves, in the lanes of a block: (nq, 16) and (nv, 16), where lane l is
  /// environment 16 block + l. Lanes beyond the last environment are padding. The addresses stay
  /// the same as long as the batch is neither moved nor destroyed; those of two blocks in a row are
  /// at one distance. The values change with the state.
  [[nodiscard]] std::span<const double> q_lanes(int block) const;
  [[nodiscard]] std::span<const double> v_lanes(int block) const;
  /// Sets a state and drops the integrator's history, so the next step is a start. All past states
  /// of sensors with lag become this state. Quaternions are normalised.
  void set_state(int environment, std::span<const double> q, std::span<const double> v);
  /// Sets the two newest states of a BDF2 run: (q, v) now and one step before. The next step
  /// continues the run.
  void set_state(int environment, std::span<const double> q, std::span<const double> v,
                 std::span<const double> previous_q, std::span<const double> previous_v);

  /// Shear state of an environment: elastic displacements of its touching points (docs/shear.md).
  /// Empty at the start of an episode and after set_state().
  [[nodiscard]] const ShearState& shear_state(int environment) const {
    return shear_[lane(environment)];
  }
  [[nodiscard]] std::span<const ShearState> shear_states() const {
    return {shear_.data(), std::size_t(environments_)};
  }
  /// Sets it, to resume from a stored state. Throws InputError unless the points are ascending and
  /// exist in the scene.
  void set_shear_state(int environment, std::span<const ShearEntry> state);

  /// Sleep state of an environment (docs/sleeping.md). Empty unless a stepper with sleep enabled
  /// stepped it. reset() and every set_ function wake all bodies.
  [[nodiscard]] const SleepState& sleep(int environment) const { return sleep_[lane(environment)]; }
  [[nodiscard]] std::span<const SleepState> sleeps() const {
    return {sleep_.data(), std::size_t(environments_)};
  }
  /// Sets it, to resume from a stored state; an empty one wakes all bodies. For sleeping trees the
  /// state one step before is set to the present one. Throws InputError unless it fits the scene.
  void set_sleep(int environment, const SleepState& state);

  /// Sets the newest state alone, for finite differences. Quaternions are not normalised; history,
  /// status and shear state are kept. Before the first step of an episode the earlier states that
  /// sensors with lag read are set, too.
  void displace_state(int environment, std::span<const double> q, std::span<const double> v);

  /// Freezes an environment as a failed step would. Throws InputError when `status` is not a
  /// failure.
  void set_failed(int environment, StepStatus status);

  /// Result of the last step: status, evaluations of the residual in all its parts, and the scaled
  /// residual at its end, dimensionless.
  [[nodiscard]] StepStatus status(int environment) const { return status_[lane(environment)]; }
  [[nodiscard]] std::int32_t iterations(int environment) const {
    return iterations_[lane(environment)];
  }
  [[nodiscard]] double residual(int environment) const { return residual_[lane(environment)]; }
  [[nodiscard]] std::span<const StepStatus> statuses() const {
    return {status_.data(), std::size_t(environments_)};
  }
  [[nodiscard]] std::span<const std::int32_t> iterations() const {
    return {iterations_.data(), std::size_t(environments_)};
  }
  [[nodiscard]] std::span<const double> residuals() const {
    return {residual_.data(), std::size_t(environments_)};
  }
  [[nodiscard]] int failed_count() const;

  /// Whether the next step continues a run, because the state one step before is known.
  [[nodiscard]] bool has_history(int environment) const {
    return has_history_[lane(environment)] != 0;
  }
  /// Saves a block, and restores it.
  [[nodiscard]] BlockState save_block(int block) const;
  void restore_block(int block, const BlockState& state);

  /// Returns randomised number k (in the order of Scene::randomizations) of an environment: the
  /// drawn value, or the one set since then unless it belongs to the starting state.
  [[nodiscard]] double randomized_value(int environment, int k) const;
  /// Whether randomised number k is a parameter, not one of the starting state.
  [[nodiscard]] bool is_parameter(int k) const;
  /// Sets randomised number k of an environment until its next reset. Readings and steps use it
  /// from now on; the state, its history and status stay. The value is not checked. Throws
  /// InputError for a number of the starting state.
  void set_randomized_value(int environment, int k, double value);
  /// Sets all that are parameters in an environment: `values` (their count) in order. What depends
  /// on a number is computed again only if its value changes. Throws like set_randomized_values().
  void set_all_randomized(int environment, std::span<const double> values);
  /// Sets some of them in some environments, and checks them: `values` (environments, numbers) in
  /// SI. Throws InputError, and sets none, for a number of the starting state, for a value that the
  /// scene could not have, and for sizes of a body that are too unlike.
  void set_randomized_values(std::span<const int> environments, std::span<const int> numbers,
                             std::span<const double> values);

  /// First row of a block. Row r of lane l is block(b)[r * 16 + l]. For the stepper and the tests.
  double* block(int b) { return data_.data() + first_row(b); }
  [[nodiscard]] const double* block(int b) const { return data_.data() + first_row(b); }

 private:
  friend class Stepper;
  [[nodiscard]] std::size_t lane(int environment) const {
    return checked_index("environment", environment, environments_);
  }
  [[nodiscard]] std::size_t first_row(int b) const {
    return checked_index("block", b, blocks_) * block_stride_;
  }
  [[nodiscard]] const RandomizationDescription& randomization(int k) const;
  void displace(std::size_t lane, std::span<const double> q, std::span<const double> v);
  void write_state(std::size_t lane, std::span<const double> q, std::span<const double> v);
  void complete_state(std::size_t lane);
  void fill_past_states(std::size_t lane);
  void place_transmissions(std::size_t lane);
  void draw_episode(std::size_t lane);
  void complete_numbers(std::size_t lane);
  [[nodiscard]] double* column(std::size_t lane);
  [[nodiscard]] const double* column(std::size_t lane) const;

  Model model_;
  int environments_, blocks_;
  std::uint64_t seed_;
  std::size_t block_stride_;  // doubles per block
  AlignedVector<double> data_;
  // Per lane, padding lanes included, so that threads can work on whole blocks.
  std::vector<StepStatus> status_;
  std::vector<std::int32_t> iterations_;
  std::vector<double> residual_;
  std::vector<std::uint8_t> has_history_;  // BDF2: the previous state is valid
  std::vector<std::uint8_t> held_;
  std::vector<std::int64_t> episode_, steps_;
  std::vector<ShearState> shear_;
  std::vector<SleepState> sleep_;
  // Distance that bodies may move until the next overlap check [m] (interpenetration.hpp); 0: now.
  std::vector<double> clearance_;
  CandidateStore candidates_;
};

}  // namespace tangere
