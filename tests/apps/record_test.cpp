// SPDX-License-Identifier: Apache-2.0
// --record and <outputs>: files hold what was asked for, and that is what a whole run holds.
#include <gmock/gmock.h>
#include <hdf5.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<double> numbers(const Folder& folder, const std::string& file,
                            const std::string& name) {
  const h5::Id opened = h5::open_file(folder.path(file)), d = h5::open_dataset(opened, name);
  const h5::Dims dims = h5::dimensions(d);
  hsize_t count = 1;
  for (const hsize_t n : dims) count *= n;
  std::vector<double> x(count);
  h5::read_box<double>(d, h5::Dims(dims.size(), 0), dims, x.data());
  return x;
}
h5::Dims shape(const Folder& folder, const std::string& file, const std::string& name) {
  const h5::Id opened = h5::open_file(folder.path(file));
  return h5::dimensions(h5::open_dataset(opened, name));
}
bool has(const Folder& folder, const std::string& file, const std::string& group,
         const std::string& name) {
  const h5::Id opened = h5::open_file(folder.path(file));
  return h5::has_link(h5::open_group(opened, group), name);
}

json simulate(const Folder& folder, const std::string& what, const std::string& out,
              const Words& more) {
  return run_json(folder, Words{"simulate", what, "--output", out, "--steps", "120", "--every",
                                "60", "--envs", "2", "--seed", "3"} +
                              more);
}

TEST(Record, ATrajectoryHoldsTheFormsOfAWholeOne) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  simulate(folder, ball, "whole.h5", {});
  const json said =
      simulate(folder, ball, "some.h5", {"--record", "pad.pressure,pad.shear,pad.sum"});
  EXPECT_EQ(said["sensors"][0]["form"], "pressure");
  EXPECT_EQ(said["sensors"][2]["form"], "sum");
  EXPECT_EQ(shape(folder, "some.h5", "tactile/pad/pressure"), (h5::Dims{2, 2, 32, 32, 1}));
  EXPECT_EQ(shape(folder, "some.h5", "tactile/pad/sum"), (h5::Dims{2, 2, 6}));
  EXPECT_FALSE(has(folder, "some.h5", "tactile/pad", "force"));
  EXPECT_FALSE(has(folder, "some.h5", "/", "bodies"));
  EXPECT_EQ(numbers(folder, "some.h5", "q"), numbers(folder, "whole.h5", "q"));
  EXPECT_EQ(numbers(folder, "some.h5", "tactile/pad/step"),
            numbers(folder, "whole.h5", "tactile/pad/step"));
  const std::vector<double> whole = numbers(folder, "whole.h5", "tactile/pad/force"),
                            shear = numbers(folder, "some.h5", "tactile/pad/shear");
  ASSERT_EQ(3 * shear.size(), 2 * whole.size());
  for (std::size_t k = 0; k < shear.size(); ++k) ASSERT_EQ(shear[k], whole[k / 2 * 3 + k % 2]) << k;
}

TEST(Record, AnythingElseOfATrajectoryStillWorks) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  simulate(folder, ball, "some.h5", {"--record", "pad.pressure"});
  EXPECT_EQ(run(folder, {"plot", "some.h5", "-o", "pad.svg"}).exit_code, 0);
  EXPECT_THAT(file_bytes(folder.path("pad.svg")), HasSubstr("shear was not recorded"));
  simulate(folder, ball, "shear.h5", {"--record", "pad.shear"});
  EXPECT_EQ(run(folder, {"plot", "shear.h5", "-o", "shear.svg"}).exit_code, 0);
  EXPECT_THAT(file_bytes(folder.path("shear.svg")), HasSubstr("pressure was not recorded"));
  simulate(folder, ball, "both.h5",
           {"--record", "pad.shear,pad.pressure", "--gradients", "tactile"});
  EXPECT_EQ(run(folder, {"plot", "both.h5", "-o", "both.svg"}).exit_code, 0);
  EXPECT_THAT(file_bytes(folder.path("both.svg")), ::testing::Not(HasSubstr("was not recorded")));
  simulate(folder, ball, "next.h5", {"--record", "bodies", "--state-from", "some.h5"});
  EXPECT_TRUE(has(folder, "next.h5", "/", "bodies"));
  EXPECT_FALSE(has(folder, "next.h5", "/", "tactile"));
  simulate(folder, ball, "sum.h5", {"--record", "pad.sum"});
  const Outcome none = run(folder, {"plot", "sum.h5", "-o", "sum.svg"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("the run recorded no tactile field, pressure or shear"));
  EXPECT_THAT(run(folder, {"plot", "sum.h5", "-o", "sum.svg", "--sensor", "pad"}).err,
              HasSubstr("of sensor 'pad' the run recorded only the sum, markers, surface, flow, "
                        "channels or pictures"));
  run_json(folder, {"simulate", "stable_grasp", "-o", "task.h5", "--record", "left_pad.sum"});
  EXPECT_EQ(shape(folder, "task.h5", "tactile/left_pad/sum").back(), 6U);
}

