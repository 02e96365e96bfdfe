// SPDX-License-Identifier: Apache-2.0
// Tests that a fit recovers a scene's numbers from its noisy recording, to the accuracy that it
// reports. Numbers that cannot be fitted are refused.
#include "tasks/gradients/identification.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/base/error.hpp"
#include "engine/model/random.hpp"
#include "engine/step/control.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

const std::vector<std::string> kSought = {"tactile pad kn", "tactile pad kt", "tactile pad mu",
                                          "body ball density"};

/// The shipped scene with a pad of 20 × 20 points, and its recording.
class RecordedBall {
 public:
  RecordedBall()
      : scene(read_scene(TANGERE_SOURCE_DIR "/scenes/identify_ball.xml").scene),
        program_(coarse(scene), scene.timestep, 0) {
    run = {[this](std::int64_t t, int e, std::span<double> u) { program_.evaluate(t, e, u); },
           program_.steps(), 5};
    clean = simulate_fields(scene, run);
    truth = numbers_of(scene, kSought);
    for (const auto& reading : clean.readings)
      for (double f : reading) peak = std::max(peak, std::abs(f));
  }

  Scene scene;
  RecordedRun run;
  FieldSequence clean;
  std::vector<double> truth;
  double peak = 0;

 private:
  static Model coarse(Scene& s) {
    s.sensors[0].array.rows = s.sensors[0].array.cols = 20;
    return Model(s);
  }
  ControlProgram program_;
};

Identification fit(const RecordedBall& r, const FieldSequence& recorded,
                   const std::vector<double>& factors, int starts = 6, double noise = 0) {
  std::vector<double> start = r.truth;
  for (std::size_t k = 0; k < start.size(); ++k) start[k] *= factors[k];
  IdentificationOptions options;
  options.numbers = kSought;
  options.starts = starts;
  options.noise = noise;
  return identify(with_numbers(r.scene, kSought, start), r.run, recorded, options);
}

TEST(Identification, FindsSkinAndMassWithinOnePercent) {
  const RecordedBall r;
  const std::vector<std::vector<double>> factors = {
      {0.5, 2, 0.5, 2}, {2, 0.5, 2, 0.5}, {0.7, 0.6, 1.8, 1.5}};
  for (std::size_t seed = 0; seed < factors.size(); ++seed) {
    FieldSequence recorded = r.clean;
    add_noise(recorded, 0.01 * r.peak, seed);
    const Identification found = fit(r, recorded, factors[seed]);
    EXPECT_TRUE(found.passed()) << found.residual.score;
    EXPECT_EQ(found.fits.size(), 1U) << "more starts where the first is sure";
    EXPECT_NEAR(found.noise, 0.01 * r.peak, 2e-4 * r.peak);
    EXPECT_LT(found.condition, 1000);
    for (std::size_t k = 0; k < r.truth.size(); ++k) {
      const double error = found.values()[k] / r.truth[k] - 1;
      EXPECT_LT(std::abs(error), 0.01) << kSought[k] << ", seed " << seed;
      EXPECT_LT(std::abs(error), 4.5 * found.deviation[k]) << kSought[k] << ", seed " << seed;
    }
  }
}

/// Without noise only the tolerance of the steps limits the result.
TEST(Identification, IsExactWithoutNoise) {
  const RecordedBall r;
  const Identification found = fit(r, r.clean, {1.5, 0.8, 0.8, 1.3});
  EXPECT_TRUE(found.converged);
  for (std::size_t k = 0; k < r.truth.size(); ++k)
    EXPECT_NEAR(found.values()[k] / r.truth[k], 1, 1e-6) << kSought[k];
  // Differences are inexact across points that begin to touch or to slip.
  EXPECT_LT(found.gradient_difference, 1e-4);
}

/// From here a fit ends in a minimum with eight times the density.
const std::vector<double> kAstray = {0.125, 0.125, 0.125, 8};

TEST(Identification, AFalseMinimumIsNoticedAndOtherStartsAreTried) {
  const RecordedBall r;
  FieldSequence recorded = r.clean;
  add_noise(recorded, 0.01 * r.peak, 1);
  const Identification several = fit(r, recorded, kAstray);
  const FitEnds& first = several.fits.front();
  EXPECT_TRUE(first.converged);
  EXPECT_GT(first.end[3] / r.truth[3], 4);
  EXPECT_TRUE(several.passed());
  EXPECT_GT(several.fits.size(), 1U);
  EXPECT_LT(several.fits.back().misfit, 0.5 * first.misfit);
  for (std::size_t k = 0; k < r.truth.size(); ++k)
    EXPECT_LT(std::abs(several.values()[k] / r.truth[k] - 1), 4.5 * several.deviation[k]);
}

/// With 5 % noise no single residual shows the other damping, which moves the density by 4.7 %.
TEST(Identification, AWrongModelIsToldByItsResidual) {
  const RecordedBall r;
  const std::string wrong = "joint pad_joint damping";
  const std::vector<double> damping = {1.1 * numbers_of(r.scene, {{wrong}})[0]};
  FieldSequence recorded = simulate_fields(with_numbers(r.scene, {{wrong}}, damping), r.run);
  add_noise(recorded, 0.05 * r.peak, 1);
  const Identification found = fit(r, recorded, {1, 1, 1, 1}, 2);
  EXPECT_TRUE(found.converged);
  EXPECT_FALSE(found.residual.is_noise());
  EXPECT_FALSE(found.passed());
  EXPECT_EQ(found.residual.suspect, wrong);
  EXPECT_NEAR(found.residual.suspect_change, std::log(1.1), 0.03);
  EXPECT_GT(std::abs(found.values()[3] / r.truth[3] - 1), 0.03) << "the recording shows no bias";
  for (std::size_t k = 0; k < r.truth.size(); ++k)
    EXPECT_LT(std::abs(std::log(found.values()[k] / r.truth[k])), 3 * found.deviation[k])
        << kSought[k];
}

