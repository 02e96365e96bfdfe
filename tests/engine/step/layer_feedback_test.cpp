// SPDX-License-Identifier: Apache-2.0
// Tests <layer feedback="true">: the layer's wrench against its energy, its field and its Jacobian,
// and motions with it.
#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <iostream>

#include "engine/derivative/dual_stage.hpp"
#include "engine/model/compiled_layer.hpp"
#include "engine/scene/sensor_contacts.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/displacement.hpp"
#include "engine/step/lane_energy.hpp"
#include "engine/step/stepper.hpp"
#include "tests/engine/layer_feedback_scene.hpp"
#include "tests/engine/runs.hpp"
#include "tests/io/scene/scene_text.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using testing::gel_model;
using testing::gel_table;
using testing::LayerProbe;
using testing::Random;
using Numbers = std::vector<double>;

const char* const kBodies[] = {R"(type="sphere" radius="0.02")",
                               R"(type="cuboid" size="0.012 0.016 0.039")",
                               R"(type="cylinder" length="0.039" radius="0.008")",
                               R"(type="capsule" length="0.02" radius="0.0097")",
                               R"(type="ellipsoid" size="0.03 0.02 0.039")"};
constexpr const char* kSmooth = R"(mu="0")";
constexpr const char* kViscous = R"(mu="0.7" ks="0" kt="4e5")";
constexpr const char* kSprings = R"(mu="0.7")";

/// A place near the start: on the gel, turned by some degrees.
Numbers gel_place(const Model& model, Random& random) {
  Numbers q = testing::q_of(Batch(model, 1));
  for (int i = 0; i < model.nv(); ++i)
    displace(model, q, i, (i < 2 ? 2e-3 : i == 2 ? 2e-4 : 0.06) * random.normal());
  return q;
}
Numbers gel_rates(const Model& model, Random& random) {
  Numbers v;
  for (int i = 0; i < model.nv(); ++i) v.push_back((i < 3 ? 0.05 : 2) * random.normal());
  return v;
}

/// w is the derivative of the energy by the pose.
TEST(LayerFeedback, TheWrenchIsTheSlopeOfTheEnergy) {
  for (const char* body : kBodies) {
    const Model model = gel_model(gel_table(body, kSmooth));
    LayerProbe probe(model);
    Random random(5);
    const Numbers still(std::size_t(model.nv()));
    int compared = 0;
    for (int trial = 0; trial < 6; ++trial) {
      const Numbers q = gel_place(model, random);
      probe.place(q, still);
      if (probe.energy() == 0) continue;
      for (int dof = 0; dof < model.nv(); ++dof) {
        const auto energy_at = [&](double e) {
          Numbers moved = q;
          displace(model, moved, dof, e);
          probe.place(moved, still);
          return probe.energy();
        };
        const double e = dof < 3 ? 1e-8 : 1e-6, slope = (8 * (energy_at(e) - energy_at(-e)) -
                                                         (energy_at(2 * e) - energy_at(-2 * e))) /
                                                        (12 * e);
        probe.place(q, still);
        probe.evaluate(false);
        const double g = probe.work().stage.g[dof][0];
        // g is what the layer leaves to inertia: gravity is in it.
        Numbers away = q;
        away[2] += 1;
        probe.place(away, still);
        probe.evaluate(false);
        const double force = g - probe.work().stage.g[dof][0];
        EXPECT_NEAR(force, slope, 1e-6 * (std::abs(slope) + (dof < 3 ? 1 : 0.01)))
            << body << ' ' << trial << ' ' << dof;
        ++compared;
      }
    }
    EXPECT_GE(compared, 12) << body;
  }
}

