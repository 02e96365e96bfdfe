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
              HasSubstr("of sensor 'pad' the run recorded only the sum"));
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

TEST(Record, ADataSetHoldsTheFormsOfAWholeOne) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const Words size{"generate", ball, "--episodes", "17", "--steps", "120", "--every", "20"};
  run_json(folder, size + Words{"-o", "whole"});
  run_json(folder, size + Words{"-o", "some", "--record", "pad.sum,q,pad.shear,pad.pressure"});
  EXPECT_EQ(run(folder, size + Words{"-o", "some", "--record", "q,pad.shear,pad.pressure,pad.sum",
                                     "--resume"})
                .exit_code,
            0)
      << "the order of names does not matter";
  EXPECT_THAT(
      run(folder, size + Words{"-o", "some", "--record", "q,pad.sum", "--resume"}).err,
      HasSubstr("observations: q, pad.pressure, pad.shear, pad.sum there, q, pad.sum here"));
  run_json(folder,
           size + Words{"-o", "sparse", "--record", "pad.shear,pad", "--tactile", "sparse"});
  const std::string shard = "some/shard-00000.h5", demo = "data/demo_16/obs/";
  EXPECT_THAT(
      h5::read_texts(h5::open_group(h5::open_file(folder.path(shard)), "scene"), "observations"),
      ElementsAre("q", "pad.pressure", "pad.shear", "pad.sum"));
  EXPECT_EQ(shape(folder, shard, demo + "pad.pressure"), (h5::Dims{6, 32, 32, 1}));
  EXPECT_EQ(shape(folder, shard, demo + "pad.sum"), (h5::Dims{6, 6}));
  const std::vector<double> whole = numbers(folder, "whole/shard-00000.h5", demo + "pad"),
                            shear = numbers(folder, shard, demo + "pad.shear");
  for (std::size_t k = 0; k < shear.size(); ++k) ASSERT_EQ(shear[k], whole[k / 2 * 3 + k % 2]) << k;
  EXPECT_EQ(numbers(folder, "sparse/shard-00000.h5", demo + "pad.shear"), shear);
  EXPECT_EQ(numbers(folder, "sparse/shard-00000.h5", demo + "pad"), whole);
  EXPECT_THAT(h5::read_texts(h5::open_group(h5::open_file(folder.path(shard)), "scene/sensors/pad"),
                             "readings"),
              ElementsAre("pad.pressure", "pad.shear", "pad.sum"));
  for (const char* set : {"some", "sparse"}) {
    EXPECT_EQ(run(folder, {"validate", set}).exit_code, 0) << set;
    EXPECT_EQ(run(folder, {"validate", std::string(set) + "/robomimic.hdf5"}).exit_code, 0) << set;
  }
}

TEST(Record, TheSceneAsksAndTheOptionAsksInstead) {
  const Folder folder;
  std::string text = file_bytes(scene("rolling_ball_small.xml"));
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
  EXPECT_THAT(set.err, HasSubstr("'bodies' of <outputs> is left out"));
  EXPECT_EQ(shape(folder, "set/shard-00000.h5", "data/demo_0/obs/pad.sum"), (h5::Dims{1, 6}));
  std::string bodies = text;
  bodies.replace(bodies.find("bodies,pad.sum"), 14, "bodies");
  folder.write("bodies.xml", bodies);
  const Outcome nothing =
      run(folder, {"generate", "bodies.xml", "-o", "none", "--episodes", "1", "--steps", "5"});
  EXPECT_EQ(nothing.exit_code, 2);
  EXPECT_THAT(nothing.err, HasSubstr("<outputs>: nothing of record is in a data set"));
  text.replace(text.find("pad.sum"), 7, "pad.sun");
  folder.write("wrong.xml", text);
  const Outcome wrong = run(folder, {"inspect", "wrong.xml"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("record has 'pad.sun'; did you mean 'pad.sum'?"));
  EXPECT_THAT(wrong.err, HasSubstr("wrong.xml:"));
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
  int on = 0;
  for (const json& effect : inspected.at("effects"))
    on += effect.at("name") == "sensor imperfections" && effect.at("on") == true ? 1 : 0;
  EXPECT_EQ(on, 1);
}

TEST(Record, ASensorWithMemoryKeepsToItsTimestepAndHasNoGradient) {
  const Folder folder;
  folder.write("ball.xml", imperfect_ball("delay=\"0.02\""));
  const Words words{"simulate", "ball.xml", "-o", "x.h5", "--steps", "30", "--every", "10"};
  const Outcome other = run(folder, words + Words{"--timestep", "0.0025"});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("delay and low_pass of 'pad' count steps of"));
  const Outcome gradient = run(folder, words + Words{"--gradients", "tactile"});
  EXPECT_EQ(gradient.exit_code, 2);
  EXPECT_THAT(gradient.err, HasSubstr("derivatives of sensor 'pad', which has low_pass or delay"));
  EXPECT_EQ(run(folder, words + Words{"--gradients", "final"}).exit_code, 0);
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
      run(folder, {"generate", ball, "-o", "x", "--episodes", "1", "--record", "bodies"}).err,
      HasSubstr("unknown observation 'bodies'"));
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
