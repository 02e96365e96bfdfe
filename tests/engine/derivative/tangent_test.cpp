// SPDX-License-Identifier: Apache-2.0
// Tests tangents in dual numbers through whole rollouts against the adjoint, for every scheme and
// every input, fields included: λᵀ(J d) = (Jᵀλ)ᵀ d to rounding.
#include <gtest/gtest.h>

#include "engine/derivative/readout_pullback.hpp"
#include "engine/derivative/step_jacobian.hpp"
#include "engine/derivative/tangent.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/sense/readout.hpp"
#include "tests/engine/gradient_run.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::kBlock;
using testing::Random;
using testing::random_input;
using testing::RunInput;
using testing::StateLoss;

/// A direction in the space of all inputs of a run.
struct Direction {
  std::vector<double> q, v, numbers;
  std::vector<std::vector<double>> u;
};

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

std::vector<double> normals(Random& random, std::size_t n) {
  std::vector<double> x(n);
  for (double& a : x) a = random.normal();
  return x;
}

struct Products {
  double forward, backward, size;  ///< λᵀ(J d), (Jᵀλ)ᵀ d and |λ| |J d|
  int splits = 0;                  ///< steps that were split
};

/// Products for a loss that is linear in the states, and in the first sensor's fields every `every`
/// steps (0: never).
Products products(const Model& model, const StepperOptions& options, const RunInput& in,
                  unsigned seed, int every) {
  const CompiledModel& m = compiled(model);
  const int steps = static_cast<int>(in.u.size());
  const StateLoss loss(model, steps, seed);
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, options);
  BlockTape tape(model, stepper.integrator(), steps);
  tape.start(batch, 0);
  int splits = 0;
  for (int t = 0; t < steps; ++t) {
    stepper.step_block(batch, 0, in.u[std::size_t(t)], &tape);
    splits += batch.status(0) == StepStatus::split;
  }
  EXPECT_FALSE(failed(batch.status(0)));

  Random random(seed + 1);
  Direction d{normals(random, std::size_t(m.nv)),
              normals(random, std::size_t(m.nv)),
              std::vector<double>(std::size_t(parameter_rows(model))),
              {}};
  const NumberGradients parameters(model);
  std::vector<double> change;
  for (const NumberInfo& info : parameters.infos())
    change.push_back(testing::size_of(info) * random.normal());
  parameters.spread(change, batch, 0, d.numbers);
  for (int t = 0; t < steps; ++t) d.u.push_back(normals(random, std::size_t(m.nu)));

  const std::size_t field_size = every > 0 ? std::size_t(3 * model.sensors()[0].points) : 0;
  std::vector<std::vector<double>> field_weights;
  for (int t = 0; t <= steps; ++t) field_weights.push_back(normals(random, field_size));

  Products p{0, 0, 0, splits};
  Tangent tangent(model, options);
  StateTangent s{d.q, d.v, std::vector<double>(std::size_t(m.nv)),
                 std::vector<double>(std::size_t(m.nv))};
  double forward_square = 0, loss_square = 0;
  const auto state = [&](int t) {
    std::vector<double> q(std::size_t(m.nq));
    for (std::size_t i = 0; i < q.size(); ++i) q[i] = tape.state(t)[i * kBlock];
    return q;
  };
  const auto look = [&](int t) {
    BlockCotangent c;
    for (auto* x : {&c.q, &c.v}) x->assign(std::size_t(m.nv * kBlock), 0.0);
    loss.add(t, state(t), c, 0);
    for (std::size_t i = 0; i < std::size_t(m.nv); ++i) {
      p.forward += c.q[i * kBlock] * s.q[i] + c.v[i * kBlock] * s.v[i];
      forward_square += s.q[i] * s.q[i] + s.v[i] * s.v[i];
      loss_square += c.q[i * kBlock] * c.q[i * kBlock] + c.v[i * kBlock] * c.v[i * kBlock];
    }
    if (every == 0 || t % every != 0) return;
    std::vector<double> of_field(field_size);
    tangent.field(batch, 0, 0, tape, t, 0, d.numbers, {}, s, of_field);
    p.forward += dot(field_weights[std::size_t(t)], of_field);
    forward_square += dot(of_field, of_field);
    loss_square += double(field_size);
  };
  look(0);
  for (int t = 0; t < steps; ++t) {
    tangent.step(batch, 0, 0, tape, t, in.u[std::size_t(t)], d.u[std::size_t(t)], d.numbers, s);
    look(t + 1);
  }
  p.size = std::sqrt(forward_square * loss_square);

  Adjoint adjoint(model, options, {1, true});
  adjoint.clear();
  ReadoutPullback pullback(model);
  Readout readout(model);
  for (int t = steps; t >= 0; --t) {
    loss.add(t, state(t), adjoint.loss(0), 0);
    if (every > 0 && t % every == 0) {
      tape.show(t, batch, 0);
      CompactFrame<double> frame(model, 0);
      readout.read(batch, 0, frame);
      const kernels::PadTiles pad = m.sensors[0].tiles();
      std::vector<double> cotangents(frame.values().size());
      for (std::size_t k = 0; k < frame.tiles().size(); ++k)
        for (int n = 0; n < 64; ++n) {
          const int tile = frame.tiles()[k], row = n / 8, col = n % 8;
          if (row >= pad.rows_of(tile) || col >= pad.cols_of(tile)) continue;
          const auto point = std::size_t(pad.first_of(tile) + row * pad.cols + col);
          for (std::size_t c = 0; c < 3; ++c)
            cotangents[192 * k + 64 * c + std::size_t(n)] =
                field_weights[std::size_t(t)][3 * point + c];
        }
      pullback.place(batch, 0);
      pullback.clear();
      pullback.field(0, 0, frame.tiles(), cotangents, adjoint.loss(0).parameters);
      pullback.finish(adjoint.loss(0));
    }
    if (t == 0) break;
    adjoint.reverse_step(batch, 0, tape, t - 1, in.u[std::size_t(t - 1)]);
    for (std::size_t k = 0; k < std::size_t(m.nu); ++k)
      p.backward += adjoint.loss(0).u[k * kBlock] * d.u[std::size_t(t - 1)][k];
  }
  for (std::size_t i = 0; i < std::size_t(m.nv); ++i)
    p.backward += adjoint.loss(0).q[i * kBlock] * d.q[i] + adjoint.loss(0).v[i * kBlock] * d.v[i];
  for (std::size_t i = 0; i < d.numbers.size(); ++i)
    p.backward += adjoint.loss(0).parameters[i * kBlock] * d.numbers[i];
  return p;
}

