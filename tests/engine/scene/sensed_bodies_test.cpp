// SPDX-License-Identifier: Apache-2.0
// Tests which bodies a sensor feels: by lists, by joints and by contacts; and what is said of
// sensors that start inside one.
#include "engine/scene/sensed_bodies.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/model.hpp"
#include "engine/sense/readout.hpp"
#include "engine/sense/start_overlaps.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::link;

/// A finger of two phalanges that overlap by 8 mm at the knuckle, a thumb on the same palm, and an
/// egg and a table in front of it. The skin covers the distal one.
Scene hand() {
  Scene s;
  s.gravity = {0, 0, 0};
  const CuboidShape bone{{0.04, 0.02, 0.02}};
  s.links = {link("palm", JointType::prismatic, {0, 0, 0}, CuboidShape{{0.02, 0.1, 0.02}}, 1000),
             link("proximal", JointType::revolute, {0.026, 0, 0}, bone, 1000),
             link("distal", JointType::revolute, {0.032, 0, 0}, bone, 1000),
             link("nail", JointType::fixed, {0, 0, 0.011}, CuboidShape{{0.01, 0.01, 0.002}}, 1000),
             link("thumb", JointType::revolute, {0.02, 0.04, 0}, bone, 1000),
             link("egg", JointType::free, {0.15, 0, 0}, SphereShape{0.02}, 1000),
             link("table", JointType::fixed, {0, 0, -0.2}, CuboidShape{{1, 1, 0.1}}, 1000)};
  s.links[1].parent = 0, s.links[2].parent = 1, s.links[3].parent = 2, s.links[4].parent = 0;
  TactileDescription skin;
  skin.name = "skin";
  skin.body = "distal";
  skin.coefficients = {100, 0, 0, 0};
  skin.array = {{-0.02, -0.01, 0.0}, {0.02, 0.01, 0.0}, {1, 0, 0}, {0, 1, 0}, 9, 5};
  s.sensors.push_back(skin);
  return s;
}

std::vector<std::string> felt(const Scene& s) {
  std::vector<std::string> names;
  for (const int k : sensed_bodies(s, s.sensors[0]))
    names.push_back(s.links[std::size_t(k)].body.name);
  return names;
}

TEST(FeltBodies, NeighboursAreLeftOutUnlessTheyTouch) {
  Scene s = hand();
  EXPECT_THAT(felt(s), ElementsAre("palm", "thumb", "egg", "table"));
  s.pair_contacts.push_back({"proximal", "nail", {100, 0, 0, 0}, ContactLaw::clamped, {}, {}});
  EXPECT_THAT(felt(s), ElementsAre("palm", "proximal", "thumb", "egg", "table"));
  // A loop makes neighbours, too.
  LoopDescription pin;
  pin.name = "pin", pin.body1 = "thumb", pin.body2 = "nail", pin.stiffness = 1;
  s.loops.push_back(pin);
  EXPECT_THAT(felt(s), ElementsAre("palm", "proximal", "egg", "table"));
  s.loops.clear();
  // The world is nobody's neighbour: a skin on the palm feels a table that is fixed in it.
  s.sensors[0].body = "palm";
  EXPECT_THAT(felt(s), ElementsAre("distal", "nail", "egg", "table"));
  // Nor does a palm that is fixed in the world make the table one.
  s.links[0].joint.type = JointType::fixed;
  EXPECT_THAT(felt(s), ElementsAre("distal", "nail", "egg"));
  s.sensors[0].body = "thumb";
  EXPECT_THAT(felt(s), ElementsAre("proximal", "distal", "nail", "egg", "table"));
}

TEST(FeltBodies, ListsChoose) {
  Scene s = hand();
  s.sensors[0].feels = {"egg", "proximal"};
  EXPECT_THAT(felt(s), ElementsAre("proximal", "egg"));
  s.sensors[0].feels.clear();
  s.sensors[0].ignores = {"thumb", "palm"};
  EXPECT_THAT(felt(s), ElementsAre("egg", "table"));
}

TEST(FeltBodies, ListsThatCannotBeMeantAreErrors) {
  const auto message = [](const std::vector<std::string>& feels,
                          const std::vector<std::string>& ignores) {
    Scene s = hand();
    s.sensors[0].feels = feels;
    s.sensors[0].ignores = ignores;
    try {
      const Model model(s);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(message({"eg"}, {}), HasSubstr("sensor 'skin' feels 'eg', which is no body"));
  EXPECT_THAT(message({}, {"eg"}), HasSubstr("sensor 'skin' ignores 'eg', which is no body"));
  EXPECT_THAT(message({"nail"}, {}), HasSubstr("'nail', which does not move against it"));
  EXPECT_THAT(message({"egg"}, {"palm"}), HasSubstr("both feels and ignores"));
}

/// Only the reading of bodies that the sensor feels is in the field.
TEST(FeltBodies, FieldsHaveWhatIsFelt) {
  const auto reading = [](const Scene& s) {
    const Model model(s);
    const Batch batch(model, 1);
    Readout readout(model);
    std::vector<double> field(3 * std::size_t(model.sensors()[0].points));
    readout.tactile(batch, 0, 0, field);
    double sum = 0;
    for (const double x : field) sum += std::abs(x);
    return sum;
  };
  Scene s = hand();
  EXPECT_EQ(reading(s), 0) << "nothing touches";
  s.sensors[0].feels = {"proximal"};
  EXPECT_GT(reading(s), 1) << "the knuckle";
}

/// Points of the skin lie every 5 mm. Two rows of them are inside the neighbour, 8 and 3 mm from
/// its end; three of the five in a row are farther than 0 from its sides: 5, 10 and 5 mm. So depths
/// are 5 + 8 + 5 + 3 · 3 = 27 mm.
TEST(FeltBodies, SaysWhereASensorStartsInside) {
  Scene s = hand();
  s.links[0].joint.type = JointType::fixed;  // as most hands stand
  EXPECT_THAT(sensors_inside(Model(s)), IsEmpty());
  s.sensors[0].feels = {"proximal"};
  const std::vector<std::string> lines = sensors_inside(Model(s));
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_THAT(lines[0],
              HasSubstr("sensor 'skin' starts with 6 of 45 points inside 'proximal', up to "
                        "0.008 m deep, where they read 2.7 N"));
  EXPECT_THAT(lines[0], HasSubstr("ignores=\"proximal\""));
}

}  // namespace
}  // namespace tangere
