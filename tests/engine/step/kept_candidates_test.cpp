// SPDX-License-Identifier: Apache-2.0
// Tests that lists of candidates which outlive a step change no bits, whatever happens to an
// environment between two steps. A copy of a batch has no lists, so each step is also taken from a
// copy.
#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "engine/derivative/adjoint.hpp"
#include "engine/model/compile.hpp"
#include "engine/step/candidate_lists.hpp"
#include "engine/step/candidate_store.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/group_step.hpp"
#include "engine/step/stepper.hpp"
#include "engine/step/tape.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

constexpr int kKeptEnvironments = 19;  // the last group has three lanes

/// A pad on balls of different radii that turn under it.
Scene balls_of_many_sizes() {
  Scene s = testing::rolling_ball(false, 8);
  s.ground_contacts.front().coefficients.kn = 500;
  s.links[1].body.density = 500;
  s.links[0].joint.pose.position = {0, 0, 0.0445};
  s.randomizations.push_back({{NumberOwner::body, NumberField::radius, "ball"},
                              {Distribution::Kind::uniform, 0.0185, 0.0205, {}},
                              {}});
  s.randomizations.push_back({{NumberOwner::contact, NumberField::mu, "pad", 0, "ball"},
                              {Distribution::Kind::uniform, 0.2, 0.9, {}},
                              {}});
  return s;
}

/// Two boxes on a third, whose faces are chosen for each solve.
Scene boxes() {
  const auto box = [](const Vector3& size) { return CuboidShape{size, {2, 2, 2}}; };
  Scene s;
  s.name = "boxes";
  s.timestep = 4e-3;
  s.links = {
      testing::link("base", JointType::fixed, {0, 0, -0.01}, box({0.2, 0.2, 0.02}), 1000),
      testing::link("low", JointType::free, {0, 0, 0.0249}, box({0.05, 0.05, 0.05}), 1000),
      testing::link("top", JointType::free, {0.02, 0, 0.0748}, box({0.05, 0.05, 0.05}), 1000)};
  for (const auto& [a, b] : {std::pair{"low", "base"}, {"top", "low"}, {"low", "top"}})
    s.pair_contacts.push_back({a, b, {1e4, 20, 0.5, 1e3}, ContactLaw::clamped, 1e-5, {}});
  return s;
}

/// The same with springs in every contact, and a skin with springs under the base's points.
Scene boxes_with_springs() {
  Scene s = boxes();
  s.name = "boxes_with_springs";
  for (PairContactDescription& c : s.pair_contacts) c.coefficients.ks = 4e3;
  s.ground = GroundDescription{{0, 0, -0.02}, {0, 0, 1}};
  s.links.push_back(testing::link("brick", JointType::free, {0.2, 0, -0.0101},
                                  CuboidShape{{0.05, 0.05, 0.02}, {3, 3, 2}}, 1000));
  s.ground_contacts.push_back({"brick", {800, 1, 0.4, 2, 300}, ContactLaw::linear, 1e-5, {}});
  TactileDescription t;
  t.name = "skin";
  t.body = "base";
  t.coefficients = {50, 0.05, 0.4, 50, 20};
  t.array = {{-0.035, -0.035, 0}, {0.035, 0.035, 0}, {1, 0, 0}, {0, 1, 0}, 9, 9};
  s.sensors.push_back(t);
  return s;
}

std::vector<double> numbers_of(const Batch& batch) {
  std::vector<double> all;
  for (int e = 0; e < batch.environments(); ++e) {
    for (const double x : testing::q_of(batch, e)) all.push_back(x);
    for (const double x : testing::v_of(batch, e)) all.push_back(x);
    all.push_back(double(batch.status(e)));
    all.push_back(batch.iterations(e));
    all.push_back(batch.residual(e));
    for (const ShearEntry& entry : batch.shear_state(e)) {
      all.push_back(entry.point);
      all.insert(all.end(), entry.s, entry.s + 3);
    }
  }
  return all;
}

