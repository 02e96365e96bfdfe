// SPDX-License-Identifier: Apache-2.0
// Sleeping criterion. It depends on the state of the environment alone (docs/sleeping.md). With w_i
// the greatest distance of a tree's points from the axis of
// coordinate i, or 1 where the joint slides, no point of the tree moves further in a step than
//   m = Σ w_i |Δq_i|
// A tree is at rest if m ≤ share · size / n, n = max(20, 2 √(size/|gravity|) / h) steps, and may
// sleep after n steps of rest. It falls asleep if all trees that it could touch may sleep too, and
// at most a third of the dofs of the environment then stays awake.
#pragma once

#include <span>
#include <vector>

#include "engine/step/batch.hpp"
#include "engine/step/workspace.hpp"

namespace tangere {

/// One lane of a block: the environment that rules are applied to.
struct SleepingLane {
  double* column;  ///< row r: column[r * kBlock]
  SleepState& state;
};

/// Constants of a model, and scratch of one thread.
class Sleep {
 public:
  /// `share`: of a body's size, that it may move in n steps and still rest. `h`: step [s].
  Sleep(const CompiledModel& model, double share, double h);

  [[nodiscard]] int trees() const { return static_cast<int>(steps_.size()); }
  [[nodiscard]] std::span<const int> tree_of_link() const { return tree_; }

  /// Allocates an empty state. Wakes trees whose controls differ from those of the last step, and
  /// resets their rest counters.
  void wake_on_control_change(SleepState& state, std::span<const double> u) const;

  /// Computes m of each tree, (trees, L) [m], from the state in `rows` to that in the workspace.
  /// `q`: the number in the whole model of each coordinate in the workspace.
  template <int L>
  void movements(const double* rows, const BasicWorkspace<L>& w, std::span<const int> q,
                 kernels::Row<L>* out) const;

  /// Adds `moved`, a bound on the displacement of awake bodies in this step [m], if some body
  /// sleeps. Returns true if, by the last distance query, no awake body can reach a sleeping one in
  /// the next step.
  bool no_awake_body_in_reach(SleepState& state, double moved) const;
  /// Queries distances and wakes the bodies that awake ones may reach in the next step. `q`: (nq)
  /// coordinates at the end of this step. `moved`: the largest m in this step [m]. Returns true if
  /// a sleeping body is touched already: the step must then be repeated with it awake. Overwrites
  /// q0 of `single`.
  bool wake_touched(const kernels::KernelTable& table, const SleepingLane& at,
                    std::span<const double> q, double moved, SingleWorkspace& single);

  /// Updates the rest counters after a step whose result is in the block. `moved`: m of awake tree
  /// t at t · stride. `plainly`: the step was neither split nor repeated. Returns whether
  /// put_to_sleep() may succeed for some tree: after n, 2n, 3n … steps of rest.
  bool update_rest_counters(SleepState& state, const double* moved, int stride, bool plainly) const;
  /// Puts trees to sleep that satisfy the criterion. Overwrites q0 of `single`.
  void put_to_sleep(const kernels::KernelTable& table, const SleepingLane& at,
                    SingleWorkspace& single);

 private:
  /// Links of different trees that may touch.
  struct TreePair {
    int pair;  ///< index into link_pairs
    int tree1, tree2;
  };

  void measure();
  void add_tree_pairs();
  void find_poses(const kernels::KernelTable& table, const double* column, SingleWorkspace& single);
  [[nodiscard]] double distance_to_contact(const kernels::LinkPair& links, const double* column,
                                           double reach, const SingleWorkspace& single) const;
  [[nodiscard]] bool within(const kernels::KernelTable& table, const kernels::LinkPair& links,
                            const double* column, double reach, SingleWorkspace& single) const;
  [[nodiscard]] bool saves_time(std::span<const std::uint8_t> asleep) const;
  void wake_island(SleepState& state, int tree) const;
  bool group_by_nearness(const kernels::KernelTable& table, const SleepingLane& at,
                         SingleWorkspace& single);
  void fall_asleep(const SleepingLane& at, int tree) const;

  const CompiledModel& model_;
  std::vector<int> tree_;        // of each link
  std::vector<int> tree_of_q_;   // (nq)
  std::vector<int> motor_tree_;  // (nu)
  std::vector<double> weight_;   // (nq) w_i
  std::vector<double> limit_;    // (trees) largest m of a step at rest [m]
  std::vector<int> steps_;       // (trees) n
  std::vector<int> bodies_;      // (trees) bodies of the scene
  std::vector<int> dofs_;        // (trees)
  std::vector<TreePair> tree_pairs_;
  bool bounded_ = true;  // m bounds how far points move
  std::vector<int> label_;
  std::vector<std::uint8_t> soon_;
};

}  // namespace tangere
