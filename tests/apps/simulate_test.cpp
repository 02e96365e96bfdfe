// SPDX-License-Identifier: Apache-2.0
// Tests what `simulate` and `plot` write: the requested run, and the same bytes for the same
// request.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/model/model.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/apps/arrays.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// Runs `tangere simulate SCENE --output out.h5 --json MORE` and returns its object.
json simulate(const Folder& folder, const std::string& scene_file, const Words& more,
              int exit_code = 0) {
  return run_json(folder, Words{"simulate", scene_file, "--output", "out.h5"} + more, exit_code);
}

const std::string kSmall = scene("rolling_ball_small.xml");

Array read_array(const Folder& folder, const std::string& name) {
  return array_of(folder.path("out.h5"), name);
}

/// The small scene without its <control>.
std::string without_control(const Folder& folder) {
  std::string text = file_bytes(kSmall);
  const std::size_t begin = text.find("<control>"), end = text.find("</control>");
  text.erase(begin, end + 10 - begin);
  return folder.write("free.xml", text);
}

std::string rows(int count, const std::string& row) {
  std::string text;
  for (int i = 0; i < count; ++i) text += row + "\n";
  return text;
}

/// The loss is computed from the fields beside it. A control's derivative matches two runs whose
/// tables differ in that control.
TEST(Simulate, WritesGradientsBesideTheTrajectory) {
  const Folder folder;
  const auto table = [&](double first) {
    std::string text;
    for (int t = 0; t < 90; ++t)
      text += (t == 5 ? std::to_string(first) : std::string("0.05")) + ",0,0.2\n";
    return folder.write("u.csv", text);
  };
  const auto shear_loss = [&](int environment) {
    const Array force = read_array(folder, "/tactile/pad/force");  // (F, E, rows, cols, 3)
    const std::size_t field = force.dims[2] * force.dims[3] * 3;
    double sum = 0;
    for (std::size_t f = 0; f < force.dims[0]; ++f)
      for (std::size_t i = 0; i < field; ++i)
        if (i % 3 != 2) {
          const double x = force.values[(f * force.dims[1] + std::size_t(environment)) * field + i];
          sum += 0.5 * x * x;
        }
    return sum;
  };
  const Words words{"--envs", "2",           "--overwrite", "--tol",
                    "1e-12",  "--gradients", "shear",       "--controls"};
  const auto loss_at = [&](double first) {
    Words all = words;
    all.push_back(table(first));
    const json answer = simulate(folder, kSmall, all);
    EXPECT_EQ(answer.at("gradients").at("loss_name"), "shear");
    return shear_loss(1);
  };
  const double ahead = loss_at(0.0501), behind = loss_at(0.0499), middle = loss_at(0.05);
  const Array loss = read_array(folder, "/gradients/loss"),
              by_u = read_array(folder, "/gradients/grad_u");
  EXPECT_NEAR(loss.values[1], middle, 1e-12 * middle);
  EXPECT_EQ(by_u.dims, (h5::Dims{2, 90, 3}));
  const double derivative = by_u.values[(90 + 5) * 3];
  EXPECT_NE(derivative, 0);
  EXPECT_NEAR((ahead - behind) / 2e-4, derivative, 1e-3 * std::abs(derivative));
  EXPECT_EQ(read_array(folder, "/gradients/grad_q").dims, (h5::Dims{2, 9}));
  EXPECT_EQ(read_array(folder, "/gradients/grad_v").dims, (h5::Dims{2, 9}));
  const Array by_numbers = read_array(folder, "/gradients/grad_numbers");
  const h5::Id file = h5::open_file(folder.path("out.h5"));
  const auto names = h5::read_texts(h5::open_dataset(file, "/gradients/grad_numbers"), "names");
  EXPECT_EQ(by_numbers.dims, (h5::Dims{2, names.size()}));
  EXPECT_THAT(names, testing::Contains("tactile pad kn"));
}

