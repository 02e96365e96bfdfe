// SPDX-License-Identifier: Apache-2.0
// Tests `tangere identify` as a user runs it: a trial, a recording from a file, and messages for
// mistakes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Words kAll = {"--number", "tactile pad kn", "--number", "tactile pad kt",
                    "--number", "tactile pad mu", "--number", "body ball density"};

TEST(Identify, ATrialFindsTheTrueNumbersAndDraws) {
  const Folder folder;
  const nlohmann::json found =
      run_json(folder, Words{"identify", scene("identify_ball.xml"), "--noise", "0.02", "--seed",
                             "4", "--svg", "fit.svg"} +
                           kAll);
  EXPECT_TRUE(found["converged"]);
  EXPECT_LT(found["gradient_difference"].get<double>(), 1e-5);
  EXPECT_NEAR(found["noise"].get<double>() / found["peak"].get<double>(), 0.02, 0.002);
  ASSERT_EQ(found["numbers"].size(), 4U);
  for (const nlohmann::json& number : found["numbers"]) {
    const double truth = number["true"], error = std::log(number["found"].get<double>() / truth);
    EXPECT_NE(number["start"].get<double>(), truth) << number;
    EXPECT_LT(std::abs(error), 5 * number["deviation"].get<double>()) << number;
    EXPECT_LT(std::abs(error), 0.01) << number;
  }
  EXPECT_EQ(found["numbers"][0]["unit"], "N/m");
  EXPECT_THAT(folder.files(), ElementsAre("fit.svg"));
  EXPECT_THAT(folder.read("fit.svg"), HasSubstr("Force on the sensors"));
}

/// What simulate writes is a recording. The fit starts from other numbers, in a scene of its own.
class Recorded : public ::testing::Test {
 protected:
  void SetUp() override {
    const Outcome r =
        run(folder, {"simulate", scene("identify_ball.xml"), "-o", "recording.h5", "--envs", "2"});
    ASSERT_EQ(r.exit_code, 0) << r.err;
    text = folder.read(scene("identify_ball.xml"));
  }
  /// Writes the scene with words replaced.
  void guess(const std::string& old, const std::string& replacement) {
    std::string changed = text;
    const std::size_t at = changed.find(old);
    ASSERT_NE(at, std::string::npos);
    folder.write("guess.xml", changed.replace(at, old.size(), replacement));
  }
  [[nodiscard]] Outcome identify(const Words& more) const {
    return run(folder, Words{"identify", "guess.xml", "recording.h5"} + more);
  }
  Folder folder;
  std::string text;
};

TEST_F(Recorded, NumbersAreFoundFromAnotherStart) {
  guess("<tactile kn=\"6\" kt=\"0.3\" mu=\"0.5\"", "<tactile kn=\"4\" kt=\"0.5\" mu=\"0.7\"");
  const nlohmann::json found =
      run_json(folder, {"identify", "guess.xml", "recording.h5", "--number", "tactile pad kn",
                        "--number", "tactile pad kt", "--number", "tactile pad mu", "--env", "1"});
  const double truth[] = {6, 0.3, 0.5}, start[] = {4, 0.5, 0.7};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_DOUBLE_EQ(found["numbers"][k]["start"], start[k]);
    EXPECT_NEAR(found["numbers"][k]["found"], truth[k], 1e-4 * truth[k]);
    EXPECT_FALSE(found["numbers"][k].contains("true"));
  }
  EXPECT_LT(found["noise"].get<double>(), 1e-4 * found["peak"].get<double>());
}

