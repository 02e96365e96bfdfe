// SPDX-License-Identifier: Apache-2.0
// Tests derivatives in data sets: they equal those of the library and have the same bytes on any
// number of threads; they are checked, compared and refused.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "engine/derivative/step_jacobian.hpp"
#include "engine/step/control.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/run/policy.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsEmpty;

const std::string kSmall = scene("rolling_ball_small.xml"), kBox = scene("box_pushing.xml");

json generate(const Folder& folder, const Words& words) {
  return run_json(folder, Words{"generate"} + words);
}

struct Array {
  h5::Dims dims;
  std::vector<double> values;
};
Array read(const h5::Id& file, int episode, const std::string& name) {
  const h5::Id dataset =
      h5::open_dataset(file, "data/demo_" + std::to_string(episode) + "/" + name);
  Array a{h5::dimensions(dataset), {}};
  std::size_t count = 1;
  for (const hsize_t n : a.dims) count *= n;
  a.values.resize(count);
  h5::read_box(dataset, h5::Dims(a.dims.size(), 0), a.dims, a.values.data());
  return a;
}

TEST(GenerateGradients, OfATasksReturnAreThoseOfTheLibrary) {
  const Folder folder;
  const json answer = generate(folder, {"dummy", "-o", "set", "--episodes", "18", "--gradients",
                                        "return", "--threads", "2"});
  EXPECT_EQ(answer.at("gradients"), "return");
  const auto task = make_task("dummy", read_scene(kSmall).scene);
  const Policy policy(*task, PolicyKind::scripted);
  TapeOptions options;
  options.precision = Precision::mixed;
  options.parameters = true;
  const TaskGradients g = task_gradients(
      *task,
      [&](const TaskView& view, std::span<const double> o, std::span<double> a) {
        policy.act(view, o, a);
      },
      0, {0, 18}, options);
  const h5::Id file = h5::open_file(folder.path("set/shard-00000.h5"));
  const auto part = [](const std::vector<double>& all, int e, std::size_t width) {
    return std::vector<double>(all.begin() + std::ptrdiff_t(std::size_t(e) * width),
                               all.begin() + std::ptrdiff_t(std::size_t(e + 1) * width));
  };
  for (const int e : {0, 15, 17}) {
    const Array by_actions = read(file, e, "grad_actions");
    EXPECT_EQ(by_actions.dims, (h5::Dims{40, 1}));
    EXPECT_EQ(by_actions.values, part(g.u, e, 40));
    EXPECT_EQ(read(file, e, "grad_q").values, part(g.q, e, 9));
    EXPECT_EQ(read(file, e, "grad_v").values, part(g.v, e, 9));
    EXPECT_EQ(read(file, e, "grad_numbers").values,
              part(g.parameters, e, g.parameters.size() / 18));
  }
  EXPECT_THAT(h5::read_text(h5::open_dataset(file, "data/demo_0/grad_actions"), "meaning"),
              HasSubstr("the return by the action"));
  const h5::Id said = h5::open_group(file, "scene/gradients/grad_q");
  EXPECT_EQ(h5::read_texts(said, "by_units")[0], "m");
  EXPECT_EQ(h5::read_texts(said, "by_names").size(), 9U);
}

TEST(GenerateGradients, OfASceneAreOfALossByItsActions) {
  const Folder folder;
  generate(folder, {kSmall, "-o", "set", "--episodes", "3", "--steps", "100", "--every", "5",
                    "--gradients", "return", "--loss", "final", "--precision", "double"});
  const Model model(read_scene(kSmall).scene);
  const ControlProgram program(model, model.timestep(), 0);
  const auto loss = make_loss(LossKind::final_state, model, 5);
  const RolloutLoss* const losses[] = {loss.get()};
  TapeOptions options;
  options.length = 100;
  options.parameters = true;
  const LossGradient g = rollout_gradients(
                             Batch(model, 3, 0),
                             [&](std::int64_t step, int e, std::span<double> u) {
                               program.evaluate(step / 5 * 5, e, u);
                             },
                             options, losses)
                             .losses[0];
  const h5::Id file = h5::open_file(folder.path("set/shard-00000.h5"));
  const Array by_actions = read(file, 2, "grad_actions");
  EXPECT_EQ(by_actions.dims, (h5::Dims{20, 3}));
  for (std::size_t row = 0; row < 20; ++row) {
    double sum = 0;
    for (std::size_t k = 0; k < 5; ++k) sum += g.u[(200 + row * 5 + k) * 3 + 2];
    EXPECT_NEAR(by_actions.values[row * 3 + 2], sum, 1e-15 * (1 + std::abs(sum)));
  }
  EXPECT_EQ(read(file, 2, "grad_v").values, std::vector<double>(g.v.begin() + 18, g.v.end()));
  EXPECT_THAT(read(file, 1, "loss").values, ElementsAre(g.value[1]));
}

