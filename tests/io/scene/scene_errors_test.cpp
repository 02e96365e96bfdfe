// SPDX-License-Identifier: Apache-2.0
// Tests every message of the scene reader: the line, the value, what was expected, the nearest
// name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/model/model.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using testing::with;

struct Bad {
  std::string what, by;              // replacement in the scene
  std::string line;                  // ":12: " or "" where no line can be told
  std::vector<std::string> message;  // parts of it
};

std::string error_of(const std::string& text) {
  try {
    const Model compiled(
        parse_scene(text, "s.xml").scene);  // some mistakes only show when it is compiled
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

/// A section of one element, which is in line 24.
Bad end_effector(const std::string& element, const std::vector<std::string>& message) {
  return {"<sensor>", "<variable>\n<" + element + "/></variable>\n<sensor>", ":24: ", message};
}

class SceneError : public ::testing::TestWithParam<Bad> {};

TEST_P(SceneError, NamesLineValueAndWhatWasExpected) {
  const Bad& bad = GetParam();
  const std::string message = error_of(with(bad.what, bad.by));
  ASSERT_NE(message, "") << bad.by;
  EXPECT_THAT(message, ::testing::HasSubstr("s.xml" + bad.line));
  for (const std::string& part : bad.message) EXPECT_THAT(message, ::testing::HasSubstr(part));
}

INSTANTIATE_TEST_SUITE_P(
    All, SceneError,
    ::testing::Values(
        Bad{"<tangere model=\"small\">", "<mujoco>", ":", {"not well-formed"}},
        Bad{"integrator=\"BDF2\"", "integrator=\"BDF3\"", ":2: ", {"BDF3", "did you mean", "BDF"}},
        Bad{"timestep=\"5e-3\"", "timestep=\"0\"", ":2: ", {"timestep", "positive"}},
        Bad{"timestep=\"5e-3\"", "timestep=\"-1\"", ":2: ", {"-1", "positive"}},
        Bad{"timestep=\"5e-3\"", "timestep=\"5e-3x\"", ":2: ", {"5e-3x", "finite numbers"}},
        Bad{"timestep=\"5e-3\"", "timestep=\"nan\"", ":2: ", {"finite numbers"}},
        Bad{"timestep=\"5e-3\"", "timestep=\"1e999\"", ":2: ", {"finite numbers"}},
        Bad{"timestep=\"5e-3\"", "timestep=\"\"", ":2: ", {"empty"}},
        Bad{"timestep=\"5e-3\"",
            "timstep=\"5e-3\"",
            ":2: ",
            {"timstep", "did you mean 'timestep'"}},
        Bad{"gravity=\"0 0 -9.8\"", "gravity=\"0 -9.8\"", ":2: ", {"2 numbers", "expected 3"}},
        Bad{"unit=\"m-kg\"", "unit=\"mm-kg\"", ":2: ", {"mm-kg", "did you mean 'm-kg'"}},
        Bad{"max_iter=\"20\"", "max_iter=\"2.5\"", ":3: ", {"2.5", "integer"}},
        Bad{"<solver_option tol=\"1e-9\"", "<solver_option tol=\"0\"", ":3: ", {"positive"}},
        Bad{"normal=\"0 0 1\"", "normal=\"0 0 0\"", ":4: ", {"no direction"}},
        Bad{"<default><tactile kn=\"1\"",
            "<default><tactil kn=\"1\"",
            ":5: ",
            {"tactil", "did you mean 'tactile'"}},
        Bad{"<default><tactile kn=\"1\"",
            "<default><tactile k=\"1\"",
            ":5: ",
            {"unknown attribute 'k'"}},
        Bad{"<default><tactile kn=\"1\"",
            "<default><tactile kn=\"-1\"",
            ":",
            {"kn=\"-1\"", "zero or more", "(from <default>, line 5)"}},
        Bad{"<link name=\"ball\">",
            "<link name=\"pad\">",
            ":11: ",
            {"'pad' is used twice, first in line 7"}},
        Bad{"name=\"ball_joint\" type=\"free3d\"",
            "name=\"pad_joint\" type=\"free3d\"",
            ":12: ",
            {"'pad_joint' is used twice"}},
        Bad{"type=\"translational\"",
            "type=\"translation\"",
            ":8: ",
            {"did you mean 'translational'"}},
        Bad{"damping=\"1\"/>", "damping=\"-1\"/>", ":8: ", {"-1", "zero or more"}},
        Bad{"damping=\"1\"/>",
            "lim=\"1 0\" lim_stiffness=\"5\"/>",
            ":8: ",
            {"lim=\"1 0\"", "low, then high"}},
        Bad{"damping=\"1\"/>", "lim=\"1\" lim_stiffness=\"5\"/>", ":8: ", {"lim", "expected 2"}},
        Bad{"damping=\"1\"/>", "lim_stifness=\"5\"/>", ":8: ", {"did you mean 'lim_stiffness'"}},
        Bad{"damping=\"1\"/>", "stiffness=\"-1\"/>", ":8: ", {"stiffness=\"-1\"", "zero or more"}},
        Bad{"damping=\"1\"/>", "armature=\"-1\"/>", ":8: ", {"armature", "zero or more"}},
        Bad{"damping=\"1\"/>",
            "stiffness=\"1\" rest=\"0 1\"/>",
            ":8: ",
            {"rest has 2", "expected 1 or 3"}},
        Bad{"type=\"free3d\"",
            "type=\"spherical\" stiffness=\"1\" rest=\"3 1 0\"",
            ":12: ",
            {"rest turns by 3.16", "pi"}},
        Bad{"type=\"translational\" pos", "type=\"revolute\" pos", ":8: ", {"'axis' is missing"}},
        Bad{"pos=\"0 0 0.06\"", "pos=\"0 0 0.06\" quat=\"0 0 0 0\"", ":8: ", {"not a rotation"}},
        Bad{"pos=\"0 0 0.06\"",
            "pos=\"0 0 0.06\" frame=\"WOLRD\"",
            ":8: ",
            {"did you mean 'WORLD'"}},
        Bad{"size=\"0.05 0.05 0.01\"", "size=\"0.05 0 0.01\"", ":9: ", {"size=\"0\"", "positive"}},
        Bad{"size=\"0.05 0.05 0.01\"", "size=\"0.05 0.05\"", ":9: ", {"expected 3"}},
        Bad{"general_contact_resolution=\"4 4 2\"",
            "general_contact_resolution=\"4 4 1\"",
            ":9: ",
            {"from 2 to"}},
        Bad{"general_contact_resolution=\"4 4 2\"",
            "general_contact_resolution=\"4 4 1e9\"",
            ":9: ",
            {"from 2 to"}},
        Bad{"density=\"1000\"", "density=\"0\"", ":9: ", {"positive"}},
        Bad{"type=\"sphere\"", "type=\"mesh\"", ":13: ", {"'filename' is missing"}},
        Bad{"type=\"sphere\" radius=\"0.02\"",
            "type=\"abstract\" mass=\"1\" inertia=\"1 1 1\"",
            ":20: ",
            {"'ball' is an abstract body", "no contact points"}},
        Bad{"type=\"sphere\"", "type=\"capsul\"", ":13: ", {"capsul", "did you mean 'capsule'"}},
        Bad{"type=\"sphere\"",
            "type=\"elipsoid\"",
            ":13: ",
            {"elipsoid", "did you mean 'ellipsoid'"}},
        Bad{"type=\"sphere\"", "type=\"capsule\"", ":13: ", {"'length' is missing"}},
        Bad{"type=\"sphere\" radius=\"0.02\"",
            "type=\"cylinder\" length=\"0.1\"",
            ":13: ",
            {"'radius' is missing"}},
        Bad{"type=\"sphere\"", "type=\"cylinder\" length=\"0\"", ":13: ", {"length", "positive"}},
        Bad{"type=\"sphere\"", "type=\"capsule\" length=\"-0.1\"", ":13: ", {"-0.1", "positive"}},
        Bad{"type=\"sphere\"",
            "type=\"cylinder\" length=\"0.1\" general_contact_angle_resolution=\"2\"",
            ":13: ",
            {"general_contact_angle_resolution", "2", "from 3 to 1000"}},
        Bad{"type=\"sphere\"",
            "type=\"cylinder\" length=\"0.1\" general_contact_radius_resolution=\"1.5\"",
            ":13: ",
            {"general_contact_radius_resolution", "1.5", "from 1 to 1000"}},
        Bad{"type=\"sphere\"",
            "type=\"capsule\" length=\"0.1\" general_contact_resolution=\"4 4 4\"",
            ":13: ",
            {"general_contact_resolution", "expected 2"}},
        Bad{"type=\"sphere\"",
            "type=\"capsule\" length=\"0.1\" general_contact_resolution=\"1 4\"",
            ":13: ",
            {"general_contact_resolution", "from 2 to 1000"}},
        Bad{"type=\"sphere\" radius=\"0.02\"",
            "type=\"plane\"",
            ":20: ",
            {"'ball' is a plane", "no contact points"}},
        Bad{"radius=\"0.02\"", "radius=\"-0.02\"", ":13: ", {"positive"}},
        Bad{"radius=\"0.02\" ", "", ":13: ", {"'radius' is missing"}},
        Bad{"<motor joint=\"pad_joint\"",
            "<motor joint=\"pad_jiont\"",
            ":17: ",
            {"did you mean 'pad_joint'"}},
        Bad{"<motor joint=\"pad_joint\"",
            "<motor joint=\"ball_joint\"",
            ":17: ",
            {"forces and torques"}},
        Bad{"ctrl=\"force\"", "ctrl=\"position\"", ":17: ", {"'P' is missing"}},
        Bad{"ctrl=\"force\"", "ctrl=\"position\" P=\"-1\"", ":17: ", {"P=\"-1\"", "zero or more"}},
        Bad{"ctrl=\"force\"", "ctrl=\"positon\"", ":17: ", {"did you mean 'position'"}},
        Bad{"ctrl=\"force\"",
            "ctrl=\"position\" P=\"1\" timing=\"begin\"",
            ":17: ",
            {"begin", "end, start"}},
        Bad{"density=\"1000\"", "mass=\"2\"", ":9: ", {"mass=\"2\"", "expected 0"}},
        Bad{"density=\"1000\"", "mass=\"0\"", ":8: ", {"pad_joint", "nothing that has mass"}},
        Bad{"type=\"translational\"",
            "type=\"fixed\"",
            ":17: ",
            {"'pad_joint' is fixed", "needs a joint that moves"}},
        Bad{"ctrl=\"force\" ctrl_range=\"-1 1\"",
            "ctrl=\"position\" P=\"1\" ctrl_range=\"1 -1\"",
            ":17: ",
            {"low, then high"}},
        Bad{" ctrl_range=\"-1 1\"", "", ":17: ", {"'ctrl_range' is missing"}},
        Bad{"ctrl_range=\"-1 1\"",
            "ctrl_range=\"-1 1\" offset=\"1\"",
            ":17: ",
            {"offset and u_range of a force motor need 'scale'"}},
        Bad{"ctrl_range=\"-1 1\"", "scale=\"0\"", ":17: ", {"scale=\"0\"", "other than 0"}},
        Bad{"ctrl_range=\"-1 1\"",
            "scale=\"1\" u_range=\"2 2\"",
            ":17: ",
            {"u_range=\"2 2\"", "low, then high"}},
        Bad{"ctrl_range=\"-1 1\"/>",
            "ctrl_range=\"-1 1\"/><motor joint=\"pad_joint\" ctrl=\"force\" scale=\"1\"/>",
            ":17: ",
            {"has the name 'pad_joint' already"}},
        Bad{"ctrl=\"force\" ctrl_range=\"-1 1\"/>",
            "ctrl=\"position\" P=\"1\"/><motor joint=\"pad_joint\" ctrl=\"position\" P=\"1\" "
            "name=\"second\"/>",
            ":17: ",
            {"'pad_joint' already has a position motor"}},
        Bad{"<ground_contact body=\"ball\"",
            "<ground_contact body=\"bal\"",
            ":20: ",
            {"did you mean 'ball'"}},
        Bad{"kn=\"5e3\"", "kn=\"-5e3\"", ":20: ", {"zero or more"}},
        Bad{"kn=\"5e3\"",
            "kn=\"5e3\" law=\"cubic\"",
            ":20: ",
            {"cubic", "clamped, paper, linear, published"}},
        Bad{"type=\"cuboid\" size=\"0.05 0.05 0.01\"",
            "type=\"plane\"",
            ":21: ",
            {"'pad' is a plane", "no contact points"}},
        Bad{"primitive_body=\"ball\"", "primitive_body=\"pad\"", ":21: ", {"against itself"}},
        Bad{"type=\"rect_array\"", "type=\"hemisphere\"", ":24: ", {"'count' is missing"}},
        Bad{"type=\"rect_array\"",
            "type=\"hemisphere\" radius=\"0\" count=\"9\"",
            ":24: ",
            {"radius", "positive"}},
        Bad{"type=\"rect_array\"",
            "type=\"mesh\" pitch=\"1\" scale=\"1 0 1\" filename=\"a.obj\"",
            ":24: ",
            {"factors other than 0"}},
        Bad{"type=\"rect_array\"",
            "type=\"hemisphere\" radius=\"1\" count=\"0\"",
            ":24: ",
            {"count", "0", "1"}},
        Bad{"axis1=\"1 0 0\"", "axis1=\"0 1 0\"", ":24: ", {"perpendicular"}},
        Bad{"rect_pos1=\"0.02 -0.02 -0.005\"",
            "rect_pos1=\"0.02 -0.02 -0.002\"",
            ":24: ",
            {"rect_pos1=\"0.02 -0.02 -0.002\" lies 0.003 m outside the plane"}},
        Bad{"resolution=\"5 7\"", "resolution=\"0 7\"", ":24: ", {"from 1 to"}},
        Bad{"resolution=\"5 7\"", "resolution=\"5 7 9\"", ":24: ", {"expected 2"}},
        Bad{"body=\"pad\" type=\"rect",
            "body=\"pda\" type=\"rect",
            ":24: ",
            {"did you mean 'pad'"}},
        Bad{"q=\"0.001 0 0 1 0 0 0\"",
            "q=\"0.001 0 0 0 0 0 0\"",
            ":27: ",
            {"quaternion of zero length"}},
        Bad{"q=\"0.001 0 0 1 0 0 0\"", "q=\"0.001 0 0\"", ":27: ", {"expected 7"}},
        Bad{"<piecewise end=\"1\">", "<piecewise end=\"0.2\">", ":30: ", {"end"}},
        Bad{"<at time=\"0\" value", "<at time=\"0.1\" value", ":31: ", {"first must be 0"}},
        Bad{"value=\"0 0 0.2\"", "value=\"0 0.2\"", ":31: ", {"2 control values", "motors take 3"}},
        Bad{"uniform=\"-0.003 0.003\"", "uniform=\"0.003 -0.003\"", ":36: ", {"low, then high"}},
        Bad{"q=\"0\" uniform", "q=\"7\" uniform", ":36: ", {"from 0 to 6"}},
        Bad{"q=\"0\" uniform=\"-0.003 0.003\"", "q=\"0\"", ":36: ", {"exactly one of uniform"}},
        Bad{"log_uniform=\"0.005 0.02\"", "log_uniform=\"0 0.02\"", ":37: ", {"positive bounds"}},
        Bad{"log_uniform=\"0.005 0.02\"",
            "normal=\"0.01 0.1\"",
            ":37: ",
            {"normal can draw a negative value"}},
        Bad{"name=\"skin\" field", "name=\"skim\" field", ":37: ", {"did you mean 'skin'"}},
        Bad{"field=\"kt\"", "field=\"kd\"", ":37: ", {"kn"}},
        Bad{"q=\"0\" uniform", "field=\"dampin\" uniform", ":36: ", {"did you mean 'damping'"}},
        Bad{"q=\"0\" uniform",
            "field=\"damping\" uniform",
            ":36: ",
            {"damping=\"-0.003\"; expected zero or more"}},
        Bad{"q=\"0\" uniform=\"-0.003",
            "field=\"lim_stiffness\" uniform=\"0",
            ":36: ",
            {"has no 'lim'"}},
        Bad{"<randomize>",
            "<randomize><motor joint=\"pad_joint\" field=\"P\" list=\"1\"/>",
            ":35: ",
            {"no position motor"}},
        Bad{"q=\"0\" uniform", "q=\"0\" tie=\"\" uniform", ":36: ", {"'tie' is empty"}},
        Bad{"uniform=\"-0.003 0.003\"/>\n<tactile name=\"skin\" field=\"kt\"",
            "tie=\"a\" uniform=\"-0.003 0.003\"/>\n<tactile name=\"skin\" tie=\"a\" field=\"kt\"",
            ":37: ",
            {"'tactile skin kt' varies, but tie=\"a\" has log_uniform; expected uniform as "
             "'joint ball_joint q[0]' with the same tie"}},
        Bad{"uniform=\"-0.003 0.003\"/>\n<tactile name=\"skin\" field=\"kt\" log_uniform",
            "tie=\"a\" list=\"0 1 2\"/>\n<tactile name=\"skin\" tie=\"a\" field=\"kt\" list",
            ":37: ",
            {"tie=\"a\" has a list of 2; expected a list of 3"}},
        Bad{"<randomize>", "<randomise>", ":", {"not well-formed"}},
        Bad{"<joint name=\"pad_joint\" type=\"translational\" pos=\"0 0 0.06\" damping=\"1\"/>",
            "",
            ":7: ",
            {"no <joint>"}},
        Bad{"<body name=\"ball\" type=\"sphere\" radius=\"0.02\" density=\"100\"/>",
            "",
            ":11: ",
            {"no <body>"}},
        end_effector("endeffector joint=\"pad_join\" pos=\"0 0 0\"",
                     {"<endeffector>: joint=\"pad_join\"", "did you mean 'pad_joint'"}),
        end_effector("endeffector pos=\"0 0 0\"", {"'joint' is missing"}),
        end_effector("endeffector joint=\"pad_joint\"", {"'pos' is missing"}),
        end_effector("endeffector joint=\"pad_joint\" pos=\"0 0\"", {"2 numbers", "expected 3"}),
        end_effector("endeffector joint=\"pad_joint\" pos=\"0 0 inf\"", {"finite numbers"}),
        end_effector("endeffector joint=\"pad_joint\" pos=\"0 0 0\" radius=\"0\"",
                     {"radius", "positive"}),
        end_effector("endeffector joint=\"pad_joint\" pos=\"0 0 0\" rgba=\"1\"",
                     {"rgba=\"1\" has 1 numbers"}),
        end_effector("endeffector joint=\"pad_joint\" position=\"0 0 0\"",
                     {"unknown attribute 'position'"}),
        end_effector("endeffector name=\"\" joint=\"pad_joint\" pos=\"0 0 0\"",
                     {"'name' is empty"}),
        end_effector("endefector joint=\"pad_joint\" pos=\"0 0 0\"",
                     {"did you mean 'endeffector'"}),
        Bad{"<sensor>",
            "<variable><endeffector name=\"a\" joint=\"pad_joint\" pos=\"0 0 "
            "0\"/></variable>\n<variable>\n"
            "<endeffector name=\"a\" joint=\"ball_joint\" pos=\"0 0 0\"/></variable>\n<sensor>",
            ":25: ",
            {"name 'a' is used twice"}},
        Bad{"<default>",
            "<default><endeffector pos=\"0 0 0\"/>",
            ":5: ",
            {"unknown attribute 'pos'"}}));

TEST(SceneError, RootsAndEmptyFilesSayWhatIsExpected) {
  EXPECT_THAT(error_of("<mujoco/>"),
              ::testing::HasSubstr("expected the root <redmax> or <tangere>"));
  EXPECT_THAT(error_of(""), ::testing::HasSubstr("not well-formed"));
  EXPECT_THAT(error_of("<tangere/>"), ::testing::HasSubstr("no <link>"));
  EXPECT_THAT(error_of(testing::kScene + "\n<tangere/>"),
              ::testing::HasSubstr("<tangere> after the end of <tangere>"));
  const SceneFile stray = parse_scene("a word\n" + testing::kScene, "s.xml");
  ASSERT_EQ(stray.warnings.size(), 1U);
  EXPECT_THAT(stray.warnings[0], ::testing::HasSubstr("s.xml:1: stray text outside <tangere>"));
  EXPECT_THAT(error_of(std::string("<tangere/>") + '\0'), ::testing::HasSubstr("zero byte"));
}

TEST(SceneError, DeepNestingIsAnErrorNotACrash) {
  std::string deep = "<tangere><robot>";
  for (int i = 0; i < 100000; ++i) deep += "<link name=\"l" + std::to_string(i) + "\">";
  EXPECT_NE(error_of(deep), "");
}

/// The XML parser compares each attribute with all others: minutes, where this is a message.
TEST(SceneError, AnElementHasAHundredAttributesAtMost) {
  const auto attributes = [](int count) {
    std::string text = "<!-- a=1 --><tangere>\n<option";
    for (int i = 0; i < count; ++i) text += " a" + std::to_string(i) + "='=\"=>'";
    return text + "/></tangere>";
  };
  EXPECT_THAT(
      error_of(attributes(200'000)),
      ::testing::HasSubstr("s.xml:2: an element of 200000 attributes; expected at most 100"));
  EXPECT_THAT(error_of(attributes(101)), ::testing::HasSubstr("an element of 101 attributes"));
  EXPECT_THAT(error_of(attributes(100)), ::testing::HasSubstr("unknown attribute 'a0'"));
}

TEST(SceneError, SizesThatNoRunCouldHaveNameTheirLineAndTheLimit) {
  std::string many;
  for (int i = 0; i < 600; ++i) {
    const std::string n = std::to_string(i);
    many += "<link name=\"l" + n + "\"><joint name=\"j" + n + "\" type=\"free3d\"/><body name=\"b" +
            n + "\" type=\"sphere\" radius=\"1\" density=\"1\"/></link>\n";
  }
  EXPECT_THAT(error_of("<tangere><robot>\n" + many + "</robot></tangere>"),
              ::testing::HasSubstr("s.xml:514: joint 'j512' is one too many: with it the scene has "
                                   "3078 degrees of freedom; expected at most 3072"));
  EXPECT_THAT(
      error_of(with("general_contact_resolution=\"4 4 2\"",
                    "general_contact_resolution=\"600 600 600\"")),
      ::testing::AllOf(::testing::HasSubstr("s.xml:21: "),
                       ::testing::HasSubstr("'pad' touches with 2152808 points; expected at "
                                            "most 1048576")));
}

TEST(SceneError, UnreadableFilesAreInputOutputErrors) {
  EXPECT_THROW(read_scene("/no/such/scene.xml"), IoError);
  EXPECT_THROW(read_scene("/"), IoError);
}

TEST(SceneError, UnknownNamesBecomeWarningsWhenAllowed) {
  SceneReadOptions options;
  options.allow_unknown = true;
  const SceneFile file =
      parse_scene(with("timestep=\"5e-3\"", "timestep=\"5e-3\" colour=\"red\""), "s.xml", options);
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_THAT(file.warnings[0],
              ::testing::HasSubstr("s.xml:2: <option>: unknown attribute 'colour'"));
}

/// Lines of a text that a program made are those of the program.
TEST(SceneError, NameTheOriginOfAMadeLine) {
  const std::string text = with("radius=\"0.02\"", "radus=\"0.02\" mu=\"1\"");
  SceneReadOptions options;
  for (int line = 1; line < 14; ++line) options.origins.push_back({"press.py", 100 + line});
  try {
    parse_scene(text, "s.xml", options);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), ::testing::StartsWith("press.py:113: <body>: unknown attribute 'radus'"));
  }
  options.allow_unknown = true;
  options.origins.resize(12);  // what is left keeps its own lines
  try {
    parse_scene(text, "s.xml", options);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), ::testing::StartsWith("s.xml:13: <body>: attribute 'radius' is missing"));
  }
}

}  // namespace
}  // namespace tangere