/// What happens to a batch before step t.
void disturb(Batch& batch, const BlockState& saved, int t) {
  const int e = 5 * t % batch.environments();
  std::vector<double> q = testing::q_of(batch, e), v = testing::v_of(batch, e);
  if (t % 5 == 1) v[2] -= 0.3, q[1] += 1e-3;
  if (t % 5 == 1) batch.set_state(e, q, v);
  if (t % 5 == 2) batch.reset(e, t);
  if (t % 5 == 3 && !compiled(batch.model()).randomized_row.empty())
    batch.set_randomized_value(e, 0, t % 2 == 0 ? 0.018 : 0.021);
  if (t % 5 == 4) q[2] += 2e-4, batch.displace_state(e, q, v);
  if (t % 9 == 3) batch.set_failed(e, StepStatus::singular);
  if (t % 20 == 15) batch.restore_block(0, saved);
  // In some steps all environments of the second group but 11, or but 11 and 14, are held.
  const bool alone = t % 20 >= 10 && t % 20 < 12, two = t % 20 >= 7 && t % 20 < 10;
  for (int l = 8; l < 16; ++l) batch.hold(l, (alone || two) && l != 11 && !(two && l == 14));
}

void expect_same_bits(const Scene& scene, const std::vector<double>& control) {
  const Model model(scene);
  Stepper stepper(model), other(model);
  BlockTape tape(model, stepper.integrator(), 4);
  Batch batch(model, kKeptEnvironments, 3);
  std::vector<double> u;
  for (int e = 0; e < kKeptEnvironments; ++e) u.insert(u.end(), control.begin(), control.end());
  const BlockState saved = batch.save_block(0);
  for (int t = 0; t < 80; ++t) {
    disturb(batch, saved, t);
    Batch without = batch;
    other.step(without, u);
    for (int b = 0; b < batch.blocks(); ++b) {
      const bool taped = t % 16 == 6;
      if (taped) tape.start(batch, b);
      stepper.step_block(batch, b, u, taped ? &tape : nullptr);
    }
    ASSERT_EQ(numbers_of(batch), numbers_of(without)) << "step " << t;
  }
}

/// Instruction sets differ in which lanes they step one after another.
void expect_same_bits_on_every_instruction_set(const Scene& scene,
                                               const std::vector<double>& control) {
  const kernels::KernelTable& before = kernels::active_kernels();
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    kernels::use_kernels(*table);
    expect_same_bits(scene, control);
  }
  kernels::use_kernels(before);
}

TEST(KeptCandidates, ChangeNoBitsWhereSizesVary) {
  expect_same_bits_on_every_instruction_set(balls_of_many_sizes(), {0.05, 0, 0.1});
}
TEST(KeptCandidates, ChangeNoBitsWhereFacesAreChosen) {
  expect_same_bits_on_every_instruction_set(boxes(), {});
}

TEST(KeptCandidates, ChangeNoBitsOfShearSprings) {
  expect_same_bits_on_every_instruction_set(boxes_with_springs(), {});
}

/// The gradient of a sum of coordinates and velocities after twelve steps, by the states at the
/// start. `kept`: whether lists are kept from step to step.
std::vector<double> gradient(const Model& model, bool kept) {
  constexpr int kSteps = 12;
  Stepper stepper(model);
  Batch batch(model, 3, 5);
  for (int e = 0; e < batch.environments(); ++e) {
    std::vector<double> q = testing::q_of(batch, e), v = testing::v_of(batch, e);
    v[0] = 0.05 * e, v[7] = 0.1;
    batch.set_state(e, q, v);
  }
  BlockTape tape(model, stepper.integrator(), kSteps);
  tape.start(batch, 0);
  for (int t = 0; t < kSteps; ++t) {
    if (!kept) batch = Batch(batch);
    stepper.step_block(batch, 0, {}, &tape);
  }
  Adjoint adjoint(model);
  adjoint.clear();
  BlockCotangent& loss = adjoint.loss(0);
  for (double& q : loss.q) q = 1;
  for (double& v : loss.v) v = 0.1;
  for (int t = kSteps; t > 0; --t) adjoint.reverse_step(batch, 0, tape, t - 1, {});
  std::vector<double> all(loss.q.begin(), loss.q.end());
  all.insert(all.end(), loss.v.begin(), loss.v.end());
  return all;
}

