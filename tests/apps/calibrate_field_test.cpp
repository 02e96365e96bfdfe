// SPDX-License-Identifier: Apache-2.0
// `tangere calibrate` with fields: a data set of the program as a table, and tables that are wrong.
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>

#include "tests/apps/press_recordings.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

/// 8 x 8 points, 0.5 mm apart, of a film of 2 mm.
std::string film_array(const std::string& name, const std::string& more) {
  return "<tactile name=\"" + name +
         "\" type=\"rect_array\" resolution=\"8 8\" rect_pos0=\"-0.00175 0.00175 0\" "
         "rect_pos1=\"0.00175 -0.00175 0\" axis0=\"0 -1 0\" axis1=\"1 0 0\" thickness=\"2e-3\" "
         "mu=\"0\" " +
         more;
}

/// A ball of 4 mm that goes in by 0.4 mm and beside by 0.3 mm.
const std::string kPressScene =
    "<tangere model=\"press\"><option unit=\"m-kg\" gravity=\"0 0 0\" timestep=\"5e-3\" "
    "integrator=\"BDF1\"/><robot><link name=\"base\"><joint name=\"base\" type=\"fixed\"/><body "
    "name=\"base\" type=\"cuboid\" size=\"0.01 0.01 0.01\"/></link></robot><robot><link "
    "name=\"ball\"><joint name=\"press\" type=\"translational\"/><body name=\"ball\" "
    "type=\"sphere\" radius=\"0.004\" pos=\"0 0 0.004\"/></link></robot><actuator><motor "
    "joint=\"press\" ctrl=\"position\" P=\"1e6\" D=\"10\"/></actuator><sensor>" +
    film_array("pad",
               "body=\"base\" modulus=\"2e5\" relaxation=\"4e-3\"><imperfections "
               "noise=\"2e-5\"/></tactile>") +
    "</sensor><control><piecewise end=\"0.2\"><at time=\"0\" value=\"0 0 0\"/><at time=\"0.05\" "
    "value=\"0 0 -0.0002\"/><at time=\"0.1\" value=\"0 0 -0.0004\"/><at time=\"0.15\" "
    "value=\"0.0003 0 -0.0004\"/></piecewise></control></tangere>";

TEST(CalibrateField, ADataSetsFieldIsFitted) {
  const Folder folder;
  folder.write("press.xml", kPressScene);
  folder.write("skin.xml", "<sensor unit=\"m-kg\">" +
                               film_array("skin_guess", "modulus=\"1e5\" relaxation=\"4e-3\"/>") +
                               "</sensor>");
  ASSERT_EQ(run(folder, {"generate", "press.xml", "-o", "set", "--episodes", "1", "--every", "2",
                         "--record", "q,pad.pressure"})
                .exit_code,
            0);
  ASSERT_EQ(run(folder, {"export", "set", "--csv", "set.csv"}).exit_code, 0);
  const Words words = {"calibrate", "set.csv",     "--sensor", "skin.xml",
                       "--ball",    "0.004",       "--column", "depth=-1*q/press.z",
                       "--column",  "x=q/press.x", "--column", "field=pad.pressure"};
  const json fit = run_json(folder, words + Words{"-o", "out.xml"});
  EXPECT_EQ(fit["points"], 64);
  const json modulus = number(fit, "modulus");
  EXPECT_NEAR(modulus["value"], 2e5, 0.01 * 2e5);
  EXPECT_LT(modulus["low"], 2e5);
  EXPECT_GT(modulus["high"], 2e5);
  EXPECT_NEAR(number(fit, "x_zero")["value"], 0, 1e-5);
  EXPECT_LT(fit["normal"]["root_mean_square"], 0.02);
  EXPECT_THAT(folder.read("out.xml"), HasSubstr("skin_measured"));
  // The comment, the report and a score of what was written have one number.
  Words again = words;
  again[3] = "out.xml";
  const json score = run_json(folder, again + Words{"--score"});
  EXPECT_NEAR(score["normal"]["root_mean_square"], fit["written"]["root_mean_square"], 1e-12);
  const Outcome text = run(folder, words);
  EXPECT_THAT(text.out, HasSubstr("pressing forces, 20 rows of 64 points: off by "));
  EXPECT_THAT(text.out, HasSubstr("of the norm of a row's own field at most"));
  EXPECT_THAT(text.err, HasSubstr("columns are not used: 'episode' to "));
  // Rows that are held out are predicted, and a table of pressures is fitted to the field as well.
  const json held = run_json(folder, words + Words{"--hold-out", "0.3"});
  EXPECT_LT(held["normal_held_out"]["largest_by_row"], 0.1);
  // Two rows of 64 forces are enough for three pressures.
  EXPECT_EQ(
      run(folder, words + Words{"--hold-out", "18", "--table", "3", "--fit", "pressure"}).exit_code,
      0);
  EXPECT_THAT(text.err, Not(HasSubstr("the fit leaves")));
  const json table =
      run_json(folder, words + Words{"--table", "3", "--fit", "pressure", "-o", "table.xml"});
  EXPECT_NEAR(table["normal"]["root_mean_square"], 0, 0.05);
  EXPECT_THAT(folder.read("table.xml"), HasSubstr("pressure_depth=\"0 "));
}

