// SPDX-License-Identifier: Apache-2.0
// Tests sensors whose coefficients follow from a material (docs/skin.md), and the layout whose
// modulus follows from measured forces.
#include "engine/scene/skin_material.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "engine/sense/readout.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// A ball of radius 7.5 mm on a vertical slide above a plate with a sensor at height 0.
Scene pressed(const std::string& sensor, const std::string& defaults = "",
              const std::string& unit = "m-kg") {
  const bool metres = unit == "m-kg";
  const auto length = [&](double x) { return std::to_string(metres ? x : 100 * x); };
  return parse_scene("<tangere><option unit=\"" + unit + "\"/><default>" + defaults +
                         "</default><robot><link name=\"plate\"><joint name=\"fixed\" "
                         "type=\"fixed\"/><body name=\"plate\" "
                         "type=\"cuboid\" size=\"" +
                         length(0.1) + " " + length(0.1) + " " + length(0.01) + "\" pos=\"0 0 " +
                         length(-0.005) +
                         "\"/></link></robot><robot><link name=\"ball\"><joint name=\"slide\" "
                         "type=\"prismatic\" "
                         "axis=\"0 0 "
                         "1\" pos=\"0 0 " +
                         length(7.5e-3) + "\"/><body name=\"ball\" type=\"sphere\" radius=\"" +
                         length(7.5e-3) + "\"/></link></robot><sensor>" + sensor +
                         "</sensor></tangere>",
                     "s.xml")
      .scene;
}

const std::string kPad =
    R"(<tactile name="pad" body="plate" type="rect_array" resolution="11 11" axis0="0 -1 0"
       axis1="1 0 0" rect_pos0="-0.01 0.01 0" rect_pos1="0.01 -0.01 0" )";

TEST(SkinMaterial, SpringsFollowFromModulusAndThickness) {
  const Scene scene = pressed(kPad + R"(modulus="2e5" thickness="4e-3" mu="0.7"/>)");
  const ContactCoefficients& c = scene.sensors[0].coefficients;
  const double kn = 2.3 * 2e5 / 4e-3 * 4e-6;  // points 2 mm apart
  EXPECT_NEAR(c.kn, kn, 1e-12 * kn);
  EXPECT_NEAR(c.ks, 0.4 * kn, 1e-12 * kn);
  EXPECT_NEAR(c.kt, 0.4 * kn * 5e-3, 1e-12 * kn);
  EXPECT_NEAR(c.damping, kn * 5e-3 / 4e-4, 1e-9 * kn);
  EXPECT_EQ(c.mu, 0.7);
  EXPECT_NEAR(scene.sensors[0].cell, 4e-6, 1e-18);
  ASSERT_TRUE(scene.sensors[0].material);
  EXPECT_EQ(scene.sensors[0].material->modulus, 2e5);
}

TEST(SkinMaterial, WhatTheElementGivesItselfCountsByAreaAndDefaultsDoNot) {
  const Scene scene =
      pressed(kPad + R"(modulus="2e5" thickness="4e-3" relaxation="0.01" ks="0" damping="3e9"/>)",
              R"(<tactile kn="123" kt="456" mu="0.5" ks="7"/>)");
  const ContactCoefficients& c = scene.sensors[0].coefficients;
  const double kn = 2.3 * 2e5 / 4e-3 * 4e-6;
  EXPECT_NEAR(c.kn, kn, 1e-12 * kn);
  EXPECT_NEAR(c.kt, 0.4 * kn * 0.01, 1e-12 * kn);
  EXPECT_EQ(c.ks, 0);
  EXPECT_NEAR(c.damping, 3e9 * 4e-6, 1e-9);
  EXPECT_EQ(c.mu, 0.5);
}

/// 0.2 MPa are 2e6 g/(cm s²).
TEST(SkinMaterial, CentimetresAndGramsGiveTheSame) {
  const std::string pad =
      R"(<tactile name="pad" body="plate" type="rect_array" resolution="11 11" axis0="0 -1 0"
         axis1="1 0 0" rect_pos0="-1 1 0" rect_pos1="1 -1 0" modulus="2e6" thickness="0.4"/>)";
  const ContactCoefficients
      a = pressed(pad, "", "cm-g").sensors[0].coefficients,
      b = pressed(kPad + R"(modulus="2e5" thickness="4e-3"/>)").sensors[0].coefficients;
  for (std::size_t k = 0; k < kCoefficients; ++k) EXPECT_NEAR(a[k], b[k], 1e-12 * b[k]) << k;
}

