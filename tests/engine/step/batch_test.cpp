// SPDX-License-Identifier: Apache-2.0
// Tests that the same seed gives the same bits, for any batch size, in any lane, whatever the
// neighbours do, on every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <thread>

#include "kernels/table/kernel_table.hpp"
#include "tests/engine/random_scene.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::q_of;
using testing::v_of;

Scene varied() {
  Scene s = testing::rolling_ball(false, 24);
  Distribution d;
  d.a = -3e-3, d.b = 3e-3;
  s.randomizations.push_back({{NumberOwner::joint, NumberField::q, "ball_joint", 0}, d, {}});
  s.randomizations.push_back({{NumberOwner::joint, NumberField::q, "ball_joint", 1}, d, {}});
  d.a = 4, d.b = 6;
  s.randomizations.push_back({{NumberOwner::contact, NumberField::kn, "pad", 0, "ball"}, d, {}});
  d.a = 0.008, d.b = 0.012;
  s.randomizations.push_back({{NumberOwner::tactile, NumberField::kt, "pad"}, d, {}});
  return s;
}

/// Everything that is stored of one environment after a run.
struct Record {
  std::vector<double> q, v, force;
  int iterations = 0;
  bool operator==(const Record&) const = default;
};

Record run(const Model& model, int environments, int wanted, std::int64_t first_episode, int steps,
           void (*disturb)(Batch&, int) = nullptr) {
  Stepper stepper(model);
  Readout readout(model);
  Batch batch(model, environments, 7, first_episode);
  Record r;
  for (int k = 0; k < steps; ++k) {
    if (k == 60 && disturb != nullptr) disturb(batch, wanted);
    testing::step_all(stepper, batch, testing::rolling_ball_control(k));
    r.iterations += batch.iterations(wanted);
  }
  EXPECT_FALSE(failed(batch.status(wanted)));
  r.q = q_of(batch, wanted);
  r.v = v_of(batch, wanted);
  r.force.resize(3 * 576);
  readout.tactile(batch, wanted, 0, r.force);
  return r;
}

TEST(Batch, AnEnvironmentHasTheSameBitsInEveryBatchAndLane) {
  const Model model(varied());
  const kernels::KernelTable& before = kernels::active_kernels();
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    kernels::use_kernels(*table);
    const Record alone = run(model, 1, 0, 5, 160);
    EXPECT_EQ(alone, run(model, 2, 1, 4, 160));
    EXPECT_EQ(alone, run(model, 7, 5, 0, 160));
    EXPECT_EQ(alone, run(model, 16, 1, 4, 160));
    EXPECT_EQ(alone, run(model, 16, 5, 0, 160));
    EXPECT_EQ(alone, run(model, 21, 3, 2, 160));
    EXPECT_TRUE(std::ranges::any_of(alone.force, [](double f) { return f != 0; }));
  }
  kernels::use_kernels(before);
}

TEST(Batch, AThousandNeighboursChangeNothing) {
  const Model model(varied());
  EXPECT_EQ(run(model, 1, 0, 999, 90), run(model, 1000, 999, 0, 90));
}

/// Trees of random joints, with spheres and cuboids in contact, thrown about: an environment alone
/// against the same one in a group of eight and in a crowd.
TEST(Batch, RandomScenesHaveTheSameBitsAloneAndInAGroup) {
  int touching = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const Model model(
        testing::random_contacts(seed, 2 + static_cast<int>(seed % 4), ContactLaw::clamped));
    const std::size_t nv = std::size_t(model.nv());
    const auto velocity = [&](int e) {
      testing::Random random(1000 * seed + static_cast<unsigned>(e));
      std::vector<double> v(nv);
      for (double& x : v) x = 0.02 * random.normal();
      return v;
    };
    const auto run_of = [&](int environments, int wanted, int episode) {
      Batch batch(model, environments);
      Stepper stepper(model);
      for (int e = 0; e < environments; ++e)
        batch.set_state(e, q_of(batch, e), velocity(e == wanted ? episode : 100 + e));
      const std::vector<double> u(std::size_t(environments * model.nu()));
      std::vector<double> record;
      for (int t = 0; t < 8; ++t) {
        stepper.step(batch, u);
        for (double x : q_of(batch, wanted)) record.push_back(x);
        for (double x : v_of(batch, wanted)) record.push_back(x);
        record.push_back(static_cast<double>(batch.status(wanted)));
        record.push_back(batch.iterations(wanted));
      }
      return record;
    };
    const std::vector<double> alone = run_of(1, 0, 3);
    EXPECT_EQ(alone, run_of(8, 5, 3)) << "seed " << seed;
    EXPECT_EQ(alone, run_of(17, 16, 3)) << "seed " << seed;
    EXPECT_EQ(alone, run_of(20, 2, 3)) << "seed " << seed;
    touching += model.contacts().empty() ? 0 : 1;
  }
  EXPECT_GT(touching, 6);
}

