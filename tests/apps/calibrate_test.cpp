// SPDX-License-Identifier: Apache-2.0
// Tests `tangere calibrate` as a user runs it, against closed forms: under a flat end of n points a
// bed of springs carries N = n k_n d (1 + τ ḋ/δ) and the shear min(n k_s x, μ N).
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/files/png_file.hpp"
#include "tests/apps/press_recordings.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(Calibrate, StiffnessAndZeroOfAPressAreFound) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\" kt=\"0.1\""));
  folder.write("press.csv", table("depth_mm,force_mN", 9, [](int k) {
                 const double depth = 0.02 * (k + 1);  // [mm], of which the zero is 0.03 mm off
                 return std::vector<double>{depth, 1e3 * kPoints * 123 * (depth + 0.03) * 1e-3};
               }));
  const json answer = run_json(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat",
                                        "0.0035", "--hold-out", "0.34", "-o", "out.xml"});
  EXPECT_NEAR(number(answer, "kn")["value"], 123, 1e-6 * 123);
  EXPECT_NEAR(number(answer, "zero")["value"], 3e-5, 1e-10);
  EXPECT_EQ(answer["normal"]["rows"], 6);
  EXPECT_EQ(answer["normal_held_out"]["rows"], 3);
  EXPECT_LT(answer["normal_held_out"]["largest"], 1e-6);
  EXPECT_EQ(reason(answer, "relaxation"), "told") << "springs without a material have none";
  EXPECT_THAT(reason(answer, "mu"), HasSubstr("nothing is sheared"));
  folder.write("still.csv", "depth,force,shear,shear_force\n1e-5,1,0,0\n2e-5,2,0,0\n");
  const json still =
      run_json(folder, {"calibrate", "still.csv", "--sensor", "skin.xml", "--flat", "0.0035"});
  EXPECT_THAT(reason(still, "ks"), HasSubstr("nothing is sheared"));
  const std::string written = folder.read("out.xml");
  EXPECT_THAT(written, HasSubstr("kn=\"123\""));
  EXPECT_THAT(written, HasSubstr("name=\"skin_measured\""));
  EXPECT_THAT(written, HasSubstr("fitted by 'tangere calibrate' to press.csv, 6 rows, to "));

  // Seven columns of three points under a rectangle, and a layout without a stiffness.
  folder.write("skin.xml", layout("mu=\"1\""));
  const json box = run_json(
      folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--box", "0.0067,0.0027"});
  EXPECT_NEAR(number(box, "kn")["value"], 123 * kPoints / 21, 1e-3);
}

TEST(Calibrate, TheIntervalIsThatOfTheNoise) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\""));
  constexpr double kNoise = 2e-4;  // [N], in turns
  folder.write(
      "press.csv", table("depth_m,force_N", 40, [](int k) {
        const double depth = 5e-6 * (k + 1);
        return std::vector<double>{depth, kPoints * 80 * depth + (k % 2 ? kNoise : -kNoise)};
      }));
  const json answer = run_json(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat",
                                        "0.0035", "--fit", "kn"});
  double squares = 0;
  for (int k = 1; k <= 40; ++k) squares += std::pow(kPoints * 5e-6 * k, 2);
  const json kn = number(answer, "kn");
  const double half = 2.0227 * kNoise * std::sqrt(40 / 39.0 / squares);
  EXPECT_NEAR((double(kn["high"]) - double(kn["low"])) / 2, half, 0.01 * half);
  EXPECT_LT(kn["low"], 80);
  EXPECT_GT(kn["high"], 80);
}

/// A film of 2e5 Pa that goes in by 0.2 mm at 10 mm/s, and out at 2 mm/s.
std::string film(double tau) {
  return table("time_ms,depth_mm,force_N", 41, [tau](int k) {
    const bool in = k <= 20;
    const double t = in ? 1e-3 * k : 0.02 + 5e-3 * (k - 20);
    const double d = in ? 0.01 * t : 2e-4 - 0.002 * (t - 0.02);
    const double rate = k == 20 ? 0 : in ? 0.01 : -0.002;
    const double kn = 2.3 * 2e5 / kThickness * kArea, depth = kThickness / 10;
    return std::vector<double>{1e3 * t, 1e3 * d, kPoints * kn * d * (1 + tau * rate / depth)};
  });
}
const Words kFitFilm = {"calibrate", "press.csv", "--sensor", "skin.xml",
                        "--flat",    "0.0035",    "--fit",    "modulus"};

