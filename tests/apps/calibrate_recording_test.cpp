// SPDX-License-Identifier: Apache-2.0
// What `tangere calibrate` says about recordings of real presses: units, zeros, intervals, turns,
// signs, resolution, and what a written layout has. Under a flat end of n points a bed of springs
// carries N = n k_n (d + zero) + force_zero.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "tasks/calibration/press.hpp"
#include "tests/apps/press_recordings.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

const Words kFlat = {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat", "0.0035"};

/// Rows from -0.02 mm to 0.07 mm of a skin of kn = 100 N/m and a zero of 0.01 mm, under a load cell
/// that adds 0.05 N.
std::string offset_press(int first, double noise) {
  return table("depth_mm,force_N", 10 - first, [=](int k) {
    const double depth = 0.01 * (k + first - 2), off = k % 2 ? noise : -noise;
    return std::vector<double>{depth,
                               kPoints * 100 * std::max(depth + 0.01, 0.0) * 1e-3 + 0.05 + off};
  });
}

TEST(CalibrateRecording, TheZeroOfTheForceIsThatOfRowsAboveTheSkin) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\""));
  folder.write("press.csv", offset_press(0, 0));
  const json above = run_json(folder, kFlat);
  EXPECT_NEAR(number(above, "force_zero")["value"], 0.05, 1e-6);
  EXPECT_NEAR(number(above, "zero")["value"], 1e-5, 1e-9);
  EXPECT_NEAR(number(above, "kn")["value"], 100, 1e-3);
  EXPECT_EQ(above["rows_above"], 1) << "the next one touches";
  EXPECT_THAT(run(folder, kFlat).out, HasSubstr("force_zero is told by 1 row above the skin"));

  // Without such rows nothing tells an offset from the zero of the depth under a flat end.
  folder.write("press.csv", offset_press(3, 1e-4));
  const json below = run_json(folder, kFlat);
  EXPECT_TRUE(number(below, "zero")["low"].is_null());
  EXPECT_NEAR(number(below, "kn")["value"], 100, 0.5);
  EXPECT_TRUE(number(below, "kn")["low"].is_number()) << "which does not depend on either";
  EXPECT_EQ(below["given"][0]["number"], "force_zero");
  EXPECT_EQ(below["given"][0]["told"], false);
  const std::string text = run(folder, kFlat).out;
  EXPECT_THAT(text, HasSubstr("cannot be told"));
  EXPECT_THAT(text, HasSubstr("taken as 0: force_zero [N]"));
  EXPECT_THAT(text, HasSubstr("record rows above the skin, at depths below 0"));
  const json both =
      run_json(folder, kFlat + Words{"--fit", "kn", "--fit", "zero", "--fit", "force_zero"});
  EXPECT_THAT(reason(both, "force_zero"), HasSubstr("from the zero of the depth"));
}

/// A line y = a + b x of n rows has s²(b) = s²/Sxx, and its root -a/b the variance
/// s² (1/n + (x̄ + a/b)²/Sxx)/b².
TEST(CalibrateRecording, IntervalsAreThoseOfALine) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\""));
  constexpr int kRows = 20;
  constexpr double kNoise = 1e-4, kZero = 1e-5, kSlope = kPoints * 100;
  const auto depth = [](int k) { return 5e-6 * (k + 1); };
  const auto noise = [](int k) { return kNoise * std::sin(2.5 * k * k); };
  folder.write("press.csv", table("depth,force", kRows, [&](int k) {
                 return std::vector<double>{depth(k), kSlope * (depth(k) + kZero) + noise(k)};
               }));
  const json answer = run_json(folder, kFlat + Words{"--fit", "kn", "--fit", "zero"});
  double x = 0, y = 0, xx = 0, xy = 0;
  for (int k = 0; k < kRows; ++k) x += depth(k) / kRows, y += noise(k) / kRows;
  for (int k = 0; k < kRows; ++k)
    xx += std::pow(depth(k) - x, 2), xy += (depth(k) - x) * (noise(k) - y);
  double squares = 0;
  for (int k = 0; k < kRows; ++k)
    squares += std::pow(noise(k) - y - xy / xx * (depth(k) - x), 2) / (kRows - 2);
  const double t = 2.101, b = kSlope + xy / xx, s = t * std::sqrt(squares),
               root = (kSlope * (x + kZero) + y) / b - x;
  const auto half = [&](const char* name) {
    const json n = number(answer, name);
    return (double(n["high"]) - double(n["low"])) / 2;
  };
  EXPECT_NEAR(number(answer, "zero")["value"], root, 1e-4 * root);
  EXPECT_NEAR(half("kn"), s / std::sqrt(xx) / kPoints, 0.01 * half("kn"));
  EXPECT_NEAR(half("zero"), s / b * std::sqrt(1.0 / kRows + std::pow(x + root, 2) / xx),
              0.01 * half("zero"));
  // A number that the user leaves out is taken as it is, and what its error does is said.
  const json alone = run_json(folder, kFlat + Words{"--fit", "kn"});
  EXPECT_EQ(alone["given"][0]["number"], "zero");
  EXPECT_NEAR(alone["given"][0]["error"], 0.01 * depth(kRows - 1), 1e-12);
  double moved = 0, of = 0;  // by -zero, of a line through 0
  for (int k = 0; k < kRows; ++k) moved += depth(k), of += depth(k) * depth(k);
  EXPECT_NEAR(alone["given"][0]["change"], -0.01 * depth(kRows - 1) * moved / of, 3e-5);
}