/// A row of a field of n numbers.
std::string field_table(const std::string& name, int n, const std::string& more = "",
                        const std::string& unit = "") {
  std::string header = "depth_mm", row = "0.1";
  for (int k = 0; k < n; ++k) header += "," + name + "/" + std::to_string(k) + unit, row += ",1e-3";
  return header + "\n" + row + "\n" + more;
}

/// A ball of 4 mm in the middle of 8 x 8 points, whose numbers are as many places on.
std::string shifted_press(int shift) {
  std::string header = "depth_mm";
  for (int k = 0; k < 64; ++k) header += ",pressure/" + std::to_string((k + shift) % 64);
  std::string out = header + "\n";
  for (const double depth : {1e-4, 2e-4, 3e-4}) {
    out += std::to_string(1e3 * depth);
    for (int k = 0; k < 64; ++k) {
      const double x = 5e-4 * (k % 8 - 3.5), y = 5e-4 * (k / 8 - 3.5);
      out += "," + std::to_string(50 * std::max(depth - (x * x + y * y) / 8e-3, 0.0));
    }
    out += "\n";
  }
  return out;
}

/// A place has a length, of which no share is said.
TEST(CalibrateField, FrictionMovesAPlaceByALength) {
  const Folder folder;
  folder.write("skin.xml", layout("modulus=\"1e5\" thickness=\"4e-3\" ks=\"40\" mu=\"0.5\""));
  std::string header = "depth_mm";
  for (int k = 0; k < 363; ++k) header += ",force/" + std::to_string(k);
  folder.write("p.csv", table(header, 4, [](int row) {
                 std::vector<double> out{0.05 * (row + 1)};
                 for (int k = 0; k < 121; ++k) {
                   const double x = 1e-3 * (k % 11 - 5), y = 1e-3 * (k / 11 - 5),
                                depth = 5e-5 * (row + 1) - (x * x + y * y) / 8e-2;
                   out.insert(out.end(), {0, 0, 100 * std::max(depth, 0.0)});
                 }
                 return out;
               }));
  const Outcome outcome =
      run(folder, {"calibrate", "p.csv", "--sensor", "skin.xml", "--ball", "0.04"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("without friction: mu = 0.5 adds "));
  EXPECT_THAT(outcome.out, ::testing::ContainsRegex("x_zero .m. is [^ ]+ larger"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("zero [m] changes")));
}

/// A fit that leaves much of the forces says so: points in another order, and a field of one value.
TEST(CalibrateField, AFieldInAnotherOrderIsNamed) {
  const Folder folder;
  folder.write("skin.xml",
               "<sensor unit=\"m-kg\">" + film_array("skin", "modulus=\"1e5\"/>") + "</sensor>");
  const auto err = [&](const std::string& text) {
    folder.write("p.csv", text);
    const Outcome outcome =
        run(folder, {"calibrate", "p.csv", "--sensor", "skin.xml", "--ball", "0.004"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, Not(HasSubstr("without friction")));
    return outcome.err;
  };
  EXPECT_THAT(err(shifted_press(0)), Not(HasSubstr("the fit leaves")));
  EXPECT_THAT(err(shifted_press(20)), HasSubstr("of the forces' root mean square; expected 15 %"));
  std::string row;
  for (int k = 0; k < 64; ++k) row += ",1e-3";
  EXPECT_THAT(err(field_table("pressure", 64, "0.2" + row + "\n0.3" + row + "\n")),
              HasSubstr("points in another order than the layout's (rows and columns), units"));
}

TEST(CalibrateField, WhatIsWrongWithAFieldIsNamed) {
  const Folder folder;
  folder.write("skin.xml",
               "<sensor unit=\"m-kg\">" + film_array("skin", "modulus=\"1e5\"/>") + "</sensor>");
  const auto err = [&](const std::string& text, const Words& more) {
    folder.write("p.csv", text);
    const Outcome outcome =
        run(folder, Words{"calibrate", "p.csv", "--sensor", "skin.xml", "--ball", "0.004"} + more);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    return outcome.err;
  };
  EXPECT_THAT(
      err(field_table("pressure", 63), {}),
      HasSubstr("p.csv:1: 63 columns 'pressure/0' to 'pressure/62'; expected 64, a pressing "
                "force for each point of 'skin', or 192, with those along axis0 and axis1 "
                "before it"));
  std::string gap = field_table("pressure", 64);
  gap.replace(gap.find("pressure/7,"), 10, "other_colum");
  EXPECT_THAT(err(gap, {}), HasSubstr("p.csv:1: no column 'pressure/7' before 'pressure/8'"));
  std::string nan = field_table("pressure", 64);
  nan.replace(nan.find("0.1,1e-3") + 4, 4, "nan");
  EXPECT_THAT(err(nan, {}), HasSubstr("p.csv:2: column 2: 'nan'; expected a finite number"));
  EXPECT_THAT(err(field_table("pressure", 64, "0.2,1\n"), {}),
              HasSubstr("p.csv:3: 2 columns; expected 65, as in the header"));
  EXPECT_THAT(err(field_table("taxel", 64), {}), HasSubstr("no column 'force' among depth_mm, "));
  EXPECT_THAT(err(field_table("taxel", 64), {"--column", "field=pad"}),
              HasSubstr("p.csv:1: no column 'pad/0' among depth_mm, "));
  EXPECT_THAT(err(field_table("pressure", 64), {"--column", "depth=z"}),
              HasSubstr("p.csv:1: no column 'z' among depth_mm, "));
  EXPECT_THAT(err(field_table("pressure", 64), {"--column", "depth"}),
              HasSubstr("--column 'depth'; expected NAME=COLUMN or NAME=FACTOR*COLUMN"));
  EXPECT_THAT(err(field_table("pressure", 64), {"--column", "depth=mm*depth_mm"}),
              HasSubstr("expected NAME=COLUMN or NAME=FACTOR*COLUMN"));
  for (const char* const factor : {"nan", "inf", "0"})
    EXPECT_THAT(err(field_table("pressure", 64),
                    {"--column", std::string("depth=") + factor + "*depth_mm"}),
                HasSubstr("expected a finite one other than 0"));
  EXPECT_THAT(err(field_table("pressure", 64),
                  {"--column", "depth=0.001*depth_mm", "--column", "depth=depth_mm"}),
              HasSubstr("--column 'depth=0.001*depth_mm' and --column 'depth=depth_mm'; expected "
                        "one column for depth"));
  EXPECT_THAT(err(field_table("taxel", 64, "", "_mN"), {}),
              HasSubstr("; the field 'taxel/0_mN' is read by --column field=0.001*taxel"));
  EXPECT_THAT(err(field_table("pressure", 64), {"--column", "force=depth_mm"}),
              HasSubstr("--column force=…; expected one of field, time, depth"));
  EXPECT_THAT(err(field_table("pressure", 64), {"--fit", "force_zero"}),
              HasSubstr("'force_zero' cannot be fitted; expected some of modulus, zero"));
  // A unit behind the number is left to the factor.
  folder.write("p.csv", field_table("taxel", 64, "", "_mN"));
  EXPECT_EQ(run(folder, {"calibrate", "p.csv", "--sensor", "skin.xml", "--ball", "0.004",
                         "--column", "field=0.001*taxel", "--fit", "modulus"})
                .exit_code,
            0);
  // A field in mN is named with what it would be.
  folder.write("p.csv", field_table("taxel", 64));
  const Outcome outcome = run(folder, {"calibrate", "p.csv", "--sensor", "skin.xml", "--ball",
                                       "0.004", "--column", "field=1e5*taxel", "--fit", "modulus"});
  EXPECT_THAT(outcome.err, HasSubstr("if forces are in mN: name the field with --column "
                                     "field=0.001*NAME"));
}

/// Hints take the unit that a column has, and say in which line the value stands.
TEST(CalibrateField, HintsFollowTheUnitOfAColumn) {
  const Folder folder;
  folder.write("skin.xml", layout("modulus=\"2e5\" thickness=\"4e-3\" mu=\"0\""));
  const auto err = [&](const std::string& text) {
    folder.write("p.csv", text);
    return run(folder, {"calibrate", "p.csv", "--sensor", "skin.xml", "--ball", "0.004"}).err;
  };
  const std::string deep = err("depth_mm,force\n100,0.1\n800,1\n");
  EXPECT_THAT(deep, HasSubstr("p.csv: line 3: a depth of 0.8 m in a skin"));
  EXPECT_THAT(deep, HasSubstr("0.0008 if the column, which is named mm, is in um"));
  EXPECT_THAT(deep, Not(HasSubstr("name it depth_mm")));
  EXPECT_THAT(err("depth,force\n0.1,0.1\n0.8,1\n"), HasSubstr("name it depth_mm"));
  EXPECT_THAT(err("depth_m,force\n1e-7,0.1\n8e-7,1\n"), Not(HasSubstr("name it depth_m")));
  EXPECT_THAT(err("depth_mm,force\n1e-4,0.1\n8e-4,1\n"), HasSubstr("name it depth_m"));
  EXPECT_THAT(err("time_ms,depth,force\n0,0,0\n0.01,1e-4,1\n0.02,2e-4,3\n"),
              HasSubstr("the times are in s: name the column time_s"));
  EXPECT_THAT(err("depth_mm,force_mN\n0.2,2e5\n0.4,8e5\n"),
              HasSubstr("if forces are 1000 times too large, in uN"));
}

/// Where nothing of a layout is fitted, no layout is written, and the exit code says so.
TEST(CalibrateField, ALayoutThatWouldNotChangeIsNotWritten) {
  const Folder folder;
  folder.write(
      "press.csv", table("time,depth,force", 41, [](int k) {
        const double d = 1e-5 * (k <= 20 ? k : 40 - k);  // of a film that does not relax
        return std::vector<double>{1e-3 * k, d, kPoints * 2.3 * 1e5 / kThickness * kArea * d};
      }));
  folder.write("skin.xml", layout("modulus=\"1e5\" thickness=\"4e-3\" relaxation=\"0.02\""));
  const Words words = {"calibrate", "press.csv", "--sensor", "skin.xml",
                       "--flat",    "0.0035",    "-o",       "out.xml"};
  const Outcome untold = run(folder, words + Words{"--fit", "relaxation"});
  EXPECT_EQ(untold.exit_code, 1) << untold.out;
  EXPECT_THAT(untold.err,
              HasSubstr("press.csv: nothing of the layout could be fitted (relaxation: the rates "
                        "of the recording do not show it); out.xml is not written"));
  EXPECT_FALSE(std::filesystem::exists(folder.path("out.xml")));
  const Outcome zero = run(folder, words + Words{"--fit", "zero"});
  EXPECT_EQ(zero.exit_code, 2) << zero.out;
  EXPECT_THAT(zero.err, HasSubstr("--output beside --fit zero, which no layout has"));
  folder.write("skin.xml", layout("pressure=\"0 1e4\" pressure_depth=\"0 1e-3\""));
  const Outcome stays = run(folder, words);
  EXPECT_EQ(stays.exit_code, 2) << stays.out;
  EXPECT_THAT(stays.err, HasSubstr("--output with skin.xml, whose table of pressures stays"));
}

}  // namespace
}  // namespace tangere::apps