/// Along a closed path of poses, the work of the layer is zero, but for the quadrature.
TEST(LayerFeedback, ACycleOfPressShearAndRockGivesOutNoEnergy) {
  for (const char* body : {kBodies[0], kBodies[1]}) {
    const Model model = gel_model(gel_table(body, kSmooth));
    LayerProbe probe(model);
    const Numbers still(std::size_t(model.nv())), start = testing::q_of(Batch(model, 1));
    constexpr int kDofs[] = {0, 1, 2, 4};  // along x, y and z, about y
    const auto ways = [](double t) {
      const double turn = 2 * M_PI * t;
      return std::array{2e-3 * std::sin(turn), 1e-3 * std::sin(2 * turn), 3e-4 * std::cos(turn),
                        0.08 * std::sin(turn + 1)};
    };
    const int steps = 2000;
    double work = 0, done = 0;
    for (int k = 0; k < steps; ++k) {
      const auto from = ways(double(k) / steps), to = ways(double(k + 1) / steps),
                 middle = ways((k + 0.5) / steps);
      Numbers q = start;
      for (std::size_t i = 0; i < from.size(); ++i) displace(model, q, kDofs[i], middle[i]);
      probe.place(q, still);
      probe.evaluate(false);
      double part = 0;
      for (std::size_t i = 0; i < from.size(); ++i)
        part += probe.work().stage.g[kDofs[i]][0] * (to[i] - from[i]);
      work += part, done += std::abs(part);
    }
    EXPECT_NEAR(work, 0, 1e-4 * done) << body;
    EXPECT_GT(done, 1e-4) << body;
  }
}

/// The field is read apart from the contact; its sum is the contact's force.
TEST(LayerFeedback, TheFieldIsTheForceInTheDynamics) {
  for (const auto& [skin, cell] :
       {std::pair{kSmooth, ""}, {kViscous, "cell=\"2.4e-3\""}, {kSprings, ""}}) {
    const std::string text =
        gel_table(kBodies[0], skin, 21, std::string("margin=\"3e-3\" ") + cell);
    const Model model = gel_model(testing::with(
        "<sensor>",
        "<robot><link name=\"second\"><joint name=\"second\" type=\"prismatic\" axis=\"0 0 1\" "
        "pos=\"0.008 0.008 0.0078\"/><body name=\"second\" type=\"sphere\" radius=\"0.008\" "
        "density=\"1000\"/></link></robot><sensor>",
        text));
    LayerProbe probe(model);
    Readout readout(model);
    Batch batch(model, 1, 0);
    Random random(7);
    Numbers field(std::size_t(3 * model.sensors()[0].points));
    for (int trial = 0; trial < 5; ++trial) {
      Numbers q = gel_place(model, random), v = gel_rates(model, random);
      q[7] = 0;
      batch.set_state(0, q, v);
      readout.tactile(batch, 0, 0, field);
      probe.place(q, v);
      const std::array<double, 6> wrench = probe.wrench();
      double sum[3] = {}, size = 0;
      for (std::size_t k = 0; k < field.size(); ++k)
        sum[k % 3] += field[k], size += std::abs(field[k]);
      EXPECT_GT(size, 0.1);
      EXPECT_NEAR(wrench[3], sum[0], 1e-12 * size) << skin;
      EXPECT_NEAR(wrench[4], sum[1], 1e-12 * size) << skin;
      EXPECT_NEAR(wrench[5], -sum[2], 1e-12 * size) << skin;
    }
  }
}