/// Presses of 0.05 mm whose shear slips with mu = 0.3 after 0.04 mm. `noise`: of the normal force,
/// of its size.
std::string slipping(double noise) {
  constexpr double kNormal = kPoints * 100 * 5e-5;
  return table("depth_mm,force_N,shear_mm,shear_force_N", 60, [=](int k) {
    return std::vector<double>{0.05, kNormal * (1 + (k % 2 ? noise : -noise)), 2e-3 * k,
                               std::min(kPoints * 40 * 2e-6 * k, 0.3 * kNormal)};
  });
}

/// One depth tells a stiffness from no zero, and a friction from no offset of the force. Who leaves
/// them out takes them as 0: a friction is then as uncertain as the mean force.
TEST(CalibrateRecording, WhatOneDepthDoesNotTellHasNoInterval) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"50\" ks=\"40\" mu=\"1\""));
  const Words words = kFlat + Words{"--fit", "kn", "--fit", "mu"};
  const auto width = [&](double noise) {
    folder.write("press.csv", slipping(noise));
    const json mu = number(run_json(folder, words), "mu");
    EXPECT_NEAR(mu["value"], 0.3, 1e-3) << noise;
    return double(mu["high"]) - double(mu["low"]);
  };
  // The error of the mean force of 60 rows with t = 2.001; the shear fits.
  EXPECT_NEAR(width(0.02), 2 * 0.3 * 2.001 * 0.02 / std::sqrt(59), 0.05 * width(0.02));
  EXPECT_LT(width(0), 1e-3);
  const json answer = run_json(folder, kFlat);
  EXPECT_NEAR(number(answer, "kn")["value"], 100, 1e-3);
  EXPECT_TRUE(number(answer, "kn")["low"].is_null());
  EXPECT_TRUE(number(answer, "mu")["high"].is_null()) << "the force may have an offset";
  EXPECT_THAT(reason(answer, "zero"), HasSubstr("one depth"));
}

TEST(CalibrateRecording, AShearOfTheOtherSignIsRefused) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"100\" ks=\"40\" mu=\"1\""));
  folder.write("press.csv", slipping(0));
  EXPECT_EQ(run(folder, kFlat).exit_code, 0);
  folder.write("press.csv", table("depth_mm,force_N,shear_mm,shear_force_N", 60, [](int k) {
                 return std::vector<double>{0.05, 0.185, -2e-3 * k,
                                            std::min(kPoints * 40 * 2e-6 * k, 0.3 * 0.185)};
               }));
  for (const Words& more : {Words{}, Words{"--fit", "kn", "--fit", "mu"}, Words{"--score"}}) {
    const Outcome outcome = run(folder, kFlat + more);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_THAT(outcome.err, HasSubstr("shear_force against the shear: its correlation with the "
                                       "computed force is -"));
    EXPECT_THAT(outcome.err, HasSubstr("multiply shear_force or shear by -1"));
  }
}