TEST(Record, DamagedReadingsEndInAMessage) {
  const Folder folder;
  simulate(folder, scene("rolling_ball_small.xml"), "run.h5",
           {"--record", "pad.pressure,pad.shear"});
  const auto damage = [&](const auto& change) {
    const hid_t file = H5Fopen(folder.path("run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    change(file);
    H5Fclose(file);
    return run(folder, {"plot", "run.h5", "-o", "pad.svg"});
  };
  const Outcome shape = damage([](hid_t file) {
    H5Ldelete(file, "tactile/pad/shear", H5P_DEFAULT);
    const hsize_t dims[] = {2, 2, 31, 32, 2};
    const hid_t space = H5Screate_simple(5, dims, nullptr);
    H5Dclose(H5Dcreate2(file, "tactile/pad/shear", H5T_NATIVE_DOUBLE, space, H5P_DEFAULT,
                        H5P_DEFAULT, H5P_DEFAULT));
    H5Sclose(space);
  });
  EXPECT_EQ(shape.exit_code, 3);
  EXPECT_THAT(shape.err, HasSubstr("'shear' has not the shape of 'pressure'"));
  const Outcome empty = damage([](hid_t file) {
    for (const char* name : {"tactile/pad/shear", "tactile/pad/pressure"})
      H5Ldelete(file, name, H5P_DEFAULT);
  });
  EXPECT_EQ(empty.exit_code, 3);
  EXPECT_THAT(empty.err, HasSubstr("sensor 'pad' has no reading"));
}

TEST(Record, ADamagedListOfStepsEndsInAMessage) {
  const Folder folder;
  simulate(folder, scene("rolling_ball_small.xml"), "run.h5", {"--record", "q/60,pad"});
  const auto with = [&](std::vector<std::int64_t> steps) {
    const hid_t file = H5Fopen(folder.path("run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t list = H5Dopen2(file, "step", H5P_DEFAULT);
    H5Dwrite(list, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, steps.data());
    H5Dclose(list);
    H5Fclose(file);
  };
  for (const std::vector<std::int64_t>& steps :
       {std::vector<std::int64_t>{0, 60, 121}, {60, 0, 120}, {-1, 60, 120}, {0, 60, 60}}) {
    with(steps);
    for (const Words& words : {Words{"view", "run.h5", "-o", "run.html", "--overwrite"},
                               Words{"simulate", scene("rolling_ball_small.xml"), "-o", "x.h5",
                                     "--state-from", "run.h5", "--steps", "1"}}) {
      const Outcome outcome = run(folder, words);
      EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
      EXPECT_THAT(outcome.err, HasSubstr("expected ascending steps from 0 to 120"));
    }
  }
  with({0, 60, 120});
  EXPECT_EQ(run(folder, {"view", "run.h5", "-o", "run.html"}).exit_code, 0);
}

TEST(Record, ADataSetHoldsTheFormsOfAWholeOne) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const Words size{"generate", ball, "--episodes", "17", "--steps", "120", "--every", "20"};
  run_json(folder, size + Words{"-o", "whole", "--tactile", "dense"});
  run_json(folder, size + Words{"-o", "some", "--record", "pad.sum,q,pad.shear,pad.pressure"});
  EXPECT_EQ(run(folder, size + Words{"-o", "some", "--record", "q,pad.shear,pad.pressure,pad.sum",
                                     "--resume"})
                .exit_code,
            0)
      << "the order of names does not matter";
  EXPECT_THAT(
      run(folder, size + Words{"-o", "some", "--record", "q,pad.sum", "--resume"}).err,
      HasSubstr("observations: q, pad.pressure, pad.shear, pad.sum there, q, pad.sum here"));
  run_json(folder, size + Words{"-o", "tiles", "--record", "pad.shear,pad"});
  const std::string shard = "some/shard-00000.h5", demo = "data/demo_16/obs/";
  EXPECT_THAT(
      h5::read_texts(h5::open_group(h5::open_file(folder.path(shard)), "scene"), "observations"),
      ElementsAre("q", "pad.pressure", "pad.shear", "pad.sum"));
  EXPECT_EQ(shape(folder, shard, demo + "pad.pressure"), (h5::Dims{6, 32, 32, 1}));
  EXPECT_EQ(shape(folder, shard, demo + "pad.sum"), (h5::Dims{6, 6}));
  const std::vector<double> whole = numbers(folder, "whole/shard-00000.h5", demo + "pad"),
                            shear = numbers(folder, shard, demo + "pad.shear");
  for (std::size_t k = 0; k < shear.size(); ++k) ASSERT_EQ(shear[k], whole[k / 2 * 3 + k % 2]) << k;
  EXPECT_EQ(numbers(folder, "tiles/shard-00000.h5", demo + "pad.shear"), shear);
  EXPECT_EQ(numbers(folder, "tiles/shard-00000.h5", demo + "pad"), whole);
  EXPECT_THAT(h5::read_texts(h5::open_group(h5::open_file(folder.path(shard)), "scene/sensors/pad"),
                             "readings"),
              ElementsAre("pad.pressure", "pad.shear", "pad.sum"));
  for (const char* set : {"some", "tiles"}) {
    EXPECT_EQ(run(folder, {"validate", set}).exit_code, 0) << set;
    EXPECT_EQ(run(folder, {"validate", std::string(set) + "/robomimic.hdf5"}).exit_code, 0) << set;
  }
}

TEST(Record, TheSceneAsksAndTheOptionAsksInstead) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  std::string text = file_bytes(ball);
  const std::string end = "</tangere>";
  const std::size_t at = text.find(end);
  ASSERT_NE(at, std::string::npos);
  text.insert(at, "<outputs record=\"bodies,pad.sum\"/>\n");
  folder.write("ball.xml", text);
  simulate(folder, "ball.xml", "scene.h5", {});
  EXPECT_TRUE(has(folder, "scene.h5", "tactile/pad", "sum"));
  EXPECT_FALSE(has(folder, "scene.h5", "tactile/pad", "force"));
  simulate(folder, "ball.xml", "option.h5", {"--record", "pad"});
  EXPECT_TRUE(has(folder, "option.h5", "tactile/pad", "force"));
  EXPECT_FALSE(has(folder, "option.h5", "/", "bodies"));
  const Outcome set =
      run(folder, {"generate", "ball.xml", "-o", "set", "--episodes", "1", "--steps", "5"});
  EXPECT_EQ(set.exit_code, 0) << set.err;
  EXPECT_EQ(shape(folder, "set/shard-00000.h5", "data/demo_0/obs/pad.sum"), (h5::Dims{1, 6}));
  EXPECT_EQ(shape(folder, "set/shard-00000.h5", "data/demo_0/obs/bodies").back(), 13U);
  EXPECT_THAT(run(folder, {"bench", "ball.xml", "--steps", "5", "--envs", "16"}).err,
              HasSubstr("bench reads sensors and cameras alone"));
  EXPECT_EQ(run_json(folder, {"inspect", "ball.xml"}).at("outputs"),
            json::array({"bodies", "pad.sum"}));
  EXPECT_THAT(run(folder, {"inspect", "ball.xml"}).out, HasSubstr("): bodies, pad.sum\n"));
  EXPECT_THAT(run(folder, {"inspect", ball}).out, HasSubstr("outputs: everything\n"));
  std::string times = text;
  times.replace(times.find("pad.sum"), 7, "pad/often");
  folder.write("times.xml", times);
  EXPECT_THAT(run(folder, {"inspect", "times.xml"}).err,
              HasSubstr("record has 'pad/often': expected 'pad', 'pad/10'"));
  text.replace(text.find("pad.sum"), 7, "pad.sun");
  folder.write("wrong.xml", text);
  const Outcome wrong = run(folder, {"inspect", "wrong.xml"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("record has 'pad.sun'; did you mean 'pad.sum'?"));
  EXPECT_THAT(wrong.err, HasSubstr("wrong.xml:"));
}

/// The same rows of two trajectories: `rows` of the whole one.
void expect_rows(const Folder& folder, const std::string& name,
                 const std::vector<std::size_t>& rows) {
  const std::vector<double> whole = numbers(folder, "whole.h5", name),
                            some = numbers(folder, "some.h5", name);
  const std::size_t width = some.size() / rows.size();
  ASSERT_EQ(some.size(), width * rows.size()) << name;
  for (std::size_t r = 0; r < rows.size(); ++r)
    for (std::size_t k = 0; k < width; ++k)
      ASSERT_EQ(some[r * width + k], whole[rows[r] * width + k]) << name << " " << r << " " << k;
}

std::vector<std::int64_t> whole_numbers(const Folder& folder, const std::string& file,
                                        const std::string& name) {
  std::vector<std::int64_t> list;
  for (const double x : numbers(folder, file, name)) list.push_back(std::int64_t(x));
  return list;
}

TEST(Record, ATrajectoryHoldsItsEndAloneOrEveryKthRow) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const Words words{"simulate", ball,     "--steps", "120",    "--every",
                    "20",       "--envs", "2",       "--seed", "3"};
  run_json(folder, words + Words{"-o", "whole.h5", "--record", "bodies,pad,pad.sum"});
  const json said = run_json(
      folder, words + Words{"-o", "some.h5", "--record", "q/final,pad/40,pad.sum,bodies.ball/60"});
  EXPECT_EQ(said["sensors"][0]["every"], 40);
  EXPECT_EQ(said["sensors"][0]["frames"], 3);
  EXPECT_EQ(said["sensors"][1]["frames"], 6);
  for (const char* name : {"q", "v", "time"}) expect_rows(folder, name, {120});
  EXPECT_THAT(whole_numbers(folder, "some.h5", "step"), ElementsAre(120));
  expect_rows(folder, "tactile/pad/force", {1, 3, 5});
  EXPECT_THAT(whole_numbers(folder, "some.h5", "tactile/pad/step"), ElementsAre(40, 80, 120));
  expect_rows(folder, "tactile/pad/sum", {0, 1, 2, 3, 4, 5});
  EXPECT_EQ(whole_numbers(folder, "some.h5", "tactile/pad/sum_step").size(), 6U);
  EXPECT_EQ(shape(folder, "some.h5", "bodies/pose"), (h5::Dims{3, 2, 1, 7}));
  EXPECT_THAT(whole_numbers(folder, "some.h5", "bodies/step"), ElementsAre(0, 60, 120));
  const std::vector<double> whole = numbers(folder, "whole.h5", "bodies/pose"),
                            one = numbers(folder, "some.h5", "bodies/pose");
  const std::size_t nb = shape(folder, "whole.h5", "bodies/pose")[2];
  const auto names =
      h5::read_texts(h5::open_group(h5::open_file(folder.path("whole.h5")), "bodies"), "names");
  const auto at = std::size_t(std::find(names.begin(), names.end(), "ball") - names.begin());
  ASSERT_LT(at, nb);
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t e = 0; e < 2; ++e)
      for (std::size_t i = 0; i < 7; ++i)
        EXPECT_EQ(one[(r * 2 + e) * 7 + i], whole[((60 * r * 2 + e) * nb + at) * 7 + i]);
  EXPECT_FALSE(has(folder, "some.h5", "/", "u"));
  EXPECT_EQ(shape(folder, "some.h5", "solver/status"), (h5::Dims{1, 2}));
  EXPECT_EQ(run(folder, {"plot", "some.h5", "-o", "pad.svg"}).exit_code, 0);
  EXPECT_EQ(run(folder, {"view", "some.h5", "-o", "end.html"}).exit_code, 0);
  simulate(folder, ball, "tenth.h5", {"--record", "q/10,pad.shear/30,pad.pressure"});
  EXPECT_EQ(shape(folder, "tenth.h5", "q")[0], 13U);
  EXPECT_EQ(run(folder, {"view", "tenth.h5", "-o", "tenth.html"}).exit_code, 0);
  EXPECT_EQ(run(folder, {"plot", "tenth.h5", "-o", "tenth.svg"}).exit_code, 0);
}

/// A scheme of one step goes on from the end alone with the bits of one long run.
TEST(Record, ARunGoesOnFromItsEndAlone) {
  const Folder folder;
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  const std::size_t at = text.find("BDF2");
  ASSERT_NE(at, std::string::npos);
  folder.write("ball.xml", text.replace(at, 4, "BDF1"));
  const Words what{"simulate", "ball.xml", "--envs", "2", "--seed", "3", "--every", "20"};
  run_json(folder, what + Words{"-o", "whole.h5", "--steps", "120"});
  run_json(folder, what + Words{"-o", "half.h5", "--steps", "60", "--record", "q/final"});
  run_json(folder, Words{"simulate", "ball.xml", "-o", "some.h5", "--state-from", "half.h5",
                         "--steps", "60", "--record", "q/final,pad/40"});
  for (const char* name : {"q", "v", "time"}) expect_rows(folder, name, {120});
  expect_rows(folder, "tactile/pad/force", {3, 5});
  EXPECT_THAT(whole_numbers(folder, "some.h5", "tactile/pad/step"), ElementsAre(20, 60));
  const Outcome other = run(folder, {"simulate", "ball.xml", "-o", "x.h5", "--state-from",
                                     "half.h5", "--row", "7", "--steps", "5"});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("row 7 of half.h5 was not recorded; expected one of 60"));
}