/// The columns of A against the dual numbers of g.
TEST(LayerFeedback, JacobianMatchesDualNumbers) {
  for (const char* body : kBodies)
    for (const char* skin : {kSmooth, kViscous, kSprings}) {
      const Model model = gel_model(gel_table(body, skin));
      LayerProbe probe(model);
      const CompiledModel& m = probe.compiled_model();
      DualStage dual(m);
      Random random(3);
      const Batch batch(model, 1, 0);
      const auto nv = std::size_t(m.nv);
      for (int trial = 0; trial < 3; ++trial) {
        const Numbers q = gel_place(model, random), v = gel_rates(model, random);
        probe.place(q, v);
        SingleWorkspace& w = probe.work();
        const double h = 1e-3;
        w.stage.c0_over_h[0] = dual.c0_over_h = 1 / h;
        w.stage.inverse_h[0] = dual.inverse_h = 1 / h;
        dual.set_numbers(batch.block(0));
        for (std::size_t i = 0; i < q.size(); ++i) dual.centre[i] = DualNumber(q[i]);
        for (std::size_t i = 0; i < nv; ++i) {
          w.stage.r[i][0] = 0;
          w.stage.x[i][0] = h * v[i];
          dual.x[i] = DualNumber(h * v[i]);
          dual.r[i] = dual.s[i] = DualNumber(0.0);
        }
        dual.choose_faces();
        dual.recall();
        probe.evaluate(true);
        double scale = 0;
        for (int e = 0; e < m.pattern.entries; ++e)
          scale = std::max(scale, std::abs(w.stage.A[e][0]));
        for (std::size_t j = 0; j < nv; ++j) {
          dual.x[j].epsilon = 1;
          dual.residual();
          dual.x[j].epsilon = 0;
          for (std::size_t i = 0; i < nv; ++i) {
            const int at = m.pattern.slot[i * nv + j];
            const double entry = at < 0 ? 0 : w.stage.A[at][0];
            EXPECT_NEAR(dual.g[i].epsilon, entry, 1e-9 * scale) << body << skin << i << ',' << j;
            EXPECT_NEAR(dual.g[i].value, w.stage.g[i][0], 1e-11 * (1 + std::abs(w.stage.g[i][0])));
          }
        }
      }
    }
}

/// The columns of A against differences of g.
TEST(LayerFeedback, JacobianMatchesDifferences) {
  for (const char* body : kBodies)
    for (const char* skin : {kSmooth, kViscous, kSprings}) {
      const Model model = gel_model(gel_table(body, skin));
      LayerProbe probe(model);
      const CompiledModel& m = probe.compiled_model();
      Random random(3);
      const auto nv = std::size_t(m.nv);
      int compared = 0;
      for (int trial = 0; trial < 3; ++trial) {
        const Numbers q = gel_place(model, random), v = gel_rates(model, random);
        probe.place(q, v);
        SingleWorkspace& w = probe.work();
        const double h = 1e-3;
        w.stage.c0_over_h[0] = w.stage.inverse_h[0] = 1 / h;
        for (std::size_t i = 0; i < nv; ++i) w.stage.r[i][0] = 0, w.stage.x[i][0] = h * v[i];
        probe.evaluate(true);
        Numbers A(nv * nv), here(nv);
        double scale = 0;
        for (std::size_t i = 0; i < nv; ++i) {
          here[i] = w.stage.g[i][0];
          for (std::size_t j = 0; j < nv; ++j)
            if (const int at = m.pattern.slot[i * nv + j]; at >= 0) {
              A[i * nv + j] = w.stage.A[at][0];
              scale = std::max(scale, std::abs(A[i * nv + j]));
            }
        }
        for (std::size_t j = 0; j < nv; ++j) {
          const double x = w.stage.x[j][0], e = 1e-9;
          const auto at = [&](double step) {
            w.stage.x[j][0] = x + step;
            probe.evaluate(false);
            w.stage.x[j][0] = x;
            Numbers g;
            for (std::size_t i = 0; i < nv; ++i) g.push_back(w.stage.g[i][0]);
            return g;
          };
          const Numbers up = at(e), down = at(-e);
          for (std::size_t i = 0; i < nv; ++i) {
            const double right = (up[i] - here[i]) / e, left = (here[i] - down[i]) / e;
            if (std::abs(right - left) > 1e-5 * scale) continue;  // a kink
            EXPECT_NEAR((up[i] - down[i]) / (2 * e), A[i * nv + j], 1e-5 * scale)
                << body << skin << i << ',' << j;
            ++compared;
          }
        }
      }
      EXPECT_GT(compared, 60) << body << skin;
    }
}

