// SPDX-License-Identifier: Apache-2.0
// Tests what a tape takes besides actions: numbers of the scene from a step on, and the springs
// with which it begins, with derivatives against differences.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/derivative/number_gradients.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/variable_numbers.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/catalogue/scene_task.hpp"
#include "tests/tasks/gradients/tape_sweep.hpp"

namespace tangere {
namespace {

using testing::keyed_incoming;
using testing::Numbers;

constexpr int kEnvironments = 18;
constexpr std::int64_t kActions = 5, kChange = 2;
constexpr const char* kNumber = "tactile left_finger kn";

/// A rod in the grip of two fingers, with springs. One number varies besides the drawn ones.
Scene gripped_rod() {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/grip_rod.xml").scene;
  for (const SceneNumber& number : variable_numbers(scene))
    if (name_of(number) == kNumber) let_vary(scene, number);
  return scene;
}

/// What a run begins with and takes.
struct Given {
  Numbers q, v, shear, actions, varying;
};

class TapeNumbers : public ::testing::Test {
 protected:
  TapeNumbers()
      : task_(gripped_rod(), 4, kActions, {{"left_finger.sum", "shear_state"}}),
        tape_(made(1, 1e9)) {
    given_ = start();
  }

  TapeOptions options(int threads, double tape_bytes) const {
    TapeOptions o = testing::tape_options(kActions, threads, tape_bytes);
    o.precision = Precision::f64;
    o.parameters = true;
    return o;
  }
  TaskTape made(int threads, double tape_bytes) const {
    return TaskTape(task_, kEnvironments, options(threads, tape_bytes));
  }
  std::size_t varying() const { return task_.model().scene().randomizations.size(); }
  std::size_t column() const {
    const auto& all = task_.model().scene().randomizations;
    return std::size_t(
        std::ranges::find(all, kNumber, [](const auto& d) { return name_of(d.number); }) -
        all.begin());
  }

  /// A state in which the fingers hold the rod, and actions that let it slip a little.
  Given start() {
    Given g;
    const Model& model = task_.model();
    const ShearStateArrays arrays = shear_state_arrays(model);
    const std::size_t nq = std::size_t(model.nq()), nv = std::size_t(model.nv()),
                      points = 3 * arrays.count();
    Batch batch(model, kEnvironments, testing::kTapeSeed);
    Stepper stepper(model);
    Numbers close;
    for (int e = 0; e < kEnvironments; ++e) close.insert(close.end(), {0.0, 0.8, 0.8});
    for (int t = 0; t < 60; ++t) stepper.step(batch, close);
    g.q.resize(kEnvironments * nq);
    g.v.resize(kEnvironments * nv);
    g.shear.resize(kEnvironments * points);
    for (std::size_t e = 0; e < kEnvironments; ++e) {
      batch.get_q(int(e), std::span(g.q).subspan(e * nq, nq));
      batch.get_v(int(e), std::span(g.v).subspan(e * nv, nv));
      arrays.write(batch.shear_state(int(e)), std::span(g.shear).subspan(e * points, points));
    }
    for (std::size_t i = 0; i < std::size_t(kActions) * kEnvironments * 4; ++i)
      g.actions.insert(g.actions.end(), {1e-4 * double(i % 7), 0.8, 0.799});
    for (int e = 0; e < kEnvironments; ++e)
      for (std::size_t k = 0; k < varying(); ++k)
        g.varying.push_back(k == column() ? 2.1e8 + 1e6 * e : 0.0);
    return g;
  }

  void play(TaskTape& tape, const Given& g) const {
    tape.reset(testing::kTapeSeed, 0);
    tape.displace(g.q, g.v, g.shear);
    const std::size_t row = g.actions.size() / std::size_t(kActions);
    for (std::int64_t t = 0; t < kActions; ++t)
      tape.step(std::span(g.actions).subspan(std::size_t(t) * row, row),
                t == kChange ? std::span<const double>(g.varying) : std::span<const double>{});
  }

  /// Σ of keyed numbers times what the environments show at last.
  double shown(const Given& g) {
    play(tape_, g);
    const std::size_t row = tape_.observations().size() / kEnvironments;
    double sum = 0;
    for (std::size_t i = 0; i < tape_.observations().size(); ++i)
      sum += keyed_incoming(int(i / row), 0, i % row) * tape_.observations()[i];
    return sum;
  }

