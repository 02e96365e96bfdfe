// SPDX-License-Identifier: Apache-2.0
// Tests that a reference says how far it is off where all schemes share its error, against a motion
// in closed form.
#include "tasks/accuracy/measured_order.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/accuracy/accuracy_sweep.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Richardson, FindsOrderAndErrorOfAPowerOfTheStep) {
  for (const double q : {1.0, 2.0, 3.5}) {
    const double c = 0.01;  // C h^q
    const RichardsonEstimate found = richardson(c * (std::exp2(q) - 1), c * (std::exp2(2 * q) - 1));
    EXPECT_NEAR(found.order, q, 1e-12);
    EXPECT_NEAR(found.error, c, 1e-14);
  }
}

TEST(Richardson, AssumesAtMostHalfAnOrderWhereStepsBringNothing) {
  for (const double further : {0.5, 1.0, 1.9}) {
    EXPECT_DOUBLE_EQ(richardson(1, further).order, RichardsonEstimate::kLeastOrder);
    EXPECT_NEAR(richardson(1, further).error, 1 / (std::sqrt(2) - 1), 1e-12);
  }
  EXPECT_EQ(richardson(0, 0).error, 0);
  EXPECT_EQ(richardson(HUGE_VAL, 1).error, HUGE_VAL);
  EXPECT_TRUE(std::isfinite(richardson(1, HUGE_VAL).error));
}

constexpr double kMass = 2, kP = 200, kD = 4, kTarget = 0.1;

/// A block of 2 kg on a rail, at rest, that a position motor pulls 0.1 m away.
Scene pulled(const char* timing) {
  return parse_scene(std::string(R"(<tangere model="pulled">
  <option unit="m-kg" gravity="0 0 0" timestep="5e-3" integrator="SDIRK2"/>
  <robot>
    <link name="block">
      <joint name="rail" type="prismatic" axis="1 0 0" pos="0 0 0"/>
      <body name="block" type="cuboid" size="0.1 0.1 0.2" density="1000"/>
    </link>
  </robot>
  <actuator>
    <motor joint="rail" ctrl="position" P="200" D="4" timing=")") +
                         timing + R"("/>
  </actuator>
</tangere>)",
                     "pulled.xml")
      .scene;
}

FixedEpisodes pulled_episodes(const Model& model) {
  FixedEpisodes episodes{Batch(model, 1), model.timestep(), 5, 20, {20}};
  episodes.controls.assign(100, kTarget);
  return episodes;
}

/// Root mean square of the distances to the motion in closed form, over the range of the motion.
double true_error(const Model& model, const AccuracySetting& setting) {
  const FixedEpisodes episodes = pulled_episodes(model);
  Stepper stepper(model, {.integrator = setting.integrator,
                          .timestep = episodes.interval() / setting.parts,
                          .tolerance = setting.tolerance});
  Batch batch = episodes.start;
  const double decay = kD / (2 * kMass), rate = std::sqrt(kP / kMass - decay * decay);
  double squares = 0, low = HUGE_VAL, high = -HUGE_VAL;
  for (int sample = 1; sample <= episodes.samples; ++sample) {
    for (int part = 0; part < setting.parts; ++part) stepper.step(batch, std::vector{kTarget});
    const double t = sample * episodes.interval();
    const double q = kTarget * (1 - std::exp(-decay * t) *
                                        (std::cos(rate * t) + decay / rate * std::sin(rate * t)));
    std::vector<double> found(1);
    batch.get_q(0, found);
    squares += (found[0] - q) * (found[0] - q);
    low = std::min(low, found[0]), high = std::max(high, found[0]);
  }
  return std::sqrt(squares / episodes.samples) / (high - low);
}

AccuracyReport measured(const Model& model, double target) {
  const FixedEpisodes episodes = pulled_episodes(model);
  AccuracyOptions options;
  options.quantity = AccuracyQuantity::state;
  options.target = target;
  return accuracy_sweep(episodes, options, {});
}