TEST(Calibrate, AFilmRelaxes) {
  const Folder folder;
  folder.write("skin.xml", layout("modulus=\"1e5\" thickness=\"4e-3\" mu=\"0.5\""));
  folder.write("press.csv", film(0.008));
  const json answer = run_json(folder, kFitFilm + Words{"--fit", "relaxation"});
  EXPECT_NEAR(number(answer, "modulus")["value"], 2e5, 1e-4 * 2e5);
  EXPECT_NEAR(number(answer, "relaxation")["value"], 0.008, 1e-3 * 0.008);
  folder.write("press.csv", film(0));
  EXPECT_THAT(reason(run_json(folder, kFitFilm + Words{"--fit", "relaxation"}), "relaxation"),
              HasSubstr("do not show it"));
}

/// A relaxation that is not told is that of the layout while the modulus is fitted, so the written
/// layout has the error of the fit.
TEST(Calibrate, ANumberThatIsNotToldIsTheLayouts) {
  const Folder folder;
  folder.write("skin.xml",
               layout("modulus=\"1e5\" thickness=\"4e-3\" mu=\"0.5\" relaxation=\"0.02\""));
  folder.write("press.csv", film(0));
  const json both = run_json(folder, kFitFilm + Words{"--fit", "relaxation", "-o", "out.xml"}),
             alone = run_json(folder, kFitFilm);
  ASSERT_THAT(reason(both, "relaxation"), HasSubstr("do not show it"));
  EXPECT_THAT(folder.read("out.xml"), HasSubstr("relaxation=\"0.02\""));
  const double modulus = number(alone, "modulus")["value"], error = alone["normal"]["largest"];
  EXPECT_GT(error, 0.1) << "of a relaxation that the press does not have";
  EXPECT_NEAR(number(both, "modulus")["value"], modulus, 1e-3 * modulus);
  EXPECT_NEAR(both["normal"]["largest"], error, 1e-3);
}

/// A press of 0.05 mm, then a shear of up to 0.06 mm and back.
std::string sheared(double friction) {
  constexpr double kNormal = kPoints * 100 * 5e-5, kShear = kPoints * 40;
  double slider = 0, before = 0;
  return table("depth_mm,force_N,shear_mm,shear_force_N", 61, [&](int k) {
    const double x = 2e-6 * (k <= 30 ? k : 60 - k);
    slider = std::clamp(slider + kShear * (x - before), -friction * kNormal, friction * kNormal);
    before = x;
    return std::vector<double>{0.05, kNormal, 1e3 * x, slider};
  });
}

TEST(Calibrate, AShearShowsItsSpringAndItsFriction) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\" ks=\"10\" mu=\"1\""));
  folder.write("shear.csv", sheared(0.2));
  const Words words = {"calibrate", "shear.csv", "--sensor", "skin.xml", "--flat", "0.0035"};
  const json answer = run_json(folder, words);
  EXPECT_NEAR(number(answer, "kn")["value"], 100, 1e-6 * 100);
  EXPECT_NEAR(number(answer, "ks")["value"], 40, 1e-3 * 40);
  EXPECT_NEAR(number(answer, "mu")["value"], 0.2, 1e-3 * 0.2);
  EXPECT_LT(answer["shear"]["largest"], 1e-3);
  EXPECT_THAT(reason(answer, "zero"), HasSubstr("one depth"));

  folder.write("known.xml", layout("kn=\"100\" ks=\"40\" mu=\"1\""));
  const json friction = run_json(folder, {"calibrate", "shear.csv", "--sensor", "known.xml",
                                          "--flat", "0.0035", "--fit", "mu"});
  EXPECT_NEAR(number(friction, "mu")["value"], 0.2, 1e-3 * 0.2);

  folder.write("shear.csv", sheared(9));
  const json stuck = run_json(folder, words + Words{"-o", "stuck.xml"});
  EXPECT_THAT(folder.read("stuck.xml"), HasSubstr("mu=\"1\"")) << "as in the layout";
  EXPECT_NEAR(number(stuck, "ks")["value"], 40, 1e-3 * 40);
  EXPECT_THAT(reason(stuck, "mu"), HasSubstr("nothing slips"));

  // A friction of the layout that would slip gives way to the largest ratio.
  folder.write("skin.xml", layout("kn=\"50\" ks=\"10\" mu=\"0.1\""));
  run_json(folder, words + Words{"-o", "bound.xml"});
  EXPECT_THAT(folder.read("bound.xml"), HasSubstr("mu=\"0.48\""));  // 40 · 6e-5 / (100 · 5e-5)
  EXPECT_THAT(folder.read("bound.xml"), HasSubstr("mu: a lower bound"));
}

