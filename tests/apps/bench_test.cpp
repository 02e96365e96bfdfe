// SPDX-License-Identifier: Apache-2.0
// Tests `tangere bench` as users see it: its keys, its files, its refusals. No test looks at how
// long anything took.
#include <gmock/gmock.h>
#include <tinyxml2.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const std::string kSmall = scene("rolling_ball_small.xml");

/// `tangere bench SCENE MORE`, with one pass unless more says otherwise.
Words bench(const Words& more, const std::string& scene_file = kSmall) {
  Words words{"bench", scene_file};
  words.insert(words.end(), more.begin(), more.end());
  if (std::find(more.begin(), more.end(), "--repeat") == more.end())
    words.insert(words.end(), {"--repeat", "1"});
  return words;
}

json bench_json(const Folder& folder, const Words& more, int exit_code = 0,
                const std::string& scene_file = kSmall) {
  return run_json(folder, bench(more, scene_file), exit_code);
}

TEST(Bench, TakesPicturesOfCameras) {
  const Folder folder;
  std::string text = file_bytes(kSmall);
  text.insert(text.find("</sensor>"),
              "<camera name=\"eye\" pos=\"0 -0.25 0.2\" look=\"0 0 0.02\" rows=\"12\" "
              "cols=\"16\"/>\n");
  const std::string watched = folder.write("watched.xml", text);
  const auto checksums = [&](const std::string& record) {
    const json runs = bench_json(folder,
                                 {"--envs", "20", "--steps", "12", "--threads", "2,1", "--record",
                                  record, "--seed", "3"},
                                 0, watched)
                          .at("runs");
    EXPECT_EQ(runs[0].at("record"), record == "q" ? "" : record);
    EXPECT_EQ(runs[0].at("checksum"), runs[1].at("checksum")) << record;
    EXPECT_EQ(runs[0].at("tactile_points_per_second"), 0) << record;
    return runs[0].at("checksum").get<std::string>();
  };
  const std::set<std::string> all{checksums("q"), checksums("eye.rgb/3"), checksums("eye.rgb/6"),
                                  checksums("eye.depth/6"), checksums("eye.ids/final")};
  EXPECT_EQ(all.size(), 5U);  // every picture counts
}

TEST(Bench, SaysWhatItMeasured) {
  const Folder folder;
  const json answer = bench_json(
      folder, {"--envs", "20", "--steps", "12", "--every", "4", "--threads", "2,1", "--seed", "3"});
  EXPECT_EQ(answer.at("seed"), 3);
  EXPECT_EQ(answer.at("timestep"), 5e-3);
  EXPECT_FALSE(answer.at("machine").get<std::string>().empty());
  ASSERT_THAT(answer.at("runs"), SizeIs(2));
  EXPECT_EQ(answer.at("runs")[0].at("threads"), 2);
  EXPECT_EQ(answer.at("runs")[1].at("threads"), 1);
  for (const json& entry : answer.at("runs")) {
    EXPECT_EQ(entry.at("envs"), 20);
    EXPECT_EQ(entry.at("steps"), 12);
    EXPECT_EQ(entry.at("every"), 4);
    EXPECT_EQ(entry.at("frames"), "dense");
    EXPECT_EQ(entry.at("precision"), "mixed");
    EXPECT_EQ(entry.at("repeat"), 1);
    EXPECT_THAT(entry.at("failed"), IsEmpty());
    EXPECT_GE(entry.at("newton_iterations"), 1);
    const double seconds = entry.at("seconds"), cpu = entry.at("cpu_seconds");
    EXPECT_DOUBLE_EQ(entry.at("env_steps_per_second"), 20 * 12 / seconds);
    EXPECT_DOUBLE_EQ(entry.at("env_steps_per_cpu_second"), 20 * 12 / cpu);
    EXPECT_DOUBLE_EQ(entry.at("tactile_points_per_second"), 20 * 3 * 32 * 32 / seconds);
    EXPECT_EQ(entry.at("median_seconds"), seconds);  // of one pass
    EXPECT_EQ(entry.at("median_env_steps_per_second"), entry.at("env_steps_per_second"));
  }
  EXPECT_THAT(folder.files(), IsEmpty());
}

