// SPDX-License-Identifier: Apache-2.0
// Tests tasks with shear springs against those of the paper: the same scenes but for what
// friction and damping are, and skins as docs/skin.md says.
#include <gmock/gmock.h>

#include <fstream>
#include <regex>
#include <sstream>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tests/tasks/task_check.hpp"
#include "tests/tasks/task_starts.hpp"

namespace tangere {
namespace {

using testing::column;
using testing::kUnlikely;
using testing::Start;
using testing::starts;
using testing::task_named;
using testing::uniform_distance;

constexpr double kRelaxation = 5e-3;  // kt over ks [s]

class ElasticTask : public ::testing::TestWithParam<const char*> {
 protected:
  static Scene elastic() {
    return task_named(std::string(GetParam()) + "_elastic")->model().scene();
  }
};

/// A scene's text without its first comment, its model's name, <randomize>, dampers and springs.
std::string bare_text(const std::string& name) {
  std::ifstream file(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml");
  std::stringstream read;
  read << file.rdbuf();
  std::string text = read.str();
  text.erase(0, text.find("-->"));
  const auto first = text.find("<randomize>"), last = text.find("</randomize>");
  text.erase(first, last - first);
  const std::regex changed(R"( (kt|ks|damping|model)="[^"]*")"), spaces(R"(\s+)"), ends(" />");
  text = std::regex_replace(std::regex_replace(text, changed, ""), spaces, " ");
  return std::regex_replace(text, ends, "/>");
}

TEST_P(ElasticTask, HasThePapersSceneButForDampersAndSprings) {
  const std::string paper = bare_text(GetParam()),
                    own = bare_text(GetParam() + std::string("_elastic"));
  EXPECT_GT(paper.size(), 3000U);
  EXPECT_EQ(own, paper);
}

TEST_P(ElasticTask, HasSpringsEverywhere) {
  const Scene scene = elastic();
  const auto expect_spring = [](const ContactCoefficients& c, const std::string& of) {
    EXPECT_NEAR(c.ks, 0.25 * c.kn, 1e-9 * c.kn) << of;
    EXPECT_NEAR(c.kt, kRelaxation * c.ks, 1e-9 * c.ks) << of;
  };
  for (const PairContactDescription& c : scene.pair_contacts)
    expect_spring(c.coefficients, c.general_body + " on " + c.primitive_body);
  for (const GroundContactDescription& c : scene.ground_contacts)
    expect_spring(c.coefficients, c.body + " on the ground");
  for (const TactileDescription& s : scene.sensors) expect_spring(s.coefficients, s.name);
  EXPECT_FALSE(scene.sensors.empty());
}

TEST_P(ElasticTask, DeclaresWhatThePapersDoes) {
  const TaskSpec paper = task_spec(GetParam()),
                 own = task_spec(GetParam() + std::string("_elastic"));
  EXPECT_EQ(own.name + ".xml", own.scene);
  EXPECT_EQ(own.success, paper.success);
  EXPECT_EQ(own.horizon, paper.horizon);
  EXPECT_EQ(own.action.size(), paper.action.size());
  EXPECT_EQ(own.observation_size(), paper.observation_size());
}

INSTANTIATE_TEST_SUITE_P(Tasks, ElasticTask,
                         ::testing::Values("stable_grasp", "insertion", "cap_opening",
                                           "box_pushing"),
                         [](const auto& given) { return std::string(given.param); });

/// Of each pad: kn, kt, mu, damping and ks of the contact, then of the sensor.
TEST(ElasticInsertion, DrawsOneSkin) {
  const auto all = starts(*task_named("insertion_elastic"));
  const auto share = [](const Start& s) { return s.varying[4] / s.varying[0]; };
  EXPECT_LT(uniform_distance(column(all, share), 0.25, 0.67), kUnlikely);
  const auto stiffness = [](std::size_t k) { return [=](const Start& s) { return s.varying[k]; }; };
  EXPECT_LT(uniform_distance(column(all, stiffness(0)), 2e3, 14e3), kUnlikely);
  EXPECT_LT(uniform_distance(column(all, stiffness(5)), 50, 450), kUnlikely);
  for (std::size_t e = 0; e < 100; ++e) {
    const std::vector<double>& x = all[e].varying;
    ASSERT_EQ(x.size(), 20U);
    for (std::size_t k = 0; k < 10; ++k) ASSERT_EQ(x[k], x[10 + k]) << "both pads are of one skin";
    for (const std::size_t at : {0U, 5U}) {
      EXPECT_NEAR(x[at + 4], share(all[e]) * x[at], 1e-9 * x[at]);
      EXPECT_NEAR(x[at + 1], kRelaxation * x[at + 4], 1e-12 * x[at]);
      EXPECT_NEAR(x[at + 3], kRelaxation / 3e-4 * x[at], 1e-9 * x[at]);
    }
  }
  // What both tasks draw is the same.
  const auto paper = starts(*task_named("insertion"));
  EXPECT_EQ(all[7].memory, paper[7].memory);
  EXPECT_EQ(all[7].varying[0], paper[7].varying[0]);
  EXPECT_EQ(all[7].varying[2], paper[7].varying[2]);
}

/// A held bar hangs still, and its pads still read its weight.
TEST(ElasticGrasp, ShearStaysWhenMotionHasStopped) {
  for (const bool elastic : {true, false}) {
    const auto task = task_named(elastic ? "stable_grasp_elastic" : "stable_grasp");
    const Model& model = task->model();
    Batch batch(model, 1);
    Stepper stepper(model);
    Readout readout(model);
    std::vector<double> u{0, 0.012, 0, 0, -0.025, -0.025}, field(3 * 130);
    for (int t = 0; t < 200; ++t) stepper.step(batch, u);
    u[4] = u[5] = 0;
    for (int t = 0; t < 40; ++t) stepper.step(batch, u);
    u[2] = 0.03;
    const auto weight = [&](int steps) {
      for (int t = 0; t < steps; ++t) stepper.step(batch, u);
      readout.tactile(batch, 0, 0, std::span<double>(field));
      double up = 0;
      for (std::size_t k = 0; k < field.size(); k += 3) up += field[k];
      return up;
    };
    const double early = weight(300), late = weight(600);
    if (elastic) {
      EXPECT_GT(std::abs(early), 1e-3);
      EXPECT_NEAR(late, early, 1e-5 * std::abs(early));
    } else {
      EXPECT_GT(std::abs(late - early), 1e-2 * std::abs(early)) << "the bar creeps in its grip";
    }
  }
}

}  // namespace
}  // namespace tangere