/// A lag needs times, also of the other recording, and more than one row.
TEST(Calibrate, ALagNeedsTimes) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\""));
  const auto late = [](int k) {
    const double before = 1e-5 * std::max(k - 0.5, 0.0);
    return std::vector<double>{0.1 * k, 1e-5 * k, kPoints * 100 * before};
  };
  folder.write("press.csv", table("time,depth,force", 20, late));
  folder.write("slow.csv", "depth,force\n1e-4,0.37\n");
  folder.write("row.csv", "time,depth,force\n1,1e-4,0.37\n");
  const Words flat = {"--sensor", "skin.xml", "--flat", "0.0035"},
              fit = Words{"calibrate", "press.csv", "--fit", "kn", "--fit", "lag"} + flat;
  const Outcome slow = run(folder, fit + Words{"--check", "slow.csv"});
  EXPECT_EQ(slow.exit_code, 2) << slow.out;
  EXPECT_THAT(slow.err, HasSubstr("has no times, and 'lag' was fitted"));
  const json row = run_json(folder, fit + Words{"--check", "row.csv"});
  EXPECT_NEAR(number(row, "lag")["value"], 0.05, 1e-3);
  EXPECT_LT(row["other"]["largest"], 0.01);
  const Outcome one =
      run(folder, Words{"calibrate", "row.csv", "--fit", "kn", "--fit", "lag"} + flat);
  EXPECT_EQ(one.exit_code, 2) << one.out;
  EXPECT_THAT(one.err, HasSubstr("has one row"));
}

/// A slider that never slips is a spring; its force is not told.
TEST(Calibrate, ASliderThatDoesNotSlipIsASpring) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"100\""));
  folder.write("press.csv", table("depth,force", 20, [](int k) {
                 return std::vector<double>{1e-5 * k, (kPoints * 100 + 2000) * 1e-5 * k};
               }));
  const json answer = run_json(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat",
                                        "0.0035", "--fit", "slider"});
  EXPECT_THAT(reason(answer, "slider_force"), HasSubstr("does not slip"));
  EXPECT_NEAR(number(answer, "slider")["value"], 2000, 1);
}

/// Writes the layout of a GelSight Mini with a layer, gel.xml.
void write_gel(const Folder& folder) {
  std::string gel = folder.read(scene("sensors/gelsight_mini_measured.xml"));
  const std::string springs = " kn=\"3.13e8\"/>";
  ASSERT_THAT(gel, HasSubstr(springs));
  gel.replace(gel.find(springs), springs.size(), "><layer margin=\"3.2e-3\"/></tactile>");
  folder.write("gel.xml", gel);
}

/// Forces on a GelSight Mini (FEATS, Helmut et al.).
TEST(Calibrate, TwoPressesOfAGelPredictTwoOthers) {
  const Folder folder;
  write_gel(folder);
  const std::vector<std::string> rows = {"0.5,1.6503", "1.0,5.9641", "1.5,13.5257", "2.0,23.2532"};
  for (const auto& order : {std::array{0, 1, 2, 3}, {1, 0, 3, 2}}) {
    std::string text = "depth_mm,force_N\n";
    for (const int k : order) text += rows[std::size_t(k)] + "\n";
    folder.write("press.csv", text);
    const json answer = run_json(folder, {"calibrate", "press.csv", "--sensor", "gel.xml", "--ball",
                                          "0.0075", "--hold-out", "2"});
    EXPECT_LE(answer["normal_held_out"]["largest_by_row"], 0.04) << text;
    EXPECT_NEAR(number(answer, "modulus")["value"], 4.28e5, 0.1 * 4.28e5);
  }
}