class TangentScheme : public ::testing::TestWithParam<Integrator> {};

TEST_P(TangentScheme, MachinesHaveTheSameProducts) {
  for (unsigned seed = 1; seed <= 25; ++seed) {
    Scene s = testing::random_machine(seed, 2 + static_cast<int>(seed % 5));
    if (seed % 2 == 0)
      for (MotorDescription& m : s.motors) m.timing = MotorTiming::start;
    if (seed % 3 == 0) testing::map_controls(s, seed);
    if (seed % 5 == 0) testing::share_gravity(s, seed);
    const Model model(s);
    const Products p = products(model, testing::options(GetParam(), s.timestep, 1e-9),
                                random_input(model, seed, 5), seed, 0);
    EXPECT_NEAR(p.forward, p.backward, 1e-12 * p.size) << "seed " << seed;
  }
}

TEST_P(TangentScheme, ContactsHaveTheSameProducts) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const Scene s =
        testing::random_contacts(seed, 2 + static_cast<int>(seed % 2), ContactLaw(seed % 3));
    const Model model(s);
    const Products p = products(model, testing::options(GetParam(), s.timestep, 1e-9),
                                random_input(model, seed, 5), seed, 0);
    EXPECT_NEAR(p.forward, p.backward, 1e-11 * p.size) << "seed " << seed;
  }
}