TEST(CalibrateRecording, ImplausibleShearsAreNamed) {
  const Folder folder;
  folder.write("skin.xml", layout("kn=\"100\" ks=\"40\" mu=\"1\""));
  const auto shear = [&](const char* header, double length, double force) {
    folder.write("press.csv", table(header, 60, [=](int k) {
                   return std::vector<double>{0.05, 0.185, 2e-3 * k * length,
                                              force * std::min(kPoints * 40 * 2e-6 * k, 0.055)};
                 }));
    return run(folder, kFlat).err;
  };
  const char* const all_mm = "depth_mm,force_N,shear_mm,shear_force_N";
  EXPECT_EQ(shear(all_mm, 1, 1), "");
  EXPECT_THAT(shear("depth_mm,force_N,shear,shear_force_N", 1, 1),
              HasSubstr("if the column is in mm: name it shear_mm"));
  EXPECT_THAT(shear(all_mm, 1e-3, 1), HasSubstr("a largest shear of 1.18e-07 m; expected 5e-06"));
  EXPECT_THAT(shear(all_mm, 1, 1e3), HasSubstr("a friction of "));
}

TEST(CalibrateRecording, ImplausibleUnitsAreNamed) {
  const Folder folder;
  folder.write("skin.xml", layout("modulus=\"2e5\" thickness=\"4e-3\" mu=\"0\""));
  const Words ball = {"calibrate", "press.csv", "--sensor", "skin.xml", "--ball", "0.004"};
  const auto press = [&](const std::string& header, double length, double force) {
    folder.write(
        "press.csv", table(header, 4, [=](int k) {
          const double d = 2e-4 * (k + 1);  // π K (R - d) d²
          return std::vector<double>{length * d, force * 3.14 * 1.15e8 * (4e-3 - d) * d * d};
        }));
  };
  press("depth,force", 1, 1);
  EXPECT_EQ(run_json(folder, ball)["warnings"], json::array());
  press("depth,force", 1, 1e3);
  EXPECT_THAT(run(folder, ball).err, HasSubstr("if forces are in mN: name the column force_mN"));
  EXPECT_THAT(run_json(folder, ball)["warnings"][0].get<std::string>(),
              HasSubstr("Pa (Young's modulus); expected 5e+03 to 2e+07; "));
  press("depth,force_mN", 1, 1);
  EXPECT_THAT(run(folder, ball).err, HasSubstr("if forces are in N: name the column force_N"));
  press("depth,force", 1, 1e-3);
  EXPECT_THAT(run(folder, ball).err, HasSubstr("if forces are in kN, or were divided by 1000"));
  // Plausible, but not beside the layout's.
  folder.write("skin.xml", layout("modulus=\"1e4\" thickness=\"4e-3\" mu=\"0\""));
  press("depth,force", 1, 50);
  EXPECT_THAT(run(folder, ball).err, HasSubstr("times the 1e+04 of the layout; 1e+04 if forces are "
                                               "in mN: name the column force_mN"));
  press("depth,force", 1, 1);
  EXPECT_EQ(run_json(folder, ball)["warnings"], json::array()) << "20 times the layout's";
  folder.write("skin.xml", layout("modulus=\"2e5\" thickness=\"4e-3\" mu=\"0\""));
  press("depth_mm,force_mN", 1e3, 1e3);
  EXPECT_EQ(run_json(folder, ball)["warnings"], json::array());
  press("depth,force", 1e3, 1);
  EXPECT_THAT(run(folder, ball).err,
              HasSubstr("a depth of 0.8 m in a skin that ends at its thickness; expected metres, "
                        "positive into the skin, 0.004 at most; 0.0008 if the column is in mm: "
                        "name it depth_mm"));
  press("depth_mm,force", 1, 1);
  EXPECT_THAT(run(folder, ball).err, HasSubstr("a largest depth of 8e-07 m; expected 5e-06 at "
                                               "least; 0.0008 if the column is in m"));
  press("depth,force", 1, 1);
  EXPECT_THAT(run(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--ball", "4"}).err,
              HasSubstr("a ball of radius 4 m on a pad of 0.01 m; expected metres, 0.03 at most; "
                        "0.004 if it is in mm"));
  EXPECT_THAT(
      run(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--flat", "3.5"}).err,
      HasSubstr("a flat end of size 3.5 m on a pad of 0.01 m; expected metres, 0.3 at most; "
                "0.0035 if it is in mm"));
  folder.write("press.csv", "time,depth,force\n0,0,0\n1e-5,1e-4,1\n2e-5,2e-4,3\n");
  EXPECT_THAT(run(folder, ball).err, HasSubstr("a speed of 10 m/s; expected times in s"));
}

/// A ball between four points, and one that touches few; cells that are coarse for a contact.
TEST(CalibrateRecording, AContactOfFewPointsOrCellsIsNamed) {
  const Folder folder;
  const std::string coarse =
      "<sensor unit=\"m-kg\"><tactile name=\"skin\" type=\"rect_array\" resolution=\"4 4\" "
      "rect_pos0=\"-0.0075 0.0075 0\" rect_pos1=\"0.0075 -0.0075 0\" axis0=\"0 -1 0\" "
      "axis1=\"1 0 0\" per=\"area\" kn=\"1e8\"/></sensor>";
  folder.write("skin.xml", coarse);
  folder.write("press.csv", "depth_mm,force\n0.2,0.1\n0.4,0.3\n");
  const auto err = [&](const char* ball) {
    return run(folder, {"calibrate", "press.csv", "--sensor", "skin.xml", "--ball", ball}).err;
  };
  EXPECT_THAT(err("0.004"),
              HasSubstr("the ball's contact has a radius of 0.00174 m at the largest depth, 0.0004 "
                        "m, and the nearest point is 0.00354 m from its axis: it falls between the "
                        "points"));
  EXPECT_THAT(err("0.03"), HasSubstr("the ball touches 4 points at its largest depth"));
  folder.write("skin.xml", coarse);

  const auto gel = [](const char* cell) {
    return "<sensor unit=\"m-kg\"><tactile name=\"gel\" type=\"rect_array\" resolution=\"41 41\" "
           "rect_pos0=\"-0.004 0.004 0\" rect_pos1=\"0.004 -0.004 0\" axis0=\"0 -1 0\" axis1=\"1 0 "
           "0\" modulus=\"2e5\" thickness=\"2e-3\"><layer" +
           std::string(cell) + "/></tactile></sensor>";
  };
  folder.write("press.csv", "depth_mm,force\n0.1,0.1\n0.2,0.3\n");
  folder.write("skin.xml", gel(""));
  EXPECT_THAT(err("0.003"), HasSubstr("the cells of the layer, 0.0004 m, are coarse for a contact "
                                      "of 0.000775 m: its forces are about 5 % too large"));
  folder.write("skin.xml", gel(" cell=\"2e-4\""));
  EXPECT_THAT(err("0.003"), Not(HasSubstr("cells"))) << "2.3 %";
}

/// What is written has the error that its comment names: it is scored again.
TEST(CalibrateRecording, AWrittenTableIsWhatWasScored) {
  const Folder folder;
  folder.write("skin.xml", layout("per=\"area\" kn=\"1e7\""));
  // Up to 0.3 mm and back, with a slider of 0.05 N beside springs.
  folder.write(
      "press.csv", table("depth_mm,force", 61, [](int k) {
        const double depth = 0.01 * (k <= 30 ? k : 60 - k),
                     slider = k <= 30 ? 0.05 * std::min(k / 2.0, 1.0)
                                      : 0.05 * std::max(1 - (k - 30) / 2.0, -1.0);
        return std::vector<double>{depth, std::max(kPoints * 100 * depth * 1e-3 + slider, 0.0)};
      }));
  const json fit = run_json(folder, kFlat + Words{"--table", "4", "--fit", "pressure", "--fit",
                                                  "slider", "-o", "out.xml"});
  EXPECT_LT(fit["normal"]["root_mean_square"], 0.01);
  EXPECT_GT(fit["written"]["root_mean_square"], 0.03) << "without the slider";
  const std::string text = folder.read("out.xml");
  EXPECT_THAT(text, HasSubstr("the slider that was fitted beside it is no part of the layout: "));
  EXPECT_THAT(text, HasSubstr("; scored without slider, 61 rows, to 4.1 %"));
  const Words score = {"calibrate", "press.csv", "--sensor", "out.xml", "--flat", "0.0035"};
  for (const Words& more : {Words{}, Words{"--score"}}) {
    const json again = run_json(folder, score + more);
    EXPECT_EQ(again["numbers"], json::array());
    EXPECT_NEAR(again["normal"]["root_mean_square"], fit["written"]["root_mean_square"], 1e-12);
  }
  EXPECT_THAT(run(folder, score).err, HasSubstr("its table of pressures stays; --table N fits"));
  const json zero = run_json(folder, score + Words{"--fit", "zero"});
  EXPECT_LT(zero["normal"]["root_mean_square"], fit["written"]["root_mean_square"]);

  EXPECT_THAT(run(folder, score + Words{"--score", "--fit", "zero", "-o", "x.xml"}).err,
              HasSubstr("--fit, --output beside --score; expected"));
  // Any layout is scored: a tenth of the stiffness misses nine tenths of the peak.
  folder.write("skin.xml", layout("kn=\"10\""));
  folder.write("press.csv", "depth_mm,force\n0.1,0.37\n0.2,0.74\n");
  const json soft = run_json(folder, kFlat + Words{"--score"});
  EXPECT_NEAR(soft["normal"]["largest"], 0.9, 1e-9);
}

TEST(CalibrateRecording, ATableThatEndsLevelIsNamed) {
  const Folder folder;
  folder.write("skin.xml", layout("per=\"area\" kn=\"1e7\""));
  folder.write("press.csv", table("depth_mm,force", 21, [](int k) {
                 return std::vector<double>{0.01 * k, 0.05 * std::min(k, 10)};
               }));
  const Outcome outcome =
      run(folder, kFlat + Words{"--table", "4", "--fit", "pressure", "-o", "out.xml"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("the table ends level, with 1.3"));
  folder.write("press.csv", "depth_mm,force\n0.1,0.37\n0.2,0.74\n");
  const Outcome rising = run(folder, kFlat + Words{"--table", "2", "--fit", "pressure"});
  EXPECT_THAT(rising.err, Not(HasSubstr("level")));
}

/// What friction would move is what a fit with it moves (tests/tasks/calibration has the truth).
TEST(CalibrateRecording, FrictionOfTheLayoutIsFittedIfNamed) {
  const Folder folder;
  folder.write("skin.xml", layout("modulus=\"2e5\" thickness=\"4e-3\" mu=\"0.3\""));
  folder.write("press.csv", table("depth_mm,force", 12, [](int k) {
                 const double d = 5e-5 * (k + 1);
                 return std::vector<double>{1e3 * d, 3.14 * 1.15e8 * (6e-3 - d) * d * d};
               }));
  const Words ball = {"calibrate", "press.csv", "--sensor", "skin.xml", "--ball", "0.006"};
  const json without = run_json(folder, ball), with = run_json(folder, ball + Words{"--friction"});
  EXPECT_EQ(without["friction"]["mu"], 0.3);
  EXPECT_EQ(with["friction"]["moved"], json::array());
  const double a = number(without, "modulus")["value"], b = number(with, "modulus")["value"],
               moved = without["friction"]["moved"][0]["value"];
  EXPECT_LT(moved, -0.01 * a);
  EXPECT_NEAR(b - a, moved, 0.1 * std::abs(moved));
  EXPECT_THAT(run(folder, ball).out, HasSubstr("without friction: mu = 0.3 adds "));
  EXPECT_THAT(run(folder, ball + Words{"--friction"}).out,
              HasSubstr("with friction: mu = 0.3 adds "));
  folder.write("skin.xml", layout("kn=\"50\" mu=\"0.3\""));
  EXPECT_THAT(run(folder, ball + Words{"--friction"}).err,
              HasSubstr("a fit with friction, of a sensor with mu = 0.3 and ks = 0; expected"));
}

/// At the turn of a fast press the rate is not known: the row is not fitted, and the rest is exact.
TEST(CalibrateRecording, TurnsOfTheDepthAreNotFitted) {
  const Folder folder;
  folder.write("skin.xml", layout("modulus=\"1e5\" thickness=\"4e-3\" mu=\"0\""));
  constexpr double kTau = 0.02, kFilm = 2.3 * 2e5 / kThickness * kArea;
  folder.write("press.csv", table("time,depth,force", 41, [](int k) {
                 const double rate = k <= 20 ? 0.01 : -0.01,
                              d = 1e-5 * (k <= 20 ? k : 40 - k) + 1e-5;
                 const double force = kPoints * kFilm * d * (1 + kTau * rate / 4e-4);
                 return std::vector<double>{1e-3 * k, d, force};
               }));
  const json answer = run_json(folder, kFlat);
  EXPECT_EQ(answer["turns"], json({20}));
  EXPECT_NEAR(number(answer, "modulus")["value"], 2e5, 1);
  EXPECT_NEAR(number(answer, "relaxation")["value"], kTau, 1e-4 * kTau);
  EXPECT_THAT(run(folder, kFlat).out, HasSubstr("not fitted: 1 row at which the rate"));
}

/// A ramp that ends between rows has kinks of 3/4 and 1/4 of its rate. A sine of few rows has none.
TEST(CalibrateRecording, KinksBetweenRowsAreTurns) {
  PressRecording hold, sine;
  for (int k = 0; k < 40; ++k) {
    const double t = 1e-2 * k;
    hold.time.push_back(t), sine.time.push_back(t);
    hold.depth.push_back(1e-2 * std::clamp(t, 0.0525, 0.2575));
    sine.depth.push_back(1e-3 * (1 - std::cos(2 * 3.14159 * k / 40)));
  }
  EXPECT_EQ(hold.turns(), (std::vector<int>{5, 6, 25, 26}));
  EXPECT_TRUE(sine.turns().empty());
  PressRecording coarse;  // whose rates jump by more than a fifth at most rows
  for (std::size_t k = 0; k < 40; k += 2)
    coarse.time.push_back(sine.time[k]), coarse.depth.push_back(sine.depth[k]);
  EXPECT_TRUE(coarse.turns().empty());
}

/// What times, depths and speeds do that a fit with relaxation does not contain.
TEST(CalibrateRecording, WhatRatesDoIsNamed) {
  const Folder folder;
  folder.write("skin.xml", layout("modulus=\"1e5\" thickness=\"4e-3\" mu=\"0\""));
  constexpr double kTau = 0.02, kFilm = 2.3 * 2e5 / kThickness * kArea;
  // `follow`: whether forces are those of the noisy depths.
  const auto write = [&](double step, double noise, bool follow) {
    folder.write("press.csv", table("time,depth,force", 41, [=](int k) {
                   const double rate = 5e-6 / step * (k <= 20 ? 2 : -1),
                                d = 5e-6 * (k <= 20 ? 2 * k : 60 - k) + 1e-5,
                                noisy = d + noise * std::sin(2.5 * k * k);
                   return std::vector<double>{
                       step * k, noisy,
                       kPoints * kFilm * (follow ? noisy : d) * (1 + kTau * rate / 4e-4)};
                 }));
    return run(folder, kFlat);
  };
  EXPECT_EQ(write(1e-3, 0, true).err, "");
  EXPECT_THAT(write(0.03, 0, true).err,
              HasSubstr("rows are 0.03 s apart, longer than the relaxation of 0.02"));
  EXPECT_THAT(write(1e-3, 2e-6, true).err,
              HasSubstr("the intervals do not contain errors of the depth"));
  const Outcome noisy = write(1e-3, 2e-6, false);
  EXPECT_EQ(noisy.err, "");
  EXPECT_THAT(noisy.out, HasSubstr("m, by the scatter of depths and forces, contained in the fit"));
  const json given = run_json(folder, kFlat + Words{"--depth-error", "3e-6"});
  EXPECT_EQ(given["depth_error"]["deviation"], 3e-6);
  EXPECT_EQ(given["depth_error"]["estimated"], false);
  EXPECT_THAT(run(folder, kFlat + Words{"--depth-error", "-1"}).err,
              HasSubstr("--depth-error -1; expected the standard deviation"));
  EXPECT_THAT(run(folder, kFlat + Words{"--depth-error", "5"}).err,
              HasSubstr("--depth-error 5; expected metres, a tenth of the range"));
}

}  // namespace
}  // namespace tangere::apps