/// A ball that is let fall on the gel slides, then rolls. Prints the passes of Newton's method.
TEST(LayerFeedback, NewtonNeedsFewPasses) {
  for (const char* skin : {kSmooth, kViscous, kSprings}) {
    const Model model = gel_model(gel_table(kBodies[0], skin));
    Batch batch(model, 1, 0);
    Stepper stepper(model);
    int passes = 0, most = 0, split = 0;
    const int steps = 150;
    for (int step = 0; step < steps; ++step) {
      stepper.step(batch, {});
      ASSERT_FALSE(failed(batch.status(0))) << skin << step;
      passes += batch.iterations(0);
      most = std::max(most, batch.iterations(0));
      split += batch.status(0) == StepStatus::split;
    }
    std::cout << skin << ": " << double(passes) / steps << " passes a step, at most " << most
              << ", " << split << " steps split\n";
    EXPECT_LT(double(passes) / steps, 8) << skin;
  }
}

/// Energy only falls: gel, friction and the scheme take it.
TEST(LayerFeedback, ABallThatFallsOnTheGelLosesEnergy) {
  const Model model = gel_model(gel_table());
  Batch batch(model, 1, 0);
  Stepper stepper(model);
  Readout readout(model);
  Numbers pose(7 * 2), twist(6 * 2);
  double before = HUGE_VAL;
  LayerProbe probe(model);
  const double mass = 4 * M_PI / 3 * 8e-6 * 3000;
  for (int step = 0; step < 200; ++step) {
    stepper.step(batch, {});
    ASSERT_FALSE(failed(batch.status(0)));
    readout.bodies(batch, 0, pose, twist);
    double moving = 0;
    for (int k = 0; k < 3; ++k)
      moving +=
          0.5 * mass * (twist[9 + k] * twist[9 + k] + 0.4 * 4e-4 * twist[6 + k] * twist[6 + k]);
    probe.place(testing::q_of(batch), testing::v_of(batch));
    const double energy = moving + mass * 10 * pose[7 + 2] + probe.energy();
    EXPECT_LT(energy, before + 2e-6) << step;
    before = energy;
  }
}

/// Environments have the same bits alone and in company.
TEST(LayerFeedback, TheBitsAreTheSameAloneAndInABatch) {
  const Model model = gel_model(gel_table());
  const int count = 11;
  Batch all(model, count, 0);
  Stepper stepper(model);
  Random random(9);
  std::vector<Batch> alone;
  for (int e = 0; e < count; ++e) {
    const Numbers q = gel_place(model, random), v = gel_rates(model, random);
    all.set_state(e, q, v);
    alone.emplace_back(model, 1, 0).set_state(0, q, v);
  }
  for (int step = 0; step < 20; ++step) {
    stepper.step(all, {});
    for (int e = 0; e < count; ++e) {
      stepper.step(alone[std::size_t(e)], {});
      EXPECT_EQ(testing::q_of(all, e), testing::q_of(alone[std::size_t(e)])) << step << ' ' << e;
    }
  }
}

/// A step whose layer has no pressures fails and says so, and a reading has no numbers.
TEST(LayerFeedback, AnUnsolvedLayerHasAStatus) {
  const Model model = gel_model(gel_table());
  Batch batch(model, 1, 0);
  Stepper stepper(model);
  for (int step = 0; step < 30; ++step) stepper.step(batch, {});
  ASSERT_FALSE(failed(batch.status(0)));
  const Numbers q = testing::q_of(batch);
  const auto& layer = compiled(model).sensors[0].layer;
  ASSERT_EQ(layer.get(), compiled(model).layer_pads[0].layer.get());
  auto& limits = const_cast<CompiledLayer&>(*layer);
  limits.most_systems = 0, limits.most_sweeps = 2;
  stepper.step(batch, {});
  EXPECT_EQ(batch.status(0), StepStatus::unsolved_layer) << to_string(batch.status(0));
  EXPECT_EQ(testing::q_of(batch), q);
  Numbers field(std::size_t(3 * model.sensors()[0].points));
  Readout(model).tactile(batch, 0, 0, field);
  EXPECT_TRUE(std::isnan(field[0]));
}