/// With one step per row, a row's Jacobian is that of its step.
TEST(GenerateGradients, JacobiansOfRowsAreThoseOfSteps) {
  const Folder folder;
  const Words words{kBox, "--episodes", "2", "--steps", "60", "--gradients", "jacobians"};
  generate(folder, words + Words{"-o", "each", "--every", "1"});
  const Model model(read_scene(kBox).scene);
  const ControlProgram program(model, model.timestep(), 0);
  Batch batch(model, 2, 0);
  Stepper stepper(model, {.differentiable = true});
  BlockTape tape(model, stepper.integrator(), 1);
  StepJacobians jacobians(model);
  StepJacobian step;
  const h5::Id file = h5::open_file(folder.path("each/shard-00000.h5"));
  const Array by_state = read(file, 1, "grad_state_by_state"),
              by_action = read(file, 1, "grad_state_by_action");
  EXPECT_EQ(by_state.dims, (h5::Dims{60, 14, 14}));
  EXPECT_EQ(by_action.dims, (h5::Dims{60, 14, 6}));
  for (std::size_t t = 0; t < 60; ++t) {
    std::vector<double> u(12);
    for (std::size_t e = 0; e < 2; ++e)
      program.evaluate(std::int64_t(t), std::int64_t(e), std::span(u).subspan(6 * e, 6));
    tape.start(batch, 0);
    stepper.step_block(batch, 0, u, &tape);
    jacobians.evaluate(batch, 0, tape, 0, u);
    jacobians.get(1, step);
    for (std::size_t i = 0; i < 14 * 14; ++i)
      ASSERT_NEAR(by_state.values[t * 196 + i], step.state[i],
                  1e-13 * (1 + std::abs(step.state[i])));
    for (std::size_t i = 0; i < 14 * 6; ++i) ASSERT_EQ(by_action.values[t * 84 + i], step.u[i]);
  }
  generate(folder, words + Words{"-o", "fifth", "--every", "5"});
  const Array rows =
      read(h5::open_file(folder.path("fifth/shard-00000.h5")), 1, "grad_state_by_state");
  EXPECT_EQ(rows.dims, (h5::Dims{12, 14, 14}));
  EXPECT_EQ(generate(folder, {kSmall, "-o", "two", "--episodes", "1", "--steps", "20",
                              "--gradients", "jacobians"})
                .at("gradients"),
            "jacobians");
  EXPECT_EQ(read(h5::open_file(folder.path("two/shard-00000.h5")), 0, "grad_state_by_previous")
                .dims.size(),
            3U)
      << "BDF2";
}