TEST(Bench, ChecksumsAgreeOnAnyNumberOfThreads) {
  const Folder folder;
  const Words words{"--envs", "70", "--steps", "60", "--threads", "1,2,4"};
  const json runs = bench_json(folder, words).at("runs");
  ASSERT_THAT(runs, SizeIs(3));
  EXPECT_THAT(runs[0].at("checksum").get<std::string>(), testing::MatchesRegex("[0-9a-f]+"));
  EXPECT_THAT(runs[0].at("checksum").get<std::string>(), SizeIs(16));
  EXPECT_EQ(runs[1].at("checksum"), runs[0].at("checksum"));
  EXPECT_EQ(runs[2].at("checksum"), runs[0].at("checksum"));
  EXPECT_NE(bench_json(folder, {"--envs", "70", "--steps", "60", "--threads", "1", "--seed", "1"})
                .at("runs")[0]
                .at("checksum"),
            runs[0].at("checksum"));
}

TEST(Bench, WithoutFramesThereAreNoTactilePoints) {
  const Folder folder;
  const json entry =
      bench_json(folder, {"--envs", "3", "--steps", "10", "--threads", "1", "--frames", "none"})
          .at("runs")[0];
  EXPECT_EQ(entry.at("tactile_points_per_second"), 0);
  EXPECT_EQ(entry.at("frames"), "none");
}

/// Scheme, step and tolerance of the command line are those of a scene that has them.
TEST(Bench, SchemeStepAndToleranceTakeTheScenesPlace) {
  const Folder folder;
  std::string text = file_bytes(kSmall);
  const std::string options = "timestep=\"5e-3\" integrator=\"BDF2\"/>";
  const std::size_t at = text.find(options);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, options.size(),
               "timestep=\"0.0125\" integrator=\"SDIRK2\"/><solver_option tol=\"1e-7\"/>");
  folder.write("own.xml", text);
  const Words same{"--envs", "3", "--steps", "40", "--threads", "1"};
  const json own = bench_json(folder, same, 0, "own.xml");
  const json asked = bench_json(
      folder, same + Words{"--integrator", "SDIRK2", "--timestep", "0.0125", "--tol", "1e-7"});
  for (const char* key : {"timestep", "integrator", "tolerance"})
    EXPECT_EQ(own.at(key), asked.at(key)) << key;
  EXPECT_EQ(own.at("runs")[0].at("checksum"), asked.at("runs")[0].at("checksum"));
  EXPECT_EQ(asked.at("integrator"), "SDIRK2");
  EXPECT_THAT(run(folder, bench({"--integrator", "RK4"})).err, HasSubstr("RK4"));
  EXPECT_THAT(run(folder, bench({"--timestep", "0.01"}, "box_pushing")).err,
              HasSubstr("--timestep"));
}

TEST(Bench, StepsAndThreadsHaveDefaults) {
  const Folder folder;
  const json runs = bench_json(folder, {"--envs", "2"}).at("runs");
  ASSERT_FALSE(runs.empty());
  EXPECT_EQ(runs[0].at("threads"), 1);
  EXPECT_EQ(runs[0].at("steps"), 350);
  EXPECT_EQ(runs[0].at("every"), 5);
}

/// The error is the one that `accuracy` finds for the scene's own setting.
TEST(Bench, SaysTheErrorBesideTheSpeed) {
  const Folder folder;
  const Words size{"--envs", "3", "--steps", "100", "--threads", "1"};
  Words words = size;
  words.emplace_back("--error");
  const json error = bench_json(folder, words).at("own_error");
  Words sweep{"accuracy", kSmall};
  sweep.insert(sweep.end(), size.begin(), size.end());
  const json own = run_json(folder, sweep).at("own");
  EXPECT_EQ(error.at("quantity"), "tactile");
  EXPECT_EQ(error.at("envs"), 3);
  EXPECT_EQ(error.at("resolved"), true);
  EXPECT_EQ(error.at("error"), own.at("error"));
  EXPECT_EQ(error.at("median_error"), own.at("median_error"));
  EXPECT_LT(error.at("reference_error"), 1e-2 / 3);
  EXPECT_FALSE(bench_json(folder, size).contains("own_error"));
  const Outcome told = run(folder, bench(words));
  EXPECT_THAT(told.out, HasSubstr("error of the tactile fields: "));
}