/// Finite elements of a gel of 0.428 MPa under a ball of 7.5 mm with friction 1, pressed 0.75 mm
/// and moved along x: the material is found, and one shear predicts another.
TEST(Calibrate, AShearedGelOfFiniteElementsIsFound) {
  const Folder folder;
  write_gel(folder);
  folder.write("shear.csv",
               "depth_mm,force_N,shear_mm,shear_force_N\n0.75,3.18433,0,0\n"
               "0.75,3.18795,0.2,0.60406\n0.75,3.19709,0.5,1.42649\n");
  const json answer =
      run_json(folder, {"calibrate", "shear.csv", "--sensor", "gel.xml", "--ball", "0.0075",
                        "--fit", "modulus", "--fit", "ks", "--hold-out", "1"});
  EXPECT_NEAR(number(answer, "modulus")["value"], 4.28e5, 0.025 * 4.28e5);
  EXPECT_LT(answer["normal_held_out"]["largest"], 0.01);
  EXPECT_LT(answer["shear_held_out"]["largest"], 0.04);
}

/// A table that is pushed by a flat end carries its area times the pressure.
TEST(Calibrate, ATableIsFound) {
  const Folder folder;
  folder.write("skin.xml", layout("modulus=\"1e5\" thickness=\"4e-3\" mu=\"0.5\""));
  // Pressures of a straight line and a steeper one, which their cubics reproduce at the knots.
  folder.write("press.csv", table("depth_m,force_N", 3, [](int k) {
                 const double depth = 1e-4 * (k + 1), pressure = k == 0 ? 2e3 : k == 1 ? 4e3 : 9e3;
                 return std::vector<double>{depth, kPoints * kArea * pressure};
               }));
  const json answer = run_json(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat",
                                        "0.0035", "--table", "3", "-o", "out.xml"});
  EXPECT_NEAR(number(answer, "pressure[1]")["value"], 2e3, 1);
  EXPECT_NEAR(number(answer, "pressure[2]")["value"], 4e3, 1);
  EXPECT_NEAR(number(answer, "pressure[3]")["value"], 9e3, 1);
  EXPECT_NEAR(answer["table_depth"], 3e-4, 1e-15);
  const std::string written = folder.read("out.xml");
  EXPECT_THAT(written, HasSubstr("pressure_depth=\"0 0.0001 0.0002 0.0003\""));
  EXPECT_THAT(written, HasSubstr("ks=\"2.3e+07\""));
  EXPECT_THAT(written, Not(HasSubstr("modulus=")));
  // The written layout is one, and its own press is the recorded one.
  const json again = run_json(folder, {"calibrate", "press.csv", "--sensor", "out.xml", "--flat",
                                       "0.0035", "--table", "3", "--check", "press.csv"});
  EXPECT_LT(again["other"]["largest"], 1e-3);
}

/// A printed lattice, half of whose rows predict the other half (tests/data/skin_loops).
TEST(Calibrate, ALatticeIsATableAndASlider) {
  const Folder folder;
  folder.write("lattice.xml",
               "<sensor unit=\"m-kg\"><tactile name=\"lattice\" type=\"rect_array\" "
               "resolution=\"4 4\" rect_pos0=\"-0.0075 0.0075 0\" rect_pos1=\"0.0075 -0.0075 0\" "
               "axis0=\"0 -1 0\" axis1=\"1 0 0\" per=\"area\" kn=\"1e7\"/></sensor>");
  const Words words = {"calibrate",  TANGERE_TEST_DATA "/skin_loops/shear.csv",
                       "--sensor",   "lattice.xml",
                       "--flat",     "0.05",
                       "--hold-out", "0.5",
                       "--table",    "8",
                       "--fit",      "pressure"};
  const json table = run_json(folder, words),
             both = run_json(folder,
                             words + Words{"--fit", "slider", "--fit", "zero", "--fit", "lag"});
  EXPECT_LT(table["normal_held_out"]["root_mean_square"], 0.065);
  EXPECT_GT(table["normal_held_out"]["root_mean_square"], 0.05);
  EXPECT_LT(both["normal_held_out"]["root_mean_square"], 0.0145);
  EXPECT_LT(number(both, "slider_force")["high"], 3);
  EXPECT_GT(number(both, "slider_force")["low"], 1);
}