TEST(GenerateGradients, AreTheSameBytesOnAnyNumberOfThreads) {
  const Folder folder;
  for (const char* kind : {"return", "jacobians"}) {
    const Words words{"dummy", "--episodes", "40", "--gradients", kind, "--shards", "2"};
    generate(folder, words + Words{"-o", std::string("one_") + kind, "--threads", "1"});
    generate(folder, words + Words{"-o", std::string("three_") + kind, "--threads", "3"});
    for (const char* shard : {"shard-00000.h5", "shard-00001.h5"})
      EXPECT_EQ(file_bytes(folder.path(std::string("one_") + kind + "/" + shard)),
                file_bytes(folder.path(std::string("three_") + kind + "/" + shard)));
  }
  const Words words{"dummy", "--episodes", "40", "--gradients", "return", "--shards",
                    "2",     "--threads",  "1"};
  generate(folder, words + Words{"-o", "tight", "--tape-memory", "2MB"});
  EXPECT_EQ(file_bytes(folder.path("tight/shard-00001.h5")),
            file_bytes(folder.path("one_return/shard-00001.h5")))
      << "from checkpoints";
  generate(folder, {"dummy", "--episodes", "40", "--shards", "2", "-o", "plain"});
  const h5::Id plain = h5::open_file(folder.path("plain/shard-00000.h5")),
               with = h5::open_file(folder.path("one_return/shard-00000.h5"));
  EXPECT_EQ(read(plain, 7, "obs/q").values, read(with, 7, "obs/q").values)
      << "derivatives change nothing";
}

TEST(GenerateGradients, AreCheckedAndCompared) {
  const Folder folder;
  const Words words{"dummy", "-o", "set", "--episodes", "16", "--gradients", "return"};
  generate(folder, words);
  EXPECT_EQ(generate(folder, words + Words{"--resume"}).at("kept"), 1);
  for (const Words& other :
       {Words{"dummy", "-o", "set", "--episodes", "16"},
        Words{"dummy", "-o", "set", "--episodes", "16", "--gradients", "jacobians"}}) {
    const Outcome outcome = run(folder, Words{"generate"} + other + Words{"--resume"});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("gradients"));
  }
  const std::string shard = folder.path("set/shard-00000.h5");
  EXPECT_EQ(check_shard(shard).demos, 16);
  std::string bytes = file_bytes(shard);
  const double number = read(h5::open_file(shard), 4, "grad_actions").values[7];
  const std::size_t at =
      bytes.find(std::string(reinterpret_cast<const char*>(&number), sizeof number));
  ASSERT_NE(at, std::string::npos);
  bytes[at] = static_cast<char>(bytes[at] ^ 1);
  std::ofstream(shard, std::ios::binary) << bytes;
  EXPECT_THAT(examine_shard(shard).problems, testing::Not(IsEmpty()));
}

/// Failed episodes are no demos and have no derivatives either.
TEST(GenerateGradients, FailedEpisodesLeaveNone) {
  const Folder folder;
  std::string text = file_bytes(kSmall);
  const std::string step = "timestep=\"5e-3\"";
  folder.write("days.xml", text.replace(text.find(step), step.size(), "timestep=\"86400\""));
  for (const Words& kind : {Words{"jacobians"}, Words{"return", "--loss", "path"}}) {
    const Outcome outcome =
        run(folder, Words{"generate", "days.xml", "-o", "set", "--episodes", "3", "--steps", "2",
                          "--every", "1", "--overwrite", "--gradients"} +
                        kind);
    EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
    EXPECT_EQ(check_shard(folder.path("set/shard-00000.h5")).failed, 3);
  }
}