TEST(MeasuredOrder, AReferenceSeesTheErrorThatAllSchemesShare) {
  const Model model(pulled("start"));
  const AccuracyReport report = measured(model, 1e-3);
  const AccuracyReference& r = report.reference;
  const double error = true_error(model, r.setting);
  EXPECT_NEAR(r.order, 1, 0.1);
  EXPECT_TRUE(r.shares_errors());
  EXPECT_GT(r.error, 0.8 * error) << r.error;
  EXPECT_LT(r.error, 1.3 * error) << r.error;
  EXPECT_LT(r.scheme_distance, 0.01 * error) << "two schemes at one step agree on what is wrong";
  ASSERT_EQ(report.orders.size(), 4U);
  for (const SchemeOrder& o : report.orders)
    EXPECT_NEAR(o.order, 1, 0.25) << to_string(o.integrator);
  // What is advised keeps the target with the reference's own error in it.
  ASSERT_GE(report.advice, 0);
  const AccuracyPoint& advised = report.points[std::size_t(report.advice)];
  EXPECT_LE(true_error(model, advised.setting), 1.05e-3);
  EXPECT_THAT(first_order_laws(model.scene()),
              ElementsAre("timing=\"start\" of the motor of 'rail'"));
}

TEST(MeasuredOrder, NoAdviceWhereTheReferenceItselfIsOff) {
  const Model model(pulled("start"));
  const AccuracyReport report = measured(model, 1e-5);
  EXPECT_FALSE(report.resolved);
  EXPECT_EQ(report.advice, -1);
  EXPECT_GT(report.reference.error, 1e-5 / 3);
}

TEST(MeasuredOrder, MotorsAtTheEndOfAStepHaveTheOrderOfTheScheme) {
  const Model model(pulled("end"));
  const AccuracyReport report = measured(model, 1e-3);
  EXPECT_TRUE(report.resolved);
  EXPECT_FALSE(report.reference.shares_errors()) << report.reference.order;
  EXPECT_LT(true_error(model, report.reference.setting), 2 * report.reference.error);
  for (const SchemeOrder& o : report.orders)
    EXPECT_NEAR(o.order, o.integrator.scheme().order, 0.3) << to_string(o.integrator);
  EXPECT_THAT(first_order_laws(model.scene()), IsEmpty());
}

/// A ball on a ground with ks. It turns about its axis of rolling [rad/s] and about another one.
Scene rolling(double along, double across) {
  return parse_scene(R"(<tangere model="rolling">
  <option unit="m-kg" gravity="0 0 -9.8" timestep="2e-3" integrator="SDIRK2"/>
  <ground pos="0 0 0" normal="0 0 1"/>
  <default><ground_contact kn="2e3" kt="2" mu="0.3" damping="20" ks="500"/></default>
  <robot>
    <link name="ball">
      <joint name="free" type="free3d" pos="0 0 0.0197537"/>
      <body name="ball" type="sphere" radius="0.02" density="1500"/>
    </link>
  </robot>
  <contact><ground_contact body="ball"/></contact>
  <initial><joint name="free" v="0 0 0 )" +
                         std::to_string(along) + " " + std::to_string(across) + R"( 0"/></initial>
</tangere>)",
                     "rolling.xml")
      .scene;
}

/// A ball that slips until it rolls: SDIRK2 and SDIRK4 at one step agree much better than SDIRK4 at
/// two steps. One that sticks has no such error.
TEST(MeasuredOrder, SpringsOfSlippingPointsShareTheirErrorWithEveryScheme) {
  const auto reference = [](const Model& model) {
    FixedEpisodes episodes{Batch(model, 1), model.timestep(), 12, 12, {12}};
    AccuracyOptions options;
    options.quantity = AccuracyQuantity::state;
    return own_accuracy(episodes, options, {}).reference;
  };
  const AccuracyReference slips = reference(Model(rolling(0.2, 5)));
  EXPECT_TRUE(slips.shares_errors());
  EXPECT_GT(slips.step_distance, 50 * slips.scheme_distance);
  EXPECT_GE(slips.error, 0.3 * slips.step_distance);
  const AccuracyReference sticks = reference(Model(rolling(0.02, 0)));
  EXPECT_FALSE(sticks.shares_errors()) << sticks.step_distance << " " << sticks.scheme_distance;
}

TEST(MeasuredOrder, LawsAreNamed) {
  const Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/box_pushing_elastic.xml").scene;
  EXPECT_THAT(first_order_laws(scene),
              ::testing::IsSupersetOf({HasSubstr("ks of the contact of 'pad' with 'box'"),
                                       HasSubstr("ks of the contact of 'box' with the ground"),
                                       HasSubstr("ks of sensor 'pad'")}));
  EXPECT_THAT(first_order_laws(read_scene(TANGERE_SOURCE_DIR "/scenes/box_pushing.xml").scene),
              IsEmpty());
}

}  // namespace
}  // namespace tangere