const std::string kTable = "depth,force\n1e-4,1\n2e-4,2\n";

TEST(Calibrate, WhatTheLayoutHasNotAndWhatIsNotFittedIsNotInvented) {
  const Folder folder;
  folder.write("press.csv", kTable);
  folder.write("skin.xml", layout("mu=\"1\""));
  const Outcome none =
      run(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat", "0.0035"});
  const std::string row = none.out.substr(none.out.find("kn [N/m]"));
  EXPECT_THAT(row.substr(0, row.find('\n')), Not(EndsWith("1"))) << "no kn in the layout";

  folder.write("skin.xml", layout("kn=\"270\""));
  const json zero = run_json(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat",
                                      "0.0035", "--fit", "zero"});
  EXPECT_EQ(zero["output"], json());
  EXPECT_EQ(zero["numbers"].size(), 1);
}

TEST(Calibrate, OtherColumnsAreNamedAndNotUsed) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\""));
  folder.write("press.csv",
               "time_index,depth [mm],force_std,force (mN),shear_force_std\n"
               "7,0.1,9,370,9\n7,0.2,9,740,9\n");
  const Outcome outcome =
      run(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat", "0.0035", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NEAR(number(json::parse(outcome.out), "kn")["value"], 100, 1e-3);
  for (const char* const name : {"time_index", "force_std", "shear_force_std"})
    EXPECT_THAT(outcome.err, HasSubstr(std::string("column '") + name + "' is not used"));
}

constexpr int kPhotoHeight = 48, kPhotoWidth = 64;  // pixels
constexpr double kPhotoBallRadius = 10;             // [pixels], of 0.2 mm

/// A press of a ball in the imprint of radius r around (x, y), whose slope fades beside it: the
/// colours are linear in the normal. r = 0: the untouched gel.
std::string drawn_photograph(double x, double y, double r) {
  Photograph photograph{kPhotoHeight, kPhotoWidth, {}};
  for (int i = 0; i < kPhotoHeight; ++i)
    for (int j = 0; j < kPhotoWidth; ++j) {
      const double dx = j + 0.5 - x, dy = i + 0.5 - y, distance = std::hypot(dx, dy),
                   sine = std::min(distance, r) / kPhotoBallRadius,
                   steep = sine / std::sqrt(1 - sine * sine) *
                           (distance > r && r > 0 ? std::exp(2 * (1 - distance / r)) : 1),
                   nz = 1 / std::sqrt(1 + steep * steep),
                   nx = distance > 0 ? steep * nz * dx / distance : 0,
                   ny = distance > 0 ? steep * nz * dy / distance : 0;
      for (const double level : {110 + 90 * nx, 120 + 90 * ny, 100 - 60 * nx + 40 * (nz - 1)})
        photograph.levels.push_back(static_cast<std::uint8_t>(std::lround(level)));
    }
  return png_bytes(photograph);
}

/// Writes the photographs of six presses into presses/.
void draw_presses(const Folder& folder) {
  std::filesystem::create_directory(folder.path("presses"));
  folder.write("presses/background.png", drawn_photograph(0, 0, 0));
  std::ostringstream rows;
  rows << "file,x_px,y_px,radius_px\n";
  for (int k = 0; k < 6; ++k) {
    const double x = 14 + 18 * (k % 3), y = 14 + 20.0 * (k / 3), r = 5.5 + 0.25 * k;
    const std::string name = "press_" + std::to_string(k) + ".png";
    folder.write("presses/" + name, drawn_photograph(x, y, r));
    rows << name << "," << x << "," << y << "," << r << "\n";
  }
  folder.write("presses/presses.csv", rows.str());
}

const Words kOfPhotographs = {"calibrate", "--pictures", "presses/", "--ball",
                              "2e-3",      "--pixel",    "2e-4"};