TEST(Record, ADataSetSamplesWhatIsNotWantedInEveryRow) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const Words size{"generate", ball, "--episodes", "17", "--steps", "120", "--every", "20"};
  run_json(folder, size + Words{"-o", "whole", "--record", "q,v,pad,bodies", "--tactile", "dense"});
  const std::string words = "q,v/final,pad/60,pad.sum,bodies.ball/40";
  run_json(folder, size + Words{"-o", "some", "--record", words});
  run_json(folder, size + Words{"-o", "packed", "--record", words, "--compress", "deflate"});
  run_json(folder, size + Words{"-o", "end", "--record", "q/final"});
  const std::string of = "data/demo_16/";
  for (const char* set : {"some", "packed"}) {
    const std::string shard = std::string(set) + "/shard-00000.h5", whole = "whole/shard-00000.h5";
    EXPECT_EQ(shape(folder, shard, of + "samples/pad"), (h5::Dims{3, 32, 32, 3}));
    const std::vector<double> rows = numbers(folder, whole, of + "obs/pad"),
                              last = numbers(folder, whole, of + "final_obs/pad"),
                              some = numbers(folder, shard, of + "samples/pad");
    const std::size_t n = last.size();
    for (std::size_t k = 0; k < n; ++k) {
      ASSERT_EQ(some[k], rows[k]);
      ASSERT_EQ(some[n + k], rows[3 * n + k]);
      ASSERT_EQ(some[2 * n + k], last[k]);
    }
    EXPECT_EQ(numbers(folder, shard, of + "samples/v"), numbers(folder, whole, of + "final_obs/v"));
    EXPECT_EQ(shape(folder, shard, of + "samples/bodies.ball"), (h5::Dims{4, 1, 13}));
    EXPECT_FALSE(has(folder, shard, of + "obs", "pad"));
    const h5::Id file = h5::open_file(folder.path(shard)), said = h5::open_group(file, "scene");
    EXPECT_THAT(h5::read_texts(said, "observations"), ElementsAre("q", "pad.sum"));
    EXPECT_THAT(h5::read_texts(said, "samples"), ElementsAre("v", "bodies.ball", "pad"));
    EXPECT_THAT(h5::read_numbers<std::int64_t>(said, "sample_every"), ElementsAre(0, 40, 60));
    EXPECT_EQ(run(folder, {"view", set, "-o", std::string(set) + ".html"}).exit_code, 0);
  }
  for (const char* set : {"some", "packed", "end"}) {
    EXPECT_EQ(run(folder, {"validate", set}).exit_code, 0) << set;
    EXPECT_EQ(run(folder, {"validate", std::string(set) + "/robomimic.hdf5"}).exit_code, 0) << set;
    EXPECT_EQ(run(folder, {"merge", set, "--copy", "--overwrite"}).exit_code, 0) << set;
    EXPECT_EQ(run(folder, {"validate", std::string(set) + "/robomimic.hdf5"}).exit_code, 0) << set;
    EXPECT_EQ(run(folder, {"info", set}).exit_code, 0) << set;
  }
  EXPECT_THAT(run(folder, {"export", "some", "--csv", "some.csv"}).err,
              HasSubstr("left out: v, bodies.ball, pad"));
  const Outcome odd = run(folder, size + Words{"-o", "odd", "--record", "pad/30"});
  EXPECT_EQ(odd.exit_code, 2);
  EXPECT_THAT(odd.err, HasSubstr("'pad/30', and a row is every 20 steps; expected a multiple"));
  // Numbers that are damaged are noticed.
  {
    const hid_t file =
        H5Fopen(folder.path("some/shard-00000.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t data = H5Dopen2(file, (of + "samples/v").c_str(), H5P_DEFAULT);
    const std::vector<double> zeros(9, 0.5);
    H5Dwrite(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, zeros.data());
    H5Dclose(data);
    H5Fclose(file);
  }
  EXPECT_EQ(run(folder, {"validate", "some"}).exit_code, 3);
}

TEST(Record, FlowIsShearOverItsLargestLength) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const Words what{"--steps", "120", "--every", "20", "--seed", "3", "--record", "pad,pad.flow"};
  run_json(folder, Words{"simulate", ball, "-o", "run.h5", "--envs", "2"} + what);
  EXPECT_EQ(shape(folder, "run.h5", "tactile/pad/flow"), (h5::Dims{6, 2, 32, 32, 2}));
  const std::vector<double> force = numbers(folder, "run.h5", "tactile/pad/force"),
                            flow = numbers(folder, "run.h5", "tactile/pad/flow");
  const std::size_t points = 32 * 32;
  int sheared = 0;
  for (std::size_t first = 0; first < flow.size() / 2; first += points) {
    double longest = 0;
    for (std::size_t p = first; p < first + points; ++p)
      longest = std::max(longest, std::hypot(force[3 * p], force[3 * p + 1]));
    sheared += longest > 0 ? 1 : 0;
    for (std::size_t k = 2 * first; k < 2 * (first + points); ++k)
      ASSERT_EQ(flow[k], longest > 0 ? force[k / 2 * 3 + k % 2] / longest : 0);
  }
  EXPECT_GT(sheared, 5);
  EXPECT_EQ(
      h5::attribute_text(h5::open_dataset(h5::open_file(folder.path("run.h5")), "tactile/pad/flow"),
                         "units"),
      "1");
  run_json(folder,
           Words{"generate", ball, "-o", "set", "--episodes", "2", "--precision", "double"} + what);
  EXPECT_EQ(shape(folder, "set/shard-00000.h5", "data/demo_1/obs/pad.flow"),
            (h5::Dims{6, 32, 32, 2}));
  EXPECT_EQ(run(folder, {"plot", "run.h5", "-o", "pad.svg"}).exit_code, 0);
}

