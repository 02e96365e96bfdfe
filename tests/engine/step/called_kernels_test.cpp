// SPDX-License-Identifier: Apache-2.0
// Tests that a scene calls no kernel of what it does not name: the calls of every kernel that only
// one effect needs are counted, and links carry the bits of their own effects alone.
#include <gtest/gtest.h>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tasks/effects/ablation.hpp"
#include "tests/engine/effect_scenes.hpp"
#include "tests/engine/gradient_run.hpp"
#include "tests/engine/runs.hpp"

namespace tangere {
namespace {

using kernels::KernelTable;
using GroupTable = kernels::StageKernels<kernels::kGroup>;
using LoneTable = kernels::StageKernels<1>;

/// Counts the calls of one kernel of a table.
template <auto Member>
struct Counted;
template <class Table, class R, class... A, R (*Table::*Member)(A...)>
struct Counted<Member> {
  static inline R (*original)(A...) = nullptr;
  static inline long calls = 0;

  static R call(A... a) {
    ++calls;
    return original(a...);
  }
  static void wrap(KernelTable& all) {
    Table* table = nullptr;
    if constexpr (std::is_same_v<Table, GroupTable>)
      table = &all.group;
    else if constexpr (std::is_same_v<Table, LoneTable>)
      table = &all.single;
    else
      table = &all;
    original = table->*Member;
    table->*Member = call;
    calls = 0;
  }
};

/// Kernels that one effect needs.
template <auto... Members>
struct Kernels {
  static void wrap(KernelTable& table) { (Counted<Members>::wrap(table), ...); }
  static long calls() { return (Counted<Members>::calls + ...); }
};

using OfPairs = Kernels<&GroupTable::near_pairs, &LoneTable::near_pairs,
                        &KernelTable::find_candidates, &KernelTable::transpose_list>;
using OfFaces = Kernels<&GroupTable::choose_faces, &LoneTable::choose_faces,
                        &GroupTable::choose_faces_at, &LoneTable::choose_faces_at>;
using OfMemory =
    Kernels<&GroupTable::touches_at, &LoneTable::touches_at, &GroupTable::recall_ground,
            &LoneTable::recall_ground, &GroupTable::advance_ground, &LoneTable::advance_ground,
            &GroupTable::clear_far_contacts, &LoneTable::clear_far_contacts, &KernelTable::recall,
            &KernelTable::recall_entries, &KernelTable::advance, &KernelTable::advance_entries,
            &KernelTable::advance_list, &KernelTable::transpose_anchors>;
using OfFields =
    Kernels<&KernelTable::pad_touch, &KernelTable::tactile, &KernelTable::tactile_mixed,
            &KernelTable::tactile_block, &KernelTable::tactile_block_mixed>;
using OfGradients =
    Kernels<&GroupTable::adjoint_rhs, &LoneTable::adjoint_rhs, &GroupTable::adjoint_products,
            &LoneTable::adjoint_products, &GroupTable::parameter_products,
            &LoneTable::parameter_products, &GroupTable::solve_transposed,
            &LoneTable::solve_transposed, &GroupTable::pull_back_poses, &LoneTable::pull_back_poses,
            &KernelTable::pull_back_links, &KernelTable::pull_back_field,
            &KernelTable::field_tangent, &KernelTable::pull_back_memory>;

/// Counts while it lives.
class Counting {
 public:
  Counting() {
    OfPairs::wrap(table_), OfFaces::wrap(table_), OfMemory::wrap(table_);
    OfFields::wrap(table_), OfGradients::wrap(table_);
    kernels::use_kernels(table_);
  }
  ~Counting() { kernels::use_kernels(before_); }
  Counting(const Counting&) = delete;
  Counting& operator=(const Counting&) = delete;