/// A search that may take only one direction: most steps are split, some of them twice. There are
/// no differences here, because neighbouring runs may split elsewhere.
TEST_P(TangentScheme, SplitStepsHaveTheSameProducts) {
  int splits = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    Scene s = testing::random_contacts(seed, 2 + static_cast<int>(seed % 2), ContactLaw(seed % 3));
    s.solver.max_iterations = 1;
    const Model model(s);
    const Products p = products(model, testing::options(GetParam(), s.timestep, 1e-9),
                                random_input(model, seed, 5), seed, 0);
    EXPECT_NEAR(p.forward, p.backward, 1e-11 * p.size) << "seed " << seed;
    splits += p.splits;
  }
  EXPECT_GT(splits, 10);
}

/// From the first touch on: the ball is pressed, rolled and turned round. Fields every fifth step.
TEST_P(TangentScheme, RollingBallHasTheSameProducts) {
  const Scene s = testing::rolling_ball(false, 40);
  const Model model(s);
  const StepperOptions options = testing::options(GetParam(), s.timestep, 1e-9);
  Batch batch(model, 1);
  RunInput in{testing::q_of(batch), testing::v_of(batch), {}};
  for (int t = 0; t < 130; ++t) in.u.push_back(testing::rolling_ball_control(t));
  const Products p = products(model, options, in, 3, 5);
  EXPECT_GT(p.size, 0);
  EXPECT_NEAR(p.forward, p.backward, 1e-12 * p.size);
}

/// Jacobians of single steps times a direction are its tangents.
TEST_P(TangentScheme, StepJacobiansTimesDirectionsAreTangents) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const Scene scene = testing::random_machine(seed, 3);
    const Model model(scene);
    const StepperOptions options = testing::options(GetParam(), scene.timestep, 1e-11);
    const RunInput in = random_input(model, seed, 4);
    Batch batch(model, 1);
    batch.set_state(0, in.q, in.v);
    Stepper stepper(model, options);
    BlockTape tape(model, stepper.integrator(), 4);
    tape.start(batch, 0);
    for (const auto& u : in.u) stepper.step_block(batch, 0, u, &tape);
    Random random(seed);
    const auto nv = std::size_t(model.nv()), nu = std::size_t(model.nu());
    StateTangent s{normals(random, nv), normals(random, nv), normals(random, nv),
                   normals(random, nv)};
    const std::vector<double> u_dot = normals(random, nu);
    StepJacobians jacobians(model, options);
    jacobians.evaluate(batch, 0, tape, 2, in.u[2]);
    StepJacobian J;
    jacobians.get(0, J);
    std::vector<double> expected(2 * nv), size(2 * nv);
    for (std::size_t i = 0; i < 2 * nv; ++i) {
      const auto add = [&](double entry, double along) {
        expected[i] += entry * along;
        size[i] += std::abs(entry * along);
      };
      for (std::size_t k = 0; k < nv; ++k) {
        add(J.state[i * 2 * nv + k], s.q[k]);
        add(J.state[i * 2 * nv + nv + k], s.v[k]);
        add(J.previous[i * 2 * nv + k], s.previous_q[k]);
        add(J.previous[i * 2 * nv + nv + k], s.previous_v[k]);
      }
      for (std::size_t k = 0; k < nu; ++k) add(J.u[i * nu + k], u_dot[k]);
    }
    Tangent tangent(model, options);
    tangent.step(batch, 0, 0, tape, 2, in.u[2], u_dot, {}, s);
    for (std::size_t i = 0; i < nv; ++i) {
      EXPECT_NEAR(expected[i], s.q[i], 1e-9 * size[i]) << "seed " << seed;
      EXPECT_NEAR(expected[nv + i], s.v[i], 1e-9 * size[nv + i]) << "seed " << seed;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, TangentScheme, ::testing::ValuesIn(integrators()));

}  // namespace
}  // namespace tangere
