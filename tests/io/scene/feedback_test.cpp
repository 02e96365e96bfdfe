// SPDX-License-Identifier: Apache-2.0
// Tests feedback="true" of a sensor: the sum of its field is the force in the dynamics, and what
// cannot act is refused with a line.
#include <gmock/gmock.h>

#include <array>
#include <cmath>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::with;

/// A ball of 0.1005 kg that slides onto a skin of 21 × 21 points on a table, 24 mm wide.
const std::string kTable = R"(<tangere model="table">
<option unit="m-kg" gravity="0. 0. -10" timestep="1e-3" integrator="BDF1"/>
<solver_option tol="1e-12"/>
<robot>
<link name="table">
<joint name="table" type="fixed" pos="0 0 0" quat="1 0 0 0"/>
<body name="table" type="cuboid" size="0.04 0.04 0.02" pos="0 0 -0.01" quat="1 0 0 0" )"
                           R"(density="1000"/>
</link>
</robot>
<robot>
<link name="ball">
<joint name="ball" type="free3d-exp" pos="0 0 0.0199" quat="1 0 0 0"/>
<body name="ball" type="sphere" radius="0.02" density="3000" pos="0 0 0" quat="1 0 0 0"/>
</link>
</robot>
<sensor>
<tactile name="skin" body="table" type="rect_array" rect_pos0="-0.012 -0.012 0.01"
 rect_pos1="0.012 0.012 0.01" axis0="1 0 0" axis1="0 1 0" resolution="21 21" kn="400" kt="0.2"
 mu="0.7" damping="20" feedback="true"/>
</sensor>
<initial><joint name="ball" v="0.05 -0.02 0 0 0 3"/></initial>
</tangere>
)";

Scene feedback_scene(const std::string& text) { return parse_scene(text, "s.xml").scene; }

std::string feedback_refusal(const std::string& text) {
  try {
    feedback_scene(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// Force of the field on the sensor's body in world axes [N]; the pad's axes are those of the
/// world.
std::array<double, 3> sum_of(Readout& readout, const Batch& batch, std::vector<double>& field) {
  readout.tactile(batch, 0, 0, field);
  std::array<double, 3> sum{};
  for (std::size_t k = 0; k < field.size(); ++k) sum[k % 3] += (k % 3 == 2 ? -1 : 1) * field[k];
  return sum;
}

/// Checks in each of 100 steps that the ball's momentum changes by gravity and the field alone.
void expect_balance(const std::string& text) {
  const Model model(feedback_scene(text));
  Batch batch(model, 1, 0);
  Stepper stepper(model);
  Readout readout(model);
  std::vector<double> field(3 * model.sensors()[0].points), pose(7 * 2), twist(6 * 2);
  const double m = 4 * M_PI / 3 * 8e-6 * 3000, h = 1e-3;
  std::array<double, 3> before = {0.05, -0.02, 0};
  double largest = 0, shear = 0;
  for (int step = 0; step < 100; ++step) {
    stepper.step(batch, {});
    ASSERT_EQ(int(batch.status(0)), 0);
    const std::array<double, 3> on_pad = sum_of(readout, batch, field);
    readout.bodies(batch, 0, pose, twist);
    const double gravity[3] = {0, 0, -10};
    for (std::size_t k = 0; k < 3; ++k) {
      const double now = twist[6 + 3 + k];
      EXPECT_NEAR(m * ((now - before[k]) / h - gravity[k]), -on_pad[k], 1e-8) << step << ' ' << k;
      before[k] = now;
    }
    largest = std::max(largest, -on_pad[2]);
    shear = std::max(shear, std::hypot(on_pad[0], on_pad[1]));
  }
  EXPECT_GT(largest, 1);
  EXPECT_GT(shear, 0.01);
}

TEST(Feedback, TheFieldIsTheForceInTheDynamics) { expect_balance(kTable); }

TEST(Feedback, WithoutItTheBallFallsThrough) {
  const Model model(feedback_scene(with(" feedback=\"true\"", "", kTable)));
  EXPECT_TRUE(model.contacts().empty());
}

TEST(Feedback, TouchesEveryBodyThatMovesAgainstTheSensor) {
  const Scene scene = feedback_scene(kTable);
  ASSERT_EQ(scene.pair_contacts.size(), 1U);
  EXPECT_EQ(scene.pair_contacts[0].primitive_body, "ball");
  const Model model(scene);
  EXPECT_EQ(model.contacts()[0].first, "tactile skin");
  EXPECT_EQ(model.contacts()[0].points, 441);
}

TEST(Sensors, ThatRememberReadingsSayHowOftenTheyAreRead) {
  const std::string waits = with("feedback=\"true\"", "ks=\"90\" memory=\"read\"", kTable);
  EXPECT_THAT(feedback_refusal(waits),
              AllOf(HasSubstr("s.xml:17:"), HasSubstr("memory=\"read\" without every")));
  const Scene scene = feedback_scene(with("memory=\"read\"", "memory=\"read\" every=\"5\"", waits));
  EXPECT_TRUE(scene.sensors[0].remembers_readings);
  EXPECT_THAT(feedback_refusal(with("memory=\"read\"", "memory=\"reed\"", waits)),
              HasSubstr("did you mean 'read'"));
}

TEST(Feedback, RefusesAndWarns) {
  EXPECT_THAT(
      feedback_refusal(with(
          "type=\"free3d-exp\"", "type=\"fixed\"",
          with("<initial><joint name=\"ball\" v=\"0.05 -0.02 0 0 0 3\"/></initial>", "", kTable))),
      AllOf(HasSubstr("s.xml:17:"), HasSubstr("feedback of 'skin' would touch nothing")));
  EXPECT_THAT(
      feedback_refusal(with("</tangere>",
                            "<randomize><tactile name=\"skin\" field=\"kn\" uniform=\"1 2\"/>"
                            "</randomize></tangere>",
                            kTable)),
      HasSubstr("the sensor has feedback, so its coefficients act on the motion as well"));
  EXPECT_THAT(feedback_refusal(with("damping=\"20\"", "damping=\"20\" ks=\"1\"", kTable)),
              AllOf(HasSubstr("s.xml:17:"), HasSubstr("feedback and ks")));
  const std::string both =
      with("<sensor>",
           "<contact><general_primitive_contact general_body=\"table\" primitive_body=\"ball\" "
           "kn=\"1\" kt=\"0\" mu=\"0\" damping=\"0\"/></contact><sensor>",
           kTable);
  EXPECT_THAT(parse_scene(both, "s.xml").warnings,
              Contains(AllOf(HasSubstr("s.xml:16:"), HasSubstr("'table' and 'ball' touch"))));
}

}  // namespace
}  // namespace tangere