TEST(Identification, StatedNoiseThatIsTooSmallIsNoticed) {
  const RecordedBall r;
  FieldSequence recorded = r.clean;
  add_noise(recorded, 0.01 * r.peak, 1);
  const Identification found = fit(r, recorded, {1, 1, 1, 1}, 1, 0.005 * r.peak);
  EXPECT_NEAR(found.residual.chi_square, 4, 0.1);
  EXPECT_FALSE(found.passed());
}

/// A force D v of the motor and one of the joint's damper are the same.
TEST(Identification, NumbersThatNoFieldTellsApartAreNamed) {
  const Scene scene = parse_scene(R"(<tangere model="pressed">
  <option unit="m-kg" gravity="0 0 0" timestep="5e-3" integrator="SDIRK2"/>
  <robot>
    <link name="pad">
      <joint name="rail" type="prismatic" axis="0 0 1" pos="0 0 0.044" damping="0.5"/>
      <body name="pad" type="cuboid" size="0.05 0.05 0.01" density="1000"/>
    </link>
  </robot>
  <robot>
    <link name="ball">
      <joint name="ball" type="fixed" pos="0 0 0.02"/>
      <body name="ball" type="sphere" radius="0.02" density="1000"/>
    </link>
  </robot>
  <actuator><motor joint="rail" ctrl="position" P="50" D="0.7"/></actuator>
  <sensor>
    <tactile name="pad" body="pad" type="rect_array" rect_pos0="-0.025 0.025 -0.005"
             rect_pos1="0.025 -0.025 -0.005" axis0="0 -1 0" axis1="1 0 0" resolution="10 10"
             kn="10" kt="0" mu="0" damping="0"/>
  </sensor>
  <initial><joint name="rail" v="0.1"/></initial>
</tangere>)",
                                  "pressed.xml")
                          .scene;
  const RecordedRun run{[](std::int64_t, int, std::span<double> u) { u[0] = -0.001; }, 60, 2};
  FieldSequence recorded = simulate_fields(scene, run);
  add_noise(recorded, 1e-5, 1);
  IdentificationOptions options;
  options.starts = 2;
  options.numbers = {"joint rail damping", "tactile pad kn", "motor rail D"};
  const Identification found = identify(scene, run, recorded, options);
  EXPECT_THAT(found.inseparable, ::testing::ElementsAre(0, 2));
  EXPECT_NEAR(found.correlation[2], -1, 1e-6);
  EXPECT_GT(found.condition, 1e8);
  EXPECT_LT(found.deviation[1], 0.01);
  EXPECT_FALSE(found.passed());
  options.numbers = {"joint rail damping", "tactile pad kn"};
  EXPECT_TRUE(identify(scene, run, recorded, options).passed());
}

TEST(Identification, MisfitIsHalfTheSquaresOfAllPoints) {
  const RecordedBall r;
  FieldSequence recorded = r.clean;
  add_noise(recorded, 0.1 * r.peak, 3);
  const Scene other = with_numbers(r.scene, kSought, std::vector<double>{5, 0.4, 0.6, 1600});
  const FieldSequence fields = simulate_fields(other, r.run);
  double expected = 0;
  for (std::size_t k = 0; k < fields.readings.size(); ++k)
    for (std::size_t i = 0; i < fields.readings[k].size(); ++i)
      expected += 0.5 * std::pow(fields.readings[k][i] - recorded.readings[k][i], 2);
  const Model model(other);
  const FieldMisfit misfit(model, recorded);
  const RolloutLoss* const losses[] = {&misfit};
  TapeOptions options;
  options.length = r.run.steps;
  const GradientSummary summary =
      rollout_gradients(Batch(model, 1), r.run.controls, options, losses);
  EXPECT_NEAR(summary.losses[0].value[0], expected, 1e-12 * expected);
}

TEST(Identification, RefusesWhatCannotBeFitted) {
  const RecordedBall r;
  const auto message = [&](const Scene& scene, const FieldSequence& recorded,
                           std::vector<std::string> numbers) {
    IdentificationOptions options;
    options.numbers = std::move(numbers);
    try {
      identify(scene, r.run, recorded, options);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message(r.scene, r.clean, {"tactile pad stiffness"}),
              HasSubstr("no number 'tactile pad stiffness'"));
  EXPECT_THAT(message(r.scene, r.clean, {"tactile pad kn", "ground ball kn"}), ::testing::IsEmpty())
      << "any number of the scene";
  // The ball never slips on the ground.
  EXPECT_THAT(message(r.scene, r.clean, {"tactile pad kn", "ground ball mu"}),
              HasSubstr("do not depend on 'ground ball mu'"));
  const Scene frictionless = with_numbers(r.scene, {{"tactile pad mu"}}, std::vector<double>{0});
  EXPECT_THAT(message(frictionless, r.clean, kSought), HasSubstr("'tactile pad mu' is 0"));
  FieldSequence short_one = r.clean;
  short_one.readings.pop_back();
  EXPECT_THAT(message(r.scene, short_one, kSought), HasSubstr("99 readings"));
  FieldSequence narrow = r.clean;
  narrow.readings[0].pop_back();
  EXPECT_THAT(message(r.scene, narrow, kSought), HasSubstr("1199 numbers; expected 1200"));
}

}  // namespace
}  // namespace tangere
