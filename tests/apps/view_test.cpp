// SPDX-License-Identifier: Apache-2.0
// Tests `tangere view`: what the data block of a page holds, compared number by number with the
// file that it shows, and what the command says where there is nothing to show.
#include <gmock/gmock.h>
#include <hdf5.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/view/view_page.hpp"
#include "io/view/view_reader.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"
#include "tests/sanitized.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

const std::string kBall = scene("rolling_ball_small.xml");

json data_of(const std::string& page) {
  const std::string mark = "id=\"tangere-data\">";
  const std::size_t begin = page.find(mark) + mark.size();
  return json::parse(page.substr(begin, page.find("</script>", begin) - begin));
}

/// The bytes of base64, as a browser decodes them.
template <class T>
std::vector<T> unpacked(const json& array) {
  const std::string text = array.at("base64"),
                    digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const std::string type = std::is_same_v<T, float> ? "float32" : "int32";
  EXPECT_EQ(array.at("type"), type);
  std::string bytes;
  unsigned group = 0, bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    group = group << 6 | static_cast<unsigned>(digits.find(c)), bits += 6;
    if (bits >= 8) bits -= 8, bytes += static_cast<char>(group >> bits & 255U);
  }
  EXPECT_EQ(bytes.size() % sizeof(T), 0U);
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

/// A whole dataset of a file.
std::vector<double> numbers(const std::string& path, const std::string& name) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT),
              dataset = H5Dopen2(file, name.c_str(), H5P_DEFAULT), space = H5Dget_space(dataset);
  std::vector<double> values(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
  EXPECT_GE(H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0)
      << name;
  H5Sclose(space), H5Dclose(dataset), H5Fclose(file);
  return values;
}

/// Runs `tangere view INPUT -o page.html` and returns the data block.
json view(const Folder& folder, const std::string& input, const Words& more = {}) {
  const json answer =
      run_json(folder, Words{"view", input, "-o", "page.html", "--overwrite"} + more);
  const std::string page = folder.read("page.html");
  EXPECT_EQ(answer.at("bytes"), page.size());
  json data = data_of(page);
  EXPECT_EQ(answer.at("episodes"), data.at("episodes").size());
  EXPECT_EQ(answer.at("stride"), data.at("stride"));
  return data;
}

