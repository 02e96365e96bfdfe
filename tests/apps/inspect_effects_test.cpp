// SPDX-License-Identifier: Apache-2.0
// inspect --effects: what it prints, draws and follows; ties in inspect. Times are never compared.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

TEST(Inspect, ListsNumbersThatAreDrawnTogether) {
  const Folder folder;
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  text.insert(text.find("</randomize>"),
              "<tactile name=\"pad\" field=\"mu\" uniform=\"1 2\" tie=\"rubber\"/>"
              "<ground_contact body=\"ball\" field=\"mu\" uniform=\"1 2\" tie=\"rubber\"/>");
  folder.write("ball.xml", text);
  const json answer = json::parse(run(folder, {"inspect", "ball.xml", "--json"}).out);
  EXPECT_EQ(answer.at("randomized_ties"), json({"", "", "", "", "rubber", "rubber"}));
  EXPECT_THAT(run(folder, {"inspect", "ball.xml"}).out,
              HasSubstr("  drawn together as 'rubber' (2): tactile pad mu, ground ball mu\n"));
}

TEST(InspectEffects, DrawsWhereTheTimeGoesAndFollowsOutputs) {
  const Folder folder;
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  text.insert(text.find("</tangere>"), "<outputs record=\"pad.sum/20,q/10\"/>\n");
  folder.write("ball.xml", text);
  const Outcome outcome =
      run(folder, {"inspect", "ball.xml", "--effects", "--svg", "effects.svg", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json answer = json::parse(outcome.out);
  EXPECT_EQ(answer.at("svg"), "effects.svg");
  const std::string svg = file_bytes(folder.path("effects.svg"));
  for (const char* part : {">contact pad ball<", ">tactile pad<", ">audit<", "Newton passes"})
    EXPECT_THAT(svg, HasSubstr(part));
  EXPECT_EQ(answer.at("effects").at("tactile pad").at("bytes"), 6 * 8 + 8)
      << "a sum, and kt that varies";
  const json& runs = answer.at("run_costs");
  EXPECT_THAT(runs[0].at("requested_by").get<std::string>(), HasSubstr("'q/10'"));
  EXPECT_EQ(runs[1].at("on"), false) << "<outputs> leaves bodies out";
  EXPECT_EQ(run(folder, {"inspect", "ball.xml", "--effects", "--svg", "effects.svg"}).exit_code, 3)
      << "it exists";
  const Outcome alone = run(folder, {"inspect", "ball.xml", "--svg", "x.svg"});
  EXPECT_EQ(alone.exit_code, 2);
  EXPECT_THAT(alone.err, HasSubstr("--svg without --effects; expected both"));
}

/// Times are never compared here, only that they are there.
TEST(InspectEffects, MeasuresWhatEffectsCost) {
  const Folder folder;
  const std::string file = scene("rolling_ball_small.xml");
  const Outcome outcome = run(folder, {"inspect", file, "--effects", "--json"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const json answer = json::parse(outcome.out);
  for (const char* key :
       {"environments", "failed", "instants", "rounds", "run_steps", "step_seconds",
        "field_seconds", "newton", "share_of_nothing", "spread_of_nothing"})
    EXPECT_TRUE(answer.at("effect_measurement").at(key).is_number()) << key;
  const json& costs = answer.at("effects");
  std::istringstream text(file_bytes(file));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  for (const auto& [name, effect] : costs.items()) {
    SCOPED_TRACE(name);
    for (const char* key : {"kind", "on", "why", "lines", "variant", "bytes", "share", "spread",
                            "step_seconds_without", "newton_without", "note"})
      EXPECT_TRUE(effect.contains(key)) << key;
    EXPECT_FALSE(effect.at("why").get<std::string>().empty());
    EXPECT_EQ(effect.at("share").is_null(), !effect.at("note").get<std::string>().empty());
    EXPECT_EQ(effect.at("lines").empty(), !effect.at("on").get<bool>());
    if (!effect.at("on").get<bool>()) {
      EXPECT_EQ(effect.at("share"), 0);
      EXPECT_EQ(effect.at("bytes"), 0);
    }
    for (const std::string line : effect.at("lines")) EXPECT_THAT(line, HasSubstr(file + ":"));
  }
  const auto called_for_by = [&](const char* name) {
    const std::string line = costs.at(name).at("lines").at(0);
    return lines.at(std::stoul(line.substr(line.rfind(':') + 1)) - 1);
  };
  EXPECT_THAT(called_for_by("gravity"), HasSubstr("<option"));
  EXPECT_THAT(called_for_by("joint damping"), HasSubstr("<joint name=\"pad_joint\""));
  EXPECT_THAT(called_for_by("force motors"), HasSubstr("<motor"));
  EXPECT_THAT(called_for_by("contact pad ball friction"), HasSubstr("<general_primitive_contact"));
  EXPECT_THAT(called_for_by("ground ball"), HasSubstr("<ground_contact"));
  EXPECT_THAT(called_for_by("tactile pad"), HasSubstr("<tactile"));
  EXPECT_EQ(costs.at("joint springs").at("on"), false);
  EXPECT_EQ(costs.at("sleeping").at("why"), "solver_option sleep is 0");
  EXPECT_TRUE(costs.at("velocity products").at("share").is_null());
  EXPECT_GT(costs.at("tactile pad").at("bytes"), 0);
  // A kind with one element is that element.
  EXPECT_EQ(costs.at("tactile").at("share"), costs.at("tactile pad").at("share"));
  for (const char* words : {"called for by", "contact pad ball friction", "tactile pad shear",
                            "off, at no cost: joint springs (0 joints)", "kernel: "})
    EXPECT_THAT(outcome.err, HasSubstr(words));
  EXPECT_TRUE(answer.at("svg").is_null());
  std::vector<std::string> names;
  for (const json& cost : answer.at("run_costs")) {
    names.push_back(cost.at("name"));
    EXPECT_GT(cost.at("seconds"), 0) << names.back();
    EXPECT_GT(cost.at("bytes"), 0) << names.back();
  }
  EXPECT_EQ(names, (std::vector<std::string>{"rows of q and v", "rows of bodies", "audit",
                                             "gradients of a loss"}));
}

/// Friction that remembers, markers and points that touch have rows, lines and bytes of their own.
TEST(InspectEffects, ShowsMemoryMarkersAndFeedback) {
  const Folder folder;
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  const auto replace = [&](const std::string& from, const std::string& to, std::size_t after = 0) {
    text.replace(text.find(from, after), from.size(), to);
  };
  replace("<tactile name=\"pad\" field=\"kt\" uniform=\"0.008 0.012\"/>", "");
  replace("every=\"5\"/>",
          "every=\"5\" feedback=\"true\">\n<markers stiffness=\"20\"/>\n</tactile>");
  replace("mu=\"1\" damping=\"1\"/>", "mu=\"1\" damping=\"1\" ks=\"5\"/>");
  folder.write("ball.xml", text);
  const Outcome outcome = run(folder, {"inspect", "ball.xml", "--effects", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json effects = json::parse(outcome.out).at("effects");
  for (const auto& [name, why] : {std::pair("contact pad ball memory", "ks 5 N/m"),
                                  std::pair("tactile pad markers", "stiffness 20 N/m"),
                                  std::pair("tactile pad feedback", "its points touch 1 body")}) {
    const json& effect = effects.at(name);
    EXPECT_EQ(effect.at("on"), true) << name;
    EXPECT_EQ(effect.at("why"), why);
    EXPECT_TRUE(effect.at("share").is_number()) << name;
    EXPECT_EQ(effect.at("lines").size(), 1U) << name;
    EXPECT_THAT(outcome.err, HasSubstr(name));
  }
  EXPECT_GT(effects.at("contact pad ball memory").at("bytes"), 0);
  EXPECT_EQ(effects.at("ground ball memory").at("why"), "ks 0 N/m");
  EXPECT_EQ(effects.at("tactile pad memory").at("on"), false);
}

/// Boxes that rest on the ground fall asleep along the run.
TEST(InspectEffects, MeasuresWhatSleepSaves) {
  const Folder folder;
  std::string text = file_bytes(scene("ten_boxes.xml"));
  // Half of the controls are enough: the finger touches no box.
  const std::size_t later = text.find("<at time=\"1.2\"");
  text.erase(later, text.find("</piecewise>") - later);
  text.replace(text.find("end=\"2\""), 7, "end=\"1\"");
  text.insert(text.find("</tangere>"), "<solver_option sleep=\"0.001\"/>\n");
  folder.write("boxes.xml", text);
  const Outcome outcome = run(folder, {"inspect", "boxes.xml", "--effects", "--json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json sleeping = json::parse(outcome.out).at("effects").at("sleeping");
  EXPECT_EQ(sleeping.at("on"), true);
  EXPECT_EQ(sleeping.at("why"), "sleep 0.001");
  EXPECT_THAT(sleeping.at("lines").at(0).get<std::string>(), HasSubstr("boxes.xml:"));
  EXPECT_TRUE(sleeping.at("share").is_number());
  EXPECT_GE(sleeping.at("bytes"), 11 * (1 + 4 + 4)) << "eleven trees";
  const auto note = sleeping.at("note").get<std::string>();
  const std::size_t count = note.find("in which ");
  ASSERT_NE(count, std::string::npos) << note;
  EXPECT_GT(std::stod(note.substr(count + 9)), 5) << "of ten boxes: " << note;
  EXPECT_THAT(outcome.err, HasSubstr("  sleeping "));
}

}  // namespace
}  // namespace tangere::apps