TEST(Calibrate, AGelOfDrawnPhotographsIsFound) {
  const Folder folder;
  draw_presses(folder);
  const json answer = run_json(folder, kOfPhotographs + Words{"-o", "gel.xml"});
  EXPECT_GT(answer["mean"]["psnr"], 25);
  EXPECT_GT(answer["mean"]["refined_ssim"], 0.8);
  ASSERT_EQ(answer["presses"].size(), 6U);
  EXPECT_EQ(answer["presses"][5]["file"], "press_5.png");
  const std::string gel = folder.read("gel.xml");
  EXPECT_THAT(gel, HasSubstr("background=\"gel_background.png\" pixel=\"0.0002\""));
  EXPECT_THAT(gel, HasSubstr("<fit photographs=\"presses\" ball=\"0.002\""));
  EXPECT_EQ(folder.read("gel_background.png"), folder.read("presses/background.png"));
}

/// A label beside its imprint is named, and a photograph without an imprint is no press.
TEST(Calibrate, LabelsThatAreFarOffAreNamed) {
  const Folder folder;
  draw_presses(folder);
  EXPECT_THAT(run(folder, kOfPhotographs).err, Not(HasSubstr("warning")));
  std::string table = folder.read("presses/presses.csv");
  const std::string last = table.substr(table.find("press_5.png"));
  const std::string others = table.substr(0, table.find("press_5.png"));
  folder.write("presses/presses.csv", others + "press_5.png,40,24,6\n");
  const Outcome outcome = run(folder, kOfPhotographs);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("warning: press_5.png: the circle of radius 6 pixels became"));
  folder.write("presses/press_5.png", folder.read("presses/background.png"));
  folder.write("presses/presses.csv", others + last);
  EXPECT_THAT(run(folder, kOfPhotographs).err,
              HasSubstr("press_5.png differs from the background by 0 levels"));
}

TEST(Calibrate, SaysWhatIsWrongWithPhotographs) {
  const Folder folder;
  draw_presses(folder);
  const auto err = [&](const Words& words) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    return outcome.err;
  };
  for (const auto& [name, value] : {std::pair{"--sensor", "skin.xml"},
                                    {"--flat", "0.01"},
                                    {"--box", "0.01,0.01"},
                                    {"--table", "3"},
                                    {"--fit", "kn"},
                                    {"--hold-out", "2"},
                                    {"--check", "other.csv"}})
    EXPECT_THAT(err(kOfPhotographs + Words{name, value}),
                HasSubstr(std::string("--pictures beside ") + name + "; expected"));
  EXPECT_THAT(err(kOfPhotographs + Words{"press.csv", "--table", "3", "--check", "other.csv"}),
              HasSubstr("--pictures beside RECORDING, --table, --check; expected"));
  EXPECT_THAT(err({"calibrate", "--pictures", "presses", "--ball", "2e-3"}),
              HasSubstr("--pictures without --ball or --pixel"));
  EXPECT_THAT(err({"calibrate", "--pictures", "presses", "--ball", "2", "--pixel", "2e-4"}),
              HasSubstr("--ball 2; expected metres, 0.1 at most"));
  folder.write("presses/presses.csv", "file,x_px,y_px\npress_0.png,14,14\n");
  EXPECT_THAT(
      err(kOfPhotographs),
      HasSubstr("presses.csv: no column 'radius_px'; expected file, x_px, y_px, radius_px"));
  folder.write("presses/presses.csv", "file,x_px,y_px,radius_px\npress_0.png,14,14,5\n");
  EXPECT_THAT(err(kOfPhotographs), HasSubstr("1 presses; expected at least 3"));
  folder.write("presses/presses.csv", "file,x_px,y_px,radius_px\npress_0.png,14,99,5\n");
  EXPECT_THAT(err(kOfPhotographs), HasSubstr("presses.csv:2: an imprint at (14, 99)"));
}