TEST(Bench, ThePictureHasOneMarkPerThreadCount) {
  const Folder folder;
  const json answer = bench_json(
      folder, {"--envs", "4", "--steps", "20", "--threads", "1,2,3", "--svg", "out.svg"});
  EXPECT_EQ(answer.at("svg"), "out.svg");
  EXPECT_TRUE(answer.at("csv").is_null());
  const std::string svg = folder.read("out.svg");
  tinyxml2::XMLDocument document;
  ASSERT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS);
  int marks = 0;
  for (const auto* dot = document.RootElement()->FirstChildElement("circle"); dot != nullptr;
       dot = dot->NextSiblingElement("circle"))
    ++marks;
  EXPECT_EQ(marks, 3);
  const std::string isa = answer.at("runs")[0].at("isa");
  for (const std::string& part : {std::string("rolling_ball_small"), isa, std::string("mixed"),
                                  std::string("4 environments")})
    EXPECT_THAT(svg, HasSubstr(part));
  EXPECT_THAT(folder.files(), ElementsAre("out.svg"));
}

TEST(Bench, TheTableHasTheKeysOfTheObject) {
  const Folder folder;
  const json answer =
      bench_json(folder, {"--envs", "4", "--steps", "20", "--threads", "1,2", "--csv", "out.csv"});
  std::istringstream table(folder.read("out.csv"));
  std::string header, row;
  std::getline(table, header);
  const json& entry = answer.at("runs")[0];
  const auto commas = [](const std::string& line) {
    return std::count(line.begin(), line.end(), ',');
  };
  EXPECT_EQ(header.rfind("scene,machine,threads,envs,steps,", 0), 0U) << header;
  EXPECT_EQ(commas(header), 1 + std::ssize(entry));
  for (const auto& [key, value] : entry.items())
    EXPECT_THAT("," + header + ",", HasSubstr("," + key + ","));
  int rows = 0;
  for (; std::getline(table, row); ++rows)
    EXPECT_THAT(row, HasSubstr("\"" + entry.at("checksum").get<std::string>() + "\""));
  EXPECT_EQ(rows, 2);
}

TEST(Bench, PeopleGetATable) {
  const Folder folder;
  const Outcome text =
      run(folder, bench({"--envs", "32", "--steps", "10", "--threads", "1,2", "--svg", "a.svg"}));
  EXPECT_EQ(text.exit_code, 0);
  for (const char* part :
       {"rolling_ball_small: 32 environments, 10 steps, frames dense of pad every 5 steps",
        "env-steps/s", "speed-up", "checksum: ", "wrote a.svg"})
    EXPECT_THAT(text.out, HasSubstr(part));
  EXPECT_THAT(run(folder, bench({"--envs", "2", "--steps", "5", "--threads", "2"})).err,
              HasSubstr("1 block of 16 environments keep"));
}

TEST(Bench, FailedEnvironmentsAreListed) {
  const Folder folder;
  std::string text;
  {
    const Folder scenes;
    std::filesystem::copy_file(kSmall, scenes.path("small.xml"));
    text = scenes.read("small.xml");
  }
  const std::size_t at = text.find("timestep=\"5e-3\"");
  ASSERT_NE(at, std::string::npos);
  folder.write("days.xml", text.replace(at, 15, "timestep=\"86400\""));
  const Words words{"--envs", "25", "--steps", "2", "--every", "1", "--threads", "1,2"};
  const json answer = bench_json(folder, words, 1, "days.xml");
  for (const json& entry : answer.at("runs")) {
    ASSERT_THAT(entry.at("failed"), SizeIs(25));
    EXPECT_EQ(entry.at("failed")[0].at("environment"), 0);
    EXPECT_EQ(entry.at("failed")[0].at("step"), 0);
  }
  const Outcome people = run(folder, bench(words, "days.xml"));
  EXPECT_EQ(people.exit_code, 1);
  EXPECT_THAT(people.err, HasSubstr("environment 0 failed in step 0: "));
  EXPECT_THAT(people.err, HasSubstr("not listed: 5; --json names all"));
}