TEST(Record, MarkersAreRecordedWhereASensorHasThem) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const Outcome none = run(folder, {"simulate", ball, "-o", "x.h5", "--record", "pad.markers"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("--record: 'pad.markers', but "));
  EXPECT_THAT(none.err, HasSubstr("sensor 'pad' has no <markers>; expected it in its <tactile>"));
  std::string text = file_bytes(ball);
  const std::size_t tag = text.find("<tactile name"), end = text.find("/>", tag);
  text.replace(end, 2, "><markers stiffness=\"20\"/></tactile>");
  folder.write("gel.xml", text);
  EXPECT_EQ(run_json(folder, {"inspect", "gel.xml"}).at("sensors")[0].at("markers"), true);
  EXPECT_EQ(run_json(folder, {"inspect", ball}).at("sensors")[0].at("markers"), false);
  const Words size{"--steps", "120", "--every",  "20",
                   "--seed",  "3",   "--record", "pad,pad.markers,pad.sum"};
  run_json(folder, Words{"simulate", "gel.xml", "-o", "gel.h5", "--envs", "17"} + size);
  run_json(folder, Words{"simulate", ball, "-o", "plain.h5", "--envs", "17", "--steps", "120",
                         "--every", "20", "--seed", "3", "--record", "pad"});
  EXPECT_EQ(shape(folder, "gel.h5", "tactile/pad/markers"), (h5::Dims{6, 17, 32, 32, 2}));
  const std::vector<double> force = numbers(folder, "gel.h5", "tactile/pad/force"),
                            markers = numbers(folder, "gel.h5", "tactile/pad/markers");
  EXPECT_EQ(force, numbers(folder, "plain.h5", "tactile/pad/force"));
  double most = 0;
  for (std::size_t k = 0; k < markers.size(); ++k) {
    ASSERT_NEAR(markers[k], force[k / 2 * 3 + k % 2] / 20, 1e-18);
    most = std::max(most, std::abs(markers[k]));
  }
  EXPECT_GT(most, 0);
  EXPECT_EQ(
      h5::attribute_text(
          h5::open_dataset(h5::open_file(folder.path("gel.h5")), "tactile/pad/markers"), "units"),
      "m");
  run_json(folder,
           Words{"generate", "gel.xml", "-o", "set", "--episodes", "17", "--precision", "double"} +
               size);
  const std::vector<double> rows =
      numbers(folder, "set/shard-00000.h5", "data/demo_16/obs/pad.markers");
  const std::size_t n = 32 * 32 * 2;
  for (std::size_t row = 1; row < 6; ++row)
    for (std::size_t k = 0; k < n; ++k)
      ASSERT_EQ(rows[row * n + k], markers[((row - 1) * 17 + 16) * n + k]);
  EXPECT_EQ(run(folder, {"validate", "set"}).exit_code, 0);
  run_json(folder,
           {"simulate", "gel.xml", "-o", "only.h5", "--steps", "20", "--record", "pad.markers"});
  EXPECT_EQ(run(folder, {"view", "only.h5", "-o", "only.html"}).exit_code, 0);
  EXPECT_THAT(run(folder, {"plot", "only.h5", "-o", "only.svg", "--sensor", "pad"}).err,
              HasSubstr("recorded only the sum, markers, surface, flow, channels or pictures"));
  const Outcome check = run(folder, {"gradcheck", ball, "--loss", "markers"});
  EXPECT_EQ(check.exit_code, 2);
  EXPECT_THAT(check.err, HasSubstr("no sensor of the scene has <markers>"));
}

