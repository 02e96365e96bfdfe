// SPDX-License-Identifier: Apache-2.0
// Tests of every subcommand: help with an example that works, one JSON object, exit codes by kind
// of mistake, messages with the nearest word, no half-written files.
#include <gmock/gmock.h>

#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "kernels/table/kernel_table.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"
#include "tests/sanitized.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// `tangere simulate small.xml --output out.h5` and more.
Words simulate(const Words& more = {}) {
  return Words{"simulate", scene("rolling_ball_small.xml"), "--output", "out.h5"} + more;
}

/// The last line of a help text, as words, without "tangere".
Words example_of(const std::string& help) {
  std::istringstream line(help.substr(help.find("Example:\n  tangere ") + 19));
  Words words;
  for (std::string word; line >> std::quoted(word, '\'');) words.push_back(word);
  return words;
}

TEST(Command, HelpEndsWithAnExampleThatWorks) {
  const Folder folder;
  std::filesystem::create_directory_symlink(TANGERE_SOURCE_DIR "/scenes", folder.path("scenes"));
  folder.write("gripper.urdf", file_bytes(TANGERE_SOURCE_DIR "/examples/grasp/gripper.urdf"));
  folder.write("press.csv", "depth_mm,force_N\n0.5,1.65\n1,5.96\n1.5,13.5\n2,23.3\n");
  for (const std::string& name : subcommands()) {
    const Outcome help = run(folder, {name, "--help"});
    EXPECT_EQ(help.exit_code, 0) << name;
    EXPECT_THAT(help.err, IsEmpty());
    ASSERT_THAT(help.out, HasSubstr("Example:\n  tangere " + name + " "));
    if (name == "accuracy" || (kSanitized && name == "bench")) continue;  // long runs
    const Words example = example_of(help.out);
    const Outcome outcome = run(folder, example);
    EXPECT_EQ(outcome.exit_code, 0) << help.out << outcome.err;
  }
  std::vector<std::string> files = {
      "ball.h5",        "ball.html", "ball.svg",     "balls",       "balls.csv",
      "balls.csv.json", "fit.svg",   "gripper.urdf", "gripper.xml", "my_gel_measured.xml",
      "press.csv",      "scenes",    "speed.svg"};
  if (kSanitized) files.pop_back();  // of `bench`
  EXPECT_THAT(folder.files(), testing::ElementsAreArray(files));
}

TEST(Command, EveryBodyTypeIsInspectedSimulatedAndDrawn) {
  const Folder folder;
  const std::string shapes = TANGERE_SOURCE_DIR "/tests/data/scenes/shapes.xml";
  const Outcome inspected = run(folder, {"inspect", shapes});
  EXPECT_EQ(inspected.exit_code, 0) << inspected.err;
  for (const char* name :
       {"cuboid", "cylinder", "capsule", "ellipsoid", "plane", "mesh", "abstract"})
    EXPECT_THAT(inspected.out, HasSubstr(name));
  const Outcome simulated = run(folder, {"simulate", shapes, "-o", "s.h5", "--json"});
  EXPECT_EQ(simulated.exit_code, 0) << simulated.err;
  EXPECT_EQ(run(folder, {"plot", "s.h5", "-o", "s.svg"}).exit_code, 0);
}