/// However observations are stored, derivatives are the same contiguous numbers with the same
/// descriptions.
TEST(GenerateGradients, AreTheSameBesideAnyObservations) {
  const Folder folder;
  const Words task{"dummy", "--episodes", "20", "--gradients", "return"};
  const Words scene{kSmall,    "--episodes", "20",          "--steps",  "25",
                    "--every", "5",          "--gradients", "jacobians"};
  const std::vector<std::pair<std::string, Words>> ways{{"deflate", {"--compress", "deflate"}},
                                                        {"lz4", {"--compress", "lz4"}},
                                                        {"dense", {"--tactile", "dense"}},
                                                        {"some", {"--record", "q"}}};
  for (const auto& [what, words] :
       {std::pair{std::string("task"), task}, std::pair{std::string("scene"), scene}}) {
    generate(folder, words + Words{"-o", what});
    const h5::Id plain = h5::open_file(folder.path(what + "/shard-00000.h5"));
    const h5::Id said = h5::open_group(plain, "scene/gradients");
    const std::vector<std::string> names = h5::link_names(said);
    ASSERT_GE(names.size(), 2U);
    for (const auto& [way, more] : ways) {
      const std::string set = what + "_" + way;
      generate(folder, words + more + Words{"-o", set, "--threads", "1"});
      generate(folder, words + more + Words{"-o", set + "_3", "--threads", "3"});
      const std::string shard = folder.path(set + "/shard-00000.h5");
      EXPECT_TRUE(file_bytes(shard) == file_bytes(folder.path(set + "_3/shard-00000.h5"))) << set;
      EXPECT_EQ(run(folder, {"validate", set}).exit_code, 0) << set;
      EXPECT_EQ(run(folder, {"validate", set + "/robomimic.hdf5"}).exit_code, 0) << set;
      const h5::Id file = h5::open_file(shard);
      for (const int episode : {0, 15, 19})
        for (const std::string& name : names) {
          const Array a = read(plain, episode, name), b = read(file, episode, name);
          EXPECT_EQ(a.dims, b.dims);
          EXPECT_EQ(a.values, b.values) << set << " " << name;
          const h5::Id dataset =
              h5::open_dataset(file, "data/demo_" + std::to_string(episode) + "/" + name);
          EXPECT_EQ(h5::read_text(dataset, "meaning"),
                    h5::read_text(h5::open_group(said, name), "meaning"));
        }
    }
    EXPECT_EQ(run(folder, {"merge", what, "--copy", "--overwrite"}).exit_code, 0);
    EXPECT_EQ(run(folder, {"validate", what + "/robomimic.hdf5"}).exit_code, 0);
    EXPECT_EQ(run(folder, {"export", what, "--csv", what + ".csv"}).exit_code, 0);
  }
}

/// The report names the requested work between simulation and disk, no more and no less.
TEST(GenerateGradients, SayWhatTheyWereMadeWith) {
  const std::vector<std::pair<Words, std::string>> ways{
      {{"--tactile", "dense"}, "checksums"},
      {{}, "tiles"},
      {{"--record", "q,pad.pressure"}, "checksums"},  // of 4 KiB a row
      {{"--tactile", "dense", "--compress", "lz4"}, "compression"},
      {{"--compress", "deflate"}, "tiles and compression"},
      {{"--gradients", "jacobians", "--tactile", "dense"}, "gradients"},
      {{"--gradients", "jacobians"}, "gradients and tiles"},
      {{"--gradients", "jacobians", "--tactile", "dense", "--compress", "deflate"},
       "gradients and compression"},
      {{"--gradients", "jacobians", "--compress", "deflate"},
       "gradients and tiles and compression"}};
  const Folder folder;
  for (const auto& [more, name] : ways) {
    const Words words =
        Words{"generate", kSmall, "-o", "set", "--episodes", "16", "--steps", "10", "--overwrite"} +
        more;
    const Outcome people = run(folder, words), program = run(folder, words + Words{"--json"});
    ASSERT_EQ(people.exit_code, 0) << people.err;
    EXPECT_THAT(people.out + people.err, testing::HasSubstr(" s and " + name + " 0."))
        << "in the summary";
    EXPECT_THAT(nlohmann::json::parse(program.out).at("limited_by").get<std::string>(),
                testing::AnyOf("simulation", name, "writing"));
  }
}

TEST(GenerateGradients, RefusesWhatFitsNot) {
  const Folder folder;
  const auto refused = [&](const Words& words, const char* message) {
    const Outcome outcome = run(folder, Words{"generate", "-o", "none", "--episodes", "2"} + words);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(message));
  };
  refused({"dummy", "--gradients", "retrun"}, "did you mean 'return'");
  refused({"dummy", "--gradients", "return", "--loss", "path"}, "expected a scene");
  refused({kSmall, "--gradients", "return"}, "expected --loss as well");
  refused({kSmall, "--gradients", "jacobians", "--loss", "path"},
          "expected a scene and --gradients return");
  refused({kSmall, "--loss", "path"}, "expected a scene and --gradients return");
  refused({"dummy", "--tape-memory", "1GB"}, "expected --gradients return");
  refused({"dummy", "--gradients", "return", "--tape-memory", "10kB"}, "expected at least");
}

}  // namespace
}  // namespace tangere::apps