TEST(Record, TimesThatContradictEachOtherAreRefused) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const auto refused = [&](const std::string& list) {
    const Outcome outcome =
        run(folder, {"simulate", ball, "-o", "x.h5", "--steps", "3", "--record", list});
    EXPECT_EQ(outcome.exit_code, 2) << list;
    return outcome.err;
  };
  EXPECT_THAT(refused("q/5,v"), HasSubstr("'q/5' and 'v'; expected one interval of both"));
  EXPECT_THAT(refused("pad/5,pad/10"), HasSubstr("'pad' is listed twice"));
  EXPECT_THAT(refused("bodies,bodies.ball"), HasSubstr("expected all bodies, or names of some"));
  EXPECT_THAT(refused("bodies.ball/2,bodies.pad"),
              HasSubstr("expected one interval of all bodies"));
  EXPECT_THAT(refused("pad/0"), HasSubstr("--record: 'pad/0': expected 'pad', 'pad/10'"));
}

/// The small ball with an imperfect sensor.
std::string imperfect_ball(const std::string& coefficients) {
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
  const std::size_t tag = text.find("<tactile name"), end = text.find("/>", tag);
  EXPECT_NE(end, std::string::npos);
  return text.replace(end, 2, "><imperfections " + coefficients + "/></tactile>");
}