/// A table counts by area, as a material does. 0.1 Pa are 1 g/(cm s²).
TEST(SkinMaterial, ATableOfPressuresCountsByArea) {
  const Scene scene =
      pressed(kPad + R"(pressure_depth="0 1e-3 2e-3" pressure="0 1e4 6e4" ks="1e7" mu="0.5"/>)");
  const TactileDescription& d = scene.sensors[0];
  ASSERT_TRUE(d.table);
  EXPECT_EQ(d.table->relaxation, 5e-3);
  EXPECT_NEAR(d.coefficients.kn, 3e7 * 4e-6, 1e-12);
  EXPECT_NEAR(d.coefficients.ks, 1e7 * 4e-6, 1e-12);
  EXPECT_EQ(d.coefficients.damping, 0);
  const std::string pad =
      R"(<tactile name="pad" body="plate" type="rect_array" resolution="11 11" axis0="0 -1 0"
         axis1="1 0 0" rect_pos0="-1 1 0" rect_pos1="1 -1 0" pressure_depth="0 0.1 0.2"
         pressure="0 1e5 6e5" thickness="0.4"/>)";
  const PressureTable grams = *pressed(pad, "", "cm-g").sensors[0].table;
  EXPECT_NEAR(grams.thickness, 4e-3, 1e-15);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(grams.depth[k], d.table->depth[k], 1e-15);
    EXPECT_NEAR(grams.pressure[k], d.table->pressure[k], 1e-9);
  }
}

TEST(SkinMaterial, PointsOfCurvedPadsStandForTheirAreas) {
  const Scene dome = pressed(
      R"(<tactile name="dome" body="ball" type="hemisphere" radius="7.5e-3" count="100"
         modulus="2e5" thickness="4e-3"/>)");
  const double cell = 2 * std::numbers::pi * 7.5e-3 * 7.5e-3 / 100;
  EXPECT_NEAR(dome.sensors[0].cell, cell, 1e-15);
  EXPECT_NEAR(dome.sensors[0].coefficients.kn, 1.15e8 * cell, 1e-9);
  const Scene tube = pressed(
      R"(<tactile name="tube" body="plate" type="cylinder" radius="5e-3" length="0.02"
         resolution="4 8" per="area" kn="1e8"/>)");
  EXPECT_NEAR(tube.sensors[0].coefficients.kn, 1e8 * 2 * std::numbers::pi * 5e-3 * 0.02 / 32, 1e-9);
}

TEST(SkinMaterial, PartsThatDoNotFitAreErrors) {
  const auto fault = [](const std::string& attributes) -> std::string {
    try {
      static_cast<void>(pressed(kPad + attributes + "/>"));
      return "";
    } catch (const InputError& error) {
      return error.what();
    }
  };
  EXPECT_THAT(fault(R"(modulus="2e5")"), HasSubstr("modulus without thickness; expected both"));
  EXPECT_THAT(fault(R"(thickness="4e-3" kn="1")"), HasSubstr("thickness without modulus"));
  EXPECT_THAT(fault(R"(relaxation="1" kn="1")"), HasSubstr("relaxation without modulus"));
  EXPECT_THAT(fault(R"(modulus="0" thickness="4e-3")"), HasSubstr("modulus=\"0\""));
  EXPECT_THAT(fault(R"(modulus="2e5" thickness="4e-3" per="point")"),
              HasSubstr("count per area; expected one of them"));
  const std::string table = R"(pressure_depth="0 1e-3" pressure="0 1e4" )";
  EXPECT_EQ(fault(table), "");
  EXPECT_THAT(fault(R"(pressure="0 1e4")"), HasSubstr("alone; expected both or none"));
  EXPECT_THAT(fault(R"(pressure_depth="0 1e-3" pressure="0 1 2")"),
              HasSubstr("2 numbers of pressure_depth and 3 of pressure"));
  EXPECT_THAT(fault(table + R"(modulus="2e5" thickness="4e-3")"),
              HasSubstr("modulus and pressure; expected one of them"));
  EXPECT_THAT(fault(table + R"(per="point")"), HasSubstr("pressure and per=\"point\""));
  EXPECT_THAT(fault(table + R"(feedback="true")"), HasSubstr("feedback and pressure"));
}

