// SPDX-License-Identifier: Apache-2.0
// Decides which bodies sleep, by what their own environment did and by nothing else
// (docs/sleeping.md). With w_i the greatest distance of a tree's points from the axis of
// coordinate i, or 1 where the joint slides, no point of the tree moves further in a step than
//   m = Σ w_i |Δq_i|
// A tree rests where m ≤ share · size / n, n = max(20, 2 √(size/|gravity|) / h) steps, and may
// sleep when it rested for n steps. It does when all trees that it could touch may, too, and at
// most a third of the dofs of the environment stays awake.
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

  /// Makes room in a state that is empty. Trees whose controls are not those of the last step
  /// wake, or have not rested.
  void wake_on_control_change(SleepState& state, std::span<const double> u) const;

  /// Computes m of each tree, (trees, L) [m], from the state in `rows` to that in the workspace.
  /// `q`: the number in the whole model of each coordinate in the workspace.
  template <int L>
  void movements(const double* rows, const BasicWorkspace<L>& w, std::span<const int> q,
                 kernels::Row<L>* out) const;

  /// Notes how far awake bodies moved in this step, at most [m], where some sleep. Returns true
  /// where none of them can come within reach of a sleeping one in the next step, by the last look.
  bool no_awake_body_in_reach(SleepState& state, double moved) const;
  /// Looks, and wakes the bodies that awake ones may reach in the next step. `q`: (nq) coordinates
  /// at the end of this step. `moved`: the largest m in this step [m]. Returns true if one of them
  /// is touched already: the step must then be taken again, with it awake. Overwrites q0 of
  /// `single`.
  bool wake_touched(const kernels::KernelTable& table, const SleepingLane& at,
                    std::span<const double> q, double moved, SingleWorkspace& single);

  /// Counts the steps of rest after one that is in the block. `moved`: m of tree t at t · stride,
  /// of those that are awake. `plainly`: the step was neither split nor taken again. Returns
  /// whether settle() may let some tree fall asleep; while its neighbours keep it awake, it is
  /// asked again after as many steps.
  bool update_rest_counters(SleepState& state, const double* moved, int stride, bool plainly) const;
  /// Lets trees fall asleep. Overwrites q0 of `single`.
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