class BenchRefuses : public testing::TestWithParam<Refusal> {};

TEST_P(BenchRefuses, AndLeavesNothing) {
  const Folder folder;
  const json answer = bench_json(folder, GetParam().words, GetParam().exit_code);
  EXPECT_THAT(answer.at("error").get<std::string>(), HasSubstr(GetParam().message));
  EXPECT_THAT(folder.files(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    Values, BenchRefuses,
    testing::Values(
        Refusal{
            "threads_0", {"--threads", "0"}, 2, "--threads 0: '0'; expected whole numbers from 1"},
        Refusal{"threads_junk", {"--threads", "1,2x"}, 2, "'2x'; expected whole numbers"},
        Refusal{"threads_empty", {"--threads", "1,,2"}, 2, "''; expected whole numbers"},
        Refusal{"threads_end", {"--threads", "1,"}, 2, "''; expected whole numbers"},
        Refusal{"threads_twice", {"--threads", "2,1,2"}, 2, "2 is given twice"},
        Refusal{"frames",
                {"--frames", "foo"},
                2,
                "unknown frames 'foo'; expected one of dense, compact, none"},
        Refusal{"frames_near", {"--frames", "dens"}, 2, "did you mean 'dense'?"},
        Refusal{"precision",
                {"--precision", "half"},
                2,
                "unknown precision 'half'; expected one of double, mixed"},
        Refusal{"repeat", {"--repeat", "0"}, 2, "--repeat 0: expected a whole number from 1"},
        Refusal{"option", {"--thread", "1"}, 2, "did you mean '--threads'?"},
        Refusal{"memory", {"--envs", "1000000000"}, 2, "--envs 1000000000 needs "},
        Refusal{"one_file", {"--svg", "x", "--csv", "x"}, 2, "expected two files"},
        Refusal{"scene_as_output", {"--svg", kSmall, "--overwrite"}, 2, "expected another file"},
        Refusal{"no_folder", {"--csv", "no/x.csv"}, 3, "no"},
        Refusal{"second_output", {"--svg", "x.svg", "--csv", "/proc/x.csv"}, 3, "/proc/x.csv"}),
    [](const auto& test) { return test.param.name; });

TEST(Bench, AnOutputThatExistsIsKept) {
  const Folder folder;
  folder.write("out.csv", "mine");
  const Words words{"--envs", "1", "--steps", "3", "--threads", "1", "--csv", "out.csv"};
  EXPECT_THAT(bench_json(folder, words, 3).at("error").get<std::string>(),
              HasSubstr("--overwrite"));
  EXPECT_EQ(folder.read("out.csv"), "mine");
  Words replace = words;
  replace.emplace_back("--overwrite");
  bench_json(folder, replace);
  EXPECT_NE(folder.read("out.csv"), "mine");
}

class BenchStops : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(BenchStops, AtASafePointAndLeavesNothing) {
  const auto [signal, exit_code] = GetParam();
  const Folder folder;
  Program program(folder,
                  bench({"--steps", "5000000", "--threads", "2", "--csv", "out.csv", "--json"}));
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!std::filesystem::exists(folder.path("out.csv.part"))) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline) << "it never began";
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  program.send(signal);
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.signal, 0);
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("while measuring 2 threads; nothing was written"));
  EXPECT_EQ(json::parse(outcome.out).at("exit_code"), exit_code);
  EXPECT_THAT(folder.files(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Signals, BenchStops,
                         testing::Values(std::pair{SIGINT, 130}, std::pair{SIGTERM, 75}));

}  // namespace
}  // namespace tangere::apps