/// E = 0.2 MPa, 3 mm: per mm² 2.3 E/t = 153 N/m. A ball of 6 mm pressed in by 1.5 mm has χ = 1.
TEST(Command, ASkinOfRubberHasItsCoefficients) {
  const Folder folder;
  Words words{"skin", "--modulus",       "2e5",  "--thickness", "3e-3", "--pitch",
              "1e-3", "--contact-pitch", "2e-3", "--json"};
  const Outcome outcome = run(folder, words);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const json answer = json::parse(outcome.out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  const json &tactile = answer.at("tactile"), &contact = answer.at("contact");
  const double kn = 2.3 * 2e5 / 3e-3 * 1e-6, ks = 0.4 * kn;
  EXPECT_NEAR(tactile.at("ks").get<double>(), ks, 1e-9 * ks);
  EXPECT_NEAR(tactile.at("kn").get<double>(), kn, 1e-9 * kn);
  EXPECT_NEAR(tactile.at("kt").get<double>(), ks * 5e-3, 1e-9 * ks);
  EXPECT_NEAR(tactile.at("damping").get<double>(), kn * 5e-3 / 3e-4, 1e-9 * kn);
  EXPECT_EQ(tactile.at("mu"), 0.6);
  for (const char* name : {"kn", "kt", "damping", "ks"})
    EXPECT_NEAR(contact.at(name).get<double>(), 4 * tactile.at(name).get<double>(),
                1e-9 * contact.at(name).get<double>())
        << name;
  words.insert(words.end(), {"--radius", "6e-3", "--press", "1.5e-3"});
  const json pressed = json::parse(run(folder, words).out);
  EXPECT_NEAR(pressed.at("stiffness_ratio").get<double>(), 2.425, 0.005);
  EXPECT_NEAR(pressed.at("tactile").at("kn").get<double>(),
              pressed.at("stiffness_ratio").get<double>() / 2.3 * kn, 1e-9 * kn);
}

TEST(Command, TopLevelHelpNamesEverySubcommandAndExitCode) {
  const Folder folder;
  const Outcome help = run(folder, {"--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(subcommands(), testing::SizeIs(17));
  for (const char* code : {"0 done", "1 finished", "2 usage", "3 input", "75 ", "130 "})
    EXPECT_THAT(help.out, HasSubstr(code));
}

TEST(Command, VersionNamesInstructionSetAndCompiler) {
  const Folder folder;
  const std::string last = kernels::available_kernels().back()->name;
  const Outcome version = run(folder, {"--version"}, {"TANGERE_ISA=" + last});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.out,
              testing::MatchesRegex("tangere [0-9.]+ \\(" + last + ", (GCC|Clang) .*\\)\n"));
}

struct Mistake {
  const char* name;
  Words arguments;
  int exit_code;
  const char* message;  ///< part of it
};

void PrintTo(const Mistake& mistake, std::ostream* out) { *out << mistake.name; }

class Mistakes : public testing::TestWithParam<Mistake> {};

TEST_P(Mistakes, SaysWhoseFaultItIsAndLeavesNothing) {
  const Mistake& mistake = GetParam();
  const Folder folder;
  const Outcome text = run(folder, mistake.arguments);
  EXPECT_EQ(text.exit_code, mistake.exit_code) << text.err;
  EXPECT_THAT(text.err, HasSubstr(mistake.message));
  EXPECT_EQ(text.err.rfind("tangere: ", 0), 0U) << text.err;
  EXPECT_THAT(text.out, IsEmpty());

  const Outcome object = run(folder, mistake.arguments + Words{"--json"});
  EXPECT_EQ(object.exit_code, mistake.exit_code);
  const json answer = json::parse(object.out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  EXPECT_EQ(answer.at("exit_code"), mistake.exit_code);
  EXPECT_THAT(answer.at("error").get<std::string>(), HasSubstr(mistake.message));
  EXPECT_THAT(folder.files(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    Usage, Mistakes,
    testing::Values(
        Mistake{"subcommand",
                {"simualte", "x"},
                2,
                "unknown subcommand 'simualte'; did you mean 'simulate'?"},
        Mistake{
            "far_off",
            {"qqqqqqqqq"},
            2,
            "expected one of inspect, import, simulate, generate, validate, info, merge, export, "
            "plot, view, bench"},
        Mistake{"top_option",
                {"--verison"},
                2,
                "unknown option '--verison'; did you mean '--version'?"},
        Mistake{"option", simulate({"--stesp", "3"}), 2,
                "unknown option '--stesp'; did you mean '--steps'?"},
        Mistake{"option_of_what_is_required",
                {"simulate", "x.xml", "--ouput", "x.h5"},
                2,
                "did you mean '--output'?"},
        Mistake{"no_scene", {"inspect"}, 2, "SCENE is required; see 'tangere inspect --help'"},
        Mistake{"no_output", {"simulate", "x.xml"}, 2, "--output is required"},
        Mistake{"two_scenes", {"inspect", "x.xml", "y.xml"}, 2, "unexpected argument 'y.xml'"},
        Mistake{"empty_scene", {"inspect", ""}, 2, "SCENE: expected text, found none"},
        Mistake{
            "empty_output", {"simulate", "x.xml", "--output", ""}, 2, "--output: expected text"},
        Mistake{"empty_controls", simulate({"--controls", ""}), 2, "--controls: expected text"},
        Mistake{"no_value", simulate({"--steps"}), 2, "--steps"},
        Mistake{"twice", simulate({"--steps", "1", "--steps", "2"}), 2, "--steps"},
        Mistake{"quiet_and_verbose", simulate({"-q", "-v"}), 2, "excludes"},
        Mistake{"steps_0", simulate({"--steps", "0"}), 2,
                "--steps 0: expected a whole number from 1"},
        Mistake{"steps_float", simulate({"--steps", "1e3"}), 2,
                "--steps 1e3: expected a whole number"},
        Mistake{"envs_0", simulate({"--envs", "0"}), 2, "--envs 0: expected a whole number from 1"},
        Mistake{"envs_negative", simulate({"--envs", "-4"}), 2, "--envs -4: expected"},
        Mistake{"envs_huge", simulate({"--envs", "99999999999999999999"}), 2,
                "--envs 99999999999999999999: expected"},
        Mistake{"every_0", simulate({"--every", "0"}), 2, "--every 0: expected"},
        Mistake{"seed", simulate({"--seed", "-1"}), 2,
                "--seed -1: expected a whole number from 0 to 18446744073709551615"},
        Mistake{"timestep_nan", simulate({"--timestep", "nan"}), 2,
                "--timestep nan: expected a positive number"},
        Mistake{"timestep_0", simulate({"--timestep", "0"}), 2, "--timestep 0: expected"},
        Mistake{"timestep_word", simulate({"--timestep", "5ms"}), 2, "--timestep 5ms: expected"},
        Mistake{"tol", simulate({"--tol", "inf"}), 2, "--tol inf: expected"},
        Mistake{"integrator", simulate({"--integrator", "BDF3"}), 2,
                "unknown integrator 'BDF3'; did you mean 'BDF1'?"},
        Mistake{"precision", simulate({"--precision", "single"}), 2,
                "unknown precision 'single'; expected one of double, mixed"},
        Mistake{"strip_and_frame",
                {"plot", "x.h5", "-o", "x.svg", "--strip", "2", "--frame", "1"},
                2,
                "excludes"}),
    [](const auto& test) { return test.param.name; });

INSTANTIATE_TEST_SUITE_P(
    Size, Mistakes,
    testing::Values(
        Mistake{"memory", simulate({"--envs", "1000000000"}), 2, "--envs 1000000000 needs "},
        Mistake{"fit",
                {"identify", scene("identify_ball.xml"), "--number", "tactile pad kn", "--steps",
                 "1000000000000"},
                2,
                "a fit of 1000000000000 steps needs "},
        Mistake{"gradients",
                {"gradcheck", scene("rolling_ball_small.xml"), "--steps", "1000000000000"},
                2,
                "gradients of 1000000000000 steps needs "},
        Mistake{"disk", simulate({"--steps", "1000000000000"}), 3, "bytes"},
        Mistake{"beyond_any_disk", simulate({"--timestep", "1e-300"}), 2, "2^63 bytes"}),
    [](const auto& test) { return test.param.name; });

INSTANTIATE_TEST_SUITE_P(
    Files, Mistakes,
    testing::Values(
        Mistake{"scene_missing", {"inspect", "nowhere.xml"}, 3, "nowhere.xml"},
        Mistake{"scene_folder", {"inspect", "."}, 3, "folder"},
        Mistake{"scene_no_xml", {"inspect", scene("../LICENSE")}, 2, "LICENSE"},
        Mistake{"output_folder_missing",
                {"simulate", scene("rolling_ball_small.xml"), "-o", "no/out.h5"},
                3,
                "no"},
        Mistake{
            "output_is_folder", {"simulate", scene("rolling_ball_small.xml"), "-o", "/"}, 3, "/"},
        Mistake{"output_unwritable",
                {"simulate", scene("rolling_ball_small.xml"), "-o", "/proc/out.h5"},
                3,
                "/proc/out.h5"},
        Mistake{"output_is_scene",
                {"simulate", scene("rolling_ball_small.xml"), "--overwrite", "-o",
                 scene("rolling_ball_small.xml")},
                2,
                "expected another file"},
        Mistake{"controls_missing", simulate({"--controls", "nowhere.csv"}), 3, "nowhere.csv"},
        Mistake{"controls_endless", simulate({"--controls", "/dev/zero"}), 3,
                "/dev/zero: is a device; expected a csv file"},
        Mistake{"controls_of_the_kernel", simulate({"--controls", "/proc/kmsg"}), 3,
                "/proc/kmsg: is a file of the kernel; expected a csv file"},
        Mistake{"plot_missing", {"plot", "nowhere.h5", "-o", "x.svg"}, 3, "nowhere.h5"},
        Mistake{"plot_no_trajectory", {"plot", scene("README.md"), "-o", "x.svg"}, 3, "README.md"},
        Mistake{"plot_scene_of_a_sensor",
                {"plot", scene("rolling_ball_small.xml"), "-o", "x.svg", "--sensor", "pad"},
                2,
                "with a scene; expected a trajectory"},
        Mistake{"plot_fields_from_a_side",
                {"plot", "run.h5", "-o", "x.svg", "--turn", "5"},
                2,
                "expected a scene, F.xml"}),
    [](const auto& test) { return test.param.name; });

/// A name that would clear a terminal, turn a line around and make a picture that is no XML.
TEST(Command, NamesReachNoTerminalAndNoPictureAsTheyAre) {
  const Folder folder;
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  const std::string name = "\"pad\"", hostile = "\"pad&#27;[2J&#x202E;&#xFFFE;\"";
  for (std::size_t at = text.find(name); at != std::string::npos;
       at = text.find(name, at + hostile.size()))
    text.replace(at, name.size(), hostile);
  folder.write("s.xml", text);
  for (const Words& words :
       {Words{"inspect", "s.xml"}, Words{"inspect", "s.xml", "--json"},
        Words{"simulate", "s.xml", "-o", "run.h5", "--steps", "10", "--json"},
        Words{"plot", "run.h5", "-o", "run.svg", "--json"},
        Words{"view", "run.h5", "-o", "run.html"},
        Words{"generate", "s.xml", "-o", "set", "--episodes", "1", "--steps", "5", "--every", "5"},
        Words{"info", "set"}}) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 0) << words.front() << outcome.err;
    for (const char* const character : {"\x1b", "\u202e", "\uFFFE"})
      EXPECT_EQ((outcome.out + outcome.err).find(character), std::string::npos) << words.front();
  }
  EXPECT_THAT(run(folder, {"info", "set"}).out, HasSubstr("pad\\u001b[2J\\u202e\\ufffe"));
  for (const char* const file : {"run.svg", "run.html"})
    for (const char* const character : {"\x1b", "\u202e", "\uFFFE"})
      EXPECT_EQ(folder.read(file).find(character), std::string::npos) << file;
}

TEST(Command, ASceneIsDrawnAtItsStart) {
  const Folder folder;
  const Outcome drawn =
      run(folder, {"plot", scene("box_pushing.xml"), "-o", "box.svg", "--turn", "-40", "--json"});
  EXPECT_EQ(drawn.exit_code, 0) << drawn.err;
  const json answer = json::parse(drawn.out);
  EXPECT_EQ(answer.at("turn"), -40);
  EXPECT_EQ(answer.at("lift"), 25);
  EXPECT_EQ(answer.at("bytes"), folder.read("box.svg").size());
  EXPECT_THAT(folder.read("box.svg"), HasSubstr("</svg>"));
}

TEST(Command, NothingToDoIsAMistake) {
  const Folder folder;
  const Outcome outcome = run(folder, {});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.err, "tangere: no subcommand given; see 'tangere --help'\n");
  EXPECT_THAT(outcome.out, IsEmpty());
}

TEST(Command, SceneErrorsNameTheLine) {
  const Folder folder;
  folder.write("bad.xml", "<tangere model=\"bad\">\n  <option timestep=\"nan\"/>\n</tangere>\n");
  for (const Words& words :
       {Words{"inspect", "bad.xml"}, Words{"simulate", "bad.xml", "-o", "x.h5"}}) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("bad.xml:2"));
  }
  EXPECT_THAT(folder.files(), testing::ElementsAre("bad.xml"));
}