TEST(Record, ImperfectSensorsReadAlikeInEveryFile) {
  const Folder folder;
  folder.write("ball.xml", imperfect_ball("noise=\"2e-4 1e-4\" bias=\"1e-4\" dead=\"0.02\""));
  const Words what{"--seed", "3", "--every", "20", "--record", "pad,pad.ideal,pad.sum"};
  const auto steps = [&](const std::string& n) { return Words{"--steps", n}; };
  run_json(folder,
           Words{"simulate", "ball.xml", "-o", "run.h5", "--envs", "2"} + what + steps("120"));
  run_json(folder,
           Words{"simulate", "ball.xml", "-o", "half.h5", "--envs", "2"} + what + steps("60"));
  run_json(folder, Words{"simulate", "ball.xml", "-o", "rest.h5", "--state-from", "half.h5",
                         "--every", "20", "--record", "pad"} +
                       steps("60"));
  run_json(folder, Words{"simulate", scene("rolling_ball_small.xml"), "-o", "plain.h5", "--envs",
                         "2", "--seed", "3", "--every", "20", "--record", "pad"} +
                       steps("120"));
  const std::vector<double> force = numbers(folder, "run.h5", "tactile/pad/force"),
                            ideal = numbers(folder, "run.h5", "tactile/pad/ideal"),
                            rest = numbers(folder, "rest.h5", "tactile/pad/force");
  EXPECT_EQ(ideal, numbers(folder, "plain.h5", "tactile/pad/force"));
  EXPECT_NE(force, ideal);
  ASSERT_EQ(force.size(), 2 * rest.size());
  EXPECT_TRUE(std::equal(rest.begin(), rest.end(), force.begin() + std::ptrdiff_t(rest.size())))
      << "a run that goes on has the noise of one long run";
  const h5::Id run_file = h5::open_file(folder.path("run.h5"));
  const auto attribute = [&](const std::string& name) {
    return h5::attribute_text(h5::open_dataset(run_file, name), "imperfections");
  };
  EXPECT_EQ(attribute("tactile/pad/force"), "bias 0.0001 N, noise 0.0002 0.0001 N, dead 0.02");
  EXPECT_EQ(attribute("tactile/pad/ideal"), "none");

  run_json(folder,
           Words{"generate", "ball.xml", "-o", "set", "--episodes", "2", "--precision", "double"} +
               what + steps("120"));
  constexpr std::size_t kField = 32 * 32 * 3;
  for (std::size_t e = 0; e < 2; ++e)
    for (const auto& [name, all] : {std::pair("pad", &force), std::pair("pad.ideal", &ideal)}) {
      const std::string demo = "set/shard-00000.h5",
                        of = "data/demo_" + std::to_string(e) + "/obs/";
      const std::vector<double> rows = numbers(folder, demo, of + name);
      for (std::size_t row = 1; row < rows.size() / kField; ++row)  // fields follow a step
        for (std::size_t i = 0; i < kField; ++i)
          ASSERT_EQ(rows[row * kField + i], (*all)[((row - 1) * 2 + e) * kField + i]) << name;
    }
  EXPECT_EQ(h5::attribute_text(h5::open_group(h5::open_file(folder.path("set/shard-00000.h5")),
                                              "scene/sensors/pad"),
                               "imperfections"),
            "bias 0.0001 N, noise 0.0002 0.0001 N, dead 0.02");
  EXPECT_EQ(run(folder, {"validate", "set"}).exit_code, 0);
  EXPECT_EQ(run(folder, {"plot", "run.h5", "-o", "run.svg"}).exit_code, 0);
  const json inspected = run_json(folder, {"inspect", "ball.xml"});
  EXPECT_EQ(inspected.at("effects").at("sensor imperfections").at("on"), true);
}