void poison(Batch& batch, int spared) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int e = 0; e < batch.environments(); ++e) {
    if (e == spared) continue;
    std::vector<double> q = q_of(batch, e), v = v_of(batch, e);
    if (e % 3 == 0) v[0] = nan;
    if (e % 3 == 1) q[2] = 1e30;
    if (e % 3 == 2) v[7] = 1e200;
    batch.set_state(e, q, v);
  }
}

TEST(Batch, BlocksAreResetFromManyThreadsAtOnce) {
  const Model model(varied());
  constexpr int kThreads = 4, kRounds = 3000;
  Batch batch(model, kThreads * kernels::kBlock, 5);
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t)
    threads.emplace_back([&, t] {
      for (int round = 0; round < kRounds; ++round)
        for (int e = t * kernels::kBlock; e < (t + 1) * kernels::kBlock; ++e)
          batch.reset(e, e + 100 * (round % 7));
    });
  for (std::thread& thread : threads) thread.join();
  const int last = (kRounds - 1) % 7;
  for (int e = 0; e < batch.environments(); ++e) {
    const Batch alone(model, 1, 5, e + 100 * last);
    EXPECT_EQ(q_of(batch, e), q_of(alone)) << e;
    EXPECT_EQ(v_of(batch, e), v_of(alone)) << e;
  }
}

TEST(Batch, PoisonedNeighboursAreFlaggedAndHarmNobody) {
  const Model model(varied());
  const Record clean = run(model, 16, 5, 0, 120);
  EXPECT_EQ(clean, run(model, 16, 5, 0, 120, poison));
}

TEST(Batch, BadStatesAndControlsAreFrozenWithAReason) {
  const Model model(varied());
  Stepper stepper(model);
  Batch batch(model, 4);
  std::vector<double> u(12, 0.0);
  u[4] = std::numeric_limits<double>::quiet_NaN();  // environment 1
  std::vector<double> v = v_of(batch, 2);
  v[3] = std::numeric_limits<double>::infinity();
  batch.set_state(2, q_of(batch, 2), v);
  const std::vector<double> before = q_of(batch, 1);
  stepper.step(batch, u);
  EXPECT_EQ(batch.status(0), StepStatus::converged);
  EXPECT_EQ(batch.status(1), StepStatus::non_finite);
  EXPECT_TRUE(failed(batch.status(2)));
  EXPECT_EQ(batch.status(3), StepStatus::converged);
  EXPECT_EQ(batch.failed_count(), 2);
  EXPECT_EQ(q_of(batch, 1), before);
  u[4] = 0;
  stepper.step(batch, u);
  EXPECT_EQ(q_of(batch, 1), before);  // stays frozen until it is set again
  batch.set_state(1, before, v_of(batch, 1));
  stepper.step(batch, u);
  EXPECT_EQ(batch.status(1), StepStatus::converged);
}