/// The sensor's coefficients act on all of its points, so their derivatives are sums over points.
TEST(Simulate, WritesGradientsOfTactilePoints) {
  const Folder folder;
  simulate(
      folder, kSmall,
      {"--envs", "2", "--steps", "90", "--gradients", "shear", "--point-gradients", "--overwrite"});
  const Array points = read_array(folder, "/gradients/grad_points/pad"),
              numbers = read_array(folder, "/gradients/grad_numbers");
  const h5::Id file = h5::open_file(folder.path("out.h5"));
  const auto names = h5::read_texts(h5::open_dataset(file, "/gradients/grad_numbers"), "names");
  const h5::Id of_pad = h5::open_dataset(file, "/gradients/grad_points/pad");
  const auto own = h5::read_texts(of_pad, "names"), units = h5::read_texts(of_pad, "units");
  EXPECT_EQ(own, (std::vector<std::string>{"x", "y", "z", "kn", "kt", "mu", "damping"}));
  EXPECT_EQ(units, (std::vector<std::string>{"m", "m", "m", "N/m", "N s/m", "1", "N s/m^2"}));
  ASSERT_EQ(points.dims.size(), 3U);
  EXPECT_EQ(points.dims[0], 2U);
  EXPECT_EQ(points.dims[2], own.size());
  for (std::size_t e = 0; e < 2; ++e)
    for (const std::string coefficient : {"kn", "kt", "mu"}) {
      const auto column = std::size_t(std::find(own.begin(), own.end(), coefficient) - own.begin());
      const auto whole = std::size_t(
          std::find(names.begin(), names.end(), "tactile pad " + coefficient) - names.begin());
      ASSERT_LT(column, own.size());
      ASSERT_LT(whole, names.size());
      double sum = 0, size = 0;
      for (std::size_t k = 0; k < points.dims[1]; ++k) {
        const double x = points.values[(e * points.dims[1] + k) * points.dims[2] + column];
        sum += x, size += std::abs(x);
      }
      EXPECT_GT(size, 0) << coefficient;
      EXPECT_NEAR(numbers.values[e * names.size() + whole], sum, 1e-12 * size) << coefficient;
    }
  const Outcome refused = run(folder, {"simulate", kSmall, "-o", "none.h5", "--point-gradients"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err,
              testing::HasSubstr("--point-gradients without --gradients; expected both"));
  const Outcome blind = run(folder, {"simulate", kSmall, "-o", "none.h5", "--steps", "5",
                                     "--gradients", "final", "--point-gradients"});
  EXPECT_EQ(blind.exit_code, 2);
  EXPECT_THAT(blind.err,
              testing::HasSubstr(
                  "--point-gradients with --gradients final; expected a loss that reads fields"));
}

TEST(Simulate, TapeMemoryChangesNoGradient) {
  const Folder folder;
  const Words words{"--envs", "3", "--steps", "120", "--gradients", "shear", "--overwrite"};
  const auto with = [&](const char* memory) {
    Words all = words;
    if (memory != nullptr) all.insert(all.end(), {"--tape-memory", memory});
    return simulate(folder, kSmall, all).at("gradients").at("recomputed_steps").get<int>();
  };
  const std::vector<std::string> names{"loss", "grad_u", "grad_q", "grad_v", "grad_numbers"};
  EXPECT_EQ(with(nullptr), 0);
  std::vector<std::vector<double>> stored;
  for (const std::string& name : names)
    stored.push_back(read_array(folder, "/gradients/" + name).values);
  for (const char* memory : {"200kB", "0.2MiB"}) {
    EXPECT_EQ(with(memory), 120);
    for (std::size_t k = 0; k < names.size(); ++k)
      EXPECT_EQ(read_array(folder, "/gradients/" + names[k]).values, stored[k]);
  }
  const std::vector<std::pair<const char*, const char*>> wrong{
      {"2", "expected a positive number and its unit"},
      {"-2GB", "as in 2GiB"},
      {"0GB", "as in 2GiB"},
      {"1gb", "as in 2GiB"},
      {"30kB", "expected at least"}};
  for (const auto& [memory, message] : wrong) {
    Words all{"simulate", kSmall,        "-o",    "none.h5",       "--steps",
              "120",      "--gradients", "shear", "--tape-memory", memory};
    const Outcome outcome = run(folder, all);
    EXPECT_EQ(outcome.exit_code, 2) << memory;
    EXPECT_THAT(outcome.err, HasSubstr(message));
  }
  const Outcome alone = run(folder, {"simulate", kSmall, "-o", "none.h5", "--tape-memory", "2GiB"});
  EXPECT_EQ(alone.exit_code, 2);
  EXPECT_THAT(alone.err, HasSubstr("without --gradients"));
}

TEST(Simulate, SaysWhatItDid) {
  const Folder folder;
  const json answer =
      simulate(folder, kSmall, {"--envs", "3", "--every", "4", "--steps", "42", "--seed", "9"});
  EXPECT_EQ(answer.at("steps"), 42);
  EXPECT_EQ(answer.at("environments"), 3);
  EXPECT_EQ(answer.at("environment_steps"), 126);
  EXPECT_EQ(answer.at("seed"), 9);
  EXPECT_EQ(answer.at("timestep"), 5e-3);
  EXPECT_EQ(answer.at("integrator"), "BDF2");
  EXPECT_EQ(answer.at("tolerance"),
            Model(read_scene(kSmall).scene).following_tolerance(Integrator::bdf2, 5e-3));
  EXPECT_EQ(answer.at("precision"), "double");
  EXPECT_EQ(answer.at("output"), "out.h5");
  EXPECT_EQ(answer.at("bytes"), std::filesystem::file_size(folder.path("out.h5")));
  EXPECT_THAT(answer.at("failed"), IsEmpty());
  EXPECT_EQ(answer.at("sensors"),
            json::parse(R"([{"name": "pad", "form": "field", "every": 4, "frames": 10}])"));
  EXPECT_GT(answer.at("environment_steps_per_second"), 0);
  EXPECT_GE(answer.at("newton_iterations_per_step"), 1);
  EXPECT_THAT(folder.files(), ElementsAre("out.h5"));
  EXPECT_EQ(read_array(folder, "/q").dims, (h5::Dims{43, 3, 10}));
}

TEST(Simulate, WritesEndEffectorsBesideTheBodies) {
  const Folder folder;
  std::string text = file_bytes(kSmall);
  const std::string marks =
      R"(<variable><endeffector name="mark" joint="pad_joint" pos="0.01 0 -0.005"/></variable>)";
  folder.write("marked.xml", text.insert(text.find("<sensor>"), marks));
  simulate(folder, "marked.xml", {"--envs", "3", "--steps", "20"});
  const Array mark = read_array(folder, "/variables/position"),
              pose = read_array(folder, "/bodies/pose");
  ASSERT_EQ(mark.dims, (h5::Dims{21, 3, 1, 3}));
  ASSERT_EQ(pose.dims, (h5::Dims{21, 3, 2, 7}));
  const double offset[] = {0.01, 0, -0.005};
  for (std::size_t row = 0; row < 63; ++row)
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(mark.values[3 * row + c], pose.values[14 * row + c] + offset[c], 1e-15);
  EXPECT_LT(mark.values[62 * 3 + 2], mark.values[2] - 1e-4) << "the pad does not sink: no test";
}

TEST(Simulate, RunsWithGradientsAreSolvedTighter) {
  const Folder folder;
  EXPECT_EQ(simulate(folder, kSmall, {"--steps", "5", "--gradients", "path"}).at("tolerance"),
            1e-9);
  EXPECT_EQ(simulate(folder, kSmall,
                     {"--steps", "5", "--gradients", "path", "--tol", "1e-6", "--overwrite"})
                .at("tolerance"),
            1e-6);
}

TEST(Simulate, ARunThatGoesOnWithAnotherToleranceIsTold) {
  const Folder folder;
  simulate(folder, kSmall, {"--steps", "5", "--tol", "1e-6"});
  const Words onward{"simulate", kSmall, "--state-from", "out.h5", "--steps", "5", "-o", "on.h5"};
  const Outcome other = run(folder, onward);
  EXPECT_EQ(other.exit_code, 0);
  EXPECT_THAT(other.err, HasSubstr("out.h5 was solved to 1e-06"));
  const Outcome same = run(folder, onward + Words{"--tol", "1e-6", "--overwrite"});
  EXPECT_EQ(same.err.find("was solved to"), std::string::npos) << same.err;
}

TEST(Simulate, SolverOptionsReachTheStepper) {
  const Folder folder;
  const json answer =
      simulate(folder, kSmall,
               {"--timestep", "0.01", "--integrator", "SDIRK2", "--tol", "1e-7", "--steps", "3"});
  EXPECT_EQ(answer.at("timestep"), 0.01);
  EXPECT_EQ(answer.at("integrator"), "SDIRK2");
  EXPECT_EQ(answer.at("tolerance"), 1e-7);
}

TEST(Simulate, SameRequestSameBytes) {
  const Folder first, second;
  simulate(first, kSmall, {"--envs", "5", "--seed", "3"});
  simulate(second, kSmall, {"--envs", "5", "--seed", "3"});
  EXPECT_EQ(first.read("out.h5"), second.read("out.h5"));
  const auto start = read_array(first, "/q");
  simulate(second, kSmall, {"--envs", "5", "--seed", "4", "--overwrite"});
  EXPECT_NE(start.values, read_array(second, "/q").values);
}

TEST(Simulate, StepsComeFromWhatDrivesIt) {
  const Folder folder;
  EXPECT_EQ(simulate(folder, kSmall, {}).at("steps"), 350);  // its piecewise control ends at 1.75 s
  EXPECT_EQ(simulate(folder, kSmall, {"--timestep", "0.01", "--overwrite"}).at("steps"), 175);
  EXPECT_EQ(simulate(folder, kSmall, {"--steps", "7", "--overwrite"}).at("steps"), 7);
  folder.write("u.csv", rows(12, "0,0,0.2"));
  EXPECT_EQ(simulate(folder, kSmall, {"--controls", "u.csv", "--overwrite"}).at("steps"), 12);
  EXPECT_EQ(
      simulate(folder, kSmall, {"--controls", "u.csv", "--steps", "5", "--overwrite"}).at("steps"),
      5);
  const json open = simulate(folder, without_control(folder), {"--overwrite"}, 2);
  EXPECT_THAT(open.at("error").get<std::string>(), HasSubstr("give --steps"));
}

TEST(Simulate, ZeroControlsAreNoControls) {
  const Folder folder;
  const std::string free = without_control(folder);
  simulate(folder, free, {"--steps", "100", "--envs", "2"});
  const Array without = read_array(folder, "/q");
  folder.write("zero.csv", "# nothing\na,b,c\n" + rows(100, "0, 0.0, -0"));
  simulate(folder, free, {"--controls", "zero.csv", "--envs", "2", "--overwrite"});
  EXPECT_EQ(read_array(folder, "/q").values, without.values);
  for (const double u : read_array(folder, "/u").values) EXPECT_EQ(u, 0);
  simulate(folder, kSmall, {"--steps", "100", "--envs", "2", "--overwrite"});
  EXPECT_NE(read_array(folder, "/q").values, without.values);
}

TEST(Simulate, SaysThatNothingDrivesIt) {
  const Folder folder;
  const Words words{"simulate", without_control(folder), "--output", "out.h5", "--steps", "2"};
  EXPECT_THAT(run(folder, words).err, HasSubstr("every control is 0"));
}

TEST(Simulate, ControlFilesMustFit) {
  const Folder folder;
  const auto complaint = [&](const std::string& text, const Words& more = {}) {
    folder.write("u.csv", text);
    Words words{"--controls", "u.csv"};
    words.insert(words.end(), more.begin(), more.end());
    return simulate(folder, kSmall, words, 2).at("error").get<std::string>();
  };
  EXPECT_EQ(complaint("0,0,0\n0,nan,0\n"), "u.csv:2: column 2: 'nan'; expected a finite number");
  EXPECT_EQ(complaint("0,0,0\n0,0\n"), "u.csv:2: 2 columns; expected 3, one per control");
  EXPECT_EQ(complaint(rows(5, "0,0,0"), {"--steps", "6"}),
            "u.csv: 5 rows of controls for 6 steps; expected a row per step");
  EXPECT_EQ(complaint("pad_joint.vy,pad_joint.vx,pad_joint.vz\n0,0,0\n"),
            "u.csv:1: column 1 is headed 'pad_joint.vy'; expected 'pad_joint.vx' there: columns "
            "follow the motors' order");
  EXPECT_EQ(complaint(""), "u.csv: no rows of numbers; expected at least one");
  EXPECT_THAT(folder.files(), ElementsAre("u.csv"));
}

TEST(Simulate, ControlsAreNotOverwritten) {
  const Folder folder;
  folder.write("u.csv", rows(5, "0,0,0"));
  const Outcome outcome =
      run(folder, {"simulate", kSmall, "--controls", "u.csv", "-o", "u.csv", "--overwrite"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(folder.read("u.csv"), rows(5, "0,0,0"));
}

TEST(Simulate, AnOutputThatExistsIsKept) {
  const Folder folder;
  folder.write("out.h5", "mine");
  EXPECT_THAT(simulate(folder, kSmall, {}, 3).at("error").get<std::string>(),
              HasSubstr("--overwrite"));
  EXPECT_EQ(folder.read("out.h5"), "mine");
  simulate(folder, kSmall, {"--overwrite", "--steps", "4"});
  EXPECT_EQ(read_array(folder, "/q").dims[0], 5U);
}

TEST(Simulate, FailedEnvironmentsAreListedAndTheFileIsWhole) {
  // A step of one day has no solution: the ball would turn by more than a rotation can express.
  const Folder folder;
  const json answer =
      simulate(folder, kSmall, {"--timestep", "86400", "--steps", "3", "--envs", "25"}, 1);
  ASSERT_THAT(answer.at("failed"), testing::SizeIs(25));
  const json& first = answer.at("failed").at(0);
  EXPECT_EQ(first.at("environment"), 0);
  EXPECT_EQ(first.at("step"), 0);
  EXPECT_LT(first.at("status"), 0);
  EXPECT_FALSE(first.at("reason").get<std::string>().empty());
  EXPECT_EQ(answer.at("environment_steps"), 25);
  const Array status = read_array(folder, "/solver/status");
  EXPECT_EQ(status.dims, (h5::Dims{3, 25}));
  for (const double s : status.values) EXPECT_LT(s, 0);

  const Outcome text = run(folder, {"simulate", kSmall, "-o", "out.h5", "--overwrite", "--timestep",
                                    "86400", "--steps", "3", "--envs", "25", "--quiet"});
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.err, HasSubstr("environment 0 failed in step 0: "));
  EXPECT_THAT(text.err, HasSubstr("not listed: 5"));
}

class Continued : public ::testing::TestWithParam<std::string> {};

TEST_P(Continued, GoesOnBitForBit) {
  const Folder whole, parts;
  const Words common{"--integrator", GetParam(), "--every", "4", "--envs", "19", "--seed", "7"};
  const auto with = [&](Words more) {
    more.insert(more.end(), common.begin(), common.end());
    return more;
  };
  simulate(whole, kSmall, with({"--steps", "90"}));
  simulate(parts, kSmall, with({"--steps", "60"}));
  std::filesystem::rename(parts.path("out.h5"), parts.path("first.h5"));
  const json answer = simulate(parts, kSmall,
                               {"--integrator", GetParam(), "--every", "4", "--steps", "40",
                                "--state-from", "first.h5", "--row", "50"});
  EXPECT_EQ(answer.at("first_step"), 50);
  EXPECT_EQ(answer.at("environments"), 19);
  EXPECT_EQ(answer.at("seed"), 7);
  for (const std::string name : {"/q", "/v", "/time", "/bodies/pose"})
    EXPECT_EQ(read_array(parts, name).values, rows_from(read_array(whole, name), 50)) << name;
  for (const std::string name : {"/u", "/solver/iterations", "/solver/residual", "/solver/status"})
    EXPECT_EQ(read_array(parts, name).values, rows_from(read_array(whole, name), 50)) << name;
  // Fields after steps 52, 56 … 88: the last ten of 22.
  EXPECT_EQ(read_array(parts, "/tactile/pad/force").values,
            rows_from(read_array(whole, "/tactile/pad/force"), 12));
  EXPECT_EQ(read_array(parts, "/tactile/pad/step").values.front(), 2);
  // Continues a continued run, by default from its last row.
  std::filesystem::rename(parts.path("out.h5"), parts.path("second.h5"));
  simulate(whole, kSmall, with({"--steps", "95", "--overwrite"}));
  const json third = simulate(
      parts, kSmall,
      {"--integrator", GetParam(), "--every", "4", "--steps", "5", "--state-from", "second.h5"});
  EXPECT_EQ(third.at("first_step"), 90);
  EXPECT_EQ(read_array(parts, "/q").values, rows_from(read_array(whole, "/q"), 90));
}
INSTANTIATE_TEST_SUITE_P(Schemes, Continued, ::testing::Values("BDF1", "BDF2", "SDIRK2", "SDIRK3"),
                         [](const auto& scheme) { return scheme.param.substr(0, 6); });

TEST(Continue, SaysWhatDoesNotFit) {
  const Folder folder;
  simulate(folder, kSmall, {"--steps", "20", "--envs", "2"});
  std::filesystem::rename(folder.path("out.h5"), folder.path("first.h5"));
  const auto complaint = [&](const Words& more, int exit_code = 2) {
    return simulate(folder, kSmall, more, exit_code).at("error").get<std::string>();
  };
  EXPECT_EQ(complaint({"--state-from", "first.h5", "--row", "21"}),
            "row 21 of first.h5; expected 0 to 20");
  EXPECT_EQ(complaint({"--state-from", "first.h5", "--envs", "3"}),
            "3 environments; first.h5 has 2");
  EXPECT_EQ(complaint({"--row", "2"}), "--row without --state-from; expected both");
  EXPECT_THAT(complaint({"--state-from", "none.h5"}, 3), HasSubstr("none.h5"));
  folder.write("text.h5", "no HDF5");
  EXPECT_THAT(complaint({"--state-from", "text.h5"}, 3), HasSubstr("text.h5"));
  folder.write("u.csv", rows(25, "0,0,0.2"));
  EXPECT_EQ(complaint({"--state-from", "first.h5", "--controls", "u.csv", "--steps", "6"}),
            "u.csv: 25 rows of controls for 26 steps; expected a row per step");
  EXPECT_EQ(
      simulate(folder, kSmall, {"--state-from", "first.h5", "--controls", "u.csv"}).at("steps"), 5);
  const Outcome other =
      run(folder, {"simulate", kSmall, "-o", "out.h5", "--overwrite", "--state-from", "first.h5",
                   "--timestep", "0.01", "--seed", "3", "--steps", "2"});
  EXPECT_THAT(other.err, HasSubstr("starts anew"));
  EXPECT_THAT(other.err, HasSubstr("seed 0"));
  EXPECT_EQ(read_array(folder, "/time").values, (std::vector<double>{0, 0.01, 0.02}));
}

TEST(Continue, AFailedEnvironmentStaysFailed) {
  const Folder folder;
  simulate(folder, kSmall, {"--timestep", "86400", "--steps", "3", "--envs", "2"}, 1);
  std::filesystem::rename(folder.path("out.h5"), folder.path("first.h5"));
  const json answer = simulate(
      folder, kSmall, {"--timestep", "86400", "--steps", "2", "--state-from", "first.h5"}, 1);
  EXPECT_EQ(answer.at("environment_steps"), 0);
  ASSERT_THAT(answer.at("failed"), testing::SizeIs(2));
  EXPECT_EQ(answer.at("failed").at(1).at("step"), -1);
}

TEST(Plot, DrawsWhatSimulateWrote) {
  const Folder folder;
  simulate(folder, kSmall, {"--envs", "2"});
  const Outcome outcome =
      run(folder, {"plot", "out.h5", "-o", "out.svg", "--sensor", "pad", "--env", "1", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json answer = json::parse(outcome.out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  EXPECT_EQ(answer.at("sensor"), "pad");
  EXPECT_EQ(answer.at("sensors"), json({"pad"}));
  EXPECT_THAT(outcome.err, Not(HasSubstr("can be drawn")));
  EXPECT_EQ(answer.at("environment"), 1);
  EXPECT_TRUE(answer.at("frame").is_null());
  const std::string svg = folder.read("out.svg");
  EXPECT_EQ(answer.at("bytes"), svg.size());
  EXPECT_THAT(svg, HasSubstr("<svg"));
  EXPECT_EQ(run(folder, {"plot", "out.h5", "-o", "one.svg", "--frame", "60"}).exit_code, 0);
  EXPECT_NE(folder.read("one.svg"), svg);
}

TEST(Plot, ListsTheSensorsOfTheFile) {
  const Folder folder;
  std::string text = file_bytes(kSmall);
  const std::size_t at = text.find("<tactile name=\"pad\""), end = text.find("/>", at) + 2;
  std::string second = text.substr(at, end - at);
  second.replace(second.find("pad"), 3, "twin");
  folder.write("two.xml", text.insert(end, second));
  simulate(folder, "two.xml", {"--steps", "5", "--every", "5"});
  const Outcome first = run(folder, {"plot", "out.h5", "-o", "first.svg", "--json"});
  const json answer = json::parse(first.out);
  EXPECT_EQ(answer.at("sensor"), "pad");
  EXPECT_EQ(answer.at("sensors"), json({"pad", "twin"}));
  EXPECT_THAT(first.err, HasSubstr("sensors that can be drawn: pad, twin"));
  const Outcome twin =
      run(folder, {"plot", "out.h5", "-o", "twin.svg", "--sensor", "twin", "--json"});
  EXPECT_EQ(json::parse(twin.out).at("sensor"), "twin");
  EXPECT_THAT(folder.read("twin.svg"), HasSubstr("sensor 'twin'"));
}

TEST(Plot, NamesWhatIsNotThere) {
  const Folder folder;
  simulate(folder, kSmall, {"--steps", "20"});
  const auto complaint = [&](const Words& more, int exit_code) {
    Words words{"plot", "out.h5", "-o", "out.svg"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
    return outcome.err;
  };
  EXPECT_THAT(complaint({"--sensor", "pda"}, 2), HasSubstr("pad"));
  EXPECT_THAT(complaint({"--env", "1"}, 2), HasSubstr("environment 1"));
  EXPECT_THAT(complaint({"--frame", "4"}, 2), HasSubstr("frame 4"));
  EXPECT_THAT(folder.files(), ElementsAre("out.h5"));
  folder.write("out.svg", "mine");
  EXPECT_THAT(complaint({}, 3), HasSubstr("--overwrite"));
  EXPECT_EQ(folder.read("out.svg"), "mine");
  const Outcome same = run(folder, {"plot", "out.h5", "-o", "out.h5", "--overwrite"});
  EXPECT_EQ(same.exit_code, 2);
}

TEST(Plot, ASceneWithoutSensorsHasNoPicture) {
  const Folder folder;
  folder.write("bare.xml",
               "<tangere model=\"bare\"><option unit=\"m-kg\"/>"
               "<robot><link name=\"a\"><joint name=\"a\" type=\"prismatic\" axis=\"0 0 1\"/>"
               "<body name=\"a\" type=\"sphere\" radius=\"0.1\"/></link></robot></tangere>");
  simulate(folder, "bare.xml", {"--steps", "3"});
  const Outcome outcome = run(folder, {"plot", "out.h5", "-o", "out.svg"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("no tactile field"));
  EXPECT_THAT(folder.files(), ElementsAre("bare.xml", "out.h5"));
}

TEST(Simulate, RunsShorterThanASensorsIntervalHaveNoField) {
  const Folder folder;
  const json answer = simulate(folder, kSmall, {"--steps", "3", "--every", "1000000000"});
  EXPECT_EQ(answer.at("sensors").at(0).at("frames"), 0);
  const Outcome text = run(folder, {"simulate", kSmall, "--steps", "3", "-o", "again.h5"});
  EXPECT_EQ(text.err, "sensor pad is read every 5 steps: no field in 3 steps\n");
  EXPECT_EQ(run(folder, {"plot", "out.h5", "-o", "out.svg"}).exit_code, 2);
  EXPECT_THAT(folder.files(), ElementsAre("again.h5", "out.h5"));
}

/// The books of every step stand beside the trajectory, and change nothing of it.
TEST(Simulate, AuditsEnergyAndMomentum) {
  const Folder folder;
  const Words words{"--envs", "3", "--steps", "90", "--record", "bodies"};
  const json plain = simulate(folder, kSmall, words);
  EXPECT_EQ(plain.at("audit"), nullptr);
  {
    const h5::Id file = h5::open_file(folder.path("out.h5"));
    EXPECT_FALSE(h5::has_link(file, "audit"));
  }
  const Array q = read_array(folder, "/q");
  const json audited = simulate(folder, kSmall, words + Words{"--audit", "--overwrite"});
  EXPECT_EQ(read_array(folder, "/q").values, q.values);
  const Array energy = read_array(folder, "/audit/energy"),
              step = read_array(folder, "/audit/step"),
              momentum = read_array(folder, "/audit/momentum");
  EXPECT_THAT(energy.dims, ElementsAre(91, 3, 3));
  EXPECT_THAT(momentum.dims, ElementsAre(91, 3, 6));
  ASSERT_THAT(step.dims, ElementsAre(90, 3, 3));
  double sums[3] = {};
  for (std::size_t e = 0; e < 3; ++e) {
    double changed = 0, passed = 0;
    for (std::size_t k = 0; k < 3; ++k)
      changed += energy.values[(90 * 3 + e) * 3 + k] - energy.values[e * 3 + k];
    for (std::size_t t = 0; t < 90; ++t) {
      const double* of = &step.values[(t * 3 + e) * 3];
      for (std::size_t k = 0; k < 3; ++k) sums[k] += of[k];
      passed += of[0] - of[1] + of[2];
    }
    EXPECT_NEAR(changed, passed, 1e-12) << e;
  }
  const json& audit = audited.at("audit");
  EXPECT_NEAR(audit.at("motors"), sums[0], 1e-12);
  EXPECT_NEAR(audit.at("taken"), sums[1], 1e-12);
  EXPECT_NEAR(audit.at("made"), sums[2], 1e-12);
  EXPECT_LT(audit.at("motors"), 0) << "the motor holds the pad while it sinks";
  EXPECT_GT(audit.at("taken"), 0);
  const double share = audit.at("worst_share");
  EXPECT_TRUE(share > 0 && share < 0.2) << share;
}

/// Of all that may be said of a run, these are for people, on stderr, and for programs.
TEST(Simulate, WarnsOfTouchesThatAreTooShortAndOfCostlySteps) {
  const Folder folder;
  const Outcome rebound = run(folder, {"simulate", scene("hard/rebound.xml"), "--output", "a.h5",
                                       "--steps", "3", "--integrator", "SDIRK2"});
  EXPECT_THAT(rebound.err, HasSubstr("warning: the contact of 'ball' with 'ground' has no damping, "
                                     "and a touch lasts 0.0031 s"));
  const json usual = simulate(folder, kSmall, {"--steps", "100"});
  EXPECT_EQ(usual.at("costly"), nullptr);
  const json tumbling =
      simulate(folder, scene("hard/tumbling.xml"), {"--steps", "20", "--overwrite"});
  EXPECT_THAT(tumbling.at("costly").get<std::string>(), HasSubstr("steps are costly: "));
  EXPECT_THAT(tumbling.at("costly").get<std::string>(), HasSubstr("or bodies turn far in it"));
}

}  // namespace
}  // namespace tangere::apps