TEST(Record, ASensorWithMemoryKeepsToItsTimestepAndHasAGradient) {
  const Folder folder;
  folder.write("ball.xml", imperfect_ball("delay=\"0.02\""));
  const Words words{"simulate", "ball.xml", "-o", "x.h5", "--steps", "30", "--every", "10"};
  const Outcome other = run(folder, words + Words{"--timestep", "0.0025"});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("delay, low_pass and hysteresis of 'pad' count steps of"));
  EXPECT_EQ(run(folder, words + Words{"--gradients", "final"}).exit_code, 0);
}

/// Readings that need earlier states have derivatives, on one tape or from checkpoints.
TEST(Record, ALateSensorHasGradientsByThreeRoutes) {
  const Folder folder;
  folder.write("ball.xml", imperfect_ball("delay=\"0.007\" low_pass=\"0.01\" noise=\"1e-3\""));
  const json found = run_json(
      folder, {"gradcheck", "ball.xml", "--loss", "tactile", "--steps", "90", "--entries", "4"});
  EXPECT_LT(found.at("max_relative_error").get<double>(), 1e-6);
  const auto gradient = [&](const Words& more) {
    const Outcome done =
        run(folder, Words{"simulate", "ball.xml", "-o", "x.h5", "--overwrite", "--steps", "90",
                          "--envs", "2", "--gradients", "tactile"} +
                        more);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return numbers(folder, "x.h5", "gradients/grad_q");
  };
  const std::vector<double> whole = gradient({});
  EXPECT_EQ(gradient({"--tape-memory", "300kB"}), whole);
  EXPECT_TRUE(std::ranges::any_of(whole, [](double x) { return x != 0; }));
}