TEST(Command, UnknownElementsMayBeAllowed) {
  const Folder folder;
  std::string text =
      "<tangere model=\"odd\"><option unit=\"m-kg\" colour=\"red\"/>"
      "<robot><link name=\"a\"><joint name=\"a\" type=\"prismatic\" axis=\"0 0 1\"/>"
      "<body name=\"a\" type=\"sphere\" radius=\"0.1\"/></link></robot></tangere>";
  folder.write("odd.xml", text);
  const Outcome strict = run(folder, {"inspect", "odd.xml"});
  EXPECT_EQ(strict.exit_code, 2);
  EXPECT_THAT(strict.err, HasSubstr("colour"));
  const Outcome lenient = run(folder, {"inspect", "odd.xml", "--allow-unknown"});
  EXPECT_EQ(lenient.exit_code, 0);
  EXPECT_THAT(lenient.err, testing::AllOf(HasSubstr("warning: "), HasSubstr("colour")));
  EXPECT_THAT(run(folder, {"inspect", "odd.xml", "--allow-unknown", "-q"}).err, IsEmpty());
}

/// What a published scene leaves over is told with its line, whatever the command.
TEST(Command, WarningsOfASceneGoToStderr) {
  const Folder folder;
  const std::string finger = std::string(TANGERE_TEST_DATA) + "/scenes/dialect_finger.xml";
  for (const Words& words :
       {Words{"inspect", finger, "--json"}, Words{"simulate", finger, "--steps", "2", "-o", "x.h5"},
        Words{"bench", finger, "--envs", "1", "--steps", "2", "--repeat", "1"},
        Words{"gradcheck", finger, "--steps", "2", "--entries", "1"},
        Words{"generate", finger, "-o", "set", "--episodes", "1", "--steps", "2"}}) {
    const Outcome outcome = run(folder, words);
    EXPECT_THAT(outcome.err,
                testing::AllOf(HasSubstr("warning: " + finger +
                                         ":19: <body>: attribute 'damping' has no effect here"),
                               HasSubstr("touches with all its 6 vertices")))
        << words[0];
    if (words[0] != "inspect") continue;
    const json answer = json::parse(outcome.out);
    EXPECT_THAT(undocumented_keys(answer), IsEmpty());
    EXPECT_EQ(answer.at("motors").at(0).at("turning_range").at(1), 0.03);
    EXPECT_EQ(answer.at("contacts").at(2).at("law"), "published");
    EXPECT_THAT(outcome.err, HasSubstr("palm (turning): force, u from -1 to 1 is -0.03 to 0.03"));
  }
}

