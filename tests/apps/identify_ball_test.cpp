// SPDX-License-Identifier: Apache-2.0
// Tests the example as a user runs it: a table with four numbers within 1 %, a picture, and
// messages for mistakes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Errors [%] of kn, kt, mu and the mass in the table that the program prints.
std::vector<double> errors(const std::string& output) {
  std::vector<double> out;
  std::istringstream lines(output);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::vector<std::string> w(std::istream_iterator<std::string>(words), {});
    for (const char* name : {"kn", "kt", "mu", "mass"})
      if (w.size() >= 6 && w[0] == name && w[1] != "[N/m]")
        out.push_back(std::stod(w[w.size() - 2]));
  }
  return out;
}

TEST(IdentifyBall, PrintsNumbersWithinOnePercentAndDraws) {
  const Folder folder;
  const Outcome r = run(
      folder, {scene("identify_ball.xml"), "--noise", "0.02", "--seed", "4", "--svg", "fit.svg"});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_THAT(r.out, HasSubstr("condition of the Fisher information"));
  const std::vector<double> e = errors(r.out);
  ASSERT_EQ(e.size(), 4U) << r.out;
  for (double percent : e) EXPECT_LT(std::abs(percent), 1) << r.out;
  EXPECT_THAT(folder.files(), ElementsAre("fit.svg"));
  EXPECT_THAT(folder.read("fit.svg"), HasSubstr("Force on the whole pad"));
}

TEST(IdentifyBall, SaysWhatIsWrong) {
  const Folder folder;
  const auto fails = [&](std::vector<std::string> arguments, int code, const char* words) {
    const Outcome r = run(folder, std::move(arguments));
    EXPECT_EQ(r.exit_code, code);
    EXPECT_THAT(r.err, HasSubstr(words));
  };
  fails({"gone.xml"}, 3, "gone.xml");
  fails({scene("box_pushing.xml")}, 2, "no number 'body ball density'");
  fails({scene("identify_ball.xml"), "--noise", "-1"}, 2, "--noise");
  fails({scene("identify_ball.xml"), "--nois", "1"}, 2, "--nois");
  folder.write("fit.svg", "mine");
  fails({scene("identify_ball.xml"), "--svg", "fit.svg"}, 3, "fit.svg");
  EXPECT_EQ(folder.read("fit.svg"), "mine");
  EXPECT_THAT(run(folder, {"--help"}).out, HasSubstr("Example:"));
}

/// The program never asks kernels::isa_error(): its models do.
TEST(IdentifyBall, RefusesAnInstructionSetThatIsNotThere) {
  const Folder folder;
  const Outcome outcome = run(folder, {scene("identify_ball.xml")}, {"TANGERE_ISA=avx1024"});
  EXPECT_NE(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("TANGERE_ISA=avx1024: an instruction set that"));
}

}  // namespace
}  // namespace tangere::apps