  struct Bars {
    Numbers actions, brought, at_start, shear;
    bool operator==(const Bars&) const = default;
  };
  Bars bars(TaskTape& tape) const {
    play(tape, given_);
    const std::size_t seen = tape.observations().size(),
                      numbers = std::size_t(NumberGradients(task_.model()).count()),
                      width = given_.actions.size() / std::size_t(kActions);
    Numbers by(seen), q(std::size_t(kEnvironments * task_.model().nv())), v = q;
    for (std::size_t i = 0; i < seen; ++i)
      by[i] = keyed_incoming(int(i / (seen / kEnvironments)), 0, i % (seen / kEnvironments));
    Bars out{Numbers(given_.actions.size()), Numbers(kEnvironments * numbers),
             Numbers(kEnvironments * numbers), Numbers(given_.shear.size())};
    for (std::int64_t t = kActions; t-- > 0;) {
      Numbers own(kEnvironments * numbers);
      tape.reverse({by}, std::span(out.actions).subspan(std::size_t(t) * width, width), own);
      if (t == kChange) {
        out.brought = own;
      } else {
        EXPECT_EQ(own, Numbers(own.size())) << "action " << t << " brings nothing";
      }
      by.assign(seen, 0.0);
    }
    tape.reverse_start({by}, {q, v, out.at_start, {}, out.shear});
    return out;
  }

  SceneTask task_;
  TaskTape tape_;
  Given given_;
};

void expect_slope(double slope, const std::function<double(double)>& at, double step,
                  const std::string& what) {
  double best = HUGE_VAL, difference = 0;
  for (const double h : {step, 0.1 * step, 0.01 * step}) {
    const double found = (at(h) - at(-h)) / (2 * h);
    if (std::abs(found - slope) < best) best = std::abs(found - slope), difference = found;
  }
  EXPECT_LE(best, 1e-5 * std::abs(slope))
      << what << ": " << slope << ", by differences " << difference;
}

TEST_F(TapeNumbers, OfAStepHaveTheirOwnDerivatives) {
  const Bars found = bars(tape_);
  const NumberGradients numbers(task_.model());
  const auto number = std::ranges::find(numbers.infos(), kNumber, &NumberInfo::name);
  ASSERT_NE(number, numbers.infos().end());
  const std::size_t at = std::size_t(number - numbers.infos().begin());
  for (const std::size_t e : {std::size_t{0}, std::size_t{17}}) {
    const double slope = found.brought[e * std::size_t(numbers.count()) + at];
    EXPECT_NE(slope, 0);
    expect_slope(
        slope,
        [&](double h) {
          Given moved = given_;
          moved.varying[e * varying() + column()] += h;
          return shown(moved);
        },
        1e6, "kn of environment " + std::to_string(e));
    // A field that is read at last does not depend on the kn of the sensor before.
    EXPECT_EQ(found.at_start[e * std::size_t(numbers.count()) + at], 0);
  }
}

TEST_F(TapeNumbers, SpringsOfTheStartHaveDerivatives) {
  const Bars found = bars(tape_);
  std::size_t most = 0;
  for (std::size_t i = 0; i < found.shear.size(); ++i)
    if (std::abs(found.shear[i]) > std::abs(found.shear[most])) most = i;
  EXPECT_NE(found.shear[most], 0);
  expect_slope(
      found.shear[most],
      [&](double h) {
        Given moved = given_;
        moved.shear[most] += h;
        return shown(moved);
      },
      1e-7, "number " + std::to_string(most) + " of the shear state");
}

TEST_F(TapeNumbers, HaveTheSameBitsOnAnyTape) {
  const Bars found = bars(tape_);
  TaskTape threads = made(3, 1e9),
           again = made(2, testing::least_tape_bytes(task_, kEnvironments, options(2, 1e9)));
  EXPECT_EQ(bars(threads), found);
  EXPECT_EQ(bars(again), found);
  EXPECT_GT(again.recomputed_steps(), 0);
}

}  // namespace
}  // namespace tangere