TEST_F(Recorded, AnotherModelFailsAndIsNamed) {
  guess("<joint name=\"pad_joint\" type=\"translational\" pos=\"0 0 0.0452\" damping=\"0.3\"",
        "<joint name=\"pad_joint\" type=\"translational\" pos=\"0 0 0.0452\" damping=\"0.27\"");
  const Outcome r = identify({"--number", "tactile pad kn", "--starts", "1", "--json"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_THAT(r.err, AllOf(HasSubstr("what is left is not independent noise"),
                           HasSubstr("another 'joint pad_joint damping'")));
  const nlohmann::json found = nlohmann::json::parse(r.out);
  EXPECT_THAT(undocumented_keys(found), ::testing::IsEmpty());
  EXPECT_EQ(found["passed"], false);
  EXPECT_EQ(found["converged"], true);
  EXPECT_EQ(found["residual"]["suspect"], "joint pad_joint damping");
  EXPECT_EQ(found["starts"].size(), 1U);
  EXPECT_EQ(found["correlations"].size(), 1U);
}

TEST_F(Recorded, ARecordingThatDoesNotFitIsRefused) {
  const Words kn = {"--number", "tactile pad kn"};
  const auto refused = [&](const char* old, const char* replacement, const char* words) {
    guess(old, replacement);
    const Outcome r = identify(kn);
    EXPECT_EQ(r.exit_code, 2) << r.err;
    EXPECT_THAT(r.err, HasSubstr(words));
  };
  refused("resolution=\"40 40\"", "resolution=\"40 20\"", "1600 points; expected 800");
  refused("every=\"2\"", "every=\"4\"", "every 2 steps; expected every 4");
  refused("timestep=\"2e-3\"", "timestep=\"1e-3\"", "steps of 0.002 s; expected 0.001 s");
  refused("tactile name=\"pad\"", "tactile name=\"skin\"", "no sensor is named 'skin'");
  refused(
      "<actuator>",
      "<randomize><tactile name=\"pad\" field=\"mu\" uniform=\"0.4 0.6\"/></randomize><actuator>",
      "<randomize> with a recording");
  guess("kn=\"6\"", "kn=\"5\"");
  EXPECT_THAT(identify(Words{"--env", "2"} + kn).err, HasSubstr("environments 0 to 1"));
  EXPECT_THAT(identify(Words{"--seed", "2"} + kn).err, HasSubstr("with a recording"));
}

TEST_F(Recorded, ARecordingOfALaterPartIsRefused) {
  ASSERT_EQ(run(folder, {"simulate", scene("identify_ball.xml"), "-o", "later.h5", "--state-from",
                         "recording.h5", "--steps", "10"})
                .exit_code,
            0);
  const Outcome r = run(
      folder, {"identify", scene("identify_ball.xml"), "later.h5", "--number", "tactile pad kn"});
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_THAT(r.err, HasSubstr("expected a recording that begins where the scene does"));
}

TEST_F(Recorded, PartsOfFieldsAreRefused) {
  const auto refused = [&](const char* record, const char* words) {
    ASSERT_EQ(run(folder, {"simulate", scene("identify_ball.xml"), "-o", "part.h5", "--overwrite",
                           "--record", record})
                  .exit_code,
              0);
    const Outcome r = run(
        folder, {"identify", scene("identify_ball.xml"), "part.h5", "--number", "tactile pad kn"});
    EXPECT_EQ(r.exit_code, 2);
    EXPECT_THAT(r.err, HasSubstr(words));
  };
  refused("pad/final", "sensor 'pad'");
  refused("pad.pressure", "expected whole fields");
}

TEST(Identify, SaysWhatIsWrong) {
  const Folder folder;
  const auto fails = [&](std::vector<std::string> arguments, int code, const char* words) {
    arguments.insert(arguments.begin(), "identify");
    const Outcome r = run(folder, std::move(arguments));
    EXPECT_EQ(r.exit_code, code) << r.err;
    EXPECT_THAT(r.err, HasSubstr(words));
  };
  const std::string ball = scene("identify_ball.xml");
  fails({"gone.xml", "--number", "tactile pad kn"}, 3, "gone.xml");
  fails({ball}, 2, "--number is missing");
  fails({ball, "--number", "tactile pad kn", "--number", "tactile pad kn"}, 2, "is given twice");
  fails({ball, "gone.h5", "--number", "tactile pad kn"}, 3, "gone.h5");
  fails({ball, "--number", "tactile pad k"}, 2, "no number 'tactile pad k'");
  fails({ball, "--number", "tactile pad kn", "--noise", "-1"}, 2, "--noise");
  fails({ball, "--number", "tactile pad kn", "--env", "1"}, 2, "--env without a recording");
  folder.write("fit.svg", "mine");
  fails({ball, "--number", "tactile pad kn", "--svg", "fit.svg"}, 3, "fit.svg");
  EXPECT_EQ(folder.read("fit.svg"), "mine");
}

}  // namespace
}  // namespace tangere::apps