/// Where all points stick and have moved alike, the energy of friction is half its force times the
/// way.
TEST(LayerFeedback, TheEnergyOfFrictionIsItsWork) {
  const Model model = gel_model(gel_table(R"(type="cuboid" size="0.03 0.03 0.039")", R"(mu="50")"));
  LayerProbe probe(model);
  const CompiledModel& m = probe.compiled_model();
  SingleWorkspace& w = probe.work();
  const double way = 2e-5;
  ShearState& memory = w.shear.now[0];
  for (const kernels::ShearSpringContact& of : m.shear_springs)
    if (of.sensor < 0)
      for (int k = 0; k < of.contact.n_points; ++k) {
        ShearEntry entry{};
        entry.point = of.first + k;
        entry.s[0] = way;
        memory.push_back(entry);
      }
  const ShearState kept = memory;
  Numbers q = testing::q_of(Batch(model, 1));
  q[2] -= 3e-4;
  probe.place(q, Numbers(std::size_t(model.nv())));
  const double side = std::abs(probe.wrench()[3]);
  EXPECT_GT(side, 0.1);
  probe.find_poses();
  const double energy = energy_of_friction(m, w, w.poses_before, kept, 0);
  EXPECT_NEAR(energy, 0.5 * side * way, 1e-9 * energy);
  double springs = 0;
  for (const ShearEntry& entry : kept) springs += 0.5 * entry.s[0] * entry.s[0];
  springs *= m.pairs[0].parameters.ks.value;
  EXPECT_GT(std::abs(energy / springs - 1), 0.02) << "as if the layer were a bed of springs";
}

/// A block that rests on a gel sleeps, keeps its place and its field, and wakes.
TEST(LayerFeedback, ABodyOnAGelSleeps) {
  const Model model =
      gel_model(testing::with("v=\"0.05 -0.02 0 0 0 3\"", "v=\"0 0 0 0 0 0\"",
                              gel_table(R"(type="cuboid" size="0.016 0.016 0.039")", kViscous)));
  StepperOptions options;
  options.sleep = kUsualSleep;
  Batch batch(model, 1, 0), awake(model, 1, 0);
  Stepper with(model, options), without(model);
  for (int step = 0; step < 800; ++step) with.step(batch, {}), without.step(awake, {});
  ASSERT_EQ(batch.sleep(0).bodies, 1);
  const Numbers slept = testing::q_of(batch);
  Readout readout(model);
  Numbers field(std::size_t(3 * model.sensors()[0].points)), other(field);
  readout.tactile(batch, 0, 0, field);
  readout.tactile(awake, 0, 0, other);
  double pressed = 0, off = 0;
  for (std::size_t k = 2; k < field.size(); k += 3)
    pressed += std::abs(field[k]), off += std::abs(field[k] - other[k]);
  EXPECT_GT(pressed, 0.2);
  EXPECT_LT(off, 1e-3 * pressed);
  for (int step = 0; step < 50; ++step) with.step(batch, {});
  EXPECT_EQ(testing::q_of(batch), slept);
  Numbers v(std::size_t(model.nv()));
  v[0] = 0.1;
  batch.set_state(0, slept, v);
  with.step(batch, {});
  EXPECT_EQ(batch.sleep(0).bodies, 0);
  EXPECT_NE(testing::q_of(batch), slept);
}

/// A scene that is made in C++ needs the contacts that the reader adds.
TEST(LayerFeedback, WithoutContactsIsRefused) {
  Scene scene = parse_scene(gel_table(), "gel.xml").scene;
  const auto contacts = scene.pair_contacts;
  scene.pair_contacts.clear();
  try {
    const Model model(scene);
    ADD_FAILURE() << "expected a refusal";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("feedback, but no contact with 'ball'"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("add_sensor_contacts()"));
  }
  add_sensor_contacts(scene, scene.sensors[0]);
  ASSERT_EQ(scene.pair_contacts.size(), contacts.size());
  EXPECT_EQ(scene.pair_contacts[0].points, contacts[0].points);
  const Model model(scene);
  EXPECT_EQ(compiled(model).pairs[0].layer_pad, 0);
}

}  // namespace
}  // namespace tangere