TEST(KeptCandidates, ChangeNoBitsOfGradients) {
  const Model model(boxes_with_springs());
  const std::vector<double> kept = gradient(model, true);
  EXPECT_GT(*std::ranges::max_element(kept), 0.5);
  EXPECT_EQ(kept, gradient(model, false));
}

/// In a second step the lists of a box at rest are those of the first; the anchors are not.
TEST(KeptCandidates, HaveTheAnchorsOfTheirStep) {
  const auto m = compile(boxes_with_springs());
  ASSERT_TRUE(keeps_lists(*m));
  Workspace w(*m);
  SingleWorkspace alone(*m);
  for (int i = 0; i < m->nq; ++i)
    for (double& q : w.q0[i].lane) q = m->initial_q[std::size_t(i)];
  for (double& v : w.v0[0].lane) v = 2e-3;  // of the low box, along x
  const kernels::KernelTable& table = kernels::active_kernels();
  NewtonReport report;
  const GroupStep step(*m, {Integrator::bdf1, 1e-4, 1e-9, 20});
  const auto take = [&] {
    step.advance(table, w, alone, kAllLanes, kNoLane, report);
    std::vector<double> anchors;
    const auto& list = w.own_candidates.lists[0];
    for (int k = 0; k < list.own_count[3]; ++k)
      anchors.push_back(list.own_anchors[(3 * kernels::kAnchorNumbers + 2) * list.stride + k]);
    return anchors;
  };
  const std::vector<double> first = take();
  ASSERT_FALSE(first.empty());
  const AlignedVector<kernels::LaneRow> references = w.own_candidates.references;
  const std::vector<double> second = take();
  for (std::size_t i = 0; i < references.size(); ++i)
    for (int l = 0; l < kernels::kGroup; ++l)
      ASSERT_EQ(w.own_candidates.references[i][l], references[i][l]) << "the lists were made anew";
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t k = 0; k < first.size(); ++k) EXPECT_NE(first[k], second[k]) << "point " << k;
}

TEST(KeptCandidates, AreDroppedWhereFacesChange) {
  const auto m = compile(boxes());
  Workspace w(*m);
  SingleWorkspace alone(*m);
  for (int i = 0; i < m->nq; ++i)
    for (double& q : w.q0[i].lane) q = m->initial_q[std::size_t(i)];
  const kernels::KernelTable& table = kernels::active_kernels();
  NewtonReport report;
  GroupStep(*m, {Integrator::bdf1, 1e-4, 1e-9, 20})
      .advance(table, w, alone, kAllLanes, kNoLane, report);
  start_solve(*m, table, w, kAllLanes);
  EXPECT_EQ(w.own_candidates.searched, kAllLanes);
  w.own_candidates.faces[2][5] *= -1;  // the lists of lane 5 are those of another face
  start_solve(*m, table, w, kAllLanes);
  EXPECT_EQ(w.own_candidates.searched, kAllLanes & ~(1U << 5));
  for (const auto& list : w.own_candidates.lists) EXPECT_EQ(list.own_count[5], 0);
}

TEST(KeptCandidates, AreThoseOfTheirGroupAndNotOfACopy) {
  const Model model(boxes());
  const CompiledModel& m = compiled(model);
  CandidateStore store(2);
  auto& lists = store.lists<1>(1, 0, m, true);
  lists.searched = 1;
  EXPECT_EQ(&store.lists<1>(1, 0, m, true), &lists);
  EXPECT_EQ(store.lists<1>(0, 0, m, true).searched, kNoLane) << "another group";
  EXPECT_EQ(store.lists<1>(1, 7, m, true).searched, kNoLane) << "another lane";
  EXPECT_EQ(store.lists<kernels::kGroup>(1, 0, m, true).searched, kNoLane) << "not of a lane alone";
  CandidateStore copy = store;
  EXPECT_EQ(copy.lists<1>(1, 0, m, true).searched, kNoLane);
  EXPECT_EQ(store.lists<1>(1, 0, m, false).searched, kNoLane) << "of another model";
}

}  // namespace
}  // namespace tangere