TEST(Record, UnknownNamesAreRefused) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  for (const Words& command : {Words{"simulate", ball, "-o", "x.h5"},
                               Words{"generate", ball, "-o", "x", "--episodes", "1"},
                               Words{"bench", ball, "--steps", "1"}}) {
    const Outcome wrong = run(folder, command + Words{"--record", "pad.presure"});
    EXPECT_EQ(wrong.exit_code, 2) << command[0];
    EXPECT_THAT(wrong.err, HasSubstr("did you mean 'pad.pressure'?")) << command[0];
  }
  EXPECT_THAT(
      run(folder, {"generate", ball, "-o", "x", "--episodes", "1", "--record", "bodies.bal"}).err,
      HasSubstr("did you mean 'bodies.ball'?"));
  EXPECT_THAT(run(folder, {"simulate", ball, "-o", "x.h5", "--record", "variables"}).err,
              HasSubstr("the scene has no end effectors"));
  const Outcome compact =
      run(folder, {"bench", ball, "--steps", "1", "--frames", "compact", "--record", "pad.shear"});
  EXPECT_EQ(compact.exit_code, 2);
  EXPECT_THAT(compact.err, HasSubstr("compact frames of a shear"));
  EXPECT_TRUE(folder.files().empty());
}

TEST(Record, ABenchmarkReadsWhatIsAskedFor) {
  const Folder folder;
  const auto points = [&](const std::string& list) {
    const json said =
        run_json(folder, {"bench", scene("rolling_ball_small.xml"), "--envs", "16", "--steps", "10",
                          "--every", "5", "--threads", "1", "--repeat", "1", "--record", list});
    const json& entry = said["runs"][0];
    return std::lround(entry["tactile_points_per_second"].get<double>() *
                       entry["seconds"].get<double>());
  };
  EXPECT_EQ(points("q"), 0);
  EXPECT_EQ(points("pad"), 2 * 16 * 1024);
  EXPECT_EQ(points("pad.pressure,pad.sum"), 2 * 2 * 16 * 1024);
}

}  // namespace
}  // namespace tangere::apps