 private:
  const KernelTable& before_ = kernels::active_kernels();
  KernelTable table_ = before_;
};

constexpr int kBriefSteps = 3, kBriefEnvironments = 3;

/// Steps with the scene's controls, and reads all fields after each step if asked.
void run_briefly(const Model& model, bool read) {
  Batch batch(model, kBriefEnvironments, 5);
  Stepper stepper(model);
  Readout readout(model);
  const std::vector<double> u = {0.1, -0.05, 0.1, 0.004};
  for (int k = 0; k < kBriefSteps; ++k) {
    testing::step_all(stepper, batch, {u.begin(), u.begin() + model.nu()});
    for (std::size_t s = 0; read && s < model.sensors().size(); ++s) {
      std::vector<double> field(3 * std::size_t(model.sensors()[s].points));
      for (int e = 0; e < kBriefEnvironments; ++e) readout.tactile(batch, e, int(s), field);
    }
  }
  EXPECT_EQ(batch.failed_count(), 0);
}

/// Friction that remembers, and a cuboid that the corners of another could touch.
Scene scene_with_faces() {
  Scene scene = testing::scene_that_remembers();
  scene.pair_contacts.push_back({"arm", "box", {100, 1, 0.5, 1}, ContactLaw::clamped, 1e-5, {}});
  return scene;
}

TEST(CalledKernels, ASceneWithAllCallsAll) {
  const Counting counting;
  run_briefly(Model(scene_with_faces()), true);
  EXPECT_GT(OfPairs::calls(), 0);
  EXPECT_GT(OfFaces::calls(), 0);
  EXPECT_GT(OfMemory::calls(), 0);
  EXPECT_GT(OfFields::calls(), 0);
  EXPECT_EQ(OfGradients::calls(), 0) << "nobody asks for a derivative";
}

TEST(CalledKernels, WithoutPairsNobodySearches) {
  const Scene scene = without(testing::scene_that_sleeps(), {EffectKind::pair_contact});
  const Counting counting;
  run_briefly(Model(scene), true);
  EXPECT_EQ(OfPairs::calls(), 0);
  EXPECT_EQ(OfFaces::calls(), 0);
  EXPECT_EQ(OfMemory::calls(), 0);
  EXPECT_GT(OfFields::calls(), 0);
}

TEST(CalledKernels, ContactsThatNeverPushAreSteppedForGradientsAlone) {
  Scene scene = without(testing::scene_that_sleeps(), {EffectKind::sleeping});
  scene = without(scene, {EffectKind::feedback});
  scene = without(scene, {EffectKind::pair_contact}, Ablation::zero);
  const Model model(scene);
  const Counting counting;
  run_briefly(model, false);
  EXPECT_EQ(OfPairs::calls(), 0);
  Batch batch(model, kBriefEnvironments, 5);
  Stepper stepper(model);
  BlockTape tape(model, stepper.integrator(), 1);
  tape.start(batch, 0);
  stepper.step_block(batch, 0, std::vector<double>(std::size_t(kBriefEnvironments * model.nu())),
                     &tape);
  EXPECT_GT(OfPairs::calls(), 0);
}

TEST(CalledKernels, FacesAreChosenOfWhatHasThem) {
  const Counting counting;
  run_briefly(Model(testing::scene_that_remembers()), true);
  EXPECT_EQ(OfFaces::calls(), 0) << "a ball alone is touched";
  EXPECT_GT(OfPairs::calls(), 0);
}

TEST(CalledKernels, MemoryIsMovedWhereFrictionRemembers) {
  Scene scene = testing::scene_that_remembers();
  for (const EffectKind kind :
       {EffectKind::pair_memory, EffectKind::ground_memory, EffectKind::tactile_memory}) {
    const Counting counting;
    run_briefly(Model(scene), true);
    EXPECT_GT(OfMemory::calls(), 0) << to_string(kind);
    scene = without(scene, {kind});
  }
  const Counting counting;
  run_briefly(Model(scene), true);
  EXPECT_EQ(OfMemory::calls(), 0);
}

TEST(CalledKernels, FieldsAreComputedWhereTheyAreRead) {
  Scene scene = testing::scene_that_sleeps();
  {
    const Counting counting;
    run_briefly(Model(scene), false);
    EXPECT_EQ(OfFields::calls(), 0) << "nobody reads";
  }
  scene = without(scene, {EffectKind::tactile});
  const Counting counting;
  run_briefly(Model(scene), true);
  EXPECT_EQ(OfFields::calls(), 0) << "no sensor";
}

TEST(CalledKernels, DerivativesAreComputedOnTheWayBack) {
  Scene scene = scene_with_faces();
  scene.solver.bounded_energy = false;
  const Model model(scene);
  const testing::RunInput input = testing::random_input(model, 3, kBriefSteps);
  const Counting counting;
  testing::losses_of_runs(model, {}, {input}, {model, kBriefSteps, 4});
  EXPECT_EQ(OfGradients::calls(), 0);
  testing::adjoint_of_run(model, {}, {input}, {model, kBriefSteps, 4}, 0);
  EXPECT_GT(OfGradients::calls(), 0);
}

/// Returns how many links have an effect.
int links_with(const Scene& scene, kernels::JointEffect effect) {
  const Model model(scene);
  int count = 0;
  for (const kernels::Link& link : compiled(model).links)
    count += (link.effects & effect) != 0 ? 1 : 0;
  return count;
}

/// Kernels go by the bits of each link.
TEST(CalledKernels, LinksCarryTheirOwnEffects) {
  struct LinkCase {
    EffectKind kind;
    kernels::JointEffect bit;
    int links;
  };
  for (const LinkCase& c : {LinkCase{EffectKind::joint_damping, kernels::kDamping, 2},
                            LinkCase{EffectKind::joint_springs, kernels::kSpring, 1},
                            LinkCase{EffectKind::joint_limits, kernels::kLimit, 1},
                            LinkCase{EffectKind::armature, kernels::kArmature, 1},
                            LinkCase{EffectKind::position_motors, kernels::kPositionServo, 1}}) {
    SCOPED_TRACE(to_string(c.kind));
    const Scene scene = testing::scene_that_sleeps();
    EXPECT_EQ(links_with(scene, c.bit), c.links);
    EXPECT_EQ(links_with(without(scene, {c.kind}), c.bit), 0);
  }
}

}  // namespace
}  // namespace tangere
