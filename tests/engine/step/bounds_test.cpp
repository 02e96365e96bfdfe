// SPDX-License-Identifier: Apache-2.0
// Tests that Batch, Stepper and Readout refuse environments, blocks, sensors and bodies that do not
// exist, arrays of another length than their shape, and batches and frames of another model.
#include <gmock/gmock.h>

#include <functional>
#include <limits>
#include <vector>

#include "engine/sense/readout.hpp"
#include "engine/step/batch.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using Numbers = std::vector<double>;

constexpr int kBoundEnvironments = 18;  // two blocks, the second one with two environments

const Model& ball() {
  static const Model model(read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball_small.xml").scene);
  return model;
}
std::size_t size_of(int n) { return std::size_t(n); }

/// Calls f with sizes other than `right`: 0, one less, one more, twice.
void expect_refused_sizes(const char* what, std::size_t right,
                          const std::function<void(std::size_t)>& f) {
  EXPECT_NO_THROW(f(right)) << what;
  for (const std::size_t wrong : {std::size_t(0), right - 1, right + 1, 2 * right})
    EXPECT_THROW(f(wrong), InputError) << what << " with " << wrong << " numbers";
}
/// Calls f with indices that are not in [0, count).
void expect_refused_indices(const char* what, int count, const std::function<void(int)>& f) {
  for (const int right : {0, count - 1}) EXPECT_NO_THROW(f(right)) << what << ' ' << right;
  for (const int wrong :
       {-1, count, count + 16, std::numeric_limits<int>::max(), std::numeric_limits<int>::min()})
    EXPECT_THROW(f(wrong), InputError) << what << ' ' << wrong;
}

TEST(Bounds, ABatchRefusesEnvironmentsThatDoNotExist) {
  Batch batch(ball(), kBoundEnvironments, 1);
  Numbers q(size_of(ball().nq())), v(size_of(ball().nv()));
  batch.get_q(0, q);
  const std::vector<std::pair<const char*, std::function<void(int)>>> calls = {
      {"reset", [&](int e) { batch.reset(e, 3); }},
      {"hold", [&](int e) { batch.hold(e, false); }},
      {"held", [&](int e) { (void)batch.held(e); }},
      {"steps", [&](int e) { (void)batch.steps(e); }},
      {"set_steps", [&](int e) { batch.set_steps(e, 0); }},
      {"episode", [&](int e) { (void)batch.episode(e); }},
      {"get_q", [&](int e) { batch.get_q(e, q); }},
      {"get_v", [&](int e) { batch.get_v(e, v); }},
      {"set_state", [&](int e) { batch.set_state(e, q, v); }},
      {"set_state of a run", [&](int e) { batch.set_state(e, q, v, q, v); }},
      {"displace_state", [&](int e) { batch.displace_state(e, q, v); }},
      {"memory", [&](int e) { (void)batch.shear_state(e); }},
      {"set_memory", [&](int e) { batch.set_shear_state(e, {}); }},
      {"sleep", [&](int e) { (void)batch.sleep(e); }},
      {"set_sleep", [&](int e) { batch.set_sleep(e, {}); }},
      {"status", [&](int e) { (void)batch.status(e); }},
      {"iterations", [&](int e) { (void)batch.iterations(e); }},
      {"residual", [&](int e) { (void)batch.residual(e); }},
      {"has_history", [&](int e) { (void)batch.has_history(e); }},
      {"set_failed", [&](int e) { batch.set_failed(e, StepStatus::not_converged); }}};
  for (const auto& [what, call] : calls) expect_refused_indices(what, kBoundEnvironments, call);
  const std::vector<std::pair<const char*, std::function<void(int)>>> of_blocks = {
      {"block", [&](int b) { (void)batch.block(b); }},
      {"save_block", [&](int b) { (void)batch.save_block(b); }},
      {"restore_block", [&](int b) { batch.restore_block(b, batch.save_block(0)); }}};
  for (const auto& [what, call] : of_blocks) expect_refused_indices(what, 2, call);
  const int randomized = int(ball().scene().randomizations.size());
  ASSERT_GT(randomized, 0);
  expect_refused_indices("randomized_value", randomized,
                         [&](int k) { (void)batch.randomized_value(0, k); });
  expect_refused_indices("is_parameter", randomized, [&](int k) { (void)batch.is_parameter(k); });
  EXPECT_THROW(batch.set_randomized_value(0, randomized, 1), InputError);
  EXPECT_THROW(batch.set_randomized_value(kBoundEnvironments, 0, 1), InputError);
}

TEST(Bounds, ABatchRefusesArraysOfAnotherLength) {
  Batch batch(ball(), kBoundEnvironments, 1);
  const std::size_t nq = size_of(ball().nq()), nv = size_of(ball().nv());
  Numbers q(nq), v(nv);
  batch.get_q(0, q);
  expect_refused_sizes("get_q", nq, [&](std::size_t n) {
    Numbers x(n);
    batch.get_q(0, x);
  });
  expect_refused_sizes("get_v", nv, [&](std::size_t n) {
    Numbers x(n);
    batch.get_v(0, x);
  });
  const auto resized = [](Numbers x, std::size_t n) {
    x.resize(n);
    return x;
  };
  expect_refused_sizes("q", nq, [&](std::size_t n) { batch.set_state(0, resized(q, n), v); });
  expect_refused_sizes("v", nv, [&](std::size_t n) { batch.set_state(0, q, Numbers(n)); });
  expect_refused_sizes("q", nq, [&](std::size_t n) { batch.displace_state(0, resized(q, n), v); });
  expect_refused_sizes("previous q", nq,
                       [&](std::size_t n) { batch.set_state(0, q, v, resized(q, n), v); });
  expect_refused_sizes("previous v", nv,
                       [&](std::size_t n) { batch.set_state(0, q, v, q, Numbers(n)); });
  expect_refused_sizes("q of a run", nq,
                       [&](std::size_t n) { batch.set_state(0, resized(q, n), v, q, v); });
  // What is refused changes nothing.
  Numbers after(nq);
  batch.get_q(0, after);
  EXPECT_EQ(after, q);
}

TEST(Bounds, AStepperRefusesControlsOfAnotherLength) {
  Batch batch(ball(), kBoundEnvironments, 1);
  Stepper stepper(ball());
  const std::size_t controls = size_of(kBoundEnvironments) * size_of(ball().nu());
  ASSERT_GT(controls, 0u);
  expect_refused_sizes("step", controls, [&](std::size_t n) { stepper.step(batch, Numbers(n)); });
  expect_refused_sizes("step_block", controls,
                       [&](std::size_t n) { stepper.step_block(batch, 1, Numbers(n)); });
  expect_refused_indices("step_block", 2,
                         [&](int b) { stepper.step_block(batch, b, Numbers(controls)); });
  Batch other(Model(ball().scene()), kBoundEnvironments, 1);
  EXPECT_THROW(stepper.step(other, Numbers(controls)), InputError);
}

TEST(Bounds, AReadoutRefusesWhatDoesNotExist) {
  const Batch batch(ball(), kBoundEnvironments, 1);
  Readout readout(ball());
  const std::size_t field = 3 * size_of(ball().sensors()[0].points);
  const int sensors = int(ball().sensors().size());
  Numbers force(field);
  std::vector<float> single(field);
  expect_refused_indices("tactile", kBoundEnvironments,
                         [&](int e) { readout.tactile(batch, e, 0, force); });
  expect_refused_indices("tactile", sensors, [&](int s) { readout.tactile(batch, 0, s, force); });
  expect_refused_indices("tactile", sensors, [&](int s) { readout.tactile(batch, 0, s, single); });
  expect_refused_sizes("tactile", field, [&](std::size_t n) {
    Numbers x(n);
    readout.tactile(batch, 0, 0, x);
  });
  const std::size_t nb = size_of(ball().nb());
  expect_refused_sizes("poses", 7 * nb, [&](std::size_t n) {
    Numbers pose(n), twist(6 * nb);
    readout.bodies(batch, 0, pose, twist);
  });
  expect_refused_sizes("twists", 6 * nb, [&](std::size_t n) {
    Numbers pose(7 * nb), twist(n);
    readout.bodies(batch, 0, pose, twist);
  });
  expect_refused_indices("body", ball().nb(), [&](int b) {
    Numbers pose(7), twist(6);
    readout.bodies(batch, 0, pose, twist, std::vector<int>{b});
  });
  // Two environments are in block 1.
  std::vector<Numbers> readings(16, force);
  const auto views = [&](std::size_t count) {
    std::vector<std::span<double>> spans;
    for (std::size_t e = 0; e < count; ++e) spans.emplace_back(readings[e]);
    return spans;
  };
  EXPECT_NO_THROW(readout.read_block(batch, 1, {0}, views(2)));
  EXPECT_THROW(readout.read_block(batch, 1, {0}, views(1)), InputError);
  EXPECT_THROW(readout.read_block(batch, 0, {0}, views(15)), InputError);
  EXPECT_THROW(readout.read_block(batch, 2, {0}, views(16)), InputError);
  EXPECT_THROW(readout.read_block(batch, 1, {sensors}, views(2)), InputError);
  EXPECT_THROW(readout.read_block(batch, 1, {0, FieldForm::pressure}, views(2)), InputError);
  const Model other(ball().scene());
  DenseFrame<double> own(ball(), 0), foreign(other, 0);
  EXPECT_NO_THROW(readout.read(batch, 0, own));
  EXPECT_THROW(readout.read(batch, 0, foreign), InputError);
  EXPECT_THROW(readout.read(batch, kBoundEnvironments, own), InputError);
  EXPECT_THROW(readout.read(Batch(other, 1), 0, own), InputError);
}

TEST(Bounds, MessagesSayWhatWasExpected) {
  Batch batch(ball(), 2, 1);
  const auto message = [](const std::function<void()>& f) -> std::string {
    try {
      f();
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(message([&] { batch.reset(2, 0); }),
            "environment 2 does not exist; expected a number from 0 to 1");
  EXPECT_EQ(message([&] { Stepper(ball()).step(batch, Numbers(1)); }),
            "controls: 1 numbers; expected " + std::to_string(2 * ball().nu()));
}

}  // namespace
}  // namespace tangere