/// A plate of half a cell is lost between the nodes of a grid, a thick one is not.
TEST(Command, AMeshThatItsGridLosesIsWarnedOf) {
  const Folder folder;
  const auto plate = [&](const std::string& half) {
    std::string text;
    for (const char* z : {"-", ""})
      for (const char* corner : {"-1 -1 ", "1 -1 ", "1 1 ", "-1 1 "})
        text += std::string("v ") + corner + z + half + "\n";
    folder.write("plate.obj", text +
                                  "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\n"
                                  "f 4 1 5 8\n");
  };
  folder.write("plate.xml", R"(<tangere><option unit="m-kg"/><robot><link name="box">
<joint name="box" type="free3d" pos="0 0 2"/><body name="box" type="cuboid" )"
                            R"(size="0.2 0.2 0.2" density="1"/></link></robot>
<robot><link name="plate"><joint name="plate" type="fixed"/>
<body name="plate" type="mesh" filename="plate.obj" transform_type="OBJ_TO_JOINT" )"
                            R"(resolution="16" density="1"/>
</link></robot><contact><general_primitive_contact general_body="box" primitive_body="plate"/>)"
                            R"(</contact>
</tangere>)");
  plate("0.03");
  for (const Words& words :
       {Words{"inspect", "plate.xml"},
        Words{"simulate", "plate.xml", "--steps", "1", "-o", "plate.h5"},
        Words{"generate", "plate.xml", "--episodes", "1", "--steps", "1", "-o", "set"}}) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("warning: body 'plate': cells of 0.125 m do not resolve "));
  }
  plate("0.5");
  const Outcome thick = run(folder, {"inspect", "plate.xml", "--json"});
  EXPECT_THAT(thick.err, Not(HasSubstr("warning: ")));
  const json mesh = json::parse(thick.out).at("meshes").at(0);
  EXPECT_EQ(mesh.at("body"), "plate");
  EXPECT_EQ(mesh.at("cells"), (json{24, 24, 16}));
  EXPECT_EQ(mesh.at("cell"), 0.125);
  // Quads along z, a bound for each, and a bound of the bending for each block of 4 x 4 x 4 cells.
  EXPECT_EQ(mesh.at("bytes"), 27 * 27 * 16 * (4 + 1) * 4 + 6 * 6 * 4 * 4);
  EXPECT_GT(mesh.at("error"), 0);
  EXPECT_LT(mesh.at("error"), 0.1 * 0.125);
  EXPECT_LT(mesh.at("unresolved"), 0.1);
}