TEST(Batch, RestartedRunContinuesBitForBit) {
  const Model model(varied());
  for (Integrator scheme : testing::all_integrators()) {
    Stepper stepper(model, testing::options(scheme, 5e-3, 1e-9));
    Batch through(model, 1, 3), resumed(model, 1, 3);
    std::vector<double> before_q, before_v;
    for (int k = 0; k < 100; ++k) {
      if (k == 80) {
        if (scheme.scheme().needs_history()) {
          resumed.set_state(0, q_of(through), v_of(through), before_q, before_v);
        } else {
          resumed.set_state(0, q_of(through), v_of(through));
        }
      }
      before_q = q_of(through), before_v = v_of(through);
      stepper.step(through, testing::rolling_ball_control(k));
      if (k >= 80) stepper.step(resumed, testing::rolling_ball_control(k));
    }
    EXPECT_EQ(q_of(through), q_of(resumed)) << to_string(scheme);
    EXPECT_EQ(v_of(through), v_of(resumed)) << to_string(scheme);
  }
}

TEST(Batch, InstructionSetsAgree) {
  const kernels::KernelTable& before = kernels::active_kernels();
  const Model model(varied());
  std::vector<Record> records;
  std::vector<std::string> names;
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    kernels::use_kernels(*table);
    records.push_back(run(model, 3, 2, 0, 100));
    names.emplace_back(table->name);
  }
  kernels::use_kernels(before);
  for (std::size_t i = 1; i < records.size(); ++i) {
    if (names[i] == "avx2" && names[0] == "avx512") {
      EXPECT_EQ(records[i], records[0]);
    }
    for (std::size_t k = 0; k < records[0].q.size(); ++k)
      EXPECT_NEAR(records[i].q[k], records[0].q[k], 1e-9) << names[i];
  }
}

TEST(Batch, SecondSceneRunsInEveryScheme) {
  const Model model(testing::two_balls());
  Readout readout(model);
  for (Integrator scheme : testing::all_integrators()) {
    Stepper stepper(model, testing::options(scheme, 2e-3, 1e-10));
    Batch batch(model, 3);
    for (int k = 0; k < 300; ++k)
      testing::step_all(stepper, batch, {k < 250 ? 0.0 : 0.02, k < 250 ? 0.0 : -0.02, -0.2});
    EXPECT_EQ(batch.failed_count(), 0) << to_string(scheme);
    std::vector<double> force(3 * 63);
    readout.tactile(batch, 1, 0, force);
    int touched = 0;
    for (std::size_t k = 0; k < 63; ++k) touched += force[3 * k + 2] != 0;
    EXPECT_GT(touched, 1) << to_string(scheme);
  }
}

TEST(Batch, LanesAreTheStateInPlace) {
  const Model model(varied());
  Stepper stepper(model);
  Batch batch(model, 37, 5);
  std::vector<std::span<const double>> q, v;
  for (int b = 0; b < batch.blocks(); ++b) {
    q.push_back(batch.q_lanes(b));
    v.push_back(batch.v_lanes(b));
    ASSERT_EQ(std::ssize(q.back()), 16 * model.nq());
    ASSERT_EQ(std::ssize(v.back()), 16 * model.nv());
  }
  EXPECT_EQ(q[2].data() - q[1].data(), q[1].data() - q[0].data());
  for (int k = 0; k < 3; ++k) {
    testing::step_all(stepper, batch, testing::rolling_ball_control(k));
    for (int e = 0; e < batch.environments(); ++e) {
      const std::vector<double> qs = q_of(batch, e), vs = v_of(batch, e);
      for (std::size_t i = 0; i < qs.size(); ++i)
        ASSERT_EQ(q[std::size_t(e) / 16][i * 16 + std::size_t(e) % 16], qs[i]) << e << ' ' << i;
      for (std::size_t i = 0; i < vs.size(); ++i)
        ASSERT_EQ(v[std::size_t(e) / 16][i * 16 + std::size_t(e) % 16], vs[i]) << e << ' ' << i;
    }
  }
  EXPECT_THROW((void)batch.q_lanes(3), InputError);
  EXPECT_THROW((void)batch.v_lanes(-1), InputError);
}

TEST(Batch, ImpossibleSizesAreRefused) {
  const Model model(varied());
  EXPECT_THROW(Batch(model, 0), InputError);
  EXPECT_THROW(Batch(model, -3), InputError);
}

}  // namespace
}  // namespace tangere