TEST(Calibrate, SaysWhatIsWrong) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\""));
  const auto err = [&](const std::string& text, const Words& more) {
    folder.write("p.csv", text);
    const Outcome outcome = run(folder, Words{"calibrate", "p.csv", "--sensor", "skin.xml"} + more);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    return outcome.err;
  };
  const Words flat = {"--flat", "0.0035"};
  EXPECT_THAT(err(kTable, {}), HasSubstr("expected one of --ball, --flat and --box"));
  EXPECT_THAT(err(kTable, {"--box", "0.01"}), HasSubstr("expected 2 positive numbers"));
  EXPECT_THAT(err(kTable, flat + Words{"--box", "1,1"}), HasSubstr("expected one of"));
  EXPECT_THAT(err("depth,forc\n1,2\n", flat), HasSubstr("no column 'force' among depth, forc"));
  EXPECT_THAT(err("depth_in,force\n1,2\n", flat),
              HasSubstr("no column 'depth' among depth_in, force; expected one in m or mm"));
  EXPECT_THAT(err("depth,force,depth\n1,2,1\n", flat), HasSubstr("two columns 'depth'"));
  EXPECT_THAT(err("1,2\n", flat), HasSubstr("p.csv:1: no names of columns"));
  EXPECT_THAT(err(kTable, flat + Words{"--fit", "mu"}), HasSubstr("nothing is sheared"));
  EXPECT_THAT(err(kTable, flat + Words{"--table", "64"}),
              HasSubstr("expected a row for each at least"));
  EXPECT_THAT(err(kTable, flat + Words{"--fit", "lag"}), HasSubstr("has no times"));
  EXPECT_THAT(err(kTable, flat + Words{"--table", "3", "--fit", "zero"}),
              HasSubstr("a table without 'pressure'"));
  EXPECT_THAT(err(kTable, flat + Words{"--fit", "ke"}), HasSubstr("expected some of kn, zero"));
  EXPECT_THAT(err(kTable, flat + Words{"--hold-out", "2"}), HasSubstr("2 of 2 rows are held out"));
  EXPECT_THAT(err("depth,force\n-1e-4,1\n", flat), HasSubstr("feels nothing"));
  EXPECT_THAT(err("depth,force\n1e-4,-1\n", flat), HasSubstr("positive in compression"));
  EXPECT_THAT(err("time,depth,force\n1,1e-4,1\n1,1e-4,1\n", flat), HasSubstr("ascending times"));
  EXPECT_THAT(err("depth,force,shear\n1e-4,1,1e-4\n", flat), HasSubstr("expected both or none"));
  EXPECT_THAT(err("depth,force,shear,shear_force\n1e-4,1,0,0\n1e-4,1,1e-4,0\n", flat),
              HasSubstr("a shear without any force"));
  folder.write("skin.xml", layout("kn=\"50\" ks=\"10\""));
  EXPECT_THAT(err(kTable, flat + Words{"--table", "3"}), HasSubstr("ks or kt by point"));
  folder.write("skin.xml", layout("kn=\"50\" feedback=\"true\""));
  EXPECT_THAT(err(kTable, flat + Words{"--table", "3"}), HasSubstr("--table with feedback"));
  std::string late = layout("kn=\"50\"");
  late.replace(late.find("/></sensor>"), 2, "><imperfections delay=\"0.1\"/></tactile>");
  folder.write("skin.xml", late);
  EXPECT_THAT(err(kTable, flat + Words{"--table", "3"}),
              HasSubstr("skin.xml:1: --table with delay in <imperfections>"));
  folder.write("skin.xml", layout("kn=\"50\""));
  EXPECT_THAT(err("depth,force\n-1e-4,1\n-2e-4,2\n", flat + Words{"--table", "3"}),
              HasSubstr("expected depths positive into the skin"));
  folder.write("skin.xml",
               "<sensor unit=\"m-kg\"><tactile type=\"hemisphere\" radius=\"0.01\" count=\"50\" "
               "modulus=\"1e5\" thickness=\"3e-3\"/></sensor>");
  EXPECT_THAT(err(kTable, flat + Words{"--table", "3"}), HasSubstr("expected type=\"rect_array\""));
  folder.write("skin.xml", "<sensor unit=\"m-kg\"/>");
  EXPECT_THAT(err(kTable, flat), HasSubstr("skin.xml:1: <sensor>: 0 sensors; expected one"));
}

}  // namespace
}  // namespace tangere::apps