TEST(Command, InspectTellsPeopleAndProgramsTheSame) {
  const Folder folder;
  const Outcome text = run(folder, {"inspect", scene("rolling_ball.xml")});
  const Outcome object = run(folder, {"inspect", scene("rolling_ball.xml"), "--json"});
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_EQ(object.exit_code, 0);
  EXPECT_EQ(text.out, object.err);
  const json answer = json::parse(object.out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  EXPECT_EQ(answer.at("command"), "inspect");
  EXPECT_EQ(answer.at("exit_code"), 0);
  EXPECT_EQ(answer.at("v_names").size(), 9U);
  EXPECT_EQ(answer.at("q_names").size(), 10U);
  EXPECT_EQ(answer.at("u_names").size(), 3U);
  EXPECT_EQ(answer.at("steps"), 350);
  EXPECT_EQ(answer.at("control"), "piecewise");
  const json& pad = answer.at("bodies").at(0);
  EXPECT_EQ(pad.at("name"), "pad");
  EXPECT_EQ(pad.at("joint_type"), "translational");
  EXPECT_EQ(pad.at("parent"), "world");
  EXPECT_NEAR(pad.at("mass").get<double>(), 1000 * 0.05 * 0.05 * 0.01, 1e-15);
  const json& sensor = answer.at("sensors").at(0);
  EXPECT_EQ(sensor.at("rows"), 200);
  EXPECT_EQ(sensor.at("cols"), 200);
  EXPECT_EQ(sensor.at("points"), 40'000);
  EXPECT_EQ(sensor.at("every"), 5);
  EXPECT_EQ(sensor.at("pressure_sign"), -1);
  EXPECT_EQ(answer.at("contacts").size(), 2U);
  EXPECT_EQ(answer.at("randomized").size(), 4U);
  EXPECT_GT(answer.at("state_bytes_per_environment"), 0);
  EXPECT_GT(answer.at("workspace_bytes"), 0);
  for (const auto& [name, effect] : answer.at("effects").items()) {
    EXPECT_FALSE(effect.at("why").get<std::string>().empty()) << name;
    if (effect.at("kind") == name) {
      EXPECT_THAT(text.out, HasSubstr(name));
    }
  }
  for (const json& name : answer.at("v_names"))
    EXPECT_THAT(text.out, HasSubstr(name.get<std::string>()));
}

TEST(Command, GradcheckTellsPeopleAndProgramsTheSame) {
  const Folder folder;
  const Words words{
      "gradcheck", scene("rolling_ball_small.xml"), "--loss", "shear", "--steps", "90", "--entries",
      "4"};
  const Outcome text = run(folder, words);
  const Outcome object = run(folder, words + Words{"--json"});
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_EQ(object.exit_code, 0);
  EXPECT_EQ(text.out, object.err);
  const json answer = json::parse(object.out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  EXPECT_EQ(answer.at("command"), "gradcheck");
  EXPECT_EQ(answer.at("loss_name"), "shear");
  EXPECT_EQ(answer.at("steps"), 90);
  EXPECT_EQ(answer.at("inputs").size(), 5U);  // u, q, v, numbers, points
  EXPECT_GT(answer.at("entries"), 8);
  EXPECT_LT(answer.at("max_relative_error"), 1e-5);
  for (const json& input : answer.at("inputs"))
    EXPECT_THAT(text.out, HasSubstr(input.at("input").get<std::string>()));
}

TEST(Command, GradcheckFailsWhereReadingsAreRounded) {
  const Folder folder;
  std::string text = folder.read(scene("identify_ball.xml"));
  const std::string end = "resolution=\"40 40\" every=\"2\"/>";
  const std::size_t at = text.find(end);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, end.size(),
               "resolution=\"8 8\" every=\"2\"><imperfections quantisation=\"1e-3\"/>"
               "</tactile>");
  folder.write("rounded.xml", text);
  const Words words{"gradcheck", "rounded.xml", "--steps", "20", "--entries", "2", "--json"};
  const Outcome failed = run(folder, words);
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_THAT(failed.err, AllOf(HasSubstr("exceeds 0.0001 (--tolerance)"),
                                HasSubstr("readings of sensor 'pad' are multiples of 0.001 N")));
  const json answer = json::parse(failed.out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  EXPECT_EQ(answer.at("exit_code"), 1);
  EXPECT_EQ(answer.at("passed"), false);
  EXPECT_EQ(answer.at("tolerance"), 1e-4);
  EXPECT_GT(answer.at("max_relative_error"), 0.1);
  EXPECT_FALSE(answer.at("reasons").empty());
  const json passed = run_json(
      folder, {"gradcheck", "rounded.xml", "--steps", "20", "--entries", "2", "--tolerance", "2"});
  EXPECT_EQ(passed.at("passed"), true);
  EXPECT_EQ(passed.at("tolerance"), 2);
}

TEST(Command, GradcheckRefusesLossesThatThereAreNot) {
  const Folder folder;
  const Outcome typo =
      run(folder, {"gradcheck", scene("rolling_ball_small.xml"), "--loss", "shaer"});
  EXPECT_EQ(typo.exit_code, 2);
  EXPECT_THAT(typo.err, HasSubstr("unknown loss 'shaer'; did you mean 'shear'?"));
  const Outcome none =
      run(folder, {"gradcheck", scene("rolling_ball_small.xml"), "--loss", "variables"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("no end effector"));
}

TEST(Command, InspectListsJointEffectsAndMotors) {
  const Folder folder;
  const std::string path = TANGERE_TEST_DATA "/scenes/every_joint.xml";
  const Outcome text = run(folder, {"inspect", path});
  const json answer = json::parse(run(folder, {"inspect", path, "--json"}).out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  const json& motors = answer.at("motors");
  ASSERT_EQ(motors.size(), 4U);
  EXPECT_EQ(motors[0].at("control"), "position");
  EXPECT_EQ(motors[1].at("range"), json({nullptr, nullptr}));
  EXPECT_EQ(motors[2].at("timing"), "start");
  EXPECT_EQ(motors[3].at("control"), "force");
  EXPECT_EQ(answer.at("u_units"), json({"rad", "rad", "rad", "rad", "m", "1", "1"}));
  for (const char* line :
       {("  shoulder: damping 1e-06, armature 5e-05, stiffness 0.01 about 0.25, limits -1.5 1.5 of "
         "stiffness 0.2\n"),
        "  puck (sliding): damping 0.007\n", "  puck (turning): damping 7e-07\n",
        "  carriage: position, P 200, D 10, range -10 10, from the start of the step\n",
        "  wrist: position, P 0.01, D 0.0001, no range, from the end of the step\n",
        "  table: force, u from -1 to 1 is -1 to 2\n"})
    EXPECT_THAT(text.out, HasSubstr(line));
}

TEST(Command, InspectListsEndEffectors) {
  const Folder folder;
  const std::string path = TANGERE_TEST_DATA "/scenes/published_dialect_pad.xml";
  const json answer = json::parse(run(folder, {"inspect", path, "--json"}).out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  EXPECT_EQ(answer.at("variables"), json::parse(R"([{"name": "endeffector0", "joint": "rim"}])"));
  EXPECT_THAT(run(folder, {"inspect", path}).out,
              HasSubstr("end effectors (1)\n  endeffector0 on joint rim\n"));
  EXPECT_THAT(run(folder, {"inspect", scene("rolling_ball.xml")}).out,
              Not(HasSubstr("end effectors")));
}

TEST(Command, QuietPrintsErrorsOnly) {
  const Folder folder;
  for (const Words& words :
       {Words{"inspect", scene("rolling_ball_small.xml"), "-q"}, simulate({"--steps", "10", "-q"}),
        Words{"plot", "out.h5", "-o", "out.svg", "--quiet"}}) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.out + outcome.err, IsEmpty()) << words[0];
  }
  EXPECT_THAT(run(folder, simulate({"-q"})).err, HasSubstr("exists"));
}

TEST(Command, NoProgressWhereThereIsNoTerminal) {
  const Folder folder;
  const Outcome outcome = run(folder, simulate());
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, IsEmpty());
  EXPECT_THAT(outcome.out, Not(HasSubstr("\r")));
}

TEST(Command, AFullStdoutIsAnIoError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full on this system";
  const Folder folder;
  const Words words{"inspect", scene("rolling_ball_small.xml")};
  const Outcome outcome = run(folder, words, {}, {"/dev/full", ""});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("stdout"));
}

TEST(Command, InstructionSetCanBeForcedAndMustExist) {
  const Folder folder;
  const Words words{"inspect", scene("rolling_ball_small.xml"), "--json"};
  const std::string last = kernels::available_kernels().back()->name;
  const Outcome forced = run(folder, words, {"TANGERE_ISA=" + last});
  EXPECT_EQ(forced.exit_code, 0);
  EXPECT_EQ(json::parse(forced.out).at("instruction_set"), last);
  const Outcome unknown = run(folder, words, {"TANGERE_ISA=avx1024"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, testing::AllOf(HasSubstr("TANGERE_ISA"), HasSubstr(last)));
}

}  // namespace
}  // namespace tangere::apps