TEST(SkinMaterial, ATableThatEndsLevelIsAWarning) {
  const auto warnings = [](const std::string& pressures) {
    const std::string text = std::string(R"(<tangere><option unit="m-kg"/><robot><link name="a">
      <joint name="a" type="fixed"/><body name="plate" type="cuboid" size="0.1 0.1 0.01"/></link>
      </robot><sensor>)") + kPad +
                             R"(pressure_depth="0 1e-3 2e-3" pressure=")" + pressures +
                             R"("/></sensor></tangere>)";
    std::string all;
    for (const std::string& warning : parse_scene(text, "s.xml").warnings) all += warning;
    return all;
  };
  EXPECT_THAT(warnings("0 1e4 1e4"),
              HasSubstr("<tactile>: pressure ends level: 10000 Pa from 0.001 m on, so a body that "
                        "goes deeper presses no harder"));
  EXPECT_THAT(warnings("0 1e4 1.1e4"), Not(HasSubstr("level")));
}

/// c of the formula at the sizes of its head comment, and the share of a size-independent one.
TEST(SkinMaterial, TheStiffnessRatioIsThatOfTheLayerFormula) {
  EXPECT_NEAR(stiffness_ratio(0.4), 2.42, 0.01);
  EXPECT_NEAR(stiffness_ratio(0.65), 2.18, 0.01);
  EXPECT_NEAR(stiffness_ratio(1), 2.425, 0.01);
  for (double size = 0.43; size <= 0.95; size += 0.01)
    EXPECT_NEAR(stiffness_ratio(size) / kUsualStiffnessRatio, 1, 0.052) << size;
}

/// The load of a layer follows from its material alone.
TEST(SkinMaterial, AKnBesideALayerIsAWarningUnlessItIsTheMaterials) {
  const auto warnings = [](const std::string& kn) {
    return parse_scene(
               "<tangere><option unit=\"m-kg\"/><robot><link name=\"plate\"><joint "
               "name=\"fixed\" type=\"fixed\"/><body name=\"plate\" type=\"cuboid\" "
               "size=\"0.1 0.1 0.01\" pos=\"0 0 -0.005\"/></link></robot><sensor>" +
                   kPad + "modulus=\"2e5\" thickness=\"6e-3\" " + kn +
                   "><layer/></tactile></sensor></tangere>",
               "s.xml")
        .warnings;
  };
  const auto named = ::testing::Contains(HasSubstr("kn of 1.5e+08 N/m³ beside <layer>"));
  EXPECT_THAT(warnings("kn=\"1.5e8\""), named);
  EXPECT_THAT(warnings(""), ::testing::Not(named));
  EXPECT_THAT(warnings("kn=\"7.6667e7\""),
              ::testing::Not(::testing::Contains(HasSubstr("beside"))));
}

/// Forces under a ball of radius 7.5 mm (Helmut et al., FEATS): depth [mm], force [N].
TEST(SkinMaterial, TheMeasuredLayoutCarriesTheMeasuredForces) {
  constexpr double kMeasured[][2] = {{0.5, 1.6503}, {1.0, 5.9641}, {1.5, 13.5257}, {2.0, 23.2532}};
  const Model model(pressed(R"(<include file=")" TANGERE_SOURCE_DIR
                            R"(/scenes/sensors/gelsight_mini_measured.xml" body="plate" )"
                            R"(pos="0 0 0.005"/>)"));
  Batch batch(model, 1, 0);
  Readout readout(model);
  std::vector<double> field(3 * std::size_t(model.sensors()[0].points));
  for (const auto& [depth, force] : kMeasured) {
    batch.set_state(0, std::vector{-1e-3 * depth}, std::vector{0.0});
    readout.tactile(batch, 0, 0, field);
    double normal = 0;
    for (std::size_t i = 2; i < field.size(); i += 3) normal += field[i];
    EXPECT_NEAR(std::abs(normal) / force, 1, 0.075) << depth << " mm";
  }
}

}  // namespace
}  // namespace tangere