void simulate(const Folder& folder, const Words& words) {
  const Outcome outcome =
      run(folder, Words{"simulate"} + words + Words{"-o", "run.h5", "--overwrite"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
}

std::vector<float> trace(const json& episode, const std::string& name) {
  for (const json& t : episode.at("traces"))
    if (t.at("name") == name) return unpacked<float>(t.at("values"));
  ADD_FAILURE() << "no trace " << name;
  return {};
}

/// Compares poses of all frames of environment e with /bodies/pose of the file.
void expect_poses(const json& data, const std::string& path, std::size_t environments) {
  const std::vector<double> whole = numbers(path, "bodies/pose");
  ASSERT_EQ(data.at("episodes").size(), environments);
  for (std::size_t e = 0; e < environments; ++e) {
    const json& episode = data.at("episodes")[e];
    const std::vector<float> poses = unpacked<float>(episode.at("poses"));
    const std::vector<std::int32_t> rows = unpacked<std::int32_t>(episode.at("rows"));
    const std::size_t width = poses.size() / rows.size();
    ASSERT_EQ(width, 7 * data.at("shapes")[0].size());
    for (std::size_t f = 0; f < rows.size(); ++f)
      for (std::size_t k = 0; k < width; ++k)
        ASSERT_NEAR(poses[f * width + k],
                    whole[(std::size_t(rows[f]) * environments + e) * width + k], 1e-6)
            << "environment " << e << " row " << rows[f] << " number " << k;
  }
}

TEST(View, PosesFieldsAndCurvesAreThoseOfTheTrajectory) {
  const Folder folder;
  simulate(folder, {kBall, "--steps", "90", "--envs", "2", "--every", "6", "--seed", "4"});
  const std::string file = folder.path("run.h5");
  const json data = view(folder, "run.h5");
  EXPECT_EQ(data.at("kind"), "trajectory");
  EXPECT_EQ(data.at("stride"), 1);
  EXPECT_THAT(data.at("notes"), IsEmpty());
  expect_poses(data, file, 2);

  const std::vector<double> q = numbers(file, "q"), force = numbers(file, "tactile/pad/force");
  const std::vector<double> status = numbers(file, "solver/status");
  const std::size_t cells = data.at("sensors")[0].at("cells");
  ASSERT_EQ(cells, 32U * 32U);
  const std::vector<std::int32_t> place = unpacked<std::int32_t>(data.at("sensors")[0].at("place"));
  double touched = 0;
  for (std::size_t e = 0; e < 2; ++e) {
    const json& episode = data.at("episodes")[e];
    EXPECT_THAT(episode.at("label").get<std::string>(), HasSubstr(std::to_string(e)));
    const std::vector<float> x = trace(episode, "ball_joint.x"), worst = trace(episode, "status"),
                             normal = trace(episode, "pad normal"),
                             shear = trace(episode, "pad shear");
    const std::vector<std::int32_t> at = unpacked<std::int32_t>(episode.at("fields")[0].at("at"));
    const std::vector<float> values = unpacked<float>(episode.at("fields")[0].at("values"));
    ASSERT_THAT(x, SizeIs(91));
    ASSERT_EQ(values.size(), 15 * cells * 3);
    for (std::size_t row = 0; row <= 90; ++row) {
      EXPECT_FLOAT_EQ(x[row], static_cast<float>(q[(row * 2 + e) * 10 + 3]));
      EXPECT_EQ(worst[row], row == 0 ? 0 : status[(row - 1) * 2 + e]);
      ASSERT_EQ(at[row], static_cast<int>(row / 6) - 1) << "the newest field at row " << row;
      if (row < 6) {
        EXPECT_TRUE(std::isnan(normal[row]));
        continue;
      }
      double sum = 0, across = 0;
      for (std::size_t c = 0; c < cells; ++c) {
        const double* f = &force[((row / 6 - 1) * 2 + e) * cells * 3 + 3 * c];
        const float* shown = &values[(std::size_t(at[row]) * cells + c) * 3];
        ASSERT_FLOAT_EQ(shown[0], static_cast<float>(f[0]));
        ASSERT_FLOAT_EQ(shown[1], static_cast<float>(f[1]));
        ASSERT_FLOAT_EQ(shown[2], static_cast<float>(-f[2])) << "pressure_sign is -1";
        sum -= f[2], across += std::hypot(f[0], f[1]);
        ASSERT_EQ(place[2 * c], int(c) / 32);
        ASSERT_EQ(place[2 * c + 1], int(c) % 32);
      }
      EXPECT_NEAR(normal[row], sum, 1e-6 * std::abs(sum) + 1e-12);
      EXPECT_NEAR(shear[row], across, 1e-6 * across + 1e-12);
      touched = std::max(touched, sum);
    }
  }
  EXPECT_GT(touched, 1e-3) << "nothing was touched: the fields were not compared";
}

/// Cells of a large array are means; forces of the whole are not touched by that.
TEST(View, ALargeArrayIsPooledAndItsForceIsNot) {
  const Folder folder;
  simulate(folder, {scene("rolling_ball.xml"), "--steps", "100", "--every", "100"});
  const json data = view(folder, "run.h5");
  const json& sensor = data.at("sensors")[0];
  EXPECT_EQ(sensor.at("rows"), 48);
  EXPECT_EQ(sensor.at("points"), 40'000);
  const std::vector<double> force = numbers(folder.path("run.h5"), "tactile/pad/force");
  std::vector<double> mean(48 * 48, 0.0), count(48 * 48, 0.0);
  double sum = 0;
  for (int i = 0; i < 200; ++i)
    for (int j = 0; j < 200; ++j) {
      const double pressure = -force[std::size_t(3 * (200 * i + j) + 2)];
      mean[std::size_t(i * 48 / 200 * 48 + j * 48 / 200)] += pressure;
      count[std::size_t(i * 48 / 200 * 48 + j * 48 / 200)] += 1;
      sum += pressure;
    }
  ASSERT_GT(sum, 0);
  const json& episode = data.at("episodes")[0];
  const std::vector<float> values = unpacked<float>(episode.at("fields")[0].at("values"));
  ASSERT_THAT(values, SizeIs(3 * 48 * 48));
  for (std::size_t c = 0; c < mean.size(); ++c)
    ASSERT_NEAR(values[3 * c + 2], mean[c] / count[c], 1e-6 * sum) << c;
  EXPECT_NEAR(trace(episode, "pad normal").back(), sum, 1e-6 * sum);
}

/// On the force that the map shows, the arrows agree: f = f0 axis0 + f1 axis1 + p press presses the
/// pad up, because the ball lies below it.
TEST(View, PressurePushesThePadAwayFromTheBall) {
  const Folder folder;
  simulate(folder, {kBall, "--steps", "10"});
  const json data = view(folder, "run.h5");
  const std::vector<float> press = unpacked<float>(data.at("sensors")[0].at("press")),
                           position = unpacked<float>(data.at("sensors")[0].at("position"));
  for (std::size_t c = 0; c < press.size(); c += 3) {
    EXPECT_FLOAT_EQ(press[c + 2], 1);
    EXPECT_FLOAT_EQ(position[c + 2], -0.005F);
  }
}

TEST(View, EpisodesOfADataSetAreItsRowsAndTheLastState) {
  const Folder folder;
  ASSERT_EQ(run(folder, {"generate", kBall, "--episodes", "3", "--steps", "100", "--every", "10",
                         "--threads", "1", "-o", "set"})
                .exit_code,
            0);
  for (const std::string input : {"set", "set/shard-00000.h5", "set/robomimic.hdf5"}) {
    SCOPED_TRACE(input);
    const json data = view(folder, input);
    EXPECT_EQ(data.at("kind"), "data set");
    ASSERT_THAT(data.at("episodes"), SizeIs(3));
    for (int e = 0; e < 3; ++e) {
      const json& episode = data.at("episodes")[std::size_t(e)];
      EXPECT_EQ(episode.at("label"), "episode " + std::to_string(e));
      const std::string demo = "data/demo_" + std::to_string(e),
                        shard = folder.path("set/shard-00000.h5");
      std::vector<double> q = numbers(shard, demo + "/obs/q"),
                          force = numbers(shard, demo + "/obs/pad");
      const std::vector<double> last = numbers(shard, demo + "/final_obs/q"),
                                end = numbers(shard, demo + "/final_obs/pad");
      q.insert(q.end(), last.begin(), last.end());
      force.insert(force.end(), end.begin(), end.end());
      const std::vector<float> poses = unpacked<float>(episode.at("poses")),
                               z = trace(episode, "pad_joint.z"),
                               fields = unpacked<float>(episode.at("fields")[0].at("values")),
                               time = unpacked<float>(episode.at("time"));
      ASSERT_THAT(time, SizeIs(11));
      EXPECT_FLOAT_EQ(time[1], 0.05F);
      ASSERT_EQ(fields.size(), force.size());
      for (std::size_t row = 0; row < 11; ++row) {
        EXPECT_FLOAT_EQ(z[row], static_cast<float>(q[row * 10 + 2]));
        EXPECT_NEAR(poses[row * 14 + 2], 0.06 + q[row * 10 + 2], 1e-6);
        for (std::size_t k = 0; k < 2; ++k)
          EXPECT_NEAR(poses[row * 14 + 7 + k], q[row * 10 + 3 + k], 1e-6);
      }
      for (std::size_t i = 0; i < force.size(); ++i)
        ASSERT_FLOAT_EQ(fields[i], static_cast<float>(i % 3 == 2 ? -force[i] : force[i]));
    }
    EXPECT_THAT(view(folder, input, {"--episode", "2"}).at("episodes")[0].at("label"), "episode 2");
    const json first = view(folder, input, {"--episodes", "2"});
    EXPECT_THAT(first.at("episodes"), SizeIs(2));
    EXPECT_THAT(first.at("notes"), ElementsAre("The first 2 of 3 episodes."));
  }
}

TEST(View, RewardsOfATaskAreShown) {
  const Folder folder;
  ASSERT_EQ(
      run(folder, {"generate", "box_pushing", "--episodes", "2", "--threads", "1", "-o", "set"})
          .exit_code,
      0);
  const json data = view(folder, "set");
  const std::vector<double> rewards =
      numbers(folder.path("set/shard-00000.h5"), "data/demo_1/rewards");
  const std::vector<float> shown = trace(data.at("episodes")[1], "reward");
  ASSERT_EQ(shown.size(), rewards.size() + 1);
  for (std::size_t row = 0; row < rewards.size(); ++row)
    EXPECT_FLOAT_EQ(shown[row], static_cast<float>(rewards[row]));
  EXPECT_TRUE(std::isnan(shown.back())) << "the last state begins no action";
  EXPECT_THAT(data.at("notes"), ElementsAre("The field of sensor 'pad' was not recorded."));
  simulate(folder, {"box_pushing"});
  const json played = view(folder, "run.h5");
  const std::vector<double> paid = numbers(folder.path("run.h5"), "task/reward");
  EXPECT_FLOAT_EQ(trace(played.at("episodes")[0], "reward").back(),
                  static_cast<float>(paid.back()));
}

TEST(View, EveryTaskIsShown) {
  for (const std::string task :
       {"cap_opening", "ball_rolling_small", "box_pushing", "insertion", "stable_grasp"}) {
    if (kSanitized && task != "cap_opening") continue;  // a list of points with an image
    SCOPED_TRACE(task);
    const Folder folder;
    simulate(folder, {task});
    const json data = view(folder, "run.h5");
    expect_poses(data, folder.path("run.h5"), 1);
    const json& episode = data.at("episodes")[0];
    ASSERT_THAT(data.at("sensors"), Not(IsEmpty()));
    for (std::size_t k = 0; k < data.at("sensors").size(); ++k) {
      const std::vector<float> fields = unpacked<float>(episode.at("fields")[k].at("values"));
      EXPECT_GT(*std::max_element(fields.begin(), fields.end()), 0) << "its script touches";
    }
  }
}

TEST(View, ARunThatGoesOnKeepsItsClock) {
  const Folder folder;
  const auto play = [&](const Words& words) {
    const Outcome outcome = run(folder, Words{"simulate", kBall} + words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  };
  play({"--steps", "30", "--every", "1", "-o", "first.h5"});
  play({"--steps", "20", "--every", "1", "--state-from", "first.h5", "-o", "on.h5"});
  play({"--steps", "50", "--every", "1", "-o", "whole.h5"});
  const json on = view(folder, "on.h5"), whole = view(folder, "whole.h5");
  expect_poses(on, folder.path("on.h5"), 1);
  for (const char* what : {"time", "poses"}) {
    const std::vector<float> part = unpacked<float>(on.at("episodes")[0].at(what)),
                             all = unpacked<float>(whole.at("episodes")[0].at(what));
    ASSERT_LT(part.size(), all.size());
    EXPECT_TRUE(std::equal(part.begin(), part.end(), all.end() - std::ssize(part))) << what;
  }
}

/// Sizes and places that vary by environment: each has its own shapes, and poses follow.
TEST(View, NumbersThatVaryAreThoseOfTheEnvironment) {
  const Folder folder;
  std::string text = file_bytes(kBall);
  const std::string end = "</randomize>";
  text.replace(text.find(end), end.size(),
               "<body name=\"ball\" field=\"radius\" uniform=\"0.015 0.02\"/>"
               "<joint name=\"pad_joint\" pos=\"0\" uniform=\"-0.01 0.01\"/>" +
                   end);
  folder.write("varying.xml", text);
  const Outcome tried =
      run(folder, {"simulate", "varying.xml", "--steps", "20", "--envs", "3", "-o", "run.h5"});
  ASSERT_EQ(tried.exit_code, 0) << tried.err;
  const json data = view(folder, "run.h5");
  expect_poses(data, folder.path("run.h5"), 3);
  ASSERT_THAT(data.at("shapes"), SizeIs(3));
  const std::vector<double> drawn = numbers(folder.path("run.h5"), "randomized");
  for (std::size_t e = 0; e < 3; ++e) {
    EXPECT_EQ(data.at("episodes")[e].at("shapes"), e);
    EXPECT_EQ(data.at("shapes")[e][1].at("radius"), drawn[e * drawn.size() / 3 + 4]);
  }
  EXPECT_NE(data.at("shapes")[0][1].at("radius"), data.at("shapes")[1][1].at("radius"));
}

/// An ellipsoid's corners satisfy Σ (2x/size)² = 1, and its normals are along the gradient of that.
void expect_round(const json& body) {
  const std::vector<float> at = unpacked<float>(body.at("vertices")),
                           normals = unpacked<float>(body.at("normals"));
  const std::vector<std::int32_t> triangles = unpacked<std::int32_t>(body.at("triangles"));
  ASSERT_EQ(at.size(), normals.size());
  ASSERT_THAT(at, Not(IsEmpty()));
  for (std::size_t k = 0; k < at.size(); k += 3) {
    double sum = 0, length = 0, along = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double size = body.at("size")[c], slope = at[k + c] / (size * size);
      sum += 4 * at[k + c] * slope, length += slope * slope, along += slope * normals[k + c];
    }
    EXPECT_NEAR(sum, 1, 1e-6);
    EXPECT_NEAR(along / std::sqrt(length), 1, 1e-6);
  }
  EXPECT_EQ(triangles.size(), at.size() / 3 / 33 * 32 * 6);  // 32 bands of 33 rings
}

TEST(View, EveryShapeIsShown) {
  const Folder folder;
  simulate(folder, {TANGERE_SOURCE_DIR "/tests/data/scenes/shapes.xml", "--steps", "10"});
  const json data = view(folder, "run.h5");
  std::vector<std::string> kinds;
  for (const json& body : data.at("shapes")[0]) {
    kinds.push_back(body.at("kind"));
    if (kinds.back() == "mesh") {
      EXPECT_THAT(unpacked<std::int32_t>(body.at("triangles")), Not(IsEmpty()));
    }
    if (kinds.back() == "ellipsoid") expect_round(body);
  }
  EXPECT_THAT(kinds, ::testing::IsSupersetOf({"cuboid", "cylinder", "capsule", "ellipsoid", "plane",
                                              "mesh", "abstract"}));
}

TEST(View, FramesAreThinnedAndThePageSaysSo) {
  const Folder folder;
  simulate(folder, {kBall, "--steps", "97", "--envs", "2", "--every", "1"});
  const json data = view(folder, "run.h5", {"--frames", "10"});
  const std::vector<std::int32_t> rows = unpacked<std::int32_t>(data.at("episodes")[0].at("rows"));
  EXPECT_THAT(rows, ElementsAre(0, 11, 22, 33, 44, 55, 66, 77, 88, 97));
  EXPECT_EQ(data.at("stride"), 11);
  expect_poses(data, folder.path("run.h5"), 2);
  for (const double bytes : {1.2e6, 1.6e6, 3e6}) {
    ViewOptions options;
    options.bytes = bytes;
    const ViewData thinned = read_view(folder.path("run.h5"), options);
    EXPECT_LE(static_cast<double>(render_view_page(thinned).size()), bytes);
    EXPECT_GT(thinned.stride, 1);
  }
}

/// A name must not end the block of data, whatever it is.
TEST(View, NamesDoNotBecomeMarkup) {
  const Folder folder;
  std::string text = file_bytes(kBall);
  const std::string model = "model=\"rolling_ball_small\"";
  text.replace(text.find(model), model.size(), "model=\"&lt;/script&gt;&lt;!--&lt;b&gt;\"");
  folder.write("named.xml", text);
  simulate(folder, {"named.xml", "--steps", "4"});
  const json data = view(folder, "run.h5");
  EXPECT_EQ(data.at("title"), "</script><!--<b>");
  const std::string page = folder.read("page.html");
  std::size_t ends = 0;
  for (std::size_t at = page.find("</script>"); at != std::string::npos;
       at = page.find("</script>", at + 1))
    ++ends;
  EXPECT_EQ(ends, 2U);
  for (const char* address : {"http://", "https://", "src=", "@import", "url("})
    EXPECT_EQ(page.find(address), std::string::npos) << address << ": a page needs no other file";
}

/// Replaces the text of an attribute.
void rewrite(const std::string& path, const char* object, const char* name,
             const std::string& text) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), type = H5Tcopy(H5T_C_S1),
              space = H5Screate(H5S_SCALAR);
  H5Tset_size(type, H5T_VARIABLE), H5Tset_cset(type, H5T_CSET_UTF8);
  H5Adelete_by_name(file, object, name, H5P_DEFAULT);
  const hid_t attribute =
      H5Acreate_by_name(file, object, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  const char* const bytes = text.c_str();
  EXPECT_GE(H5Awrite(attribute, type, &bytes), 0);
  H5Aclose(attribute), H5Sclose(space), H5Tclose(type), H5Fclose(file);
}

void expect_refused(const Folder& folder, const std::string& input, int exit_code,
                    const std::string& message, const Words& more = {}) {
  const Outcome outcome = run(folder, Words{"view", input, "-o", "refused.html"} + more);
  EXPECT_EQ(outcome.exit_code, exit_code) << input << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(message)) << input;
  EXPECT_FALSE(std::filesystem::exists(folder.path("refused.html")));
}

TEST(View, WhatCannotBeShownIsSaid) {
  const Folder folder;
  simulate(folder, {kBall, "--steps", "4"});
  expect_refused(folder, "nowhere.h5", 3, "nowhere.h5");
  expect_refused(folder, kBall, 3, "rolling_ball_small.xml");
  expect_refused(folder, "run.h5", 2, "environment 1: run.h5 has 0 to 0", {"--episode", "1"});
  expect_refused(folder, "run.h5", 2, "--frames", {"--frames", "1"});
  folder.write("page.html", "mine");
  const Outcome kept = run(folder, {"view", "run.h5", "-o", "page.html"});
  EXPECT_EQ(kept.exit_code, 3);
  EXPECT_EQ(folder.read("page.html"), "mine");

  rewrite(folder.path("run.h5"), ".", "scene_text", "<tangere/");
  expect_refused(folder, "run.h5", 3, "its scene cannot be compiled");
  rewrite(folder.path("run.h5"), ".", "scene_text", file_bytes(scene("box_pushing.xml")));
  expect_refused(folder, "run.h5", 3, "its coordinates are not those of its scene");
  rewrite(folder.path("run.h5"), ".", "format", "something else");
  expect_refused(folder, "run.h5", 3, "neither a trajectory file");

  ASSERT_EQ(run(folder, {"generate", kBall, "--episodes", "2", "--steps", "10", "--every", "5",
                         "--threads", "1", "--record", "pad", "-o", "felt"})
                .exit_code,
            0);
  expect_refused(folder, "felt", 3, "has no obs/q");
  ASSERT_EQ(run(folder, {"generate", kBall, "--episodes", "2", "--steps", "10", "--every", "5",
                         "--threads", "1", "-o", "set"})
                .exit_code,
            0);
  expect_refused(folder, "set", 2, "has no episode 7", {"--episode", "7"});
  std::filesystem::create_directory(folder.path("empty"));
  expect_refused(folder, "empty", 3, "empty");
}

/// Numbers that are not finite end in a message, not in a page that does not open.
TEST(View, DamagedNumbersAreSaid) {
  for (const char* name : {"q", "tactile/pad/force"}) {
    const Folder folder;
    simulate(folder, {kBall, "--steps", "10"});
    const hid_t file = H5Fopen(folder.path("run.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT),
                dataset = H5Dopen2(file, name, H5P_DEFAULT), all = H5Dget_space(dataset);
    const hsize_t place[5] = {0, 0, 0, 0, 0}, one = 1;
    H5Sselect_elements(all, H5S_SELECT_SET, 1, place);
    const hid_t memory = H5Screate_simple(1, &one, nullptr);
    const double nan = NAN;
    EXPECT_GE(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, memory, all, H5P_DEFAULT, &nan), 0);
    H5Sclose(memory), H5Sclose(all), H5Dclose(dataset), H5Fclose(file);
    expect_refused(folder, "run.h5", 3, "has a number that is nan");
  }
}

}  // namespace
}  // namespace tangere::apps
